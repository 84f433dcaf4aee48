//! Motion as triangle meshes: readers of animation formats and the topology that they share.
//!
//! Readers take bytes or something to seek in, and give a [`MeshStream`]: a [`MeshClip`] (topology and frame times)
//! and a [`FrameReader`]. [`FrameSampler`] puts frames on a regular grid, [`MeshPrepare`] orients a topology.
//! [`Mesh`] is what travels between nodes.

pub mod alembic;
mod bytes;
mod clip;
mod error;
#[cfg(test)]
mod fuzz;
pub mod generate;
pub mod generate_node;
pub mod gltf;
mod item;
mod materials;
mod matrix;
mod obj;
mod obj_sequence;
mod point_cache;
mod polygon;
mod prepare;
mod regions;
mod sampler;
pub mod sequence_node;
pub mod subdivide;
pub mod subdivide_node;
mod topology;

pub use crate::core::files::ReadSeek;
pub(crate) use clip::metres;
pub use clip::{FARTHEST, FrameReader, MeshClip, MeshLimits, MeshStream, ReadOptions, UpAxis};
pub use error::MeshError;
pub use item::{Mesh, MeshFormat};
pub use materials::Materials;
pub use obj::ObjMesh;
pub use obj_sequence::{OpenFrame, open_obj_sequence};
pub use point_cache::{open_mdd, open_pc2};
pub use polygon::{MAX_CORNERS, Triangulation, Triangulator};
pub use prepare::{MeshPrepare, vertex_areas};
pub use regions::Regions;
pub use sampler::{FrameSampler, nominal_rate};
pub(crate) use sequence_node::rest;
pub use topology::Topology;
