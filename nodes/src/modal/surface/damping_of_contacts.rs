//! Damping of the modes of an object by supports and grips.

use super::contact::Contact;
use super::surface_view::SurfaceView;

/// Law by which a contact damps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// Damping coefficient along the normal, N s/m.
    pub coefficient: f64,
    /// Tangential damping relative to the normal one.
    pub mu: f64,
}

impl ContactLaw {
    /// Adds the decay rates in 1/s that a contact adds to each mode: half of the diagonal of the damping matrix,
    /// `G_ii / 2 = coefficient (mu |phi_i|^2 + (1 - mu) (n . phi_i)^2) / 2`.
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), equation 21, after Zheng and James, "Toward high-quality modal contact sound" (ACM TOG
    /// 30(4), 2011). The equation has the normal force as the coefficient; one in N s/m is the force times a constant of the material in s/m.
    ///
    /// # Complexity
    /// O(modes).
    pub fn add(self, surface: SurfaceView<'_>, contact: &Contact, scratch: &mut [f64], rates: &mut [f64]) {
        let half = 0.5 * self.coefficient;
        let modes = surface.modes;
        let Some((along, shape)) = scratch.split_at_mut_checked(modes) else { return };
        along.fill(0.0);
        for (axis, normal) in contact.direction.iter().enumerate() {
            shape.fill(0.0);
            contact.add_shapes(surface, axis, 1.0, shape);
            for ((rate, along), x) in rates.iter_mut().zip(&mut *along).zip(&*shape) {
                *rate += half * self.mu * x * x;
                *along += normal * x;
            }
        }
        for (rate, along) in rates.iter_mut().zip(&*along) {
            *rate += half * (1.0 - self.mu) * along * along;
        }
        // With a friction above 1 rounding could leave a negative number.
        rates.iter_mut().for_each(|rate| *rate = rate.max(0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;
    use crate::modal::surface::mode_shapes::ModeShapes;

    fn rates(law: ContactLaw, shapes: &ModeShapes, direction: [f64; 3]) -> Vec<f64> {
        let contact = Contact { vertices: [0, 1, 2], weights: [0.2, 0.3, 0.5], direction };
        let (mut scratch, mut rates) = (vec![0.0; 2 * shapes.len()], vec![0.0; shapes.len()]);
        law.add(shapes.surface(), &contact, &mut scratch, &mut rates);
        rates
    }

    #[test]
    fn rates_are_those_of_the_matrix() {
        let mut rng = Rng::new(4);
        for _ in 0..50 {
            let shapes = ModeShapes::trial(&mut rng);
            let raw = [0.0; 3].map(|_| rng.between(-1.0, 1.0));
            let length = raw.iter().map(|x| x * x).sum::<f64>().sqrt();
            let n = raw.map(|x| x / length);
            let (mu, coefficient) = (rng.between(0.0, 1.5), rng.between(0.0, 10.0));
            let found = rates(ContactLaw { coefficient, mu }, &shapes, n);
            for (mode, rate) in found.iter().enumerate() {
                let phi: Vec<f64> = (0..3)
                    .map(|axis| {
                        let x = |v: usize| f64::from(shapes.surface().shape(v, axis)[mode]);
                        0.2 * x(0) + 0.3 * x(1) + 0.5 * x(2)
                    })
                    .collect();
                // phi^T (mu I + (1 - mu) n n^T) phi, written out.
                let mut product = 0.0;
                for (a, x) in phi.iter().enumerate() {
                    for (b, y) in phi.iter().enumerate() {
                        let entry = (1.0 - mu) * n[a] * n[b] + if a == b { mu } else { 0.0 };
                        product += x * entry * y;
                    }
                }
                let expected = 0.5 * coefficient * product;
                assert!((rate - expected).abs() < 1e-12 * (1.0 + expected) && *rate >= 0.0);
            }
            let twice = rates(ContactLaw { coefficient: 2.0 * coefficient, mu }, &shapes, n);
            assert!(
                twice.iter().zip(&found).all(|(a, b)| (a - 2.0 * b).abs() < 1e-12 * (1.0 + a)),
                "linear in the coefficient"
            );
        }
    }

    #[test]
    fn without_a_difference_of_directions_the_normal_does_not_matter() {
        let shapes = ModeShapes::trial(&mut Rng::new(9));
        let law = ContactLaw { coefficient: 0.5, mu: 1.0 };
        let (a, b) = (rates(law, &shapes, [1.0, 0.0, 0.0]), rates(law, &shapes, [0.0, 0.6, 0.8]));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + a)));
    }
}
