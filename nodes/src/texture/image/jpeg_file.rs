//! Decoding of JPEG images.

use super::format::{Format, ImageError, MAX_SIDE, Read, Samples};
use super::orientation::Orientation;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Columns and rows, from the header.
pub(super) fn jpeg_size(bytes: &[u8]) -> Result<(u64, u64), ImageError> {
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), jpeg_options());
    decoder.decode_headers().map_err(|e| jpeg_error(&e))?;
    let damaged = || ImageError::Damaged { format: Format::Jpeg, reason: "it has no size".into() };
    let (width, height) = decoder.dimensions().ok_or_else(damaged)?;
    Ok((width as u64, height as u64))
}

fn jpeg_options() -> DecoderOptions {
    let side = MAX_SIDE as usize;
    DecoderOptions::default().set_strict_mode(true).set_max_width(side).set_max_height(side)
}

fn jpeg_error(e: &DecodeErrors) -> ImageError {
    let format = Format::Jpeg;
    match e {
        DecodeErrors::LargeDimensions(side) => {
            ImageError::TooLarge { width: *side as u64, height: *side as u64 }
        }
        DecodeErrors::Unsupported(what) => ImageError::Unsupported { format, found: format!("{what:?}") },
        other => ImageError::Damaged { format, reason: format!("{other:?}") },
    }
}

pub(super) fn jpeg_samples(bytes: &[u8]) -> Result<Read, ImageError> {
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), jpeg_options());
    decoder.decode_headers().map_err(|e| jpeg_error(&e))?;
    let (channels, space) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (1, ColorSpace::Luma),
        _ => (3, ColorSpace::RGB),
    };
    decoder.set_options(jpeg_options().jpeg_set_out_colorspace(space));
    let data = decoder.decode().map_err(|e| jpeg_error(&e))?;
    let orientation = decoder.exif().map(|exif| Orientation::in_exif(exif)).unwrap_or_default();
    Ok((channels, Samples::Bytes(data), orientation))
}
