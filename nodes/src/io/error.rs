//! What can be wrong with an audio file, and what is merely odd about one.

use std::fmt;
use std::io;

/// Why an audio file cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AudioError {
    /// The source or sink failed.
    #[error("reading or writing the audio file failed: {0}")]
    Io(#[from] io::Error),
    /// The first bytes belong to no format that is read.
    #[error(
        "the file begins with {found}, which is no audio file known here; WAV, FLAC, Ogg Vorbis and MP3 are read"
    )]
    UnknownFormat {
        /// The first bytes, printable ones as text.
        found: String,
    },
    /// A known format in a variant that is not read.
    #[error("{found} is not supported; {wanted}")]
    Unsupported {
        /// What the file holds.
        found: String,
        /// What would be read.
        wanted: &'static str,
    },
    /// The file breaks its format so that nothing can be read.
    #[error("the {format} file is broken at byte {at}: {what}")]
    Malformed {
        /// Which format the file claims to be.
        format: &'static str,
        /// Byte position of the trouble.
        at: u64,
        /// What was found and what would be right.
        what: String,
    },
    /// The file breaks its format somewhere that its decoder does not tell.
    #[error("the {format} file cannot be decoded: {what}")]
    Undecodable {
        /// Which format the file claims to be.
        format: &'static str,
        /// What its decoder says.
        what: String,
    },
    /// A value beyond the limits of this reader.
    #[error("the file has {found} {what}, above the limit of {limit}")]
    Limit {
        /// Which limit: seconds, channels or samples per second.
        what: &'static str,
        /// What the file has.
        found: f64,
        /// The limit in force.
        limit: f64,
    },
    /// A sample that is no number.
    #[error("frame {frame}, channel {channel} is {value}; samples must be finite numbers")]
    NotFinite {
        /// Frame index from the start of the file.
        frame: u64,
        /// Channel from 0.
        channel: usize,
        /// The value found.
        value: f64,
    },
    /// A buffer that holds no whole number of frames.
    #[error("a buffer of {len} samples holds no whole number of frames of {channels} channels")]
    PartialFrame {
        /// Length of the buffer.
        len: usize,
        /// Channels of the file.
        channels: usize,
    },
    /// A position behind the end.
    #[error("frame {frame} is behind the end; the file has {frames} frames")]
    SeekBehindEnd {
        /// The frame asked for.
        frame: u64,
        /// Frames of the file.
        frames: u64,
    },
    /// A channel count or rate that the format cannot carry.
    #[error("cannot write {what} = {found}; {wanted}")]
    WriteSpec {
        /// The parameter.
        what: &'static str,
        /// Its value.
        found: u64,
        /// What would be right.
        wanted: &'static str,
    },
}

/// Something odd about a file that can be read all the same.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum AudioWarning {
    /// The header promises another length than the bytes hold.
    LengthDiffers {
        /// Frames promised.
        header_frames: u64,
        /// Frames that are there.
        frames: u64,
        /// Samples per second.
        rate: u32,
    },
    /// A chunk before the samples whose length leads out of the file; the next one was found by its name.
    FalseChunk {
        /// Its name.
        chunk: String,
        /// Where it begins, bytes.
        at: u64,
        /// Bytes that it promises.
        size: u64,
        /// Bytes that follow.
        there: u64,
    },
    /// A header without a length, as programs write that stream into a pipe; everything to the end is taken.
    OpenLength,
    /// Bytes of an incomplete last frame, dropped.
    PartialLastFrame {
        /// How many bytes.
        bytes: u64,
    },
    /// The stream breaks off before its marked end.
    NoEnd,
    /// 24-bit samples that sit in the low instead of the high bytes of their 32-bit containers.
    LowAligned24,
    /// Packets that did not decode; silence stands in their place.
    CorruptPackets {
        /// How many so far.
        packets: u64,
    },
    /// A second stream in the same file, not read.
    ExtraStream,
    /// Another stream follows behind the end of the first one, not read.
    Chained {
        /// Frames of the first one.
        frames: u64,
        /// Frames per second.
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
                    "the header says {header_frames} frames ({:.3} s), the file holds {frames} ({:.3} s): read what is there",
                    seconds(*header_frames),
                    seconds(*frames)
                )
            }
            Self::FalseChunk { chunk, at, size, there } => write!(
                f,
                "the chunk {chunk:?} at byte {at} says it has {size} bytes, {there} follow: what stands behind it was looked for by name"
            ),
            Self::OpenLength => f.write_str("the header leaves the length open: read to the end of the file"),
            Self::PartialLastFrame { bytes } => {
                write!(f, "the last frame is incomplete: its {bytes} bytes are dropped")
            }
            Self::NoEnd => f.write_str("the stream breaks off before its marked end: read what is there"),
            Self::LowAligned24 => {
                f.write_str("24-bit samples sit in the low bytes of 32-bit containers: read as such")
            }
            Self::CorruptPackets { packets } => {
                write!(f, "{packets} packets do not decode: silence in their place")
            }
            Self::ExtraStream => f.write_str("the file holds more than one stream: only the first is read"),
            Self::Chained { frames, rate } => {
                let seconds = *frames as f64 / f64::from(*rate);
                write!(
                    f,
                    "another stream follows behind the first one, which ends after {frames} frames ({seconds:.3} s): \
                     only the first is read"
                )
            }
        }
    }
}
