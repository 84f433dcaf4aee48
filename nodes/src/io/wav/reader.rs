//! Linear samples of a WAV file as floats, from any frame.
//!
//! [`WavHeader`] finds the samples, since `hound` trusts all lengths and does not support RF64. `hound` decodes them.

use super::header::{WavHeader, read_at};
use super::samples::{Block, Layout};
use crate::core::files::ReadSeek;
use crate::io::{AudioError, AudioInfo, AudioWarning, FileFormat, SampleFormat};

/// Bytes per decoded block.
const BLOCK: usize = 64 * 1024;
/// Frames that determine the alignment of 24-bit samples in 32-bit containers.
const ALIGN_FRAMES: u64 = 4096;

/// The samples of an open WAV file.
pub(in crate::io) struct WavReader<'s> {
    source: Box<dyn ReadSeek + 's>,
    frame_bytes: usize,
    start: u64,
    block: Block,
}

impl<'s> WavReader<'s> {
    /// A reader of the samples that `header` describes.
    pub fn new(
        mut source: Box<dyn ReadSeek + 's>,
        header: WavHeader,
    ) -> Result<(AudioInfo, Self), AudioError> {
        let frame_bytes = header.container * header.channels;
        let block_frames = (BLOCK / frame_bytes).max(1);
        let mut warnings = header.warnings;
        let layout = match (header.sample_format, header.container) {
            (SampleFormat::Float { bits: 64 }, _) => Layout::Float64,
            (SampleFormat::Float { .. }, _) => Layout::Float32,
            (SampleFormat::Int { bits: 24 }, 4) => {
                let frames = header.frames.min(ALIGN_FRAMES).min(block_frames as u64) as usize;
                let mut head = vec![0; frames * frame_bytes];
                read_at(&mut source, header.data_start, &mut head)?;
                if is_low_aligned(&head) {
                    warnings.push(AudioWarning::LowAligned24);
                    Layout::Int { bytes: 4, bits: 24 }
                } else {
                    Layout::int(4)
                }
            }
            // Samples with fewer valid bits are in the high bits of their container.
            (_, container) => Layout::int(container as u16),
        };
        let block = Block::new(layout, block_frames * frame_bytes);
        let info = AudioInfo {
            format: FileFormat::Wav,
            rate: header.rate,
            channels: header.channels,
            frames: header.frames,
            sample_format: header.sample_format,
            channel_mask: header.channel_mask,
            warnings,
        };
        Ok((info, Self { source, frame_bytes, start: header.data_start, block }))
    }

    /// Fills `out` from `frame`; the caller checks that the frames exist.
    pub fn read(&mut self, frame: u64, out: &mut [f32]) -> Result<(), AudioError> {
        let mut offset = self.start + frame * self.frame_bytes as u64;
        for out in out.chunks_mut(self.block.capacity()) {
            let bytes = self.block.bytes_mut(out.len());
            let next = offset + bytes.len() as u64;
            read_at(&mut self.source, offset, bytes)?;
            self.block.decode(out).map_err(|error| undecoded(&error, offset))?;
            offset = next;
        }
        Ok(())
    }
}

fn undecoded(error: &hound::Error, at: u64) -> AudioError {
    AudioError::Malformed { format: "WAV", at, what: format!("the samples do not decode: {error}") }
}

/// Returns true if every container holds a sign-extended 24-bit number, and at least one cannot be high-aligned.
fn is_low_aligned(bytes: &[u8]) -> bool {
    let containers = bytes.as_chunks::<4>().0;
    let extended = |&[_, _, c, d]: &[u8; 4]| d == if c & 0x80 == 0 { 0 } else { 0xFF };
    containers.iter().all(extended) && containers.iter().any(|c| c[0] != 0)
}
