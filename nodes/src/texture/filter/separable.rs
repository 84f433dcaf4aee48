//! Separable filters over images: symmetric kernels along columns, then along rows.
//!
//! Rows are computed in parallel, each from the image alone, so that the result does not depend on the number of threads.

use super::kernel::Kernel;
use super::simd::{BLOCK, LANES, load_block, store_block};
use crate::texture::grid::{Grid, Wrap};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use rayon::prelude::*;
use std::ops::Range;

/// Pixels of a row that are blurred together.
pub(super) const TILE: usize = 256;
/// Rows that one task blurs.
const STRIP: usize = 128;
/// Samples from one row of a ring to the next. It is no power of two, so that rows do not share cache sets.
const PITCH: usize = TILE + LANES;

/// Blurs an image by the same kernel along both axes.
///
/// # Complexity
/// `O(pixels * radius)`, with a few rows of memory per thread in addition to the result.
#[must_use]
pub fn smooth(image: &Grid, kernel: &Kernel, wrap: Wrap) -> Grid {
    if kernel.radius() == 0 {
        return image.clone();
    }
    blur(image, [kernel], wrap, |_, [row], out| out.iter_mut().zip(row).for_each(|(out, x)| *out = *x))
}

/// Blurs an image by several kernels at once; `join` combines the results, one tile of a row at a time.
///
/// Tiles stay in the first-level cache: rows are filtered into a ring buffer of lines, then columns are filtered over the ring.
pub(super) fn blur<const N: usize>(
    image: &Grid,
    kernels: [&Kernel; N],
    wrap: Wrap,
    join: impl Fn(Level, &[[f32; TILE]; N], &mut [f32]) + Sync,
) -> Grid {
    let (width, height, level) = (image.width, image.height, Level::new());
    let radius = kernels.iter().map(|kernel| kernel.radius()).max().unwrap_or_default();
    let weight = |kernel: &Kernel, t: usize| kernel.weights().get(t).copied().unwrap_or_default();
    let weights: Vec<[f32; N]> = (0..=radius).map(|t| kernels.map(|kernel| weight(kernel, t))).collect();
    let mut samples = vec![0.0; width * height];
    if width == 0 {
        return Grid { width, height, samples };
    }
    samples.par_chunks_mut(width * STRIP).enumerate().for_each(|(strip, out)| {
        let mut ring = Ring::new(&weights);
        for from in (0..width).step_by(TILE) {
            let tile = from..(from + TILE).min(width);
            for k in 0..out.len() / width + 2 * radius {
                let row = image.row((strip * STRIP + k) as i64 - radius as i64, wrap);
                ring.read(row, tile.clone(), wrap);
                dispatch!(level, simd => ring.along(simd, k));
                let Some(y) = k.checked_sub(2 * radius) else { continue };
                dispatch!(level, simd => ring.down(simd, k));
                let part = out.get_mut(y * width + tile.start..y * width + tile.end);
                join(level, &ring.output, part.unwrap_or_default());
            }
        }
    });
    Grid { width, height, samples }
}

/// Ring buffer of the filtered rows of a tile that the column filters need.
struct Ring<'a, const N: usize> {
    /// Weights of all kernels from the middle outwards, padded with zeros.
    weights: &'a [[f32; N]],
    /// A padded part of a row.
    padded: Vec<f32>,
    /// Filtered parts, of row `k` at index `k` modulo their count.
    rows: Vec<[[f32; PITCH]; N]>,
    /// One row of the result of each kernel.
    output: [[f32; TILE]; N],
}

impl<'a, const N: usize> Ring<'a, N> {
    fn new(weights: &'a [[f32; N]]) -> Self {
        let length = 2 * weights.len() - 1;
        let padded = vec![0.0; TILE + length];
        Self { weights, padded, rows: vec![[[0.0; PITCH]; N]; length], output: [[0.0; TILE]; N] }
    }

    /// Reads a part of a row with its surroundings.
    fn read(&mut self, row: &[f32], tile: Range<usize>, wrap: Wrap) {
        let radius = self.weights.len() - 1;
        let (from, to) = (tile.start.saturating_sub(radius), (tile.end + radius).min(row.len()));
        let before = radius + from - tile.start;
        let inside = self.padded.get_mut(before..before + to - from).unwrap_or_default();
        inside.copy_from_slice(row.get(from..to).unwrap_or_default());
        let after = before + to - from..tile.len() + 2 * radius;
        for k in (0..before).chain(after) {
            self.padded[k] = row[wrap.index((tile.start + k) as i64 - radius as i64, row.len())];
        }
    }

    /// Filters row `k` along x by all kernels.
    #[inline(always)]
    fn along<S: Simd>(&mut self, simd: S, k: usize) {
        let radius = self.weights.len() - 1;
        let index = k % self.rows.len();
        let (Some((middle, outer)), Some(out)) = (self.weights.split_first(), self.rows.get_mut(index))
        else {
            return;
        };
        for at in (0..TILE).step_by(BLOCK) {
            let own = load_block(simd, &self.padded, at + radius);
            let mut sums: [[f32x16<S>; 4]; N] = std::array::from_fn(|n| own.map(|x| x * middle[n]));
            for (t, weights) in outer.iter().enumerate() {
                let a = load_block(simd, &self.padded, at + radius - t - 1);
                let b = load_block(simd, &self.padded, at + radius + t + 1);
                add_pair(simd, a, b, weights, &mut sums);
            }
            for n in 0..N {
                store_block(sums[n], &mut out[n], at);
            }
        }
    }

    /// Filters along y by all kernels, with row `k` as the last one.
    #[inline(always)]
    fn down<S: Simd>(&mut self, simd: S, k: usize) {
        let (radius, count) = (self.weights.len() - 1, self.rows.len());
        let Some((middle, outer)) = self.weights.split_first() else { return };
        let k = k + count - radius;
        for n in 0..N {
            let row = |k: usize| self.rows.get(k % count).map_or(&[][..], |rows| &rows[n]);
            for at in (0..TILE).step_by(BLOCK) {
                let mut sums = [load_block(simd, row(k), at).map(|x| x * middle[n])];
                for (t, weights) in outer.iter().enumerate() {
                    let (a, b) = (load_block(simd, row(k - t - 1), at), load_block(simd, row(k + t + 1), at));
                    add_pair(simd, a, b, &[weights[n]], &mut sums);
                }
                store_block(sums[0], &mut self.output[n], at);
            }
        }
    }
}

/// Adds the sum of two blocks, weighted for each kernel.
#[inline(always)]
fn add_pair<S: Simd, const N: usize>(
    simd: S,
    a: [f32x16<S>; 4],
    b: [f32x16<S>; 4],
    weights: &[f32; N],
    sums: &mut [[f32x16<S>; 4]; N],
) {
    for k in 0..4 {
        let pair = a[k] + b[k];
        for n in 0..N {
            sums[n][k] = pair.mul_add(f32x16::splat(simd, weights[n]), sums[n][k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    /// The filter by its definition, in double precision.
    fn naive(image: &Grid, kernel: &Kernel, wrap: Wrap) -> Vec<f64> {
        let r = kernel.radius() as i64;
        let weight = |t: i64| f64::from(kernel.weights()[t.unsigned_abs() as usize]);
        let at = |x: i64, y: i64| f64::from(image.row(y, wrap)[wrap.index(x, image.width)]);
        let mut out = Vec::new();
        for y in 0..image.height as i64 {
            for x in 0..image.width as i64 {
                let sum = (-r..=r).flat_map(|v| (-r..=r).map(move |u| (u, v)));
                out.push(sum.map(|(u, v)| weight(u) * weight(v) * at(x + u, y + v)).sum());
            }
        }
        out
    }

    #[test]
    fn the_separable_filter_is_its_defining_sum() {
        let mut rng = Rng::new(3);
        for (width, height) in [(1, 1), (1, 9), (5, 3), (16, 2), (17, 40), (70, 33)] {
            let image = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                for kernel in [Kernel::binomial(), Kernel::gaussian(1.26, 4.0), Kernel::gaussian(0.0, 4.0)] {
                    let fast = smooth(&image, &kernel, wrap);
                    for (a, b) in fast.samples.iter().zip(naive(&image, &kernel, wrap)) {
                        assert!((f64::from(*a) - b).abs() < 4e-5, "{width}x{height} {wrap:?}: {a} {b}");
                    }
                }
            }
        }
    }

    /// `scipy.ndimage.gaussian_filter` with `truncate = 4` of 11 x 9 pixels, by border and sigma: `tests/oracles/texture.py`.
    const GAUSSIAN: [(Wrap, f64, [f64; 99]); 6] = include!("../testdata/gaussian.in");

    #[test]
    fn gaussians_are_those_of_scipy() {
        let image = Grid::from_fn(11, 9, |x, y| ((7 * x * x + 3 * x * y + 5 * y) % 11) as f32);
        for (wrap, sigma, right) in GAUSSIAN {
            let found = smooth(&image, &Kernel::gaussian(sigma, 4.0), wrap);
            for (k, (a, b)) in found.samples.iter().zip(right).enumerate() {
                assert!((f64::from(*a) - b).abs() < 5e-6, "{wrap:?}, {sigma}: pixel {k} is {a} for {b}");
            }
        }
    }
}
