//! TIFF images with a palette.
//!
//! The decoder reads their samples only if they are declared as grey, and returns the palette as a tag.

use super::format::{Format, ImageError};
use std::io::Cursor;
use tiff::TiffError;
use tiff::decoder::Decoder;
use tiff::tags::Tag;

/// Tag of the meaning of samples, and its value for grey with 0 as black.
const PHOTOMETRIC: u16 = 262;
const BLACK_IS_ZERO: u8 = 1;

/// The colours of an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Palette {
    /// Bits of an index: 1, 2, 4 or 8.
    bits: u8,
    colours: Vec<[u16; 3]>,
}

impl Palette {
    /// Reads the palette of an image.
    pub fn new(tiff: &mut Decoder<Cursor<&[u8]>>, bits: u8) -> Result<Self, ImageError> {
        let damaged = |reason: String| ImageError::Damaged { format: Format::Tiff, reason };
        let map = tiff.find_tag_unsigned_vec::<u16>(Tag::ColorMap).map_err(|e| tiff_error(&e))?;
        let map = map.ok_or_else(|| damaged("it has a palette without colours".into()))?;
        let count = 1_usize << bits;
        let part = |k: usize| map.get(k * count..(k + 1) * count);
        let (Some(red), Some(green), Some(blue)) = (part(0), part(1), part(2)) else {
            return Err(damaged(format!("its palette has {} numbers for {count} colours", map.len())));
        };
        // Some programs write 8-bit values to the 16-bit fields.
        let scale = if map.iter().all(|x| *x < 256) { 257 } else { 1 };
        let colours = red.iter().zip(green).zip(blue).map(|((r, g), b)| [*r, *g, *b].map(|x| x * scale));
        let colours = colours.collect();
        Ok(Self { bits, colours })
    }

    /// Red, green and blue of each pixel, from packed indices in rows of whole bytes.
    pub fn paint(&self, packed: &[u8], width: usize) -> Vec<u16> {
        let bits = usize::from(self.bits);
        let row = (width * bits).div_ceil(8).max(1);
        let colour = |row: &[u8], x: usize| {
            let byte = row.get(x * bits / 8).copied().unwrap_or_default();
            let shift = 8 - bits - x * bits % 8;
            let index = usize::from(byte) >> shift & ((1 << bits) - 1);
            self.colours.get(index).copied().unwrap_or_default()
        };
        packed.chunks_exact(row).flat_map(|row| (0..width).flat_map(move |x| colour(row, x))).collect()
    }
}

/// A copy of the file with its first image declared as grey; `None` if the tag is not found.
pub(super) fn as_grey(bytes: &[u8]) -> Option<Vec<u8>> {
    let little = bytes.first() == Some(&b'I');
    let number = |at: usize, len: usize| {
        let part = bytes.get(at..at.checked_add(len)?)?;
        let join = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        let value = if little { part.iter().rev().fold(0, join) } else { part.iter().fold(0, join) };
        usize::try_from(value).ok()
    };
    // BigTIFF has longer offsets.
    let big = number(2, 2)? == 43;
    let (start, count, head, entry) =
        if big { (number(8, 8)?, 8, 12, 20) } else { (number(4, 4)?, 2, 8, 12) };
    let entries = number(start, count)?.min(4096);
    for k in 0..entries {
        let at = start.checked_add(count + k * entry)?;
        if number(at, 2)? == usize::from(PHOTOMETRIC) {
            let mut grey = bytes.to_vec();
            // A 16-bit number whose upper byte is zero.
            let low = at + head + usize::from(!little);
            *grey.get_mut(low)? = BLACK_IS_ZERO;
            return Some(grey);
        }
    }
    None
}

pub(super) fn tiff_error(e: &TiffError) -> ImageError {
    let format = Format::Tiff;
    match e {
        TiffError::UnsupportedError(what) => ImageError::Unsupported { format, found: what.to_string() },
        other => ImageError::Damaged { format, reason: other.to_string() },
    }
}

#[cfg(test)]
pub(super) mod tests;
