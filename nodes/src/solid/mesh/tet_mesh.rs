//! A mesh of tetrahedra.

use super::element::{edges, faces, signed_volume};
use super::error::{MAX_TETS, TetMeshError};
use super::isoparametric::{POINTS, QuadraturePoint, quadrature};
use super::quality::{self, Quality};
use crate::core::node::Summary;
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};

/// Volume relative to the mean at which an element counts as degenerate.
const DEGENERATE: f64 = 1e-12;
/// Tetrahedra over nodes in metres, with straight edges except those of `curves`.
///
/// [`TetMesh::new`] checks the invariants: all coordinates are finite, every node is used, every element has a positive volume
/// `det(b - a, c - a, d - a) / 6`, and no element is there twice. With [`TetMesh::with_curves`], elements of order 2 follow the curves; the
/// surface is that of the corners in any case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TetMesh {
    /// Positions of the nodes, m.
    pub nodes: Vec<[f64; 3]>,
    /// The four corners of each element.
    pub tets: Vec<[u32; 4]>,
    /// The curved edges: ascending ends, and the position of the node between them, m; in the order of the ends.
    #[serde(default)]
    pub curves: Vec<([u32; 2], [f64; 3])>,
}

impl TetMesh {
    /// Creates a mesh: orients its elements, removes the unused nodes, and checks it.
    ///
    /// # Errors
    /// The first invariant that does not hold; slivers with a dihedral angle below 0.1 degrees or a ratio of radii below 1e-3.
    ///
    /// # Complexity
    /// O(n) on average.
    pub fn new(nodes: Vec<[f64; 3]>, tets: Vec<[u32; 4]>) -> Result<Self, TetMeshError> {
        Self::with_curves(nodes, tets, Vec::new())
    }

    /// Creates a mesh with some curved edges: the ends of each, in any order, and the position of the node between them, m.
    ///
    /// # Errors
    /// As [`TetMesh::new`]; curves that are no edges or not finite; elements whose Jacobian is not positive at a point of quadrature.
    ///
    /// # Complexity
    /// O(n + curves log curves) on average.
    pub fn with_curves(
        nodes: Vec<[f64; 3]>,
        tets: Vec<[u32; 4]>,
        curves: Vec<([u32; 2], [f64; 3])>,
    ) -> Result<Self, TetMeshError> {
        let mut mesh = Self { nodes, tets, curves };
        if !(1..=MAX_TETS).contains(&mesh.tets.len()) {
            return Err(TetMeshError::Count { found: mesh.tets.len() });
        }
        if let Some(node) = mesh.nodes.iter().position(|p| !is_near(p)) {
            return Err(TetMeshError::NotFinite { node });
        }
        for (tet, corners) in mesh.tets.iter().enumerate() {
            if let Some(&node) = corners.iter().find(|c| **c as usize >= mesh.nodes.len()) {
                return Err(TetMeshError::Node { tet, node, nodes: mesh.nodes.len() });
            }
        }
        mesh.orient()?;
        mesh.distinct()?;
        mesh.sort_curves()?;
        mesh.drop_unused();
        let worst = quality::worst(&mesh.nodes, &mesh.tets);
        if worst.angle < quality::MIN_ANGLE || worst.ratio < quality::MIN_RATIO {
            return Err(TetMeshError::Sliver { tet: worst.tet, angle: worst.angle, ratio: worst.ratio });
        }
        mesh.unfolded()?;
        mesh.surface()?;
        Ok(mesh)
    }

    /// Puts the curves in order, and checks them.
    fn sort_curves(&mut self) -> Result<(), TetMeshError> {
        if self.curves.is_empty() {
            return Ok(());
        }
        self.curves.iter_mut().for_each(|(ends, _)| ends.sort_unstable());
        self.curves.sort_unstable_by_key(|(ends, _)| *ends);
        let edges: HashSet<[u32; 2]> = self.tets.iter().flat_map(edges).collect();
        let stray = self.curves.iter().find(|(ends, middle)| !edges.contains(ends) || !is_near(middle));
        let twice = self.curves.windows(2).find(|pair| pair[0].0 == pair[1].0).map(|pair| &pair[0]);
        stray.or(twice).map_or(Ok(()), |(ends, _)| Err(TetMeshError::Curve { ends: *ends }))
    }

    /// Checks that the Jacobian of each curved element is positive at its points of quadrature.
    fn unfolded(&self) -> Result<(), TetMeshError> {
        for (tet, corners) in self.tets.iter().enumerate() {
            let Some(points) = self.curved(corners) else { continue };
            let lowest = points.iter().map(|p| p.determinant).fold(f64::INFINITY, f64::min);
            let ratio = lowest / (6.0 * signed_volume(&self.corners(corners)));
            if !(ratio > 0.0 && ratio.is_finite()) {
                return Err(TetMeshError::Folded { tet, ratio });
            }
        }
        Ok(())
    }

    fn orient(&mut self) -> Result<(), TetMeshError> {
        let volumes: Vec<f64> = self.tets.iter().map(|t| signed_volume(&self.corners(t))).collect();
        let mean = volumes.iter().map(|v| v.abs()).sum::<f64>() / volumes.len() as f64;
        for (tet, (corners, volume)) in self.tets.iter_mut().zip(volumes).enumerate() {
            // A mean of 0 makes all of them degenerate.
            if volume.abs() < DEGENERATE * mean || volume == 0.0 {
                return Err(TetMeshError::Degenerate { tet, volume: volume.abs() });
            }
            if volume < 0.0 {
                corners.swap(2, 3);
            }
        }
        Ok(())
    }

    fn distinct(&self) -> Result<(), TetMeshError> {
        let mut found = HashMap::with_capacity(self.tets.len());
        for (second, corners) in self.tets.iter().enumerate() {
            let mut key = *corners;
            key.sort_unstable();
            if let Some(first) = found.insert(key, second) {
                return Err(TetMeshError::Duplicate { first, second });
            }
        }
        Ok(())
    }

    fn drop_unused(&mut self) {
        let mut index = vec![u32::MAX; self.nodes.len()];
        self.tets.iter().flatten().for_each(|c| index[*c as usize] = 0);
        let mut nodes = Vec::new();
        for (index, node) in index.iter_mut().zip(&self.nodes).filter(|(index, _)| **index == 0) {
            *index = nodes.len() as u32;
            nodes.push(*node);
        }
        let ends = self.curves.iter_mut().flat_map(|(ends, _)| ends);
        self.tets.iter_mut().flatten().chain(ends).for_each(|c| *c = index[*c as usize]);
        self.nodes = nodes;
    }

    /// Positions of the corners of an element.
    #[must_use]
    pub fn corners(&self, tet: &[u32; 4]) -> [[f64; 3]; 4] {
        tet.map(|c| self.nodes[c as usize])
    }

    /// Position of the node between the ascending ends of an edge, m: on its curve, else in the middle.
    #[must_use]
    pub fn middle(&self, ends: [u32; 2]) -> [f64; 3] {
        let found = self.curves.binary_search_by_key(&ends, |(ends, _)| *ends);
        let [p, q] = ends.map(|c| self.nodes[c as usize]);
        found.map_or_else(|_| std::array::from_fn(|k| 0.5 * (p[k] + q[k])), |k| self.curves[k].1)
    }

    /// Returns true if an edge of the element is curved.
    #[must_use]
    pub fn is_curved(&self, tet: &[u32; 4]) -> bool {
        let curve = |edge: [u32; 2]| self.curves.binary_search_by_key(&edge, |(ends, _)| *ends).is_ok();
        !self.curves.is_empty() && edges(tet).into_iter().any(curve)
    }

    /// Points of quadrature of an element, if it is curved.
    ///
    /// # Complexity
    /// O(log curves).
    #[must_use]
    pub fn curved(&self, tet: &[u32; 4]) -> Option<[QuadraturePoint; POINTS]> {
        self.is_curved(tet).then(|| {
            let middles = edges(tet).map(|ends| self.middle(ends));
            let corners = self.corners(tet);
            quadrature(&std::array::from_fn(|k| if k < 4 { corners[k] } else { middles[k - 4] }))
        })
    }

    /// The faces that belong to one element, anticlockwise seen from outside, in the order of the elements.
    ///
    /// # Errors
    /// A face that belongs to more than two elements.
    pub fn surface(&self) -> Result<Vec<[u32; 3]>, TetMeshError> {
        let mut count: HashMap<[u32; 3], u8> = HashMap::with_capacity(2 * self.tets.len());
        for face in self.tets.iter().flat_map(faces) {
            let seen = count.entry(sorted(face)).or_insert(0);
            *seen += 1;
            if *seen > 2 {
                return Err(TetMeshError::Face { nodes: face });
            }
        }
        Ok(self.tets.iter().flat_map(faces).filter(|face| count[&sorted(*face)] == 1).collect())
    }

    /// Volume, m^3.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let straight = |t| signed_volume(&self.corners(t));
        let volume = |t| self.curved(t).map_or_else(|| straight(t), |all| all.iter().map(|p| p.weight).sum());
        self.tets.iter().map(volume).sum()
    }

    /// Lowest and highest coordinates, m.
    #[must_use]
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in self.nodes.iter().chain(self.curves.iter().map(|(_, middle)| middle)) {
            for k in 0..3 {
                bounds[0][k] = bounds[0][k].min(p[k]);
                bounds[1][k] = bounds[1][k].max(p[k]);
            }
        }
        bounds
    }

    /// Edges of the bounding box, m.
    #[must_use]
    pub fn size(&self) -> [f64; 3] {
        let [low, high] = self.bounds();
        [0, 1, 2].map(|k| high[k] - low[k])
    }

    /// The mesh in other units.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.nodes.iter_mut().flatten().for_each(|x| *x *= factor);
        self.curves.iter_mut().flat_map(|(_, middle)| middle).for_each(|x| *x *= factor);
        self
    }

    /// Worst elements, parts and counts.
    #[must_use]
    pub fn quality(&self) -> Quality {
        quality::quality(&self.nodes, &self.tets)
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let [low, high] = self.bounds();
        let quality = self.quality();
        vec![
            ("nodes", self.nodes.len().into()),
            ("tetrahedra", self.tets.len().into()),
            ("bounding_box_m", serde_json::json!([low, high])),
            ("volume_m3", self.volume().into()),
            ("components", quality.components.into()),
            ("smallest_dihedral_angle_deg", quality.worst.angle.into()),
            ("smallest_ratio_of_radii", quality.worst.ratio.into()),
        ]
    }
}

/// Returns true if a position is finite and within 1e6 m.
fn is_near(p: &[f64; 3]) -> bool {
    p.iter().all(|x| x.abs() <= 1e6)
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

#[cfg(test)]
mod tests;
