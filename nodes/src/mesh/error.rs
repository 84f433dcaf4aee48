//! Errors of mesh files.

use thiserror::Error;

/// An error in a mesh or an animation.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// Reading the file failed.
    #[error("the {format} file could not be read: {source}")]
    Io {
        /// Name of the file format.
        format: &'static str,
        /// The underlying error.
        source: std::io::Error,
    },
    /// The file has another format.
    #[error("this is not {expected}: {found}")]
    Format {
        /// Format of the reader.
        expected: &'static str,
        /// Format or first bytes that were found.
        found: String,
    },
    /// The file is shorter than it states.
    #[error("the {format} file is truncated: {what} needs {needed} bytes, {available} are present")]
    Truncated {
        /// Name of the file format.
        format: &'static str,
        /// The truncated part.
        what: String,
        /// Bytes that the part needs, counted from the same start as `available`.
        needed: u64,
        /// Bytes that are present.
        available: u64,
    },
    /// The structure of the file violates its format.
    #[error("the {format} file is malformed: {what}")]
    Malformed {
        /// Name of the file format.
        format: &'static str,
        /// Description of the mistake, and of the expected form.
        what: String,
    },
    /// A line of a text file is invalid.
    #[error("line {line} of the OBJ file: {what}")]
    Line {
        /// Line number, from 1.
        line: usize,
        /// Description of the mistake, and of the expected form.
        what: String,
    },
    /// The file uses a feature that the reader does not support.
    #[error("the {format} file uses {what}")]
    Unsupported {
        /// Name of the file format.
        format: &'static str,
        /// The feature, and what to use instead.
        what: String,
    },
    /// A limit of the caller is exceeded.
    #[error("the file has {found} {what}; at most {limit} are read (`MeshLimits::{field}`)")]
    Limit {
        /// The limited quantity.
        what: &'static str,
        /// The field of [`MeshLimits`](super::MeshLimits) to raise.
        field: &'static str,
        /// Quantity in the file.
        found: u64,
        /// Maximum.
        limit: u64,
    },
    /// No mesh has the wanted name.
    #[error("there is no mesh `{wanted}`; the file has: {}", list(.available))]
    NoSuchMesh {
        /// The wanted name.
        wanted: String,
        /// The existing names.
        available: Vec<String>,
    },
    /// No animation has the wanted name.
    #[error("there is no animation `{wanted}`; the file has: {}", list(.available))]
    NoSuchAnimation {
        /// The wanted name.
        wanted: String,
        /// The existing names.
        available: Vec<String>,
    },
    /// No mesh was named, and several meshes share the largest number of vertices.
    #[error("the file has {} meshes and no largest one; name one of them: {}", .available.len(), list(.available))]
    AmbiguousMesh {
        /// The existing names.
        available: Vec<String>,
    },
    /// Not exactly one object has the wanted name.
    #[error("there is no single object `{wanted}`; the file has: {}", list_of(MAX_OBJECTS, .available))]
    NoSuchObject {
        /// The wanted name.
        wanted: String,
        /// The existing names.
        available: Vec<String>,
    },
    /// No object was named, and not exactly one is animated.
    #[error("{} animated; name one object: {}", count_of_objects(*.animated), list_of(MAX_OBJECTS, .available))]
    AmbiguousObject {
        /// Number of animated objects.
        animated: usize,
        /// Names of the animated objects, or of all if none is animated.
        available: Vec<String>,
    },
    /// A transform has an element that is NaN or infinite.
    #[error("the transform of `{object}` is not finite in frame {frame}, at {time} s")]
    TransformNotFinite {
        /// Name of the object.
        object: String,
        /// Index of the frame.
        frame: usize,
        /// Time of the frame in seconds.
        time: f64,
    },
    /// The mesh has no vertices, faces or frames.
    #[error(
        "the mesh `{mesh}` is empty: it has {vertices} vertices, {faces} faces and {frames} frames; each must be at least 1"
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
    /// A face refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex}; the mesh has {vertices} vertices (0 to {})", .vertices.saturating_sub(1))]
    FaceIndex {
        /// Index of the face.
        face: usize,
        /// Vertex of the face.
        vertex: i64,
        /// Number of vertices.
        vertices: usize,
    },
    /// The animation and the base mesh differ in their numbers of vertices.
    #[error(
        "frame {frame} has {found} vertices, the base mesh has {expected}: the animation is of another mesh"
    )]
    VertexCount {
        /// Index of the frame.
        frame: usize,
        /// Vertices in the animation.
        found: u64,
        /// Vertices of the base mesh.
        expected: u64,
    },
    /// The faces differ between frames.
    #[error(
        "the faces change at frame {frame} ({what}): all frames of a stream share one topology; split the file at this frame"
    )]
    TopologyChanged {
        /// Index of the first frame with other faces.
        frame: usize,
        /// The difference.
        what: String,
    },
    /// A position is NaN, infinite or too large.
    #[error("vertex {vertex} of frame {frame} is at ({}, {}, {}): positions must be finite and within 1e9 m", .position[0], .position[1], .position[2])]
    NotFinite {
        /// Index of the frame.
        frame: usize,
        /// Index of the vertex.
        vertex: usize,
        /// The position found.
        position: [f64; 3],
    },
    /// Frame times do not increase.
    #[error(
        "frame {frame} is at {time} s, the previous frame at {previous} s: times must be finite and increase"
    )]
    Times {
        /// Index of the frame.
        frame: usize,
        /// Time of the frame in seconds.
        time: f64,
        /// Time of the previous frame in seconds.
        previous: f64,
    },
    /// A frame outside of the clip was requested.
    #[error("there is no frame {frame}; the clip has {frames} frames (0 to {})", .frames.saturating_sub(1))]
    NoSuchFrame {
        /// Requested frame.
        frame: usize,
        /// Number of frames.
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
        /// Valid values.
        expected: &'static str,
    },
    /// A connected component has no consistent winding, like a Möbius strip.
    #[error("component {component} is not orientable: faces {} and {} cannot have the same winding across their common edge", .faces[0], .faces[1])]
    NonOrientable {
        /// Index of the component.
        component: usize,
        /// Two faces with contradicting windings.
        faces: [usize; 2],
    },
    /// A frame of a sequence cannot be read.
    #[error("frame {frame} of the sequence: {source}")]
    Frame {
        /// Index of the frame.
        frame: usize,
        /// Error of the frame.
        source: Box<MeshError>,
    },
}

/// Maximum number of objects in an error message: the joints of a skeleton.
const MAX_OBJECTS: usize = 40;

/// Names for an error message: at most twelve, then the number of the others.
fn list(names: &[String]) -> String {
    list_of(12, names)
}

fn count_of_objects(count: usize) -> String {
    if count == 0 { "no object is".to_owned() } else { format!("{count} objects are") }
}

/// Names for an error message: at most `max`, then the number of the others.
fn list_of(max: usize, names: &[String]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    let mut text = names.iter().take(max).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > max {
        text.push_str(&format!(" and {} more", names.len() - max));
    }
    text
}
