//! Codes of a discontinuity map: one bit, one byte, or a pair of signed bytes per pixel.

use crate::texture::filter::sobel::length;
use crate::texture::filter::{Kernel, smooth};
use crate::texture::grid::{Grid, percentile};
use crate::texture::maps::{DiscontinuityMap, FeatureMap, Surface};
use serde::{Deserialize, Serialize};

/// Standard deviation, in pixels, of the Gaussian over decoded bits, which smooths their steps.
pub const BIT_BLUR: f64 = 0.7;

/// Coding of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Coding {
    /// A pair of signed bytes, the gradient along x and y, for forces that depend on the direction of motion.
    #[default]
    Signed,
    /// One byte, the magnitude of the gradient up to its 99.9th percentile.
    Byte,
    /// One bit, 1 where the gradient exceeds a threshold, as in the paper.
    Bit,
}

/// A coded map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CodedMap {
    /// The coding.
    pub coding: Coding,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Gradient, in luminance per pixel, of the largest code value; for bits, the threshold.
    pub scale: f32,
    /// The code, row by row: eight pixels per byte from the lowest bit, without padding between rows; bytes; or pairs x, y.
    pub bytes: Vec<u8>,
    /// Scale on the surface.
    pub surface: Surface,
}

impl CodedMap {
    /// Codes a map; `threshold` is that of bits, by default from Otsu's method.
    ///
    /// # Complexity
    /// `O(pixels)`.
    #[must_use]
    pub fn new(map: &DiscontinuityMap, coding: Coding, threshold: Option<f32>) -> Self {
        let g = || length(&map.gx, &map.gy).samples;
        let pairs = || map.gx.samples.iter().zip(&map.gy.samples);
        let (scale, bytes) = match coding {
            Coding::Bit => {
                let g = g();
                let threshold = threshold.unwrap_or_else(|| otsu(&g));
                (threshold, pack(g.iter().map(|g| *g > threshold)))
            }
            Coding::Byte => {
                let g = g();
                let max = percentile(g.iter().copied(), 0.999);
                let unit = steps(255.0, max);
                (max, g.iter().map(|g| (g * unit).round().min(255.0) as u8).collect())
            }
            Coding::Signed => {
                let max = pairs().fold(0.0_f32, |max, (x, y)| max.max(x.abs()).max(y.abs()));
                let unit = steps(127.0, max);
                let byte = |g: f32| ((g * unit).round() as i8) as u8;
                (max, pairs().flat_map(|(x, y)| [byte(*x), byte(*y)]).collect())
            }
        };
        let (width, height) = (map.gx.width, map.gx.height);
        Self { coding, width, height, scale, bytes, surface: map.surface }
    }

    /// Codes features, 0 to 1, with a byte per pixel.
    #[must_use]
    pub fn of_features(map: &FeatureMap) -> Self {
        let byte = |x: &f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
        let FeatureMap { grid: Grid { width, height, samples }, surface } = map;
        let bytes = samples.iter().map(byte).collect();
        Self { coding: Coding::Byte, width: *width, height: *height, scale: 1.0, bytes, surface: *surface }
    }

    /// Returns the gradients of a signed code, with an error of at most `scale / 254`; `None` for the other codings.
    #[must_use]
    pub fn gradient(&self) -> Option<DiscontinuityMap> {
        if self.coding != Coding::Signed {
            return None;
        }
        let grid = |axis: usize| {
            let samples = self.bytes.iter().skip(axis).step_by(2);
            let samples = samples.map(|b| f32::from(*b as i8) * self.scale / 127.0).collect();
            Grid { width: self.width, height: self.height, samples }
        };
        Some(DiscontinuityMap { gx: grid(0), gy: grid(1), surface: self.surface })
    }

    /// Returns the decoded magnitude of the gradient, 0 to 1; bits are smoothed by a Gaussian of [`BIT_BLUR`] pixels.
    #[must_use]
    pub fn magnitude(&self) -> Grid {
        let (width, height) = (self.width, self.height);
        let samples: Vec<f32> = match self.coding {
            Coding::Bit => unpack(&self.bytes, width * height).map(|bit| f32::from(u8::from(bit))).collect(),
            Coding::Byte => self.bytes.iter().map(|b| f32::from(*b) / 255.0).collect(),
            Coding::Signed => self
                .bytes
                .as_chunks()
                .0
                .iter()
                .map(|[x, y]| (f32::from(*x as i8).hypot(f32::from(*y as i8)) / 127.0).min(1.0))
                .collect(),
        };
        let grid = Grid { width, height, samples };
        match self.coding {
            Coding::Bit => smooth(&grid, &Kernel::gaussian(BIT_BLUR, 4.0), self.surface.wrap),
            _ => grid,
        }
    }
}

/// Quantisation steps per unit, so that `count` steps are `max`; 0 if `max` is 0.
fn steps(count: f32, max: f32) -> f32 {
    if max > 0.0 { count / max } else { 0.0 }
}

/// Packs bits into bytes, from the lowest bit.
#[must_use]
pub fn pack(bits: impl Iterator<Item = bool>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (k, bit) in bits.enumerate() {
        if k % 8 == 0 {
            bytes.push(0);
        }
        if let Some(last) = bytes.last_mut() {
            *last |= u8::from(bit) << (k % 8);
        }
    }
    bytes
}

/// Unpacks the first `count` bits of [`pack`].
pub fn unpack(bytes: &[u8], count: usize) -> impl Iterator<Item = bool> + '_ {
    bytes.iter().flat_map(|byte| (0..8).map(move |k| byte >> k & 1 == 1)).take(count)
}

/// Returns the threshold of gradients by Otsu's method, over 256 bins of `ln(1 + g)`.
///
/// # Source
/// Otsu, "A threshold selection method from gray-level histograms" (1979).
#[must_use]
pub fn otsu(gradients: &[f32]) -> f32 {
    const BINS: usize = 256;
    let logs = || gradients.iter().map(|g| f64::from(*g).ln_1p());
    let (low, high) = logs().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    if high <= low {
        return gradients.first().copied().unwrap_or_default();
    }
    let mut counts = [0.0_f64; BINS];
    let unit = BINS as f64 / (high - low);
    logs().for_each(|x| counts[(((x - low) * unit) as usize).min(BINS - 1)] += 1.0);
    let centre = |k: usize| low + (k as f64 + 0.5) / unit;
    let total: f64 = counts.iter().sum();
    let sum: f64 = counts.iter().enumerate().map(|(k, n)| n * centre(k)).sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, (0.0, low));
    for (k, n) in counts.iter().enumerate() {
        (below, sum_below) = (below + n, sum_below + n * centre(k));
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let distance = sum_below / below - (sum - sum_below) / above;
            let variance = below * above * distance * distance;
            if variance > best.0 {
                best = (variance, centre(k));
            }
        }
    }
    best.1.exp_m1() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::texture::filter::sobel::gradient;
    use crate::texture::grid::Wrap;

    fn map(width: usize, height: usize) -> DiscontinuityMap {
        let mut rng = Rng::new(6);
        let image = Grid::from_fn(width, height, |x, _| {
            let step = if x % 16 < 8 { 20.0 } else { 80.0 };
            step + rng.between(-1.0, 1.0) as f32
        });
        let [gx, gy] = gradient(&image, Wrap::Repeat);
        DiscontinuityMap { gx, gy, surface: Surface::default() }
    }

    #[test]
    fn packed_bits_are_unpacked_and_take_an_eighth_of_a_byte() {
        let map = map(512, 512);
        let code = CodedMap::new(&map, Coding::Bit, Some(5.0));
        assert_eq!(code.bytes.len(), 32_768);
        let bits: Vec<bool> = unpack(&code.bytes, 512 * 512).collect();
        assert_eq!(bits, length(&map.gx, &map.gy).samples.iter().map(|g| *g > 5.0).collect::<Vec<_>>());
        for count in [0, 1, 7, 8, 9, 100] {
            let bits: Vec<bool> = (0..count).map(|k| k % 3 == 0).collect();
            let bytes = pack(bits.iter().copied());
            assert_eq!((bytes.len(), unpack(&bytes, count).collect::<Vec<_>>()), (count.div_ceil(8), bits));
        }
    }

    #[test]
    fn otsu_thresholds_are_those_of_skimage() {
        let map = map(64, 64);
        let code = CodedMap::new(&map, Coding::Bit, None);
        let part = unpack(&code.bytes, 64 * 64).filter(|bit| *bit).count() as f64 / 4096.0;
        assert!((part - 0.25).abs() < 1e-3, "a column on both sides of each step, of eight: {part}");
        // skimage.filters.threshold_otsu(numpy.log1p(g)) for g = (k % 10) ** 2 / 9 of 1000 numbers.
        let g: Vec<f32> = (0..1000).map(|k| ((k % 10) * (k % 10)) as f32 / 9.0).collect();
        let bin = 10_f64.ln() / 256.0;
        let ours = f64::from(otsu(&g)).ln_1p();
        assert!((ours - OTSU).abs() < 1.01 * bin, "{ours} {OTSU}");
        assert_eq!(otsu(&[3.0; 5]), 3.0);
        assert_eq!(otsu(&[]), 0.0);
    }

    const OTSU: f64 = include!("../testdata/otsu.in");

    #[test]
    fn signed_pairs_are_decoded_to_half_a_step() {
        let map = map(40, 30);
        let code = CodedMap::new(&map, Coding::Signed, None);
        assert_eq!(code.bytes.len(), 2 * 40 * 30);
        let back = code.gradient().unwrap();
        let half = 0.5001 * code.scale / 127.0;
        for (a, b) in map.gx.samples.iter().zip(&back.gx.samples) {
            assert!((a - b).abs() <= half, "{a} {b}");
        }
        for (a, b) in map.gy.samples.iter().zip(&back.gy.samples) {
            assert!((a - b).abs() <= half, "{a} {b}");
        }
        assert_eq!(CodedMap::new(&map, Coding::Byte, None).gradient(), None);
    }

    #[test]
    fn bytes_follow_the_magnitude_up_to_their_scale() {
        let map = map(40, 30);
        let code = CodedMap::new(&map, Coding::Byte, None);
        assert_eq!(code.bytes.len(), 40 * 30);
        let g = length(&map.gx, &map.gy);
        for (m, g) in code.magnitude().samples.iter().zip(&g.samples) {
            assert!((m * code.scale - g.min(code.scale)).abs() <= 0.51 * code.scale / 255.0);
        }
        // One pixel of a thousand is beyond the scale, which is between the two of that rank.
        let wide = Grid::from_fn(100, 100, |x, y| ((x * 37 + y * 101) % 9973) as f32);
        let zero = Grid::from_fn(100, 100, |_, _| 0.0);
        let map = DiscontinuityMap { gx: wide.clone(), gy: zero, surface: Surface::default() };
        let code = CodedMap::new(&map, Coding::Byte, None);
        let mut sorted = wide.samples;
        sorted.sort_by(f32::total_cmp);
        assert!((sorted[9988]..=sorted[9990]).contains(&code.scale), "{}", code.scale);
        assert_eq!(sorted.iter().filter(|g| **g > code.scale).count(), 10);
    }

    #[test]
    fn decoded_bits_are_smoothed_by_a_gaussian_of_seven_tenths_of_a_pixel() {
        let code = CodedMap::new(&map(64, 48), Coding::Bit, None);
        let bits: Vec<bool> = unpack(&code.bytes, 64 * 48).collect();
        let weight = |d: i64| (-(d * d) as f64 / (2.0 * 0.7 * 0.7)).exp();
        let all: f64 = (-3..=3).map(weight).sum();
        for (k, m) in code.magnitude().samples.iter().enumerate() {
            let (x, y) = ((k % 64) as i64, (k / 64) as i64);
            let around = (-3..=3).flat_map(|v| (-3..=3).map(move |u| (u, v)));
            let right: f64 = around
                .filter(|(u, v)| bits[((y + v).rem_euclid(48) * 64 + (x + u).rem_euclid(64)) as usize])
                .map(|(u, v)| weight(u) * weight(v) / (all * all))
                .sum();
            assert!((f64::from(*m) - right).abs() < 1e-5, "{x} {y}: {m} {right}");
        }
    }

    #[test]
    fn decoded_bits_have_no_steps_and_a_flat_map_is_all_zero() {
        let m = CodedMap::new(&map(64, 64), Coding::Bit, None).magnitude();
        let steepest = m.samples.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        assert!(steepest < 0.6, "{steepest}");
        let zero = Grid::from_fn(20, 20, |_, _| 0.0);
        let flat = DiscontinuityMap { gx: zero.clone(), gy: zero, surface: Surface::default() };
        for coding in [Coding::Bit, Coding::Byte, Coding::Signed] {
            let m = CodedMap::new(&flat, coding, None).magnitude();
            assert!(m.samples.iter().all(|m| *m == 0.0), "{coding:?}");
        }
    }
}
