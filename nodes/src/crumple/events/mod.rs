//! Events: connected vertices that buckle together, joined over space and over time.

mod components;
mod crumple;
pub mod crumple_events;
pub mod grouping;
mod mesh_digest;

pub use crumple::{Crumple, Weight};
pub use grouping::{CrumpleEvents, CrumpleParams};
pub(crate) use mesh_digest::mesh_digest;
