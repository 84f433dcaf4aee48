//! JPEG and TIFF in a build without the feature `images`: an error.

use super::format::{Format, ImageError, Read};

pub(super) fn jpeg_size(_: &[u8]) -> Result<(u64, u64), ImageError> {
    Err(ImageError::NotBuilt(Format::Jpeg))
}

pub(super) fn jpeg_samples(_: &[u8]) -> Result<Read, ImageError> {
    Err(ImageError::NotBuilt(Format::Jpeg))
}

pub(super) fn tiff_size(_: &[u8]) -> Result<(u64, u64), ImageError> {
    Err(ImageError::NotBuilt(Format::Tiff))
}

pub(super) fn tiff_samples(_: &[u8]) -> Result<Read, ImageError> {
    Err(ImageError::NotBuilt(Format::Tiff))
}
