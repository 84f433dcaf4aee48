//! Channels: mapping, mixing and panning.

pub mod channels;
pub mod mix;
pub mod mono;
pub mod pan;
