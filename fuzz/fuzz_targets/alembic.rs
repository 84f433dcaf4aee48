//! Any bytes as an Alembic archive: the target opens every mesh of it.
#![no_main]

mod meshes;

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;
use meshes::{options, read_ends};

fuzz_target!(|data: &[u8]| {
    let file = || Box::new(std::io::Cursor::new(data.to_vec()));
    if let Ok(meshes) = alembic::list(file(), &options().limits) {
        for mesh in meshes.iter().take(4) {
            read_ends(alembic::open(file(), Some(&mesh.path), &options()));
        }
    }
});
