//! Codes of discontinuity maps, and their files.

pub mod code;
pub mod file;
pub mod map_coder;
pub mod map_file;
