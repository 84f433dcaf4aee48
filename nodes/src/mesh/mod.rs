//! Motion as triangle meshes: readers of animation formats, synthetic motion and the topology that both share.
//!
//! A reader takes bytes or a seekable file and returns a [`MeshStream`]: a [`MeshClip`] (topology and frame times)
//! and a [`FrameReader`]. [`FrameSampler`] resamples frames onto a regular grid, [`MeshPrepare`] orients a topology.
//! [`Mesh`] is the item of the streams between nodes.

pub(crate) mod animation_file;
mod clip;
mod error;
mod formats;
pub mod generate;
mod item;
pub mod mesh_generator;
pub mod mesh_sequence;
pub mod mesh_subdivide;
pub mod subdivide;
pub(crate) mod topology;

pub use crate::core::files::ReadSeek;
pub(crate) use clip::to_metres;
pub use clip::{
    FrameReader, FrameSampler, MAX_COORDINATE, MeshClip, MeshLimits, MeshStream, ReadOptions, UpAxis,
    nominal_rate, rate_difference,
};
pub use error::MeshError;
#[cfg(test)]
pub(crate) use formats::test_files;
pub use formats::{ObjMesh, ObjectMotion, OpenFrame, alembic, gltf, open_mdd, open_obj_sequence, open_pc2};
pub use item::{Mesh, MeshFormat};
pub(crate) use mesh_sequence::rest_mesh;
pub use topology::{
    MAX_CORNERS, Materials, MeshPrepare, Regions, Topology, Triangulation, Triangulator, vertex_areas,
};
