//! Image files: decoding, orientation, and luminance.

pub mod blockiness;
pub mod decode;
mod format;
pub mod image_luma;
pub mod luma;
mod orientation;
mod palette;
mod tiff_file;
