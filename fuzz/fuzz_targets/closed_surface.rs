//! Closed surfaces from OBJ and STL: rejected, or filled with tetrahedra, or rejected then.
#![no_main]

use foley_nodes::solid::mesh::closed_surface::ClosedSurface;
use foley_nodes::solid::mesh::voxels::voxels;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(surface) = ClosedSurface::read(bytes, 1.0)
        && let Ok(found) = voxels(&surface, 6, 1)
    {
        assert!(found.mesh.volume() > 0.0);
    }
});
