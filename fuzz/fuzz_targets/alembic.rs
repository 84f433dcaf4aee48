//! Any bytes as an Alembic archive: the target opens its meshes, and reads the motion of the same objects and of the only animated one.
#![no_main]

mod meshes;
mod objects;

use foley_nodes::mesh::*;
use libfuzzer_sys::fuzz_target;
use meshes::{options, read_ends};
use objects::read_motion;

fuzz_target!(|data: &[u8]| {
    let file = || Box::new(std::io::Cursor::new(data.to_vec()));
    read_motion(alembic::object_motion(file(), None, &options().limits));
    if let Ok(meshes) = alembic::list(file(), &options().limits) {
        for mesh in meshes.iter().take(4) {
            read_ends(alembic::open(file(), Some(&mesh.path), &options()));
            read_motion(alembic::object_motion(file(), Some(&mesh.path), &options().limits));
        }
    }
});
