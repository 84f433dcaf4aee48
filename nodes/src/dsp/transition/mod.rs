//! Transitions between a sound and silence, or between two sounds.

pub mod crossfade;
pub mod dropout;
pub mod fade;
