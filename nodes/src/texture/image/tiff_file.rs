//! Samples of a TIFF.

use super::format::{Format, ImageError, MAX_PIXELS, Read, Samples, tiff_error};
use super::orientation::Orientation;
use super::palette::{self, Palette};
use std::io::Cursor;
use tiff::decoder::{Decoder as Tiff, DecodingResult, Limits};
use tiff::tags::{PhotometricInterpretation, PlanarConfiguration, Tag};
use tiff::{ColorType as TiffColour, TiffError};

pub(super) fn tiff_samples(bytes: &[u8]) -> Result<Read, ImageError> {
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
pub(super) enum TiffKind {
    /// So many channels.
    Channels(usize),
    /// Numbers of colours, of so many bits.
    Palette(u8),
}

/// A palette that is not read, and what to do.
const PALETTE: &str = "colours of a palette in a way that is not read (convert it to RGB, such as by `magick in.tif -type TrueColor out.png`)";

/// The kind of a TIFF, where it is one that is read.
pub(super) fn tiff_kind(tiff: &mut Tiff<Cursor<&[u8]>>) -> Result<TiffKind, ImageError> {
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
