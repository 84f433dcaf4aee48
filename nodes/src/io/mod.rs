//! Audio files in and out.
//!
//! [`probe`] and [`AudioReader`] read WAV, FLAC, Ogg Vorbis and MP3. They trust the bytes of a file, not its name or the
//! lengths in its header. [`AudioWriter`] writes WAV, with the same bits for any block size.

mod csv_error;
mod error;
mod info;
pub mod manifest;
#[cfg(feature = "flac")]
mod packets;
mod reader;
pub(crate) mod recording_list;
mod recordings;
pub(crate) mod text_output;
mod wav;
mod wav_in;
pub(crate) mod wav_out;
#[cfg(not(feature = "flac"))]
mod without_packets;

pub use crate::core::files::ReadSeek;
pub(crate) use csv_error::csv_error;
pub use error::{AudioError, AudioWarning};
pub use info::{AudioInfo, FileFormat, ReadLimits, SampleFormat};
pub use reader::{AudioReader, probe, probe_with};
pub(crate) use recording_list::{ListedRecording, RecordingList};
pub(crate) use recordings::{MaxLength, RecordingParam, Whole, recording_warnings, trial_wav};
pub use wav::{AudioWriter, Dither, WriteFormat, WriteSpec, WrittenInfo};

/// Nodes of this family.
pub mod nodes {
    pub use super::wav_in::{WavInIo, WavInNode, WavInParams, WavInPorts};
    pub use super::wav_out::{WavOutIo, WavOutNode, WavOutParams, WavOutPorts};
}

#[cfg(test)]
mod tests;
