//! The part of an animated mesh that does not move.

use serde::{Deserialize, Serialize};

/// Triangles over a fixed set of vertices, with the rest pose that distances along the surface are measured on.
///
/// # Shapes
/// `rest` holds one position in metres per vertex; each triangle names three vertices below `rest.len()`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Topology {
    /// Rest position of each vertex, metres.
    pub rest: Vec<[f32; 3]>,
    /// Corner indices of each triangle, wound anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Topology {
    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    /// Vertices that lie, at rest, exactly where another one does: both sides of a seam at which the surface is cut.
    ///
    /// # Complexity
    /// O(n log n) and a copy of the rest pose.
    #[must_use]
    pub fn coincident(&self) -> usize {
        let mut places: Vec<[u32; 3]> = self.rest.iter().map(|p| p.map(|x| (x + 0.0).to_bits())).collect();
        places.sort_unstable();
        places.chunk_by(|a, b| a == b).map(<[_]>::len).filter(|n| *n > 1).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_of_a_seam_are_counted() {
        let rest = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, -0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Topology { rest, triangles: vec![[0, 1, 2], [3, 4, 0]] };
        assert_eq!(mesh.coincident(), 4);
        assert_eq!(Topology::default().coincident(), 0);
    }
}
