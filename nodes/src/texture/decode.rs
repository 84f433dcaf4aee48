//! Reads PNG, JPEG and TIFF images into plain samples; nothing that a header claims is believed before it is plausible.

use super::orientation::Orientation;
use super::palette::{self, Palette};
use std::io::Cursor;
use thiserror::Error;
use tiff::decoder::{Decoder as Tiff, DecodingResult, Limits};
use tiff::tags::{PhotometricInterpretation, PlanarConfiguration, Tag};
use tiff::{ColorType as TiffColour, TiffError};
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Longest side of an image that is read.
pub const MAX_SIDE: u32 = 16_384;
/// Most pixels of an image that is read: 8192 squared.
pub const MAX_PIXELS: u64 = 1 << 26;
/// Bytes of samples that one byte of a file can hold at most, generously: that of Deflate is 1032.
const DENSEST: u64 = 4096;

/// Formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Portable network graphics.
    Png,
    /// The JPEG format of photographs.
    Jpeg,
    /// Tagged image files.
    Tiff,
}

impl Format {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
        }
    }

    /// The format that the first bytes of a file tell.
    fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::Tiff),
            _ => None,
        }
    }
}

/// Why an image cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ImageError {
    /// Nothing, or nothing known.
    #[error("{0}; PNG, JPEG and TIFF are read")]
    NoImage(String),
    /// More pixels than are read.
    #[error(
        "it has {width} x {height} pixels; at most {MAX_SIDE} along a side and {MAX_PIXELS} in all are read"
    )]
    TooLarge {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// Broken or cut off.
    #[error("the {} is damaged or cut off: {reason}", .format.name())]
    Damaged {
        /// What it claims to be.
        format: Format,
        /// What is wrong.
        reason: String,
    },
    /// Sound, but of a kind that is not read.
    #[error("the {} holds {found}; 8 or 16 bits of grey or red, green and blue, with or without alpha, are read", .format.name())]
    Unsupported {
        /// Its format.
        format: Format,
        /// What it holds.
        found: String,
    },
    /// No pixel to see.
    #[error("every pixel is transparent; a texture needs pixels of an alpha of at least half")]
    Transparent,
}

impl ImageError {
    /// The code of the diagnostic.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoImage(_) => "F120",
            Self::TooLarge { .. } => "F121",
            Self::Damaged { .. } => "F122",
            Self::Unsupported { .. } | Self::Transparent => "F123",
        }
    }
}

/// Samples of 8 or 16 bits.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 0 to 255.
    Bytes(Vec<u8>),
    /// 0 to 65535.
    Words(Vec<u16>),
}

/// An image as it is looked at: turned where its file says how the camera was held.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns, at least 1.
    pub width: usize,
    /// Rows, at least 1.
    pub height: usize,
    /// 1 grey, 2 grey and alpha, 3 red, green and blue, 4 with alpha.
    pub channels: usize,
    /// `width * height * channels` samples.
    pub samples: Samples,
    /// What it was read from.
    pub format: Format,
}

/// What the header of an image says; columns and rows as they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Its format.
    pub format: Format,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Looks at the header of an image alone.
///
/// # Errors
/// As [`decode`], as far as the header shows it.
pub fn header(bytes: &[u8]) -> Result<Header, ImageError> {
    let format = known(bytes)?;
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
    if width * height > bytes.len() as u64 * DENSEST {
        let reason = format!("{} bytes cannot hold {width} x {height} pixels", bytes.len());
        return Err(damaged(reason));
    }
    Ok(Header { format, width: width as usize, height: height as usize })
}

/// Reads an image.
///
/// # Errors
/// Says what was found and what would be right: no image, too large, damaged or cut off, of a kind that is not read.
///
/// # Complexity
/// Memory for the samples, and no more than a few times that while they are unpacked.
pub fn decode(bytes: &[u8]) -> Result<Picture, ImageError> {
    let header = header(bytes)?;
    let (channels, samples, held) = match header.format {
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
        Samples::Bytes(samples) => Samples::Bytes(held.turned(samples, width, height, channels)),
        Samples::Words(samples) => Samples::Words(held.turned(samples, width, height, channels)),
    };
    let (width, height) = held.size(width, height);
    Ok(Picture { width, height, channels, samples, format })
}

fn known(bytes: &[u8]) -> Result<Format, ImageError> {
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

/// Channels, samples as stored, and how they are turned.
type Read = (usize, Samples, Orientation);

fn png_samples(bytes: &[u8]) -> Result<Read, ImageError> {
    let format = Format::Png;
    let damaged = |e: png::DecodingError| ImageError::Damaged { format, reason: e.to_string() };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png_limits());
    // Palettes become colours, a transparent colour becomes alpha, and less than 8 bits become 8.
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
    let held = reader.info().exif_metadata.as_deref().map(Orientation::in_exif).unwrap_or_default();
    Ok((frame.color_type.samples(), samples, held))
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
    let held = decoder.exif().map(|exif| Orientation::in_exif(exif)).unwrap_or_default();
    Ok((channels, Samples::Bytes(data), held))
}

pub(super) fn tiff_error(e: &TiffError) -> ImageError {
    let format = Format::Tiff;
    match e {
        TiffError::UnsupportedError(what) => ImageError::Unsupported { format, found: what.to_string() },
        other => ImageError::Damaged { format, reason: other.to_string() },
    }
}

fn tiff_samples(bytes: &[u8]) -> Result<Read, ImageError> {
    let mut tiff = tiff_reader(bytes)?;
    let held = tiff.find_tag_unsigned::<u16>(Tag::Orientation).map_err(|e| tiff_error(&e))?;
    let held = Orientation::of(held.unwrap_or(1));
    let read = |tiff: &mut Tiff<Cursor<&[u8]>>| tiff.read_image().map_err(|e| tiff_error(&e));
    match tiff_kind(&mut tiff)? {
        TiffKind::Channels(channels) => match read(&mut tiff)? {
            DecodingResult::U8(samples) => Ok((channels, Samples::Bytes(samples), held)),
            DecodingResult::U16(samples) => Ok((channels, Samples::Words(samples), held)),
            _ => Err(not_read("numbers that are not unsigned".into())),
        },
        TiffKind::Palette(bits) => {
            let colours = Palette::new(&mut tiff, bits)?;
            let width = tiff.dimensions().map_err(|e| tiff_error(&e))?.0;
            let grey = palette::as_grey(bytes).ok_or_else(|| not_read(PALETTE.into()))?;
            match read(&mut tiff_reader(&grey)?)? {
                DecodingResult::U8(packed) => {
                    Ok((3, Samples::Words(colours.paint(&packed, width as usize)), held))
                }
                _ => Err(not_read(PALETTE.into())),
            }
        }
    }
}

fn tiff_reader(bytes: &[u8]) -> Result<Tiff<Cursor<&[u8]>>, ImageError> {
    let most = MAX_PIXELS as usize * 8;
    let mut limits = Limits::default();
    (limits.decoding_buffer_size, limits.intermediate_buffer_size) = (most, most);
    Ok(Tiff::new(Cursor::new(bytes)).map_err(|e| tiff_error(&e))?.with_limits(limits))
}

fn not_read(found: String) -> ImageError {
    ImageError::Unsupported { format: Format::Tiff, found }
}

/// What the samples of a TIFF are.
enum TiffKind {
    /// So many channels.
    Channels(usize),
    /// Numbers of colours, of so many bits.
    Palette(u8),
}

/// A palette that is not read, and what to do.
const PALETTE: &str = "colours of a palette in a way that is not read (convert it to RGB, such as by `magick in.tif -type TrueColor out.png`)";

/// The kind of a TIFF, where it is one that is read.
fn tiff_kind(tiff: &mut Tiff<Cursor<&[u8]>>) -> Result<TiffKind, ImageError> {
    let bad = |e: TiffError| tiff_error(&e);
    let photometric = tiff.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation).map_err(bad)?;
    if photometric == Some(PhotometricInterpretation::RGBPalette.to_u16()) {
        let bits = tiff.find_tag_unsigned_vec::<u8>(Tag::BitsPerSample).map_err(bad)?.unwrap_or_default();
        return match bits[..] {
            [bits @ (1 | 2 | 4 | 8)] => Ok(TiffKind::Palette(bits)),
            _ => Err(not_read(PALETTE.into())),
        };
    }
    let planes = tiff.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(bad)?;
    let colour = tiff.colortype().map_err(bad)?;
    if planes == Some(PlanarConfiguration::Planar.to_u16()) && colour.num_samples() > 1 {
        return Err(not_read(
            "each channel as a plane of its own (save it with interleaved channels)".into(),
        ));
    }
    Ok(TiffKind::Channels(match colour {
        TiffColour::Gray(8 | 16) => 1,
        TiffColour::GrayA(8 | 16) | TiffColour::Multiband { bit_depth: 8 | 16, num_samples: 2 } => 2,
        TiffColour::RGB(8 | 16) => 3,
        TiffColour::RGBA(8 | 16) => 4,
        found => return Err(not_read(format!("{found:?}"))),
    }))
}

#[cfg(test)]
#[path = "decode_tests.rs"]
pub(super) mod tests;
