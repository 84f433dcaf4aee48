//! What an image file holds, and why one cannot be read.

use super::orientation::Orientation;
use thiserror::Error;
use tiff::TiffError;

/// Longest side of an image that is read.
pub const MAX_SIDE: u32 = 16_384;
/// Most pixels of an image that is read: 8192 squared.
pub const MAX_PIXELS: u64 = 1 << 26;
/// Bytes of samples that one byte of a file can hold at most, generously: that of Deflate is 1032.
pub(super) const DENSEST: u64 = 4096;

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
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
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

/// Channels, samples as stored, and how they are turned.
pub(super) type Read = (usize, Samples, Orientation);

pub(super) fn tiff_error(e: &TiffError) -> ImageError {
    let format = Format::Tiff;
    match e {
        TiffError::UnsupportedError(what) => ImageError::Unsupported { format, found: what.to_string() },
        other => ImageError::Damaged { format, reason: other.to_string() },
    }
}
