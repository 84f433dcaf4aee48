//! Orientation of photographs.
//!
//! # Source
//! CIPA DC-008 (Exif 2.32), tag 274 of the first directory; the same tag in TIFF 6.0.

/// Transformation of the stored rows and columns to the upright image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Orientation {
    /// Transposition, applied first.
    transpose: bool,
    /// Reversal of the columns, applied after it.
    mirror: bool,
    /// Reversal of the rows, applied after it.
    flip: bool,
}

impl Orientation {
    /// The orientation of a value of the tag; the identity for an undefined value.
    pub fn of(tag: u16) -> Self {
        let (transpose, mirror, flip) = match tag {
            2 => (false, true, false),
            3 => (false, true, true),
            4 => (false, false, true),
            5 => (true, false, false),
            6 => (true, true, false),
            7 => (true, true, true),
            8 => (true, false, true),
            _ => (false, false, false),
        };
        Self { transpose, mirror, flip }
    }

    /// The orientation in an Exif block; the identity if there is none or the block is damaged.
    pub fn in_exif(exif: &[u8]) -> Self {
        Self::of(tag(exif).unwrap_or(1))
    }

    /// Width and height of the upright image from the stored ones.
    pub fn size(self, width: usize, height: usize) -> (usize, usize) {
        if self.transpose { (height, width) } else { (width, height) }
    }

    /// Rotates an image upright.
    ///
    /// # Shapes
    /// `samples`: stored rows of `width` pixels with `channels` samples each; the result has the same layout, upright.
    pub fn rotated<T: Copy>(self, samples: Vec<T>, width: usize, height: usize, channels: usize) -> Vec<T> {
        if self == Self::default() {
            return samples;
        }
        let (out_width, out_height) = self.size(width, height);
        let mut out = Vec::with_capacity(samples.len());
        for row in 0..out_height {
            let y = if self.flip { out_height - 1 - row } else { row };
            for column in 0..out_width {
                let x = if self.mirror { out_width - 1 - column } else { column };
                let from = if self.transpose { x * width + y } else { y * width + x };
                out.extend_from_slice(
                    samples.get(from * channels..(from + 1) * channels).unwrap_or_default(),
                );
            }
        }
        out
    }
}

/// Value of the tag in the first directory of an Exif block, which is a small TIFF.
fn tag(exif: &[u8]) -> Option<u16> {
    let exif = exif.strip_prefix(b"Exif\0\0").unwrap_or(exif);
    let little = match exif.get(..4)? {
        [b'I', b'I', 42, 0] => true,
        [b'M', b'M', 0, 42] => false,
        _ => return None,
    };
    let bytes = |at: usize, len: usize| exif.get(at..at.checked_add(len)?);
    let short = |at: usize| {
        let pair = bytes(at, 2)?.try_into().ok()?;
        Some(if little { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) })
    };
    let four = bytes(4, 4)?.try_into().ok()?;
    let first = (if little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) }) as usize;
    let entry = |k: usize| first.checked_add(2 + 12 * k);
    let offset = (0..usize::from(short(first)?)).filter_map(entry).find(|at| short(*at) == Some(274))?;
    short(offset.checked_add(8)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An Exif block with a tag before that of the orientation.
    fn exif(little: bool, value: u16) -> Vec<u8> {
        let short = |x: u16| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let long = |x: u32| if little { x.to_le_bytes() } else { x.to_be_bytes() };
        let mut out = if little { b"Exif\0\0II".to_vec() } else { b"Exif\0\0MM".to_vec() };
        out.extend(short(42));
        out.extend(long(8));
        out.extend(short(2));
        for (tag, value) in [(256, 7), (274, value)] {
            out.extend([short(tag), short(3)].concat());
            out.extend(long(1));
            out.extend([short(value), short(0)].concat());
        }
        out
    }

    #[test]
    fn every_orientation_gives_the_same_upright_image() {
        // The image a b c / d e f, as stored in each orientation.
        let stored = [
            (1, 3, "abcdef"),
            (2, 3, "cbafed"),
            (3, 3, "fedcba"),
            (4, 3, "defabc"),
            (5, 2, "adbecf"),
            (6, 2, "cfbead"),
            (7, 2, "fcebda"),
            (8, 2, "daebfc"),
        ];
        for (tag, width, text) in stored {
            let orientation = Orientation::of(tag);
            let height = 6 / width;
            assert_eq!(orientation.size(width, height), (3, 2), "{tag}");
            let upright = orientation.rotated(text.as_bytes().to_vec(), width, height, 1);
            assert_eq!(std::str::from_utf8(&upright).unwrap(), "abcdef", "{tag}");
        }
        let pairs = Orientation::of(6).rotated(vec![3, 30, 1, 10, 4, 40, 2, 20], 2, 2, 2);
        assert_eq!(pairs, [4, 40, 3, 30, 2, 20, 1, 10]);
    }

    #[test]
    fn the_tag_is_found_in_either_byte_order_and_damaged_blocks_are_ignored() {
        for little in [true, false] {
            let whole = exif(little, 6);
            assert_eq!(Orientation::in_exif(&whole), Orientation::of(6));
            assert_eq!(Orientation::in_exif(&whole[6..]), Orientation::of(6));
            for cut in 0..whole.len() - 4 {
                assert_eq!(Orientation::in_exif(&whole[..cut]), Orientation::default(), "{cut}");
            }
            assert_eq!(Orientation::in_exif(&exif(little, 99)), Orientation::default());
        }
    }
}
