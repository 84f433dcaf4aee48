//! Positions and orientations over time: poses, and the nodes that make them.

pub mod bvh;
pub mod bvh_pose;
pub(crate) mod interpolation;
pub mod item;
pub mod object_pose;
pub mod orbit;
pub mod pose;
pub mod pose_file;
pub mod pose_track;
pub mod vertex_pose;
