//! Rows of samples as bits, 64 in a word.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};

/// Samples of a word.
pub(super) const WORD: usize = u64::BITS as usize;
/// Samples of a vector.
const LANES: usize = 16;

/// One bit for each sample of a row, and once more for the first at the end.
pub(super) struct RowBits {
    /// For each level, the samples above it.
    pub(super) high: Vec<Vec<u64>>,
    /// Samples that are not finite.
    pub(super) missing: Vec<u64>,
}

impl RowBits {
    pub(super) fn new(width: usize, levels: usize) -> Self {
        // One word more, for the shift of the last one.
        let words = vec![0; width / WORD + 2];
        Self { high: vec![words.clone(); levels], missing: words }
    }

    /// Reads the samples of a row.
    pub(super) fn read(&mut self, level: Level, row: &[f32], heights: &[f32]) {
        dispatch!(level, simd => set_missing(simd, row, &mut self.missing));
        for (words, height) in self.high.iter_mut().zip(heights) {
            dispatch!(level, simd => set_high(simd, row, *height, words));
        }
        for words in self.high.iter_mut().chain([&mut self.missing]) {
            let first = words.first().copied().unwrap_or_default() & 1;
            if let Some(word) = words.get_mut(row.len() / WORD) {
                *word |= first << (row.len() % WORD);
            }
        }
    }
}

/// Bits of the corners of 64 cells: top left, top right, bottom right, bottom left.
#[inline(always)]
pub(super) fn corners(upper: &[u64], lower: &[u64], word: usize) -> [u64; 4] {
    let left = |bits: &[u64]| bits.get(word).copied().unwrap_or_default();
    let right =
        |bits: &[u64]| left(bits) >> 1 | bits.get(word + 1).copied().unwrap_or_default() << (WORD - 1);
    [left(upper), right(upper), right(lower), left(lower)]
}

#[inline(always)]
fn set_high<S: Simd>(simd: S, row: &[f32], height: f32, words: &mut [u64]) {
    let heights = f32x16::splat(simd, height);
    let (whole, rest) = row.as_chunks::<WORD>();
    for (samples, word) in whole.iter().zip(words.iter_mut()) {
        *word = 0;
        for (k, part) in samples.chunks_exact(LANES).enumerate() {
            *word |= f32x16::from_slice(simd, part).simd_gt(heights).to_bitmask() << (k * LANES);
        }
    }
    if let Some(word) = words.get_mut(whole.len()) {
        *word = bits_of(rest, |x| x > height);
    }
}

#[inline(always)]
fn set_missing<S: Simd>(simd: S, row: &[f32], words: &mut [u64]) {
    let (whole, rest) = row.as_chunks::<WORD>();
    for (samples, word) in whole.iter().zip(words.iter_mut()) {
        let mut finite = 0;
        for (k, part) in samples.chunks_exact(LANES).enumerate() {
            finite |= f32x16::from_slice(simd, part).is_finite().to_bitmask() << (k * LANES);
        }
        *word = !finite;
    }
    if let Some(word) = words.get_mut(whole.len()) {
        *word = bits_of(rest, |x| !x.is_finite());
    }
}

/// Bits of at most 63 samples.
fn bits_of(samples: &[f32], bit: impl Fn(f32) -> bool) -> u64 {
    samples.iter().rev().fold(0, |bits, x| bits << 1 | u64::from(bit(*x)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_those_of_the_samples() {
        for width in [1, 15, 63, 64, 65, 130] {
            let sample = |x: usize| match x * 7 % 11 {
                3 => f32::NAN,
                5 => f32::NEG_INFINITY,
                k => k as f32,
            };
            let row: Vec<f32> = (0..width).map(sample).collect();
            let mut bits = RowBits::new(width, 2);
            bits.read(Level::new(), &row, &[2.0, 6.0]);
            let bit = |words: &[u64], x: usize| words[x / WORD] >> (x % WORD) & 1 == 1;
            for x in 0..=width {
                let sample = sample(x % width);
                assert_eq!(bit(&bits.missing, x), !sample.is_finite(), "{x} of {width}");
                assert_eq!(
                    [0, 1].map(|k| bit(&bits.high[k], x)),
                    [sample > 2.0, sample > 6.0],
                    "{x} of {width}"
                );
            }
            let below = bits.high[1].clone();
            for x in 0..width {
                let found = corners(&bits.high[0], &below, x / WORD).map(|word| word >> (x % WORD) & 1 == 1);
                let [a, b] = [x, x + 1].map(|x| sample(x % width));
                assert_eq!(found, [a > 2.0, b > 2.0, b > 6.0, a > 6.0]);
            }
        }
    }
}
