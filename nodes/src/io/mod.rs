//! Audio files in and out.
//!
//! Reading goes by the bytes, never by a name or a header's promise: [`probe`] and [`AudioReader`] for WAV, FLAC,
//! Ogg Vorbis and MP3. Writing is WAV by [`AudioWriter`], the same bits for any block size.

mod audio;
mod error;
mod packets;
mod wav_header;
mod wav_read;
mod wav_write;

pub use audio::{AudioInfo, AudioReader, FileFormat, ReadLimits, ReadSeek, SampleFormat, probe, probe_with};
pub use error::{AudioError, AudioWarning};
pub use wav_write::{AudioWriter, Dither, WriteFormat, WriteSpec, WrittenInfo};

#[cfg(test)]
mod tests;
