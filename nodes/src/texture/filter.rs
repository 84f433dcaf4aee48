//! Separable filters over images: symmetric kernels along columns, then along rows.
//!
//! Rows are made in parallel, each from the image alone, so that the bits do not depend on how many threads there are.

use super::item::{Grid, Wrap};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use rayon::prelude::*;
use std::f32::consts::LN_2;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Pixels that are treated together.
pub(super) const LANES: usize = 16;
/// Pixels of a row that are blurred together, and rows that one task blurs.
pub(super) const TILE: usize = 256;
const BLUR_STRIP: usize = 128;
/// Places from one line of a ring to the next: no power of two, or all lines would fall into the same part of the cache.
const PITCH: usize = TILE + LANES;
/// Pixels that are under way at once.
const BLOCK: usize = 4 * LANES;
/// Rows that one task makes: enough to pay for the task, few enough to stay in the cache.
const STRIP: usize = 32;

/// A symmetric kernel of odd length, as its weights from the middle outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel(Vec<f32>);

impl Kernel {
    /// A Gaussian of standard deviation `sigma` pixels, cut off at `reach` deviations, of sum 1.
    ///
    /// The kernel is that of `scipy.ndimage.gaussian_filter` with `truncate = reach`. A `sigma` of 0 leaves the image as it is.
    #[must_use]
    pub fn gaussian(sigma: f64, reach: f64) -> Self {
        let radius = (reach * sigma + 0.5).clamp(0.0, 4096.0) as usize;
        let weights: Vec<f64> = (0..=radius)
            .map(|t| if t == 0 { 1.0 } else { (-0.5 * (t as f64 / sigma).powi(2)).exp() })
            .collect();
        let sum = 2.0 * weights.iter().sum::<f64>() - 1.0;
        Self(weights.iter().map(|w| (w / sum) as f32).collect())
    }

    /// The binomial kernel 1 4 6 4 1, of sum 1.
    #[must_use]
    pub fn binomial() -> Self {
        Self(vec![6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0])
    }

    /// A low-pass that keeps waves of up to 0.13 cycles per pixel within 0.5 dB, takes 6 dB at 0.16 and at least 63 dB from 0.21 on:
    /// what is left can be halved, and read by a cubic spline whose images are then 63 dB below it.
    ///
    /// # Source
    /// Kaiser, "Nonrecursive digital filter design using the I0-sinh window function" (1974).
    #[must_use]
    pub fn low_pass() -> Self {
        const RADIUS: usize = 20;
        const CORNER: f64 = 0.16;
        const BETA: f64 = 6.0;
        let weight = |t: usize| {
            let x = t as f64;
            let sinc = if t == 0 { 2.0 * CORNER } else { (TAU * CORNER * x).sin() / (PI * x) };
            sinc * bessel(BETA * (1.0 - (x / RADIUS as f64).powi(2)).sqrt())
        };
        let weights: Vec<f64> = (0..=RADIUS).map(weight).collect();
        let sum = 2.0 * weights.iter().sum::<f64>() - weight(0);
        Self(weights.iter().map(|w| (w / sum) as f32).collect())
    }

    /// Pixels to either side of the middle.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.0.len() - 1
    }

    /// Weights from the middle outwards.
    #[must_use]
    pub fn weights(&self) -> &[f32] {
        &self.0
    }
}

/// The modified Bessel function of the first kind and order 0, by its series.
fn bessel(x: f64) -> f64 {
    let term = |sum: (f64, f64), k: u32| {
        let next = sum.1 * (0.5 * x / f64::from(k)).powi(2);
        (sum.0 + next, next)
    };
    (1..30).fold((1.0, 1.0), term).0
}

/// Blurs an image by the same kernel along both axes.
///
/// # Complexity
/// `O(pixels * radius)`, with a few rows of memory for each thread beside the result.
#[must_use]
pub fn smooth(image: &Grid, kernel: &Kernel, wrap: Wrap) -> Grid {
    if kernel.radius() == 0 {
        return image.clone();
    }
    blur(image, [kernel], wrap, |_, [row], out| out.iter_mut().zip(row).for_each(|(out, x)| *out = *x))
}

/// Makes a grid row by row, in parallel; `state` makes what one task needs for its rows.
pub(super) fn map_rows<T>(
    width: usize,
    height: usize,
    state: impl Fn() -> T + Sync,
    row: impl Fn(&mut T, usize, &mut [f32]) + Sync,
) -> Grid {
    let mut samples = vec![0.0; width * height];
    if width > 0 {
        samples.par_chunks_mut(width * STRIP).enumerate().for_each(|(strip, rows)| {
            let mut state = state();
            for (k, out) in rows.chunks_exact_mut(width).enumerate() {
                row(&mut state, strip * STRIP + k, out);
            }
        });
    }
    Grid { width, height, samples }
}

/// Makes two grids row by row, as [`map_rows`].
pub(super) fn map_row_pairs<T>(
    width: usize,
    height: usize,
    state: impl Fn() -> T + Sync,
    row: impl Fn(&mut T, usize, &mut [f32], &mut [f32]) + Sync,
) -> [Grid; 2] {
    let (mut first, mut second) = (vec![0.0; width * height], vec![0.0; width * height]);
    if width > 0 {
        let strips = first.par_chunks_mut(width * STRIP).zip(second.par_chunks_mut(width * STRIP));
        strips.enumerate().for_each(|(strip, (a, b))| {
            let mut state = state();
            for (k, (a, b)) in a.chunks_exact_mut(width).zip(b.chunks_exact_mut(width)).enumerate() {
                row(&mut state, strip * STRIP + k, a, b);
            }
        });
    }
    [first, second].map(|samples| Grid { width, height, samples })
}

impl Grid {
    /// Row `y` of the endless image.
    pub(super) fn row(&self, y: i64, wrap: Wrap) -> &[f32] {
        let y = wrap.place(y, self.height);
        self.samples.get(y * self.width..(y + 1) * self.width).unwrap_or_default()
    }
}

/// Blurs an image by several kernels at once, and joins what they give piece by piece of a row.
///
/// The image is gone through in tiles that stay in the nearest cache: along the rows into a ring of lines, then down that ring.
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
    samples.par_chunks_mut(width * BLUR_STRIP).enumerate().for_each(|(strip, out)| {
        let mut ring = Ring::new(&weights);
        for from in (0..width).step_by(TILE) {
            let tile = from..(from + TILE).min(width);
            for k in 0..out.len() / width + 2 * radius {
                let row = image.row((strip * BLUR_STRIP + k) as i64 - radius as i64, wrap);
                ring.cut(row, tile.clone(), wrap);
                dispatch!(level, simd => ring.along(simd, k));
                let Some(done) = k.checked_sub(2 * radius) else { continue };
                dispatch!(level, simd => ring.down(simd, k));
                let piece = out.get_mut(done * width + tile.start..done * width + tile.end);
                join(level, &ring.done, piece.unwrap_or_default());
            }
        }
    });
    Grid { width, height, samples }
}

/// The lines of a tile that the column filters need at once.
struct Ring<'a, const N: usize> {
    /// Weights of all kernels from the middle outwards; zeros where one is shorter.
    weights: &'a [[f32; N]],
    /// A piece of a row, with what lies before and after it.
    line: Vec<f32>,
    /// Filtered pieces, of row `k` at place `k` modulo their count.
    rows: Vec<[[f32; PITCH]; N]>,
    /// One filtered row.
    done: [[f32; TILE]; N],
}

impl<'a, const N: usize> Ring<'a, N> {
    fn new(weights: &'a [[f32; N]]) -> Self {
        let places = 2 * weights.len() - 1;
        let line = vec![0.0; TILE + places];
        Self { weights, line, rows: vec![[[0.0; PITCH]; N]; places], done: [[0.0; TILE]; N] }
    }

    /// Takes up a piece of a row, with what lies to both sides of it.
    fn cut(&mut self, row: &[f32], tile: Range<usize>, wrap: Wrap) {
        let radius = self.weights.len() - 1;
        let (from, to) = (tile.start.saturating_sub(radius), (tile.end + radius).min(row.len()));
        let before = radius + from - tile.start;
        let inside = self.line.get_mut(before..before + to - from).unwrap_or_default();
        inside.copy_from_slice(row.get(from..to).unwrap_or_default());
        let after = before + to - from..tile.len() + 2 * radius;
        for k in (0..before).chain(after) {
            self.line[k] = row[wrap.place((tile.start + k) as i64 - radius as i64, row.len())];
        }
    }

    /// The row filters of all kernels, of row `k`.
    #[inline(always)]
    fn along<S: Simd>(&mut self, simd: S, k: usize) {
        let radius = self.weights.len() - 1;
        let place = k % self.rows.len();
        let (Some((middle, outer)), Some(out)) = (self.weights.split_first(), self.rows.get_mut(place))
        else {
            return;
        };
        for at in (0..TILE).step_by(BLOCK) {
            let own = load_block(simd, &self.line, at + radius);
            let mut sums: [[f32x16<S>; 4]; N] = std::array::from_fn(|n| own.map(|x| x * middle[n]));
            for (t, weights) in outer.iter().enumerate() {
                let a = load_block(simd, &self.line, at + radius - t - 1);
                let b = load_block(simd, &self.line, at + radius + t + 1);
                add_pair(simd, a, b, weights, &mut sums);
            }
            for n in 0..N {
                store_block(sums[n], &mut out[n], at);
            }
        }
    }

    /// The column filters of all kernels, with row `k` as the last that they need.
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
                store_block(sums[0], &mut self.done[n], at);
            }
        }
    }
}

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

/// Fills `radius` places before and after a line of `width` pixels with what lies beyond its ends.
pub(super) fn extend(line: &mut [f32], radius: usize, width: usize, wrap: Wrap) {
    for t in 0..radius {
        let before = line[radius + wrap.place(t as i64 - radius as i64, width)];
        line[t] = before;
        let after = line[radius + wrap.place((width + t) as i64, width)];
        line[radius + width + t] = after;
    }
}

/// Sixteen pixels of a row; zeros beyond its end.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, row: &[f32], at: usize) -> f32x16<S> {
    match row.get(at..at + LANES) {
        Some(full) => f32x16::from_slice(simd, full),
        None => {
            let mut part = [0.0; LANES];
            part.iter_mut().zip(row.get(at..).unwrap_or_default()).for_each(|(p, x)| *p = *x);
            f32x16::from_slice(simd, &part)
        }
    }
}

/// Writes sixteen pixels of a row, or those before its end.
#[inline(always)]
pub(super) fn store<S: Simd>(pixels: f32x16<S>, row: &mut [f32], at: usize) {
    match row.get_mut(at..at + LANES) {
        Some(full) => pixels.store_slice(full),
        None => {
            let mut part = [0.0; LANES];
            pixels.store_slice(&mut part);
            row.get_mut(at..).unwrap_or_default().iter_mut().zip(part).for_each(|(p, x)| *p = x);
        }
    }
}

/// [`BLOCK`] pixels of a row; zeros beyond its end.
#[inline(always)]
fn load_block<S: Simd>(simd: S, row: &[f32], at: usize) -> [f32x16<S>; 4] {
    match row.get(at..at + BLOCK) {
        Some(block) => std::array::from_fn(|k| f32x16::from_slice(simd, &block[k * LANES..(k + 1) * LANES])),
        None => std::array::from_fn(|k| load(simd, row, (at + k * LANES).min(row.len()))),
    }
}

#[inline(always)]
fn store_block<S: Simd>(pixels: [f32x16<S>; 4], row: &mut [f32], at: usize) {
    match row.get_mut(at..at + BLOCK) {
        Some(block) => {
            for (pixels, out) in pixels.iter().zip(block.chunks_exact_mut(LANES)) {
                pixels.store_slice(out);
            }
        }
        None => {
            for (k, pixels) in pixels.into_iter().enumerate() {
                store(pixels, row, (at + k * LANES).min(row.len()));
            }
        }
    }
}

/// `2^x` of sixteen numbers up to 0, to 2 parts in 10^7; those below -126 give `2^-126`.
#[inline(always)]
pub(super) fn exp2<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    // Adding this number rounds to a whole number, which then stands in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let x = x.max(f32x16::splat(simd, -126.0));
    let whole = x + ROUND;
    let part = x - (whole - ROUND);
    // Fit of least relative error over -0.5 to 0.5 that is exact at 0.
    let mut y = f32x16::splat(simd, EXP2[5]);
    for k in (0..5).rev() {
        y = y.mul_add(part, f32x16::splat(simd, EXP2[k]));
    }
    // The whole number is added to the exponent.
    (y.bitcast::<fearless_simd::i32x16<S>>() + (whole.bitcast::<fearless_simd::i32x16<S>>() << 23)).bitcast()
}

/// Coefficients of [`exp2`].
const EXP2: [f32; 6] = [1.0, LN_2, 0.240_222_42, 0.055_507_34, 0.009_671_513, 0.001_326_472_7];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    /// The filter by its definition, in double precision.
    fn naive(image: &Grid, kernel: &Kernel, wrap: Wrap) -> Vec<f64> {
        let r = kernel.radius() as i64;
        let weight = |t: i64| f64::from(kernel.weights()[t.unsigned_abs() as usize]);
        let at = |x: i64, y: i64| f64::from(image.row(y, wrap)[wrap.place(x, image.width)]);
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
    fn the_separable_filter_is_the_sum_that_defines_it() {
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
    const GAUSSIAN: [(Wrap, f64, [f64; 99]); 6] = include!("testdata/gaussian.in");

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

    #[test]
    fn gaussians_sum_to_one_and_fall_as_they_should() {
        let kernel = Kernel::gaussian(1.0, 4.0);
        assert_eq!(kernel.radius(), 4);
        let w = kernel.weights();
        assert!((w[0] + 2.0 * w[1..].iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((w[1] / w[0] - (-0.5_f32).exp()).abs() < 1e-6);
        assert_eq!(Kernel::gaussian(0.0, 4.0).weights(), [1.0]);
    }

    #[test]
    fn powers_of_two_are_near_enough() {
        let x: Vec<f32> = (0..16 * 900).map(|k| -(k as f32) * 0.01).collect();
        let mut out = vec![0.0; x.len()];
        dispatch!(Level::new(), simd => {
            for at in (0..x.len()).step_by(LANES) {
                store(exp2(simd, load(simd, &x, at)), &mut out, at);
            }
        });
        for (x, y) in x.iter().zip(out) {
            let right = f64::from(x.max(-126.0)).exp2();
            assert!((f64::from(y) / right - 1.0).abs() < 4e-7, "2^{x} = {y}");
        }
        dispatch!(Level::new(), simd => assert_eq!(exp2(simd, f32x16::splat(simd, 0.0))[0], 1.0));
    }
}
