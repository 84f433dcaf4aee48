//! Any bytes as a PC2 point cache.
#![no_main]

mod meshes;

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;
use meshes::{options, read_ends};

fuzz_target!(|data: &[u8]| {
    let Ok(base) = ObjMesh::parse(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", None, &options().limits) else {
        return;
    };
    read_ends(open_pc2(Box::new(std::io::Cursor::new(data.to_vec())), &base, 24.0, &options()));
});
