//! Feature crossings: excitation from the lines of two surfaces, with a pulse where a line of one crosses a line of the other.

pub(super) mod crossing_force;
pub mod feature_crossings;

pub use crossing_force::{CrossingForce, CrossingVoice};
