//! What can be wrong with a tetrahedral mesh or its file.

use thiserror::Error;

/// Maximum number of elements.
pub const MAX_TETS: usize = 1 << 26;

/// Formats that are read, for messages.
pub const FORMATS: &str = "Gmsh .msh 2.2 (ASCII) and 4.1 (ASCII, binary), Medit .mesh, TetGen .ele with .node, and VTK .vtu (ASCII, inline base64)";

/// Error in a tetrahedral mesh.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TetMeshError {
    /// A file of another format.
    #[error("this is {0}; the formats are {FORMATS}")]
    Format(String),
    /// A mistake at a position of the file.
    #[error("{position}: {what}")]
    Text {
        /// Line or byte.
        position: String,
        /// The value found, and what is needed.
        what: String,
    },
    /// No tetrahedra, or too many.
    #[error("there are {found} tetrahedra; 1 to {MAX_TETS} are needed")]
    Count {
        /// The number found.
        found: usize,
    },
    /// A coordinate that is not finite.
    #[error("node {node} has a coordinate that is not finite or above 1e6 m")]
    NotFinite {
        /// Index of the node, from 0.
        node: usize,
    },
    /// An element over a node that does not exist.
    #[error("tetrahedron {tet} names node {node}; there are {nodes}, counted from 0")]
    Node {
        /// Index of the element, from 0.
        tet: usize,
        /// Index of the node.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// An element without volume.
    #[error(
        "tetrahedron {tet} has a volume of {volume:e} m^3, less than 1e-12 of the mean: remove it, or mesh the object again"
    )]
    Degenerate {
        /// Index of the element, from 0.
        tet: usize,
        /// Its volume.
        volume: f64,
    },
    /// A curved element that is folded.
    #[error(
        "the curved tetrahedron {tet} is folded: its Jacobian is {ratio:.3} times that of straight edges at a point, but must be above 0: \
         move the nodes in the middle of its edges, or refine the mesh there"
    )]
    Folded {
        /// Index of the element, from 0.
        tet: usize,
        /// Smallest Jacobian at a point of quadrature over that of the element with straight edges.
        ratio: f64,
    },
    /// A curve that no edge has.
    #[error(
        "the curve between the nodes {ends:?} is no edge of a tetrahedron, is there twice, or is not finite"
    )]
    Curve {
        /// Indices of the nodes.
        ends: [u32; 2],
    },
    /// Two elements with the same corners.
    #[error("tetrahedra {first} and {second} have the same nodes: remove one of them")]
    Duplicate {
        /// Index of one element, from 0.
        first: usize,
        /// Index of the other.
        second: usize,
    },
    /// A face of more than two elements.
    #[error("the face of nodes {nodes:?} belongs to three tetrahedra or more; at most two may share a face")]
    Face {
        /// Indices of the nodes.
        nodes: [u32; 3],
    },
    /// An element too flat to compute with.
    #[error(
        "tetrahedron {tet} is too flat: its smallest dihedral angle is {angle} degrees (0.1 are needed), its ratio of radii {ratio:e} (1e-3 is \
         needed): optimise the mesh"
    )]
    Sliver {
        /// Index of the element, from 0.
        tet: usize,
        /// Smallest dihedral angle, degrees.
        angle: f64,
        /// Three times the radius of the inscribed sphere over that of the circumscribed one.
        ratio: f64,
    },
    /// Parts that share nodes, but no face.
    #[error(
        "{parts} parts of the object touch at a corner or an edge only, as a hinge that turns freely: join them over a face, or take them apart"
    )]
    Hinge {
        /// Number of parts by shared faces.
        parts: usize,
    },
}
