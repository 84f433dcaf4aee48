//! Tetrahedra of order 2 with curved edges, whose positions are interpolated in the same way as displacements.

use crate::contact::vector::{cross, dot};

/// Corners of the edge of each mid-edge node 4 to 9.
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

/// Number of points of quadrature.
pub const POINTS: usize = 15;

/// A point of quadrature of an element.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct QuadraturePoint {
    /// Determinant of the Jacobian, m^3: six times the volume if the edges are straight, not positive where the element is folded.
    pub determinant: f64,
    /// Its part of the volume, m^3.
    pub weight: f64,
    /// Position, m.
    pub position: [f64; 3],
    /// Shape functions of the ten nodes.
    pub values: [f64; 10],
    /// Their gradients, 1/m.
    pub gradients: [[f64; 3]; 10],
}

/// Barycentric coordinates and weights, whose sum is 1: exact up to degree 5, all weights positive.
///
/// # Source
/// Stroud, "Approximate calculation of multiple integrals" (1971), rule T3: 5-1; Keast, "Moderate-degree tetrahedral quadrature formulas"
/// (Comput. Methods Appl. Mech. Eng. 55, 1986).
fn rule() -> [([f64; 4], f64); POINTS] {
    let root = 15.0_f64.sqrt();
    let mut rule = [([0.25; 4], 16.0 / 135.0); POINTS];
    for (first, sign) in [(1, 1.0), (5, -1.0)] {
        let (near, far) = ((7.0 - sign * root) / 34.0, (13.0 + 3.0 * sign * root) / 34.0);
        for corner in 0..4 {
            let l = std::array::from_fn(|k| if k == corner { far } else { near });
            rule[first + corner] = (l, (2665.0 + 14.0 * sign * root) / 37_800.0);
        }
    }
    let (near, far) = ((5.0 - root) / 20.0, (5.0 + root) / 20.0);
    for (point, edge) in rule[9..].iter_mut().zip(EDGES) {
        *point = (std::array::from_fn(|k| if edge.contains(&k) { near } else { far }), 10.0 / 189.0);
    }
    rule
}

/// Shape functions at barycentric coordinates, and their derivatives by each of these.
fn shape_functions(l: &[f64; 4]) -> ([f64; 10], [[f64; 4]; 10]) {
    let (mut values, mut slopes) = ([0.0; 10], [[0.0; 4]; 10]);
    for k in 0..4 {
        values[k] = l[k] * (2.0 * l[k] - 1.0);
        slopes[k][k] = 4.0 * l[k] - 1.0;
    }
    for (node, [a, b]) in EDGES.into_iter().enumerate() {
        values[4 + node] = 4.0 * l[a] * l[b];
        slopes[4 + node][a] = 4.0 * l[b];
        slopes[4 + node][b] = 4.0 * l[a];
    }
    (values, slopes)
}

/// The points of quadrature of an element with four corners and six mid-edge nodes in the order of [`EDGES`], m.
///
/// Volumes are exact, as the determinant of the Jacobian has degree 3. Products of shape functions have degree 7 in a curved element, and
/// those of gradients are not polynomial: their errors are of a higher order in the size of the elements than those of the shape functions.
///
/// # Source
/// Zienkiewicz and Taylor, "The finite element method" (2000), chapter 9.
#[must_use]
pub fn quadrature(nodes: &[[f64; 3]; 10]) -> [QuadraturePoint; POINTS] {
    rule().map(|(l, weight)| {
        let (values, slopes) = shape_functions(&l);
        // The fourth coordinate depends on the others: columns are derivatives by the coordinates 1, 2 and 3, with 0 as the rest.
        let by = |m: usize, node: usize| slopes[node][m + 1] - slopes[node][0];
        let sum = |of: &dyn Fn(usize) -> f64| -> [f64; 3] {
            let mut sum = [0.0; 3];
            for (node, p) in nodes.iter().enumerate() {
                (0..3).for_each(|k| sum[k] += of(node) * p[k]);
            }
            sum
        };
        let [u, v, w] = [0, 1, 2].map(|m| sum(&|node| by(m, node)));
        let determinant = dot(u, cross(v, w));
        // Rows of the inverse: the gradients of the three coordinates.
        let rows = [cross(v, w), cross(w, u), cross(u, v)].map(|row| row.map(|x| x / determinant));
        let gradient = |node: usize| [0, 1, 2].map(|k| (0..3).map(|m| by(m, node) * rows[m][k]).sum::<f64>());
        QuadraturePoint {
            determinant,
            weight: weight * determinant / 6.0,
            position: sum(&|node| values[node]),
            values,
            gradients: std::array::from_fn(gradient),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_is_exact_up_to_degree_five() {
        let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
        for degree in 0..=5 {
            for a in 0..=degree {
                for b in 0..=degree - a {
                    let c = degree - a - b;
                    let power =
                        |l: &[f64; 4]| l[0].powi(a as i32) * l[1].powi(b as i32) * l[3].powi(c as i32);
                    let found: f64 = rule().iter().map(|(l, weight)| weight * power(l)).sum();
                    let exact = 6.0 * factorial(a) * factorial(b) * factorial(c) / factorial(degree + 3);
                    assert!((found - exact).abs() < 1e-14, "{a} {b} {c}: {found} {exact}");
                }
            }
        }
    }

    #[test]
    fn a_curved_element_has_the_volume_of_its_polynomial() {
        // The unit tetrahedron with the middle of the edge from 1 to 2 moved outwards by s along x and y: x = L1 + 4 s L1 L2, and y
        // = L2 + 4 s L1 L2. The Jacobian is 1 + 4 s (L1 + L2), with the mean 1 + 2 s.
        let s = 0.1;
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut nodes = [[0.0; 3]; 10];
        nodes[..4].copy_from_slice(&corners);
        for (node, [a, b]) in nodes[4..].iter_mut().zip(EDGES) {
            *node = [0, 1, 2].map(|k| 0.5 * (corners[a][k] + corners[b][k]));
        }
        (0..2).for_each(|k| nodes[5][k] += s);
        let points = quadrature(&nodes);
        let volume: f64 = points.iter().map(|p| p.weight).sum();
        assert!((volume - (1.0 + 2.0 * s) / 6.0).abs() < 1e-15, "{volume}");
        for p in points {
            // The gradients reproduce the identity.
            for a in 0..3 {
                for b in 0..3 {
                    let slope: f64 = nodes.iter().zip(p.gradients).map(|(n, g)| n[a] * g[b]).sum();
                    assert!((slope - f64::from(u8::from(a == b))).abs() < 1e-14);
                }
            }
        }
    }
}
