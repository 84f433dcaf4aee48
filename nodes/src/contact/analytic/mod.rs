//! Colliders defined by a formula: a plane, a sphere, a capsule.

pub mod analytic_collider;
pub mod collider;
