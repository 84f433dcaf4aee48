//! Simple and complex textures, told apart by the bandwidth of their histogram.

pub mod histogram;
pub mod histogram_class;
