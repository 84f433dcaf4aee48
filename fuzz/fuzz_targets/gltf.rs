//! Any bytes as a GLB or glTF file: the target opens its largest mesh, and reads the motion of its first node and of the only animated one.
#![no_main]

mod meshes;
mod objects;

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;
use meshes::{options, read_ends};
use objects::read_motion;

fuzz_target!(|data: &[u8]| {
    let mut resolve = |_: &str| Ok(vec![0; 256]);
    read_ends(gltf::open(data, &gltf::GltfSelection::default(), &mut resolve, &options()));
    for object in [None, Some("node 0".to_owned())] {
        let selection = gltf::GltfSelection { object, ..gltf::GltfSelection::default() };
        read_motion(gltf::object_motion(data, &selection, &mut resolve, &options().limits));
    }
});
