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
pub(super) mod tests {
    use super::*;
    use crate::core::random::Draw;

    /// Writes a PNG, for tests.
    pub(in super::super) fn png(
        width: u32,
        height: u32,
        colour: png::ColorType,
        words: bool,
        data: &[u8],
    ) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, width, height);
        encoder.set_color(colour);
        encoder.set_depth(if words { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
        if colour == png::ColorType::Indexed {
            encoder.set_palette(vec![0, 0, 0, 255, 255, 255, 255, 0, 0]);
            encoder.set_trns(vec![255, 255, 0]);
        }
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        out
    }

    fn tiff(colour: u16, samples: &[u8]) -> Vec<u8> {
        use tiff::encoder::{TiffEncoder, colortype};
        let mut out = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut out).unwrap();
        match colour {
            1 => encoder.write_image::<colortype::Gray8>(3, 2, samples).unwrap(),
            _ => encoder.write_image::<colortype::RGB8>(1, 2, samples).unwrap(),
        }
        out.into_inner()
    }

    /// An 8 x 8 grey JPEG of the level 129 at quality 90, as Pillow writes it.
    const JPEG: &[u8] = include_bytes!("testdata/grey.jpg");
    /// A 16 x 9 colour JPEG with halved colour, as Pillow writes it: orange with a blue corner.
    const COLOUR: &[u8] = include_bytes!("testdata/colour.jpg");

    #[test]
    fn every_kind_of_png_is_read() {
        use png::ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
        for (colour, channels) in [(Grayscale, 1), (GrayscaleAlpha, 2), (Rgb, 3), (Rgba, 4)] {
            let data: Vec<u8> = (0..6 * channels as u8).map(|k| k * 7).collect();
            let picture = decode(&png(3, 2, colour, false, &data)).unwrap();
            assert_eq!((picture.width, picture.height, picture.channels), (3, 2, channels));
            assert_eq!(picture.samples, Samples::Bytes(data.clone()));
            let wide: Vec<u8> = data.iter().flat_map(|k| [*k, 9]).collect();
            let words = data.iter().map(|k| u16::from(*k) * 256 + 9).collect();
            assert_eq!(decode(&png(3, 2, colour, true, &wide)).unwrap().samples, Samples::Words(words));
        }
        let palette = decode(&png(3, 1, Indexed, false, &[0, 1, 2])).unwrap();
        assert_eq!(palette.samples, Samples::Bytes(vec![0, 0, 0, 255, 255, 255, 255, 255, 255, 0, 0, 0]));
    }

    #[test]
    fn jpeg_and_tiff_are_read() {
        let grey = decode(JPEG).unwrap();
        assert_eq!((grey.width, grey.height, grey.channels, grey.format), (8, 8, 1, Format::Jpeg));
        let Samples::Bytes(samples) = grey.samples else { panic!("8 bits") };
        assert!(samples.iter().all(|x| x.abs_diff(129) <= 1), "{samples:?}");
        let colour = decode(COLOUR).unwrap();
        assert_eq!((colour.width, colour.height, colour.channels), (16, 9, 3));
        let Samples::Bytes(samples) = colour.samples else { panic!("8 bits") };
        let orange = samples.last_chunk::<3>().unwrap();
        assert!(orange.iter().zip([230, 140, 20]).all(|(a, b)| a.abs_diff(b) < 12), "{orange:?}");
        let data = [1, 2, 3, 4, 5, 6];
        let grey = decode(&tiff(1, &data)).unwrap();
        assert_eq!((grey.width, grey.height, grey.channels, grey.format), (3, 2, 1, Format::Tiff));
        assert_eq!(grey.samples, Samples::Bytes(data.to_vec()));
        assert_eq!(decode(&tiff(3, &data)).unwrap().channels, 3);
    }

    /// A TIFF of two pixels of grey with alpha, written by hand: its encoder knows none.
    fn grey_and_alpha(bits: u8, samples: &[u8]) -> Vec<u8> {
        let short = |tag: u16, values: [u16; 2], count: u32| {
            let [tag, kind] = [tag, 3].map(u16::to_le_bytes);
            [&tag[..], &kind, &count.to_le_bytes(), &values[0].to_le_bytes(), &values[1].to_le_bytes()]
                .concat()
        };
        let bits = u16::from(bits);
        // Width, height, bits, no compression, black is 0, where the samples are, channels, rows, bytes, and that the second is alpha.
        let tags = [
            short(256, [2, 0], 1),
            short(257, [1, 0], 1),
            short(258, [bits, bits], 2),
            short(259, [1, 0], 1),
            short(262, [1, 0], 1),
            short(273, [134, 0], 1),
            short(277, [2, 0], 1),
            short(278, [1, 0], 1),
            short(279, [samples.len() as u16, 0], 1),
            short(338, [2, 0], 1),
        ];
        [&b"II\x2a\0\x08\0\0\0\x0a\0"[..], &tags.concat(), &[0; 4], samples].concat()
    }

    #[test]
    fn a_tiff_of_grey_and_alpha_has_holes_where_it_is_transparent() {
        use crate::texture::LumaKind;
        use crate::texture::luma::luminance;
        let bytes = decode(&grey_and_alpha(8, &[119, 255, 200, 10])).unwrap();
        assert_eq!((bytes.width, bytes.height, bytes.channels, bytes.format), (2, 1, 2, Format::Tiff));
        assert_eq!(bytes.samples, Samples::Bytes(vec![119, 255, 200, 10]));
        let words = [119 * 257_u16, 65_535, 51_400, 2570];
        let wide: Vec<u8> = words.iter().flat_map(|x| x.to_le_bytes()).collect();
        let wide = decode(&grey_and_alpha(16, &wide)).unwrap();
        assert_eq!(wide.samples, Samples::Words(words.to_vec()));
        for picture in [bytes, wide] {
            let (luma, holes) = luminance(&picture, LumaKind::Lstar, false).unwrap();
            assert!((luma.samples[0] - 50.0).abs() < 0.1 && luma.samples[1] == 0.0, "{:?}", luma.samples);
            assert_eq!(holes, [false, true]);
        }
    }

    /// The JPEG with an Exif block behind its first two bytes.
    fn turned_jpeg(orientation: u8) -> Vec<u8> {
        let exif: &[u8] =
            &[b'M', b'M', 0, 42, 0, 0, 0, 8, 0, 1, 1, 18, 0, 3, 0, 0, 0, 1, 0, orientation, 0, 0, 0, 0, 0, 0];
        [&COLOUR[..2], &[0xff, 0xe1, 0, exif.len() as u8 + 8], b"Exif\0\0", exif, &COLOUR[2..]].concat()
    }

    #[test]
    fn photographs_are_turned_as_the_camera_was_held() {
        let plain = decode(COLOUR).unwrap();
        assert_eq!(decode(&turned_jpeg(1)).unwrap(), plain);
        let turned = decode(&turned_jpeg(6)).unwrap();
        assert_eq!((turned.width, turned.height), (9, 16));
        let (Samples::Bytes(before), Samples::Bytes(after)) = (&plain.samples, &turned.samples) else {
            panic!("8 bits")
        };
        // What was on the left lies on top, and what was at the bottom on the left.
        assert_eq!(after[..3], before[8 * 16 * 3..][..3]);
        assert_eq!(after[8 * 3..][..3], before[..3]);
        assert_ne!(after[..3], after[8 * 3..][..3], "one corner is blue");
    }

    #[test]
    fn a_tiff_of_separate_planes_is_told_from_a_damaged_one() {
        // Two pixels of red, then of green, then of blue, as tifffile writes them.
        let text = code(include_bytes!("testdata/planes.tif"));
        assert!(text.0 == "F123" && text.1.contains("plane of its own"), "{text:?}");
    }

    fn code(bytes: &[u8]) -> (&'static str, String) {
        let e = decode(bytes).unwrap_err();
        (e.code(), e.to_string())
    }

    #[test]
    fn errors_name_what_was_found_and_what_would_be_right() {
        let (c, text) = code(b"");
        assert!(c == "F120" && text.contains("empty") && text.contains("PNG, JPEG and TIFF"), "{text}");
        let (c, text) = code(b"RIFF....WEBP");
        assert!(c == "F120" && text.contains("52 49 46 46"), "{text}");
        let whole = png(30, 20, png::ColorType::Grayscale, false, &[7; 600]);
        let (c, text) = code(&whole[..whole.len() - 20]);
        assert!(c == "F122" && text.contains("PNG"), "{text}");
        let (c, _) = code(&JPEG[..JPEG.len() - 12]);
        assert_eq!(c, "F122");
        let (c, text) = code(&tiff(1, &[1, 2, 3, 4, 5, 6])[..40]);
        assert!(c == "F122", "{text}");
    }

    /// A PNG whose header claims a size, with the checksum that fits.
    fn claims(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = png(1, 1, png::ColorType::Grayscale, false, &[0]);
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let crc = bytes[12..29].iter().fold(u32::MAX, |crc, b| {
            (0..8).fold(crc ^ u32::from(*b), |c, _| (c >> 1) ^ (0xedb8_8320 * (c & 1)))
        });
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        bytes
    }

    #[test]
    fn what_a_header_claims_is_not_believed() {
        let (c, text) = code(&claims(16_385, 1));
        assert!(c == "F121" && text.contains("16385 x 1"), "{text}");
        assert_eq!(code(&claims(16_384, 16_384)).0, "F121");
        assert_eq!(code(&claims(u32::MAX >> 1, u32::MAX >> 1)).0, "F121");
        let (c, text) = code(&claims(8192, 8192));
        assert!(c == "F122" && text.contains("cannot hold 8192 x 8192"), "{text}");
        assert_eq!(code(&claims(2, 2)).0, "F122", "one pixel where four were announced");
    }

    #[test]
    fn damaged_files_give_an_image_or_an_error() {
        let seeds = [
            png(5, 4, png::ColorType::Rgba, false, &[99; 80]),
            png(3, 1, png::ColorType::Indexed, false, &[0, 1, 2]),
            png(4, 2, png::ColorType::Rgb, true, &[5; 48]),
            JPEG.to_vec(),
            COLOUR.to_vec(),
            tiff(1, &[1, 2, 3, 4, 5, 6]),
            palette::tests::tiff(4, true),
            palette::tests::tiff(8, false),
        ];
        let mut draw = Draw::new(120);
        let (mut read, mut refused) = (0, 0);
        for k in 0..3000 {
            let mut bytes = seeds[k % seeds.len()].clone();
            for _ in 0..=draw.below(4) {
                let at = draw.below(bytes.len());
                match draw.below(5) {
                    0 => bytes.truncate(at.max(1)),
                    1 => drop(bytes.remove(at)),
                    2 => bytes.insert(at, draw.below(256) as u8),
                    3 => bytes[at] ^= 1 << draw.below(8),
                    _ => bytes[at] = [0, 1, 0x7f, 0x80, 0xff, 0xd9][draw.below(6)],
                }
                if bytes.is_empty() {
                    break;
                }
            }
            match decode(&bytes) {
                Ok(picture) => {
                    read += 1;
                    let count = match &picture.samples {
                        Samples::Bytes(samples) => samples.len(),
                        Samples::Words(samples) => samples.len(),
                    };
                    assert_eq!(count, picture.width * picture.height * picture.channels);
                }
                Err(e) => {
                    refused += 1;
                    assert!(!e.to_string().is_empty());
                }
            }
        }
        assert!(read > 50 && refused > 500, "{read} read, {refused} refused");
    }
}
