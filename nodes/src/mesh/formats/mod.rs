//! File formats, each with one reader that opens a [`MeshStream`](super::MeshStream). Scenes have one more, of an [`ObjectMotion`].

mod affine;
pub mod alembic;
mod bytes;
#[cfg(test)]
mod fuzz;
#[cfg(feature = "gltf")]
pub mod gltf;
mod obj;
mod obj_sequence;
mod object_motion;
mod ply;
mod point_cache;
#[cfg(not(feature = "gltf"))]
pub mod without_gltf;

use super::clip::{self, FrameReader, MeshClip, MeshLimits, MeshStream, ReadOptions};
use super::topology::{Materials, Topology, Triangulator};
use super::{MeshError, ReadSeek};
pub use obj::ObjMesh;
pub use obj_sequence::{OpenFrame, open_obj_sequence};
pub use object_motion::ObjectMotion;
pub use point_cache::{open_mdd, open_pc2};
#[cfg(not(feature = "gltf"))]
pub use without_gltf as gltf;

#[cfg(test)]
pub(crate) mod test_files {
    //! Small files of each format for the tests of the readers and of `MeshSequence`.

    pub(crate) use super::gltf::tests::{asset, floats};
    pub(in crate::mesh) use super::point_cache::tests::{mdd, pc2};
}
