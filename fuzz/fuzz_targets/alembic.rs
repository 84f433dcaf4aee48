//! Any bytes as an Alembic archive: every mesh of it is opened.
#![no_main]

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;

fn options() -> ReadOptions {
    let limits =
        MeshLimits { max_vertices: 100_000, max_faces: 100_000, max_frames: 10_000, max_bytes: 1 << 24 };
    ReadOptions { metres_per_unit: 1.0, limits }
}

fn read_ends(stream: Result<MeshStream, MeshError>) {
    if let Ok(mut stream) = stream {
        let mut out = vec![[0.0; 3]; stream.clip.vertex_count()];
        for frame in [0, stream.clip.frame_count() - 1] {
            let _ = stream.frames.read_frame(frame, &mut out);
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let file = || Box::new(std::io::Cursor::new(data.to_vec()));
    if let Ok(meshes) = alembic::list(file(), &options().limits) {
        for mesh in meshes.iter().take(4) {
            read_ends(alembic::open(file(), Some(&mesh.path), &options()));
        }
    }
});
