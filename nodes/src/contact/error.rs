//! What can be wrong with the meshes and parameters given to contact.

use thiserror::Error;

/// A mesh, frame or parameter that contact can't work with.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ContactError {
    /// A parameter lies outside its range.
    #[error("{name} is {found}; it must be {expected}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value that was given.
        found: f64,
        /// What would have been right.
        expected: &'static str,
    },
    /// A triangle names a vertex that the surface doesn't have.
    #[error(
        "triangle {triangle} of surface {surface} names vertex {found}; the surface has {vertices} vertices"
    )]
    Corner {
        /// Surface: 0 is the cloth, 1 and up the others.
        surface: usize,
        /// Triangle index.
        triangle: usize,
        /// The vertex index that was found.
        found: u32,
        /// Number of vertices of the surface.
        vertices: usize,
    },
    /// A surface has more vertices or triangles than indices can name.
    #[error("surface {surface} has {found} vertices or triangles; at most {limit} are possible")]
    Size {
        /// Surface: 0 is the cloth, 1 and up the others.
        surface: usize,
        /// The larger of the two counts.
        found: usize,
        /// The largest count possible.
        limit: usize,
    },
    /// What a vertex may not touch of its own cloth is most of the cloth.
    #[error(
        "each of {vertices} vertices is kept from touching about {patch} others around it, which takes too long to work out"
    )]
    Patches {
        /// Vertices of the cloth.
        vertices: usize,
        /// Vertices in the neighbourhood of one of them, on average.
        patch: usize,
    },
    /// A slice has the wrong length.
    #[error("{what} has length {found}; it must have {expected}")]
    Length {
        /// What was counted.
        what: &'static str,
        /// The length that was given.
        found: usize,
        /// The length that would have been right.
        expected: usize,
    },
    /// The positions of a surface don't match its topology.
    #[error("surface {surface} has {found} positions in this frame; its topology has {expected} vertices")]
    Positions {
        /// Surface: 0 is the cloth, 1 and up the others.
        surface: usize,
        /// Positions in the frame.
        found: usize,
        /// Vertices of the topology.
        expected: usize,
    },
    /// A position is NaN, infinite or too far.
    #[error("vertex {vertex} of surface {surface} has a position that is not finite, or farther than 1e15 m")]
    NotFinite {
        /// Surface: 0 is the cloth, 1 and up the others.
        surface: usize,
        /// Vertex index.
        vertex: usize,
    },
    /// Frame times don't increase.
    #[error("frame {frame} at {found} s does not come after the frame before it, at {previous} s")]
    Time {
        /// Frame index.
        frame: usize,
        /// Time of that frame, seconds.
        found: f64,
        /// Time of the frame before, seconds.
        previous: f64,
    },
}
