//! Any bytes as a GLB or glTF file.
#![no_main]

mod meshes;

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;
use meshes::{options, read_ends};

fuzz_target!(|data: &[u8]| {
    let mut resolve = |_: &str| Ok(vec![0; 256]);
    read_ends(gltf::open(data, &gltf::GltfSelection::default(), &mut resolve, &options()));
});
