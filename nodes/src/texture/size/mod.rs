//! Sizes of all codes of a texture, and the costs of contacts on them.

pub mod map_sizes;
pub mod report;
pub mod texture_report;
