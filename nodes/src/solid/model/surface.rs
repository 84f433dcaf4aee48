//! The surface of a mesh, and integrals of mode shapes over it.

use super::super::fem::assembly::Discretisation;
use super::super::fem::elements::Order;
use super::super::mesh::error::TetMeshError;
use super::super::mesh::tet_mesh::TetMesh;
use crate::contact::vector::{cross, norm, sub};
use faer::Mat;
use rayon::prelude::*;

/// Points of quadrature on a triangle, exact up to degree 4: one barycentric coordinate, those of the others, and the weight.
///
/// # Source
/// Dunavant, "High degree efficient symmetrical Gaussian quadrature rules for the triangle" (Int. J. Numer. Methods Eng. 21, 1985).
const QUADRATURE: [(f64, f64, f64); 2] = [
    (0.108_103_018_168_070, 0.445_948_490_915_965, 0.223_381_589_678_011),
    (0.816_847_572_980_459, 0.091_576_213_509_771, 0.109_951_743_655_322),
];

/// The surface of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Node of the mesh of each vertex.
    pub nodes: Vec<u32>,
    /// Positions, m.
    pub vertices: Vec<[f64; 3]>,
    /// Triangles over the vertices, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Unit normals at the vertices, outwards: those of the triangles, weighted with their areas.
    pub normals: Vec<[f64; 3]>,
}

/// Integrals of the outward normal component `n . phi` of a mode shape over the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Integral of `n . phi`: the net volume that the mode displaces.
    pub net: f64,
    /// Integral of `|n . phi|`.
    pub absolute: f64,
    /// Integral of `(n . phi)^2`.
    pub square: f64,
}

impl Surface {
    /// The surface of a mesh.
    ///
    /// # Errors
    /// As [`TetMesh::surface`].
    pub fn new(mesh: &TetMesh) -> Result<Self, TetMeshError> {
        let faces = mesh.surface()?;
        let mut index = vec![u32::MAX; mesh.nodes.len()];
        faces.iter().flatten().for_each(|c| index[*c as usize] = 0);
        let nodes: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|c| index[*c as usize] == 0).collect();
        nodes.iter().enumerate().for_each(|(k, c)| index[*c as usize] = k as u32);
        let triangles: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|c| index[c as usize])).collect();
        let vertices: Vec<[f64; 3]> = nodes.iter().map(|c| mesh.nodes[*c as usize]).collect();
        let mut normals = vec![[0.0; 3]; vertices.len()];
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|i| vertices[i as usize]);
            let area = cross(sub(b, a), sub(c, a));
            for i in triangle {
                (0..3).for_each(|k| normals[*i as usize][k] += area[k]);
            }
        }
        for normal in &mut normals {
            let length = norm(*normal);
            // Both sides of a fold can cancel.
            *normal = if length > 0.0 { normal.map(|x| x / length) } else { [0.0, 0.0, 1.0] };
        }
        Ok(Self { nodes, vertices, triangles, normals })
    }

    /// Area, m^2.
    #[must_use]
    pub fn area(&self) -> f64 {
        let areas = self.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| self.vertices[i as usize]);
            let normal = cross(sub(b, a), sub(c, a));
            0.5 * norm(normal)
        });
        areas.sum()
    }

    /// Mode shapes at the vertices, `[vertices][3][modes]`.
    #[must_use]
    pub fn shapes(&self, shapes: &Mat<f64>) -> Vec<f32> {
        let row = |dof: usize| (0..shapes.ncols()).map(move |j| shapes[(dof, j)] as f32);
        self.nodes.iter().flat_map(|node| (0..3).map(move |a| 3 * *node as usize + a)).flat_map(row).collect()
    }

    /// Integrals over the surface of each mode.
    #[must_use]
    pub fn flows(&self, space: &Discretisation, shapes: &Mat<f64>) -> Vec<Flow> {
        (0..shapes.ncols()).into_par_iter().map(|j| self.flow(space, shapes, j)).collect()
    }

    fn flow(&self, space: &Discretisation, shapes: &Mat<f64>, mode: usize) -> Flow {
        let mut flow = Flow::default();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| self.vertices[i as usize]);
            // Twice the area along the normal.
            let normal = cross(sub(b, a), sub(c, a));
            let length = norm(normal);
            let area = 0.5 * length;
            let corners = triangle.map(|i| self.nodes[i as usize]);
            let through = |node: u32| {
                (0..3).map(|k| normal[k] * shapes[(3 * node as usize + k, mode)]).sum::<f64>() / length
            };
            let at_corners = corners.map(through);
            let at_middles = [[0, 1], [1, 2], [2, 0]].map(|[p, q]| {
                let (p, q) = (corners[p], corners[q]);
                match space.order {
                    Order::Linear => 0.5 * (through(p) + through(q)),
                    Order::Quadratic => space.middles.get(&[p.min(q), p.max(q)]).map_or(0.0, |m| through(*m)),
                }
            });
            for (first, others, weight) in QUADRATURE {
                for k in 0..3 {
                    let l: [f64; 3] = std::array::from_fn(|i| if i == k { first } else { others });
                    let value: f64 = (0..3)
                        .map(|i| {
                            l[i] * (2.0 * l[i] - 1.0) * at_corners[i]
                                + 4.0 * l[i] * l[(i + 1) % 3] * at_middles[i]
                        })
                        .sum();
                    flow.net += weight * area * value;
                    flow.absolute += weight * area * value.abs();
                    flow.square += weight * area * value * value;
                }
            }
        }
        flow
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::mesh::shapes::{ball, block};

    #[test]
    fn a_field_that_is_the_position_displaces_three_volumes() {
        // The divergence of the position is 3.
        let mesh = ball(0.1, 4);
        let surface = Surface::new(&mesh).unwrap();
        for order in [Order::Linear, Order::Quadratic] {
            let space = Discretisation::new(&mesh, order);
            let shapes = Mat::from_fn(3 * space.nodes.len(), 1, |i, _| space.nodes[i / 3][i % 3]);
            let flow = surface.flows(&space, &shapes)[0];
            assert!((flow.net / (3.0 * mesh.volume()) - 1.0).abs() < 1e-12);
            assert!((flow.absolute / flow.net - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn squares_of_quadratic_fields_are_exact() {
        let mesh = block([1.0, 2.0, 0.5], [2, 2, 1]);
        let (surface, space) = (Surface::new(&mesh).unwrap(), Discretisation::new(&mesh, Order::Quadratic));
        assert!((surface.area() - 7.0).abs() < 1e-12);
        let shapes = Mat::from_fn(3 * space.nodes.len(), 1, |i, _| {
            let [x, y, _] = space.nodes[i / 3];
            if i % 3 == 2 { x * x - x * y } else { 0.0 }
        });
        let flow = surface.flows(&space, &shapes)[0];
        // Top and bottom: the integral of (x^2 - x y)^2 over 1 x 2.
        let expected = 2.0 * (2.0 / 5.0 - 2.0 * 0.25 * 2.0 + 8.0 / 9.0);
        assert!((flow.square / expected - 1.0).abs() < 1e-10, "{} {expected}", flow.square);
        assert!(flow.net.abs() < 1e-12);
    }
}
