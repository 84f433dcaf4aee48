//! Filters over images: Gaussian, bilateral, Sobel, difference of Gaussians, pyramid.

pub mod bilateral;
pub mod dog;
pub mod dog_features;
pub mod kernel;
pub mod masked;
pub mod pyramid;
mod rows;
pub mod separable;
mod simd;
pub mod sobel;
pub mod sobel_map;

pub use kernel::Kernel;
pub use separable::smooth;
