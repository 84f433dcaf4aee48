//! Functions shared by the targets of mesh files.

use foley_nodes::mesh::*;

/// Limits that no input can make slow.
pub fn options() -> ReadOptions {
    let limits =
        MeshLimits { max_vertices: 100_000, max_faces: 100_000, max_frames: 10_000, max_bytes: 1 << 24 };
    ReadOptions { metres_per_unit: 1.0, limits }
}

/// Reads the first and the last frame of a clip, if it could be opened.
pub fn read_ends(stream: Result<MeshStream, MeshError>) {
    if let Ok(mut stream) = stream {
        let mut out = vec![[0.0; 3]; stream.clip.vertex_count()];
        for frame in [0, stream.clip.frame_count() - 1] {
            let _ = stream.frames.read_frame(frame, &mut out);
        }
    }
}
