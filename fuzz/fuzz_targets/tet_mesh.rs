//! Meshes of tetrahedra of all formats: rejected, or the same when they are written as Medit and read again.
#![no_main]

use foley_nodes::solid::mesh::formats::write_medit;
use foley_nodes::solid::read_tets;
use libfuzzer_sys::fuzz_target;

const NODES: &[u8] = b"4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";

fuzz_target!(|bytes: &[u8]| {
    if let Ok(mesh) = read_tets(bytes, Some(NODES)) {
        assert!(mesh.volume() > 0.0);
        assert_eq!(read_tets(write_medit(&mesh).as_bytes(), None).unwrap(), mesh);
    }
});
