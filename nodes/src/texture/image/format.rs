//! Formats, samples and errors of image files.

use super::orientation::Orientation;
use thiserror::Error;

/// Maximum side of an image.
pub const MAX_SIDE: u32 = 16_384;
/// Maximum number of pixels of an image: 8192 squared.
pub const MAX_PIXELS: u64 = 1 << 26;
/// Upper bound of the compression ratio; that of Deflate is 1032.
pub(super) const MAX_RATIO: u64 = 4096;

/// Supported formats.
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
    /// Name of the format.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
        }
    }

    /// The format by the first bytes of a file.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::Tiff),
            _ => None,
        }
    }
}

/// Error in an image file.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ImageError {
    /// Empty, or of another format.
    #[error("{0}; PNG, JPEG and TIFF are read")]
    NoImage(String),
    /// Too many pixels.
    #[error(
        "it has {width} x {height} pixels; at most {MAX_SIDE} along a side and {MAX_PIXELS} in all are read"
    )]
    TooLarge {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// Damaged or cut off.
    #[error("the {} is damaged or cut off: {reason}", .format.name())]
    Damaged {
        /// Its format.
        format: Format,
        /// The defect.
        reason: String,
    },
    /// Valid, but of an unsupported kind.
    #[error("the {} holds {found}; 8 or 16 bits of grey or red, green and blue, with or without alpha, are read", .format.name())]
    Unsupported {
        /// Its format.
        format: Format,
        /// The unsupported kind.
        found: String,
    },
    /// A format that this build does not read.
    #[error("this build reads PNG only; the feature `images` adds {}", .0.name())]
    NotBuilt(Format),
    /// All pixels are holes.
    #[error("every pixel is transparent; a texture needs pixels of an alpha of at least half")]
    Transparent,
}

impl ImageError {
    /// Code of the diagnostic.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoImage(_) => "F120",
            Self::TooLarge { .. } => "F121",
            Self::Damaged { .. } => "F122",
            Self::Unsupported { .. } | Self::NotBuilt(_) | Self::Transparent => "F123",
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

/// A decoded image, rotated upright by the orientation in its file.
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
    /// Format of the file.
    pub format: Format,
}

/// The header of an image; columns and rows are as stored, before rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Its format.
    pub format: Format,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Channels, samples as stored, and orientation.
pub(super) type Read = (usize, Samples, Orientation);
