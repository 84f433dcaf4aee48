//! Bytes and playing costs of all codes of a texture.

pub mod map_sizes;
pub mod report;
pub mod texture_report;
