//! Broad phase of the proximity search: triangles that may be near a vertex, found by bounding boxes, without those of its own
//! neighbourhood.

mod boxes;
pub mod bvh;
mod culling;
mod excluded_leaves;
pub mod exclusion;

pub(super) use boxes::{CLUSTER, LANES, max, min};
pub(super) use culling::{ClusterPoints, Pair, cull_boxes, cull_triangles, points_near_box};
pub(super) use excluded_leaves::{ExcludedLeaves, all_members};
pub use exclusion::Exclude;
