//! Errors of audio files, and warnings about files that can be read.

use std::fmt;
use std::io;

/// An error of reading or writing an audio file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AudioError {
    /// The source or sink failed.
    #[error("reading or writing the audio file failed: {0}")]
    Io(#[from] io::Error),
    /// The first bytes belong to no supported format.
    #[error(
        "the file begins with {found}, which is not a known audio format; WAV, FLAC, Ogg Vorbis and MP3 are supported"
    )]
    UnknownFormat {
        /// The first bytes; printable ones as text.
        found: String,
    },
    /// A known format in an unsupported variant.
    #[error("{found} is not supported; {wanted}")]
    Unsupported {
        /// Variant of the file.
        found: String,
        /// Supported variants.
        wanted: &'static str,
    },
    /// The file violates its format and cannot be read.
    #[error("the {format} file is malformed at byte {at}: {what}")]
    Malformed {
        /// Format of the file.
        format: &'static str,
        /// Byte offset of the error.
        at: u64,
        /// Description of the mistake, and of the expected form.
        what: String,
    },
    /// The file violates its format at a position that its decoder does not report.
    #[error("the {format} file cannot be decoded: {what}")]
    Undecodable {
        /// Format of the file.
        format: &'static str,
        /// Message of its decoder.
        what: String,
    },
    /// A value above the limits of the reader.
    #[error("the file has {found} {what}, above the limit of {limit}")]
    Limit {
        /// The limited quantity: seconds, channels or samples per second.
        what: &'static str,
        /// Value of the file.
        found: f64,
        /// The limit.
        limit: f64,
    },
    /// A sample that is NaN or infinite.
    #[error("frame {frame}, channel {channel} is {value}; samples must be finite numbers")]
    NotFinite {
        /// Frame index from the start of the file.
        frame: u64,
        /// Channel from 0.
        channel: usize,
        /// The value found.
        value: f64,
    },
    /// A buffer whose length is not an integer number of frames.
    #[error("a buffer of {len} samples is not an integer number of frames of {channels} channels")]
    PartialFrame {
        /// Length of the buffer.
        len: usize,
        /// Channels of the file.
        channels: usize,
    },
    /// A position after the end.
    #[error("frame {frame} is after the end; the file has {frames} frames")]
    SeekPastEnd {
        /// Requested frame.
        frame: u64,
        /// Number of frames.
        frames: u64,
    },
    /// A channel count or rate that the format cannot represent.
    #[error("cannot write {what} = {found}; {wanted}")]
    WriteSpec {
        /// Name of the parameter.
        what: &'static str,
        /// Its value.
        found: u64,
        /// Valid values.
        wanted: &'static str,
    },
}

/// An irregularity of a file that can be read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum AudioWarning {
    /// The header states another length than the file has.
    LengthDiffers {
        /// Frames in the header.
        header_frames: u64,
        /// Frames in the file.
        frames: u64,
        /// Samples per second.
        rate: u32,
    },
    /// A chunk before the samples whose size exceeds the file; the next chunk was found by its identifier.
    InvalidChunkSize {
        /// Identifier of the chunk.
        chunk: String,
        /// Byte offset of the chunk.
        at: u64,
        /// Size in the header of the chunk, bytes.
        size: u64,
        /// Size of the rest of the file, bytes.
        available: u64,
    },
    /// A header without a length, as programs write it into a pipe; the samples extend to the end of the file.
    UnknownLength,
    /// The last frame is incomplete and dropped.
    PartialLastFrame {
        /// Bytes of the incomplete frame.
        bytes: u64,
    },
    /// The stream ends before its end marker.
    NoEnd,
    /// 24-bit samples are in the low instead of the high bytes of their 32-bit containers.
    LowAligned24,
    /// Packets do not decode and are replaced by silence.
    CorruptPackets {
        /// Number of such packets so far.
        packets: u64,
    },
    /// The file has another stream, which is not read.
    ExtraStream,
    /// Another stream follows the first one and is not read.
    Chained {
        /// Frames of the first stream.
        frames: u64,
        /// Samples per second.
        rate: u32,
    },
}

impl fmt::Display for AudioWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LengthDiffers { header_frames, frames, rate } => {
                let seconds = |n: u64| n as f64 / f64::from((*rate).max(1));
                write!(
                    f,
                    "the header states {header_frames} frames ({:.3} s), the file has {frames} ({:.3} s): these are read",
                    seconds(*header_frames),
                    seconds(*frames)
                )
            }
            Self::InvalidChunkSize { chunk, at, size, available } => write!(
                f,
                "the chunk {chunk:?} at byte {at} states a size of {size} bytes, but {available} bytes follow: the next chunk was searched by its identifier"
            ),
            Self::UnknownLength => f.write_str("the header states no length: the file is read to its end"),
            Self::PartialLastFrame { bytes } => {
                write!(f, "the last frame is incomplete: its {bytes} bytes are dropped")
            }
            Self::NoEnd => f.write_str("the stream ends before its end marker: it is read as far as it goes"),
            Self::LowAligned24 => f.write_str(
                "24-bit samples are in the low bytes of 32-bit containers: they are read from there",
            ),
            Self::CorruptPackets { packets } => {
                write!(f, "{packets} packets do not decode and are replaced by silence")
            }
            Self::ExtraStream => f.write_str("the file has more than one stream: only the first is read"),
            Self::Chained { frames, rate } => {
                let seconds = *frames as f64 / f64::from(*rate);
                write!(
                    f,
                    "another stream follows the first one, which ends after {frames} frames ({seconds:.3} s): \
                     only the first is read"
                )
            }
        }
    }
}
