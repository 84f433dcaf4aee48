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

use crate::core::fault::Reject;
pub use crate::core::files::ReadSeek;
use crate::core::params::AssetPath;
use crate::core::shape::Shape;
pub(crate) use audio::oddities;
pub use audio::{AudioInfo, AudioReader, FileFormat, ReadLimits, SampleFormat, probe, probe_with};
pub use error::{AudioError, AudioWarning};
pub use wav_write::{AudioWriter, Dither, WriteFormat, WriteSpec, WrittenInfo};

/// Looks at each recording of a list, that a node will hold: what is wrong with any of them, and what is odd.
pub(crate) fn look_at<P>(
    s: &mut Shape<'_, '_, P>,
    list: &str,
    paths: &[AssetPath],
    open: impl Fn(&str, Box<dyn ReadSeek + '_>) -> Result<AudioInfo, Reject>,
) {
    for (k, AssetPath(path)) in paths.iter().enumerate() {
        let field = format!("{list}[{k}]");
        let opened = s.open(&field, path).and_then(|file| open(path, file));
        let Some(info) = s.check(opened.map_err(|reject| reject.at(&field))) else { continue };
        let held = s.hold(&field, path, info.worked());
        if s.check(held).is_none() {
            // All that follow are too much as well.
            break;
        }
        info.odd(path).for_each(|text| s.note(text));
    }
}

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
