//! Blocks of samples of a WAV file, decoded by `hound`.
//!
//! `hound` reads each block as a separate WAV file in memory: a valid header of 44 bytes, then the samples. Its 32-bit
//! lengths are therefore correct for a file of any size, it never parses an irregular header, and a seek is another block
//! (the seek of `hound` treats 24 bits in four bytes as three bytes).

use std::io::{self, Read};

use hound::WavReader;

/// The canonical header: RIFF, a `fmt ` chunk of 16 bytes, the head of the `data` chunk.
const HEADER: usize = 44;

/// Layout of a sample in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    /// An integer in the low `bits` bits of `bytes` bytes.
    Int { bytes: u16, bits: u16 },
    /// 32-bit float.
    Float32,
    /// 64-bit float, which `hound` does not support; this module rounds it to 32 bits.
    Float64,
}

impl Layout {
    /// An integer of all bits of `bytes` bytes.
    pub const fn int(bytes: u16) -> Self {
        Self::Int { bytes, bits: 8 * bytes }
    }

    pub const fn bytes(self) -> usize {
        match self {
            Self::Int { bytes, .. } => bytes as usize,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

/// A WAV file in memory: a header for `hound` and the bytes of samples.
pub(super) struct Block {
    layout: Layout,
    file: Vec<u8>,
}

impl Block {
    /// A block for `bytes` bytes of samples, less than the 4 GiB of a WAV file.
    pub fn new(layout: Layout, bytes: usize) -> Self {
        let mut file = header(layout).to_vec();
        file.resize(HEADER + bytes, 0);
        Self { layout, file }
    }

    /// Maximum number of samples.
    pub fn capacity(&self) -> usize {
        (self.file.len() - HEADER) / self.layout.bytes()
    }

    /// Buffer for the bytes of `samples` samples.
    pub fn bytes_mut(&mut self, samples: usize) -> &mut [u8] {
        &mut self.file[HEADER..HEADER + samples * self.layout.bytes()]
    }

    /// The first samples of the block as floats; full scale of integers is +-1.
    ///
    /// # Errors
    /// The errors of `hound`; none occur with this header.
    pub fn decode(&mut self, out: &mut [f32]) -> Result<(), hound::Error> {
        let len = self.bytes_mut(out.len()).len();
        self.file[4..8].copy_from_slice(&((HEADER - 8 + len) as u32).to_le_bytes());
        self.file[HEADER - 4..HEADER].copy_from_slice(&(len as u32).to_le_bytes());
        let file = &self.file[..HEADER + len];
        match self.layout {
            Layout::Int { bits, .. } => {
                // Exact up to 24 bits; more bits are rounded once to f32, since the product with a power of two is exact.
                let step = 2.0_f64.powi(1 - i32::from(bits));
                fill(out, WavReader::new(Bytes(file))?.samples::<i32>(), |v| (f64::from(v) * step) as f32)
            }
            Layout::Float32 => fill(out, WavReader::new(Bytes(file))?.samples::<f32>(), |v| v),
            Layout::Float64 => {
                for (out, bytes) in out.iter_mut().zip(file[HEADER..].as_chunks().0) {
                    *out = f64::from_le_bytes(*bytes) as f32;
                }
                Ok(())
            }
        }
    }
}

/// A reader that returns one byte per call.
///
/// `hound` reads the bytes of one sample and repeats until it has them. `&[u8]` uses a `memcpy` of a length that is unknown
/// at compile time, which takes longer than decoding the sample; single bytes become plain loads.
struct Bytes<'b>(&'b [u8]);

impl Read for Bytes<'_> {
    #[inline]
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let (Some(out), Some((&byte, rest))) = (out.first_mut(), self.0.split_first()) else { return Ok(0) };
        *out = byte;
        self.0 = rest;
        Ok(1)
    }
}

fn fill<S>(
    out: &mut [f32],
    samples: impl Iterator<Item = hound::Result<S>>,
    float: impl Fn(S) -> f32,
) -> hound::Result<()> {
    for (out, sample) in out.iter_mut().zip(samples) {
        *out = float(sample?);
    }
    Ok(())
}

/// The header with zeros for both lengths.
///
/// It states one channel at one sample per second: decoding does not depend on interleaving and rate, and the size of a
/// frame always fits 16 bits.
fn header(layout: Layout) -> [u8; HEADER] {
    let (tag, bits) = match layout {
        Layout::Int { bits, .. } => (1_u16, bits),
        Layout::Float32 => (3, 32),
        Layout::Float64 => (3, 64),
    };
    let bytes = layout.bytes() as u16;
    let mut h = [0; HEADER];
    h[..4].copy_from_slice(b"RIFF");
    h[8..16].copy_from_slice(b"WAVEfmt ");
    h[16..20].copy_from_slice(&16_u32.to_le_bytes());
    h[20..22].copy_from_slice(&tag.to_le_bytes());
    h[22..24].copy_from_slice(&1_u16.to_le_bytes());
    h[24..28].copy_from_slice(&1_u32.to_le_bytes());
    h[28..32].copy_from_slice(&u32::from(bytes).to_le_bytes());
    h[32..34].copy_from_slice(&bytes.to_le_bytes());
    h[34..36].copy_from_slice(&bits.to_le_bytes());
    h[36..40].copy_from_slice(b"data");
    h
}
