//! Decoding of PNG, JPEG and TIFF images into plain samples, with a check of the header before any allocation.

pub use super::format::{Format, Header, ImageError, MAX_PIXELS, MAX_SIDE, Picture, Samples};
use super::format::{MAX_RATIO, Read};
#[cfg(feature = "images")]
use super::jpeg_file::{jpeg_samples, jpeg_size};
use super::orientation::Orientation;
#[cfg(feature = "images")]
use super::tiff_file::{tiff_samples, tiff_size};
#[cfg(not(feature = "images"))]
use super::without_images::{jpeg_samples, jpeg_size, tiff_samples, tiff_size};
use std::io::Cursor;

/// Reads the header of an image.
///
/// # Errors
/// As [`decode`], for errors that the header shows.
pub fn header(bytes: &[u8]) -> Result<Header, ImageError> {
    let format = format(bytes)?;
    let damaged = |reason: String| ImageError::Damaged { format, reason };
    let (width, height) = match format {
        Format::Png => {
            let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png_limits());
            let info = decoder.read_header_info().map_err(|e| damaged(e.to_string()))?;
            (u64::from(info.width), u64::from(info.height))
        }
        Format::Jpeg => jpeg_size(bytes)?,
        Format::Tiff => tiff_size(bytes)?,
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

#[cfg(test)]
pub(super) mod tests;
