//! TIFF images with a palette.
//!
//! The decoder reads their samples only if they are declared as grey, and gives the palette as a tag.

use super::format::{Format, ImageError, tiff_error};
use std::io::Cursor;
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

#[cfg(test)]
pub(super) mod tests {
    use crate::texture::image::decode::{Samples, decode};

    /// A TIFF of 5 x 2 pixels with the palette indices 0, 1, 2, ... (0, 1, 0, 1, ... for one bit).
    pub(in super::super) fn tiff(bits: u16, little: bool) -> Vec<u8> {
        let short = |x: u16| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let long = |x: u32| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let colours = 1_u32 << bits;
        let mut data = vec![0_u8; 2 * (5 * usize::from(bits)).div_ceil(8)];
        let each = data.len() / 2;
        for k in 0..10_usize {
            let (x, number) = (k % 5, k as u32 % colours);
            let offset = x * usize::from(bits);
            data[k / 5 * each + offset / 8] |= (number as u8) << (8 - usize::from(bits) - offset % 8);
        }
        let map_at = 8 + data.len() as u32 + data.len() as u32 % 2;
        let start = map_at + 6 * colours;
        let mut out = if little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
        out.extend(long(start));
        out.extend(&data);
        out.resize(map_at as usize, 0);
        for channel in 0..3_u32 {
            (0..colours).for_each(|k| out.extend(short((k * 250 + 9 * channel + 1) as u16)));
        }
        let entries: [(u16, u16, u32, u32); 9] = [
            (256, 4, 1, 5),
            (257, 4, 1, 2),
            (258, 3, 1, bits.into()),
            (259, 3, 1, 1),
            (262, 3, 1, 3),
            (273, 4, 1, 8),
            (278, 4, 1, 2),
            (279, 4, 1, data.len() as u32),
            (320, 3, 3 * colours, map_at),
        ];
        out.extend(short(entries.len() as u16));
        for (tag, kind, count, value) in entries {
            out.extend(short(tag));
            out.extend(short(kind));
            out.extend(long(count));
            if kind == 3 && count == 1 {
                out.extend(short(value as u16));
                out.extend([0; 2]);
            } else {
                out.extend(long(value));
            }
        }
        out.extend(long(0));
        out
    }

    #[test]
    fn indices_become_colours_at_any_depth_and_byte_order() {
        for bits in [1, 2, 4, 8] {
            for little in [true, false] {
                let picture = decode(&tiff(bits, little)).unwrap();
                assert_eq!((picture.width, picture.height, picture.channels), (5, 2, 3));
                let right =
                    (0..10_u16).flat_map(|k| [0, 1, 2].map(|c| k % (1 << bits) * 250 + 9 * c + 1)).collect();
                assert_eq!(picture.samples, Samples::Words(right), "{bits} bits, little {little}");
            }
        }
    }

    #[test]
    fn the_error_of_an_unsupported_palette_has_a_remedy() {
        let mut deep = tiff(8, true);
        let at = deep.windows(4).position(|w| w == [2, 1, 3, 0]).unwrap();
        deep[at + 8] = 16;
        let e = decode(&deep).unwrap_err();
        assert!(e.code() == "F123" && e.to_string().contains("convert it to RGB"), "{e}");
        // Too few colours.
        let mut poor = tiff(4, true);
        let at = poor.windows(4).position(|w| w == [64, 1, 3, 0]).unwrap();
        poor[at + 4] = 30;
        let e = decode(&poor).unwrap_err();
        assert!(e.code() == "F122" && e.to_string().contains("30 numbers for 16 colours"), "{e}");
    }
}
