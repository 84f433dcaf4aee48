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
}
