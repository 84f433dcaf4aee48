//! Linear samples of a WAV file as floats.
//!
//! `hound` is the oracle of the tests and not the decoder: it reads its samples one by one from its own header walk, while
//! the walk here must survive false lengths, RF64 and missing pad bytes, and then converts whole blocks from a slice.

use super::audio::{AudioInfo, FileFormat};
use super::wav_header::{WavHeader, read_at};
use super::{AudioError, AudioWarning, SampleFormat};
use crate::core::files::ReadSeek;

/// Bytes converted at a time.
const BLOCK: usize = 64 * 1024;
/// Frames looked at to see on which side of a 32-bit container 24-bit samples sit.
const ALIGN_FRAMES: u64 = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    U8,
    I16,
    I24,
    I32,
    /// 24 bits in the low three bytes of four, against the standard.
    Low24,
    F32,
    F64,
}

/// The samples of an open WAV file.
pub(super) struct WavReader<'s> {
    source: Box<dyn ReadSeek + 's>,
    layout: Layout,
    frame_bytes: usize,
    start: u64,
    bytes: Vec<u8>,
}

impl<'s> WavReader<'s> {
    pub fn new(
        mut source: Box<dyn ReadSeek + 's>,
        header: WavHeader,
    ) -> Result<(AudioInfo, Self), AudioError> {
        let frame_bytes = header.container * header.channels;
        let mut bytes = vec![0; (BLOCK / frame_bytes).max(1) * frame_bytes];
        let mut warnings = header.warnings;
        let layout = match (header.sample_format, header.container) {
            (SampleFormat::Float { bits: 64 }, _) => Layout::F64,
            (SampleFormat::Float { .. }, _) => Layout::F32,
            (_, 1) => Layout::U8,
            (_, 2) => Layout::I16,
            (_, 3) => Layout::I24,
            (SampleFormat::Int { bits: 24 }, _) => {
                let whole = bytes.len() / frame_bytes;
                let frames = header.frames.min(ALIGN_FRAMES).min(whole as u64) as usize;
                let head = &mut bytes[..frames * frame_bytes];
                read_at(&mut source, header.data_start, head)?;
                if is_low_aligned(head) {
                    warnings.push(AudioWarning::LowAligned24);
                    Layout::Low24
                } else {
                    Layout::I32
                }
            }
            _ => Layout::I32,
        };
        let info = AudioInfo {
            format: FileFormat::Wav,
            rate: header.rate,
            channels: header.channels,
            frames: header.frames,
            sample_format: header.sample_format,
            channel_mask: header.channel_mask,
            warnings,
        };
        Ok((info, Self { source, layout, frame_bytes, start: header.data_start, bytes }))
    }

    /// Fills `out` from `frame` on; the caller has checked that the frames are there.
    pub fn read(&mut self, frame: u64, out: &mut [f32]) -> Result<(), AudioError> {
        let sample_bytes = self.layout.bytes();
        let mut at = self.start + frame * self.frame_bytes as u64;
        for out in out.chunks_mut(self.bytes.len() / sample_bytes) {
            let bytes = &mut self.bytes[..out.len() * sample_bytes];
            read_at(&mut self.source, at, bytes)?;
            self.layout.convert(bytes, out);
            at += bytes.len() as u64;
        }
        Ok(())
    }
}

impl Layout {
    const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I16 => 2,
            Self::I24 => 3,
            Self::I32 | Self::Low24 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn convert(self, bytes: &[u8], out: &mut [f32]) {
        // Integers of up to 24 bits are exact in f32; 32-bit ones are rounded once, by the division in f64.
        let full = |v: i32| (f64::from(v) / 2_147_483_648.0) as f32;
        match self {
            Self::U8 => each::<1>(bytes, out, |[a]| (f32::from(a) - 128.0) / 128.0),
            Self::I16 => each::<2>(bytes, out, |b| f32::from(i16::from_le_bytes(b)) / 32_768.0),
            Self::I24 => each::<3>(bytes, out, |[a, b, c]| full(i32::from_le_bytes([0, a, b, c]))),
            Self::I32 => each::<4>(bytes, out, |b| full(i32::from_le_bytes(b))),
            Self::Low24 => each::<4>(bytes, out, |[a, b, c, _]| full(i32::from_le_bytes([0, a, b, c]))),
            Self::F32 => each::<4>(bytes, out, f32::from_le_bytes),
            Self::F64 => each::<8>(bytes, out, |b| f64::from_le_bytes(b) as f32),
        }
    }
}

fn each<const N: usize>(bytes: &[u8], out: &mut [f32], sample: impl Fn([u8; N]) -> f32) {
    for (out, bytes) in out.iter_mut().zip(bytes.as_chunks::<N>().0) {
        *out = sample(*bytes);
    }
}

/// Whether every container holds a sign-extended 24-bit number, and not all of them could be high-aligned.
fn is_low_aligned(bytes: &[u8]) -> bool {
    let containers = bytes.as_chunks::<4>().0;
    let extended = |&[_, _, c, d]: &[u8; 4]| d == if c & 0x80 == 0 { 0 } else { 0xFF };
    containers.iter().all(extended) && containers.iter().any(|c| c[0] != 0)
}
