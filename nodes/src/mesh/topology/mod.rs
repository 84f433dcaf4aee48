//! The constant part of a moving mesh: triangles, rest pose, materials and everything that follows from them.

mod area;
mod disjoint_sets;
mod materials;
mod prepare;
mod regions;
mod triangulator;

use serde::{Deserialize, Serialize};

use super::MeshError;
pub use area::vertex_areas;
pub(crate) use disjoint_sets::DisjointSets;
pub use materials::Materials;
pub use prepare::MeshPrepare;
pub use regions::Regions;
pub use triangulator::{MAX_CORNERS, Triangulation, Triangulator};

/// Triangles over a fixed set of vertices, with the rest pose in which distances along the surface are measured.
///
/// # Shapes
/// `rest` holds one position in metres per vertex; each triangle names three vertices below `rest.len()`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Topology {
    /// Rest position of each vertex, metres.
    pub rest: Vec<[f32; 3]>,
    /// Corner indices of each triangle, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Topology {
    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    /// Number of vertices that share their rest position with another vertex, as on both sides of a cut seam.
    ///
    /// # Complexity
    /// O(n log n) and a copy of the rest pose.
    #[must_use]
    pub fn coincident(&self) -> usize {
        // Adding 0 makes -0 and 0 the same bits.
        let mut positions: Vec<[u32; 3]> = self.rest.iter().map(|p| p.map(|x| (x + 0.0).to_bits())).collect();
        positions.sort_unstable();
        positions.chunk_by(|a, b| a == b).map(<[_]>::len).filter(|n| *n > 1).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_on_both_sides_of_a_seam_are_counted() {
        let rest = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, -0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Topology { rest, triangles: vec![[0, 1, 2], [3, 4, 0]] };
        assert_eq!(mesh.coincident(), 4);
        assert_eq!(Topology::default().coincident(), 0);
    }
}
