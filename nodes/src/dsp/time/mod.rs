//! Shifts in time: delays, feedback, and parts of a recording.

pub mod advance;
pub mod delay;
pub mod feedback;
pub mod trim;
