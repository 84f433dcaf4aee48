//! A block of samples from a WAV file, decoded by `hound`.
//!
//! `hound` gets each block as a small WAV file of its own in memory: a header of 44 bytes that is always true, then the
//! samples. So its 32-bit lengths hold in a file of any size, no odd header reaches it, and a seek is only another block
//! (`hound`'s own seek takes 24 bits in four bytes for three bytes).

use std::io::{self, Read};

use hound::WavReader;

/// The canonical header: RIFF, a `fmt ` chunk of 16 bytes, the head of the `data` chunk.
const HEADER: usize = 44;

/// How a sample lies in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    /// An integer in the low `bits` of its `bytes`.
    Int { bytes: u16, bits: u16 },
    /// 32-bit float.
    Float32,
    /// 64-bit float, which `hound` refuses: rounded to 32 bits here.
    Float64,
}

impl Layout {
    /// An integer that fills its bytes.
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

/// Bytes of samples, behind the header that tells `hound` how to take them.
pub(super) struct Block {
    layout: Layout,
    file: Vec<u8>,
}

impl Block {
    /// Room for whole samples in `bytes`, which must stay below the 4 GiB of a WAV file.
    pub fn new(layout: Layout, bytes: usize) -> Self {
        let mut file = header(layout).to_vec();
        file.resize(HEADER + bytes, 0);
        Self { layout, file }
    }

    /// Samples that fit.
    pub fn capacity(&self) -> usize {
        (self.file.len() - HEADER) / self.layout.bytes()
    }

    /// Where the bytes of the next `samples` samples belong.
    pub fn bytes_mut(&mut self, samples: usize) -> &mut [u8] {
        &mut self.file[HEADER..HEADER + samples * self.layout.bytes()]
    }

    /// The first samples of the block as floats; full scale of integers is +-1.
    ///
    /// # Errors
    /// What `hound` refuses: with this header, nothing.
    pub fn decode(&mut self, out: &mut [f32]) -> Result<(), hound::Error> {
        let len = self.bytes_mut(out.len()).len();
        self.file[4..8].copy_from_slice(&((HEADER - 8 + len) as u32).to_le_bytes());
        self.file[HEADER - 4..HEADER].copy_from_slice(&(len as u32).to_le_bytes());
        let file = &self.file[..HEADER + len];
        match self.layout {
            Layout::Int { bits, .. } => {
                // Exact up to 24 bits; more are rounded once, to f32, since the product with a power of two is exact.
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

/// A slice that gives one byte a call.
///
/// `hound` asks for the bytes of one sample and asks again until it has them. `&[u8]` answers with a `memcpy` whose length the
/// compiler cannot know, which takes longer than the sample; single bytes become plain loads.
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

/// The header with both lengths still open.
///
/// It says one channel at one sample per second: interleaving and rate don't matter to a sample, and so no count of
/// channels is too large for the 16 bits of a frame's size.
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
