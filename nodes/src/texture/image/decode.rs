//! Decoding of PNG, JPEG and TIFF images into plain samples, with a check of the header before any allocation.

pub use super::format::{Format, Header, ImageError, MAX_PIXELS, MAX_SIDE, Picture, Samples};
use super::format::{MAX_RATIO, Read, tiff_error};
use super::orientation::Orientation;
use super::tiff_file::{tiff_kind, tiff_samples};
use std::io::Cursor;
use tiff::decoder::Decoder as Tiff;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Reads the header of an image.
///
/// # Errors
/// As [`decode`], as far as the header shows them.
pub fn header(bytes: &[u8]) -> Result<Header, ImageError> {
    let format = format(bytes)?;
    let damaged = |reason: String| ImageError::Damaged { format, reason };
    let (width, height) = match format {
        Format::Png => {
            let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png_limits());
            let info = decoder.read_header_info().map_err(|e| damaged(e.to_string()))?;
            (u64::from(info.width), u64::from(info.height))
        }
        Format::Jpeg => {
            let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), jpeg_options());
            decoder.decode_headers().map_err(|e| jpeg_error(&e))?;
            let (width, height) = decoder.dimensions().ok_or_else(|| damaged("it has no size".into()))?;
            (width as u64, height as u64)
        }
        Format::Tiff => {
            let mut tiff = Tiff::new(Cursor::new(bytes)).map_err(|e| tiff_error(&e))?;
            tiff_kind(&mut tiff)?;
            let (width, height) = tiff.dimensions().map_err(|e| tiff_error(&e))?;
            (u64::from(width), u64::from(height))
        }
    };
    if width > u64::from(MAX_SIDE) || height > u64::from(MAX_SIDE) || width * height > MAX_PIXELS {
        return Err(ImageError::TooLarge { width, height });
    }
    if width * height == 0 {
        return Err(damaged(format!("it has {width} x {height} pixels")));
    }
    if width * height > bytes.len() as u64 * MAX_RATIO {
        let reason = format!("{} bytes cannot hold {width} x {height} pixels", bytes.len());
        return Err(damaged(reason));
    }
    Ok(Header { format, width: width as usize, height: height as usize })
}

/// Reads an image.
///
/// # Errors
/// Bytes that are no image, or an image that is too large, damaged, cut off or of an unsupported kind.
///
/// # Complexity
/// Memory of a few times the samples.
pub fn decode(bytes: &[u8]) -> Result<Picture, ImageError> {
    let header = header(bytes)?;
    let (channels, samples, orientation) = match header.format {
        Format::Png => png_samples(bytes)?,
        Format::Jpeg => jpeg_samples(bytes)?,
        Format::Tiff => tiff_samples(bytes)?,
    };
    let Header { format, width, height } = header;
    let count = match &samples {
        Samples::Bytes(samples) => samples.len(),
        Samples::Words(samples) => samples.len(),
    };
    if count != width * height * channels {
        let reason = format!("{count} samples where {width} x {height} x {channels} were announced");
        return Err(ImageError::Damaged { format, reason });
    }
    let samples = match samples {
        Samples::Bytes(samples) => Samples::Bytes(orientation.rotated(samples, width, height, channels)),
        Samples::Words(samples) => Samples::Words(orientation.rotated(samples, width, height, channels)),
    };
    let (width, height) = orientation.size(width, height);
    Ok(Picture { width, height, channels, samples, format })
}

fn format(bytes: &[u8]) -> Result<Format, ImageError> {
    if bytes.is_empty() {
        return Err(ImageError::NoImage("the file is empty".into()));
    }
    Format::of(bytes).ok_or_else(|| {
        let first: Vec<String> = bytes.iter().take(4).map(|b| format!("{b:02x}")).collect();
        ImageError::NoImage(format!("the file starts with the bytes {}", first.join(" ")))
    })
}

fn png_limits() -> png::Limits {
    png::Limits { bytes: 1 << 26 }
}

fn png_samples(bytes: &[u8]) -> Result<Read, ImageError> {
    let format = Format::Png;
    let damaged = |e: png::DecodingError| ImageError::Damaged { format, reason: e.to_string() };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png_limits());
    // Expands palettes to colours, a transparent colour to alpha, and less than 8 bits to 8.
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let size = reader.output_buffer_size().ok_or(ImageError::TooLarge {
        width: u64::from(reader.info().width),
        height: u64::from(reader.info().height),
    })?;
    let mut data = vec![0; size];
    let frame = reader.next_frame(&mut data).map_err(damaged)?;
    data.truncate(frame.buffer_size());
    let samples = match frame.bit_depth {
        png::BitDepth::Sixteen => {
            Samples::Words(data.as_chunks().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect())
        }
        _ => Samples::Bytes(data),
    };
    let orientation = reader.info().exif_metadata.as_deref().map(Orientation::in_exif).unwrap_or_default();
    Ok((frame.color_type.samples(), samples, orientation))
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

fn jpeg_samples(bytes: &[u8]) -> Result<Read, ImageError> {
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

#[cfg(test)]
pub(super) mod tests;
