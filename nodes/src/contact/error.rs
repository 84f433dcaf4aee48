//! Errors in the meshes and parameters of contact detection.

use thiserror::Error;

use crate::core::fault::Fault;

/// An unusable mesh, frame or parameter.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A parameter lies outside its range.
    #[error("{name} is {found}; it must be {expected}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value.
        found: f64,
        /// The values that are possible.
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
        /// The vertex index.
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
    /// The neighbourhoods that vertices must not touch are about as large as the cloth.
    #[error(
        "each of {vertices} vertices excludes about {patch} others around it from contact, which takes too long to compute"
    )]
    Patches {
        /// Vertices of the cloth.
        vertices: usize,
        /// Mean number of vertices in a neighbourhood.
        patch: usize,
    },
    /// A slice has the wrong length.
    #[error("{what} has length {found}; it must have {expected}")]
    Length {
        /// Name of the slice.
        what: &'static str,
        /// The length.
        found: usize,
        /// The right length.
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
    /// A position is NaN, infinite or farther than 1e15 m from the origin.
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

impl ContactError {
    /// The same as a fault of a node whose inputs are `mesh` and `others`.
    pub(super) fn fault(&self) -> Fault {
        let field = match self {
            Self::Corner { surface, .. }
            | Self::Size { surface, .. }
            | Self::Positions { surface, .. }
            | Self::NotFinite { surface, .. }
                if *surface > 0 =>
            {
                "others"
            }
            Self::Parameter { name, .. } => name,
            Self::Patches { .. } => "radius",
            _ => "mesh",
        };
        let fault = Fault::new("F073", self.to_string()).at(field);
        match self {
            Self::Patches { .. } => fault
                .help("make `radius` small compared with the cloth, or set `exclude`, in metres along it"),
            _ => fault,
        }
    }
}
