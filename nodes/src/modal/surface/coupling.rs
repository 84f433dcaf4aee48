//! Coupling of modes by supports: the damping matrix with all its entries.

use super::contact::Contact;
use super::damping_of_contacts::ContactLaw;
use super::surface_view::SurfaceView;
use crate::impl_state;

/// Maximum number of modes that are coupled.
pub const MAX_COUPLED: usize = 64;

/// The damping matrix `G` of the supports of an object, and its effect on the velocities of the modes in one sample.
///
/// Between two samples each mode moves freely; at each sample the velocities `v` become `exp(-G T) v`. Both steps dissipate, so the whole
/// is stable at any damping. Its error is that of operator splitting, of the order of `G T (omega T)^2 / 24`.
///
/// # Source
/// Sterling et al. (IEEE TVCG 25(5), 2019), equation 21, whose diagonal alone is common: off it, modes of nearly the same frequency exchange
/// energy, so that a pair of modes of a round object decays as the two combinations that move at the support and that do not.
#[derive(Clone, Debug)]
pub struct Coupling {
    modes: usize,
    /// Gain of each mode: velocities of the bank are these times those of the object.
    gains: Vec<f32>,
    /// `G` now and at the end of a change, 1/s, row by row.
    current: Vec<f64>,
    target: Vec<f64>,
    /// `exp(-G T) - 1` in units of the bank.
    change: Vec<f32>,
    /// True if any of it is not 0.
    active: bool,
    /// True if it is out of date.
    stale: bool,
    scratch: [Vec<f64>; 4],
}
impl_state!(Coupling { current, target, change, active, stale });

impl Coupling {
    /// Creates a coupling without supports of modes with these gains, at most [`MAX_COUPLED`].
    #[must_use]
    pub fn new(gains: &[f32]) -> Self {
        let n = gains.len();
        let zero = vec![0.0; n * n];
        Self {
            modes: n,
            gains: gains.to_vec(),
            change: vec![0.0; n * n],
            current: zero.clone(),
            target: zero.clone(),
            active: false,
            stale: false,
            scratch: [zero.clone(), zero.clone(), zero.clone(), zero],
        }
    }

    /// Sets the target to no support.
    pub fn clear(&mut self) {
        self.target.fill(0.0);
    }

    /// Adds a support.
    ///
    /// # Complexity
    /// O(modes^2).
    pub fn add(&mut self, surface: SurfaceView<'_>, contact: &Contact, law: ContactLaw) {
        let ContactLaw { coefficient, mu } = law;
        let n = self.modes;
        let [shape, along, ..] = &mut self.scratch;
        let (shape, along) = (&mut shape[..n], &mut along[..n]);
        along.fill(0.0);
        let mut outer = |x: &[f64], factor: f64| {
            for (row, a) in self.target.chunks_exact_mut(n.max(1)).zip(x) {
                row.iter_mut().zip(x).for_each(|(entry, b)| *entry += factor * a * b);
            }
        };
        for (axis, normal) in contact.direction.iter().enumerate() {
            shape.fill(0.0);
            contact.add_shapes(surface, axis, 1.0, shape);
            outer(shape, coefficient * mu);
            along.iter_mut().zip(&*shape).for_each(|(sum, x)| *sum += normal * x);
        }
        outer(along, coefficient * (1.0 - mu));
    }

    /// Moves by a share of the distance to the target, for samples of `interval` seconds.
    ///
    /// # Complexity
    /// O(modes^3) while it moves, O(modes^2) otherwise.
    pub fn advance(&mut self, share: f64, interval: f64) {
        if !std::mem::take(&mut self.stale) && self.current == self.target {
            return;
        }
        for (now, target) in self.current.iter_mut().zip(&self.target) {
            *now = if share < 1.0 { *now + share * (target - *now) } else { *target };
        }
        self.active = self.current.iter().any(|x| *x != 0.0);
        let n = self.modes;
        // By Taylor's series of a matrix of a norm below 1/4, squared as often as it was halved.
        let norm = self.current.chunks_exact(n.max(1)).map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
        let norm = norm.fold(0.0, f64::max) * interval;
        let halvings = (norm * 4.0).max(1.0).log2().ceil() as i32;
        let scale = -interval / 2f64.powi(halvings);
        let [sum, term, a, next] = &mut self.scratch;
        a.iter_mut().zip(&self.current).for_each(|(a, x)| *a = x * scale);
        sum.copy_from_slice(a);
        term.copy_from_slice(a);
        for k in 2..12 {
            product(term, a, n, next);
            std::mem::swap(term, next);
            term.iter_mut().for_each(|x| *x /= f64::from(k));
            sum.iter_mut().zip(&*term).for_each(|(sum, x)| *sum += x);
        }
        for _ in 0..halvings {
            // (1 + s)^2 - 1 = 2 s + s^2.
            product(sum, sum, n, next);
            sum.iter_mut().zip(&*next).for_each(|(s, x)| *s = 2.0 * *s + x);
        }
        for (i, row) in self.change.chunks_exact_mut(n.max(1)).enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let ratio = if self.gains[j] == 0.0 { 0.0 } else { self.gains[i] / self.gains[j] };
                *entry = sum[i * n + j] as f32 * ratio;
            }
        }
    }

    /// Takes over the matrix of another coupling of as many modes, whose gains may differ.
    pub fn take_state(&mut self, old: &Self) {
        if old.modes == self.modes {
            self.current.copy_from_slice(&old.current);
            self.stale = true;
        }
    }

    /// Changes of the velocities of all modes in one sample, row by row; none without supports.
    #[must_use]
    pub fn change(&self) -> Option<&[f32]> {
        self.active.then_some(&self.change)
    }
}

/// The product of two square matrices.
fn product(a: &[f64], b: &[f64], n: usize, out: &mut [f64]) {
    out.fill(0.0);
    for (row, a) in out.chunks_exact_mut(n.max(1)).zip(a.chunks_exact(n.max(1))) {
        for (x, b) in a.iter().zip(b.chunks_exact(n.max(1))) {
            row.iter_mut().zip(b).for_each(|(sum, y)| *sum += x * y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;
    use crate::modal::surface::mode_shapes::ModeShapes;

    #[test]
    fn the_diagonal_is_that_of_the_law_and_velocities_never_grow() {
        let mut rng = Rng::new(7);
        for _ in 0..30 {
            let shapes = ModeShapes::trial(&mut rng);
            let n = shapes.len();
            let contact =
                Contact { vertices: [0, 1, 3], weights: [0.2, 0.3, 0.5], direction: [0.6, 0.0, 0.8] };
            let (coefficient, mu) = (rng.between(0.0, 200.0), rng.between(0.0, 1.0));
            let mut coupling = Coupling::new(&vec![1.0; n]);
            coupling.add(shapes.surface(), &contact, ContactLaw { coefficient, mu });
            let (mut scratch, mut rates) = (vec![0.0; 2 * n], vec![0.0; n]);
            ContactLaw { coefficient, mu }.add(shapes.surface(), &contact, &mut scratch, &mut rates);
            for (i, rate) in rates.iter().enumerate() {
                assert!((coupling.target[i * n + i] - 2.0 * rate).abs() < 1e-9 * (1.0 + rate));
            }
            coupling.advance(1.0, 1.0 / 44_100.0);
            let change = coupling.change().unwrap();
            let v: Vec<f64> = (0..n).map(|_| rng.between(-1.0, 1.0)).collect();
            let after: Vec<f64> = change
                .chunks_exact(n)
                .zip(&v)
                .map(|(row, own)| own + row.iter().zip(&v).map(|(a, b)| f64::from(*a) * b).sum::<f64>())
                .collect();
            let energy = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
            assert!(energy(&after) <= energy(&v) * (1.0 + 1e-6));
            coupling.clear();
            coupling.advance(1.0, 1.0 / 44_100.0);
            assert_eq!(coupling.change(), None);
        }
    }

    #[test]
    fn one_mode_decays_by_the_exponential_also_where_it_is_large() {
        for rate in [1.0, 1e3, 1e6] {
            let mut coupling = Coupling::new(&[3.0]);
            coupling.target[0] = rate;
            coupling.advance(1.0, 1e-4);
            let found = f64::from(coupling.change().unwrap()[0]);
            assert!((found - (-rate * 1e-4).exp_m1()).abs() < 1e-6, "{rate}");
        }
    }
}
