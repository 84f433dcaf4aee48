//! Image files: decoding, orientation, and luminance.

pub mod blockiness;
pub mod decode;
mod format;
pub mod image_luma;
#[cfg(feature = "images")]
mod jpeg_file;
pub mod luma;
mod orientation;
#[cfg(feature = "images")]
mod palette;
#[cfg(feature = "images")]
mod tiff_file;
#[cfg(not(feature = "images"))]
mod without_images;
