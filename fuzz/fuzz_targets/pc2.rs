//! Any bytes as a PC2 point cache.
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
    let Ok(base) = ObjMesh::parse(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", None, &options().limits) else {
        return;
    };
    read_ends(open_pc2(Box::new(std::io::Cursor::new(data.to_vec())), &base, 24.0, &options()));
});
