//! Stiffness and mass of one tetrahedron, with straight or curved edges.

use super::super::mesh::isoparametric::{EDGES, QuadraturePoint};
use crate::contact::vector::{cross, dot, sub};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Elastic constants and density of an isotropic solid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Isotropic {
    /// Young's modulus, Pa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density, kg/m^3.
    pub density: f64,
}

/// Error in elastic constants.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{field} is {found}; {needed}")]
pub struct IsotropicError {
    field: &'static str,
    found: f64,
    needed: &'static str,
}

impl Isotropic {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The first constant out of range.
    pub fn validate(&self) -> Result<(), IsotropicError> {
        let check = |field, found: f64, good, needed| {
            if good { Ok(()) } else { Err(IsotropicError { field, found, needed }) }
        };
        let positive = |x: f64| x > 0.0 && x.is_finite();
        check("Young's modulus", self.young, positive(self.young), "it must be above 0 Pa")?;
        let poisson = self.poisson > -1.0 && self.poisson < 0.5;
        check("Poisson's ratio", self.poisson, poisson, "it must lie between -1 and 0.5")?;
        check("the density", self.density, positive(self.density), "it must be above 0 kg/m^3")
    }

    /// Lame's constants lambda and mu, Pa.
    #[must_use]
    pub fn lame(&self) -> [f64; 2] {
        let (e, nu) = (self.young, self.poisson);
        [e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))]
    }
}

/// Polynomial order of the displacement inside an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// Ten nodes. The default: elements of order 1 are far too stiff in bending.
    Quadratic,
    /// Four nodes.
    Linear,
}

impl Order {
    /// Nodes of an element.
    #[must_use]
    pub fn nodes(self) -> usize {
        match self {
            Self::Quadratic => 10,
            Self::Linear => 4,
        }
    }
}

/// Barycentric coordinates of the four points of Gauss quadrature, exact up to degree 2.
const GAUSS: [f64; 2] = [0.585_410_196_624_968_5, 0.138_196_601_125_010_5];

/// Geometry of one element with straight edges.
pub struct Element {
    /// Volume, m^3.
    pub volume: f64,
    /// Gradients of the barycentric coordinates, 1/m.
    pub gradients: [[f64; 3]; 4],
}

impl Element {
    /// The element of four corners in an order that gives a positive volume.
    #[must_use]
    pub fn new(p: &[[f64; 3]; 4]) -> Self {
        let (e1, e2, e3) = (sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0]));
        let six_volumes = dot(e1, cross(e2, e3));
        let over = |v: [f64; 3]| v.map(|x| x / six_volumes);
        let (b, c, d) = (over(cross(e2, e3)), over(cross(e3, e1)), over(cross(e1, e2)));
        let a = [0, 1, 2].map(|k| -b[k] - c[k] - d[k]);
        Self { volume: six_volumes / 6.0, gradients: [a, b, c, d] }
    }

    /// Blocks of the stiffness between nodes, `[nodes * nodes]`, each 3 x 3 by rows, N/m.
    ///
    /// `K_ij[a][b] = integral of lambda d_a N_i d_b N_j + mu d_b N_i d_a N_j + mu delta_ab grad N_i . grad N_j`.
    pub fn stiffness(&self, order: Order, material: &Isotropic, out: &mut [[f64; 9]]) {
        let n = order.nodes();
        out.fill([0.0; 9]);
        let points = if order == Order::Linear { 1 } else { 4 };
        let weight = self.volume / points as f64;
        for point in 0..points {
            add_stiffness(material, weight, &self.gradients_at(order, point)[..n], out);
        }
        symmetrise(n, out);
    }

    /// Gradients of the shape functions at a point of quadrature.
    fn gradients_at(&self, order: Order, point: usize) -> [[f64; 3]; 10] {
        let mut all = [[0.0; 3]; 10];
        let l: [f64; 4] = std::array::from_fn(|k| GAUSS[usize::from(k != point)]);
        for (node, gradient) in all.iter_mut().take(order.nodes()).enumerate() {
            *gradient = match (order, node) {
                (Order::Linear, _) => self.gradients[node],
                (Order::Quadratic, 0..4) => self.gradients[node].map(|x| (4.0 * l[node] - 1.0) * x),
                (Order::Quadratic, _) => {
                    let [a, b] = EDGES[node - 4];
                    let (ga, gb) = (self.gradients[a], self.gradients[b]);
                    std::array::from_fn(|k| 4.0 * (l[a] * gb[k] + l[b] * ga[k]))
                }
            };
        }
        all
    }

    /// Consistent mass between nodes, the same along each axis, `[nodes * nodes]`, kg.
    pub fn mass(&self, order: Order, density: f64, out: &mut [f64]) {
        let n = order.nodes();
        for i in 0..n {
            for j in 0..n {
                out[i * n + j] = density * self.volume * mass_share(order, i, j);
            }
        }
    }
}

/// Stiffness and mass of an element of order 2 with curved edges from its points of quadrature, as those of [`Element`].
pub fn curved_matrices(
    points: &[QuadraturePoint],
    material: &Isotropic,
    stiffness: &mut [[f64; 9]],
    mass: &mut [f64],
) {
    let n = Order::Quadratic.nodes();
    stiffness.fill([0.0; 9]);
    mass.fill(0.0);
    for point in points {
        add_stiffness(material, point.weight, &point.gradients, stiffness);
        for i in 0..n {
            // Products in this order are symmetric bit for bit.
            (0..n).for_each(|j| {
                mass[i * n + j] += material.density * point.weight * (point.values[i] * point.values[j]);
            });
        }
    }
    symmetrise(n, stiffness);
}

/// Adds the part of a point of quadrature to the blocks of the upper triangle of a stiffness.
fn add_stiffness(material: &Isotropic, weight: f64, gradients: &[[f64; 3]], out: &mut [[f64; 9]]) {
    let [lambda, mu] = material.lame();
    let n = gradients.len();
    for i in 0..n {
        for j in i..n {
            let (g, h) = (gradients[i], gradients[j]);
            let shear = mu * dot(g, h);
            let block = &mut out[i * n + j];
            for a in 0..3 {
                for b in 0..3 {
                    let diagonal = if a == b { shear } else { 0.0 };
                    block[3 * a + b] += weight * (lambda * g[a] * h[b] + mu * g[b] * h[a] + diagonal);
                }
            }
        }
    }
}

/// Copies the upper triangle of a stiffness into the lower one, so that the sum is symmetric bit for bit.
fn symmetrise(n: usize, out: &mut [[f64; 9]]) {
    for i in 0..n {
        let block = out[i * n + i];
        out[i * n + i] = std::array::from_fn(|k| block[k.min(3 * (k % 3) + k / 3)]);
        for j in i + 1..n {
            let block = out[i * n + j];
            out[j * n + i] = std::array::from_fn(|k| block[3 * (k % 3) + k / 3]);
        }
    }
}

/// Integral of the product of two shape functions over the volume.
///
/// # Source
/// The integral of `L1^a L2^b L3^c L4^d` is `6 V a! b! c! d! / (a + b + c + d + 3)!`.
fn mass_share(order: Order, i: usize, j: usize) -> f64 {
    if order == Order::Linear {
        return if i == j { 0.1 } else { 0.05 };
    }
    let (i, j) = (i.min(j), i.max(j));
    let share = match (i, j) {
        (_, 0..4) if i == j => 6.0,
        (_, 0..4) => 1.0,
        (0..4, _) => {
            if EDGES[j - 4].contains(&i) {
                -4.0
            } else {
                -6.0
            }
        }
        _ => {
            let [a, b] = EDGES[i - 4];
            let other = EDGES[j - 4];
            match usize::from(other.contains(&a)) + usize::from(other.contains(&b)) {
                2 => 32.0,
                1 => 16.0,
                _ => 8.0,
            }
        }
    };
    share / 420.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial in barycentric coordinates: coefficients by exponents.
    type Polynomial = Vec<([u32; 4], f64)>;

    fn shape(i: usize) -> Polynomial {
        let unit = |k: usize, n: u32| std::array::from_fn(|m| if m == k { n } else { 0 });
        if i < 4 {
            return vec![(unit(i, 2), 2.0), (unit(i, 1), -1.0)];
        }
        let [a, b] = EDGES[i - 4];
        vec![(std::array::from_fn(|k| u32::from(k == a || k == b)), 4.0)]
    }

    fn integral(p: &Polynomial, q: &Polynomial) -> f64 {
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        let mut sum = 0.0;
        for (a, x) in p {
            for (b, y) in q {
                let e: [u32; 4] = std::array::from_fn(|k| a[k] + b[k]);
                let products: f64 = e.iter().map(|n| factorial(*n)).product();
                sum += x * y * 6.0 * products / factorial(e.iter().sum::<u32>() + 3);
            }
        }
        sum
    }

    #[test]
    fn masses_are_the_exact_integrals() {
        for i in 0..10 {
            for j in 0..10 {
                let exact = integral(&shape(i), &shape(j));
                assert!((mass_share(Order::Quadratic, i, j) - exact).abs() < 1e-15, "{i} {j}");
            }
        }
    }

    #[test]
    fn constants_out_of_range_are_refused() {
        let steel = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };
        assert_eq!(steel.validate(), Ok(()));
        for wrong in [
            Isotropic { young: 0.0, ..steel },
            Isotropic { poisson: 0.5, ..steel },
            Isotropic { density: f64::NAN, ..steel },
        ] {
            assert!(wrong.validate().is_err());
        }
    }
}
