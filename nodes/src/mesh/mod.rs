//! Motion as triangle meshes: readers of animation formats and the topology that they share.

mod topology;

pub use topology::Topology;
