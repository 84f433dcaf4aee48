//! Audio files in and out.
//!
//! Reading goes by the bytes, never by a name or a header's promise: [`probe`] and [`AudioReader`] for WAV, FLAC,
//! Ogg Vorbis and MP3. Writing is WAV by [`AudioWriter`], the same bits for any block size.

mod audio;
mod error;
mod packets;
mod wav_header;
mod wav_in;
mod wav_out;
mod wav_read;
mod wav_samples;
mod wav_write;

pub use crate::core::files::ReadSeek;
pub(crate) use audio::oddities;
pub use audio::{AudioInfo, AudioReader, FileFormat, ReadLimits, SampleFormat, probe, probe_with};
pub use error::{AudioError, AudioWarning};
pub use wav_write::{AudioWriter, Dither, WriteFormat, WriteSpec, WrittenInfo};

/// The bytes of a mono WAV, for trials of nodes that read one; empty where it cannot be made.
pub(crate) fn trial_wav(samples: &[f32], rate: u32) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let spec = WriteSpec::new(rate, 1, WriteFormat::Float32);
    let written = AudioWriter::new(&mut file, spec).and_then(|mut writer| {
        writer.write(samples)?;
        writer.finish()
    });
    if written.is_ok() { file.into_inner() } else { Vec::new() }
}

/// The nodes of this family.
pub mod nodes {
    pub use super::wav_in::{WavInIo, WavInNode, WavInParams, WavInPorts};
    pub use super::wav_out::{WavOutIo, WavOutNode, WavOutParams, WavOutPorts};
}

#[cfg(test)]
mod tests;
