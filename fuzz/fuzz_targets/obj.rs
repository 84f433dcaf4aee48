//! Any bytes as an OBJ sequence of one file, prepared when it can be read.
#![no_main]

mod meshes;

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;
use meshes::{options, read_ends};

fuzz_target!(|data: &[u8]| {
    let bytes = data.to_vec();
    let stream = open_obj_sequence(Box::new(move |_| Ok(bytes.clone())), vec![0.0], None, &options());
    if let Ok(stream) = &stream {
        let _ = MeshPrepare::new(stream.clip.topology());
    }
    read_ends(stream);
});
