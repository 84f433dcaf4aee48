//! Any bytes as an OBJ sequence of one file, prepared when it can be read.
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
    let bytes = data.to_vec();
    let stream = open_obj_sequence(Box::new(move |_| Ok(bytes.clone())), vec![0.0], None, &options());
    if let Ok(stream) = &stream {
        let _ = MeshPrepare::new(stream.clip.topology());
    }
    read_ends(stream);
});
