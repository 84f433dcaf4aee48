//! Obstacles between a source and a listener.

pub mod line_of_sight;
pub mod occlusion;
pub mod occlusion_filter;
