//! Decoding of TIFF images.

use super::format::{Format, ImageError, MAX_PIXELS, Read, Samples};
use super::orientation::Orientation;
use super::palette::{self, Palette, tiff_error};
use std::io::Cursor;
use tiff::decoder::{Decoder as Tiff, DecodingResult, Limits};
use tiff::tags::{PhotometricInterpretation, PlanarConfiguration, Tag};
use tiff::{ColorType as TiffColour, TiffError};

/// Columns and rows, from the header.
pub(super) fn tiff_size(bytes: &[u8]) -> Result<(u64, u64), ImageError> {
    let mut tiff = Tiff::new(Cursor::new(bytes)).map_err(|e| tiff_error(&e))?;
    tiff_kind(&mut tiff)?;
    let (width, height) = tiff.dimensions().map_err(|e| tiff_error(&e))?;
    Ok((u64::from(width), u64::from(height)))
}

pub(super) fn tiff_samples(bytes: &[u8]) -> Result<Read, ImageError> {
    let mut tiff = tiff_reader(bytes)?;
    let orientation = tiff.find_tag_unsigned::<u16>(Tag::Orientation).map_err(|e| tiff_error(&e))?;
    let orientation = Orientation::of(orientation.unwrap_or(1));
    let read = |tiff: &mut Tiff<Cursor<&[u8]>>| tiff.read_image().map_err(|e| tiff_error(&e));
    match tiff_kind(&mut tiff)? {
        TiffKind::Channels(channels) => match read(&mut tiff)? {
            DecodingResult::U8(samples) => Ok((channels, Samples::Bytes(samples), orientation)),
            DecodingResult::U16(samples) => Ok((channels, Samples::Words(samples), orientation)),
            _ => Err(unsupported("numbers that are not unsigned".into())),
        },
        TiffKind::Palette(bits) => {
            let colours = Palette::new(&mut tiff, bits)?;
            let width = tiff.dimensions().map_err(|e| tiff_error(&e))?.0;
            let grey = palette::as_grey(bytes).ok_or_else(|| unsupported(PALETTE.into()))?;
            match read(&mut tiff_reader(&grey)?)? {
                DecodingResult::U8(packed) => {
                    Ok((3, Samples::Words(colours.paint(&packed, width as usize)), orientation))
                }
                _ => Err(unsupported(PALETTE.into())),
            }
        }
    }
}

fn tiff_reader(bytes: &[u8]) -> Result<Tiff<Cursor<&[u8]>>, ImageError> {
    let max = MAX_PIXELS as usize * 8;
    let mut limits = Limits::default();
    (limits.decoding_buffer_size, limits.intermediate_buffer_size) = (max, max);
    Ok(Tiff::new(Cursor::new(bytes)).map_err(|e| tiff_error(&e))?.with_limits(limits))
}

fn unsupported(found: String) -> ImageError {
    ImageError::Unsupported { format: Format::Tiff, found }
}

/// Kind of the samples of a TIFF.
pub(super) enum TiffKind {
    /// Interleaved channels, and their number.
    Channels(usize),
    /// Indices into a palette, and their bits.
    Palette(u8),
}

/// Description of an unsupported palette, with a remedy.
const PALETTE: &str =
    "an unsupported palette (convert it to RGB, for example by `magick in.tif -type TrueColor out.png`)";

/// Returns the kind of a TIFF, if it is supported.
fn tiff_kind(tiff: &mut Tiff<Cursor<&[u8]>>) -> Result<TiffKind, ImageError> {
    let bad = |e: TiffError| tiff_error(&e);
    let photometric = tiff.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation).map_err(bad)?;
    if photometric == Some(PhotometricInterpretation::RGBPalette.to_u16()) {
        let bits = tiff.find_tag_unsigned_vec::<u8>(Tag::BitsPerSample).map_err(bad)?.unwrap_or_default();
        return match bits[..] {
            [bits @ (1 | 2 | 4 | 8)] => Ok(TiffKind::Palette(bits)),
            _ => Err(unsupported(PALETTE.into())),
        };
    }
    let planes = tiff.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(bad)?;
    let colour = tiff.colortype().map_err(bad)?;
    if planes == Some(PlanarConfiguration::Planar.to_u16()) && colour.num_samples() > 1 {
        return Err(unsupported(
            "each channel as a separate plane (save it with interleaved channels)".into(),
        ));
    }
    Ok(TiffKind::Channels(match colour {
        TiffColour::Gray(8 | 16) => 1,
        TiffColour::GrayA(8 | 16) | TiffColour::Multiband { bit_depth: 8 | 16, num_samples: 2 } => 2,
        TiffColour::RGB(8 | 16) => 3,
        TiffColour::RGBA(8 | 16) => 4,
        found => return Err(unsupported(format!("{found:?}"))),
    }))
}
