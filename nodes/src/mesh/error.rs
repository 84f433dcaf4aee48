//! What can be wrong with a mesh file, in words that say what would have been right.

use thiserror::Error;

/// Why a mesh or an animation could not be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The reader under the file failed.
    #[error("the {format} file could not be read: {source}")]
    Io {
        /// Name of the file format.
        format: &'static str,
        /// The error of the reader.
        source: std::io::Error,
    },
    /// The bytes are not of this format.
    #[error("this is not {expected}: {found}")]
    Format {
        /// What the reader reads.
        expected: &'static str,
        /// What the bytes are instead.
        found: String,
    },
    /// The file ends before the bytes that it announces.
    #[error("the {format} file is truncated: {what} needs {needed} bytes, {available} are there")]
    Truncated {
        /// Name of the file format.
        format: &'static str,
        /// The part that is cut off.
        what: String,
        /// Bytes that the part needs, counted like `available`.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// The structure of the file contradicts its format.
    #[error("the {format} file is malformed: {what}")]
    Malformed {
        /// Name of the file format.
        format: &'static str,
        /// What was found and what would be right.
        what: String,
    },
    /// A text file has a wrong line.
    #[error("line {line} of the OBJ file: {what}")]
    Line {
        /// Line number, from 1.
        line: usize,
        /// What was found and what would be right.
        what: String,
    },
    /// The file uses a feature that this reader does not read.
    #[error("the {format} file uses {what}")]
    Unsupported {
        /// Name of the file format.
        format: &'static str,
        /// The feature, and what to use instead.
        what: String,
    },
    /// A caller's limit is exceeded.
    #[error("the file has {found} {what}; at most {limit} are read (`MeshLimits::{field}`)")]
    Limit {
        /// What there is too much of.
        what: &'static str,
        /// The field of [`MeshLimits`](super::MeshLimits) to raise.
        field: &'static str,
        /// What the file has.
        found: u64,
        /// What is allowed.
        limit: u64,
    },
    /// No mesh of the wanted name.
    #[error("there is no mesh `{wanted}`; the file has: {}", list(.available))]
    NoSuchMesh {
        /// The name asked for.
        wanted: String,
        /// The names that would have worked.
        available: Vec<String>,
    },
    /// No animation of the wanted name.
    #[error("there is no animation `{wanted}`; the file has: {}", list(.available))]
    NoSuchAnimation {
        /// The name asked for.
        wanted: String,
        /// The names that would have worked.
        available: Vec<String>,
    },
    /// The file holds several meshes, none was named and none has more vertices than all others.
    #[error("the file has {} meshes and no largest one, name one of them: {}", .available.len(), list(.available))]
    AmbiguousMesh {
        /// The names that would have worked.
        available: Vec<String>,
    },
    /// The mesh has nothing to read.
    #[error(
        "the mesh `{mesh}` is empty: it has {vertices} vertices, {faces} faces and {frames} frames, each must be at least 1"
    )]
    Empty {
        /// Name of the mesh.
        mesh: String,
        /// Vertices found.
        vertices: usize,
        /// Faces found.
        faces: usize,
        /// Frames found.
        frames: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {vertex}, the mesh has {vertices} (0 to {})", .vertices.saturating_sub(1))]
    FaceIndex {
        /// Face number, from 0.
        face: usize,
        /// Vertex named.
        vertex: i64,
        /// Vertices that there are.
        vertices: usize,
    },
    /// The animation moves another number of vertices than the base mesh has.
    #[error(
        "frame {frame} has {found} vertices, the base mesh has {expected}: the animation belongs to another mesh"
    )]
    VertexCount {
        /// Frame number, from 0.
        frame: usize,
        /// Vertices in the animation.
        found: u64,
        /// Vertices of the base mesh.
        expected: u64,
    },
    /// Faces differ between frames.
    #[error(
        "the faces change at frame {frame} ({what}): a stream of frames has one topology, split the file there"
    )]
    TopologyChanged {
        /// First frame whose faces differ, from 0.
        frame: usize,
        /// What differs.
        what: String,
    },
    /// A position is NaN, infinite or too far to be one.
    #[error("vertex {vertex} of frame {frame} is at ({}, {}, {}): positions must be finite and within 1e9 m", .position[0], .position[1], .position[2])]
    NotFinite {
        /// Frame number, from 0.
        frame: usize,
        /// Vertex number, from 0.
        vertex: usize,
        /// The position found.
        position: [f64; 3],
    },
    /// Frame times do not increase.
    #[error(
        "frame {frame} is at {time} s, the frame before it at {previous} s: times must be finite and increase"
    )]
    Times {
        /// Frame number, from 0.
        frame: usize,
        /// Its time in seconds.
        time: f64,
        /// The time of the frame before it.
        previous: f64,
    },
    /// A frame outside of the clip was asked for.
    #[error("there is no frame {frame}, the clip has {frames} (0 to {})", .frames.saturating_sub(1))]
    NoSuchFrame {
        /// Frame asked for.
        frame: usize,
        /// Frames that there are.
        frames: usize,
    },
    /// The caller's slice has the wrong length.
    #[error("the output holds {found} positions, the mesh has {expected} vertices")]
    OutputLength {
        /// Length of the slice.
        found: usize,
        /// Vertices of the mesh.
        expected: usize,
    },
    /// A parameter of the caller is out of range.
    #[error("{name} is {value}, it must be {expected}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Value found.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A connected component has no consistent winding (as a Möbius strip).
    #[error("component {component} is not orientable: faces {} and {} cannot be wound alike across their common edge", .faces[0], .faces[1])]
    NonOrientable {
        /// Component number, from 0.
        component: usize,
        /// Two faces where the contradiction shows.
        faces: [usize; 2],
    },
    /// One frame of a sequence cannot be had.
    #[error("frame {frame} of the sequence: {source}")]
    Frame {
        /// Frame number, from 0.
        frame: usize,
        /// What is wrong with it.
        source: Box<MeshError>,
    },
}

/// Names for an error message: at most twelve, then how many more.
fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    if names.is_empty() {
        return "none".to_owned();
    }
    let mut text = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    text
}
