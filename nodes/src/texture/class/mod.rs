//! Classification of textures as simple or complex, by the bandwidth of their histogram.

pub mod histogram;
pub mod histogram_class;
mod stretch;
