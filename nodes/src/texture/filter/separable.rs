//! Separable filters over images: symmetric kernels along rows, then along columns.
//!
//! Strips of rows are computed in parallel, each from the image alone, so that the result does not depend on the number of threads.
#![allow(
    clippy::needless_range_loop,
    reason = "iterators over vectors are not always inlined into code for wider registers"
)]

use super::kernel::Kernel;
use super::rows::{copy_continued, strip_rows};
use crate::texture::grid::{Grid, Wrap};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use std::ops::Range;

/// Pixels of a row that are filtered together: the rows of a ring stay in the second-level cache.
const TILE: usize = 1024;
/// Rows that are filtered along y together: each row of the ring is read once for all of them.
const GROUP: usize = 4;
/// Vectors that are filtered along x together.
const BLOCK: usize = 4;
/// Greatest number of pixels in [`BLOCK`] vectors.
const MAX_BLOCK: usize = 16 * BLOCK;
/// Samples from one row of a ring to the next. It is no power of two, so that rows do not share cache sets.
const PITCH: usize = TILE + MAX_BLOCK;

/// Result of a pixel from the sums of several kernels.
pub(super) trait Join<const N: usize>: Sync {
    /// Combines the sums of a vector of pixels.
    fn join<S: Simd>(&self, simd: S, sums: [S::f32s; N]) -> S::f32s;
}

/// The sum of a single kernel.
struct Single;

impl Join<1> for Single {
    #[inline(always)]
    fn join<S: Simd>(&self, _: S, [sum]: [S::f32s; 1]) -> S::f32s {
        sum
    }
}

/// Blurs an image by the same kernel along both axes.
///
/// # Complexity
/// `O(pixels * radius)`, with a few rows of memory per thread in addition to the result.
#[must_use]
pub fn smooth(image: &Grid, kernel: &Kernel, wrap: Wrap) -> Grid {
    if kernel.radius() == 0 {
        return image.clone();
    }
    blur(image, [kernel], wrap, &Single)
}

/// Blurs an image by several kernels at once, and combines the results of each pixel.
pub(super) fn blur<const N: usize>(
    image: &Grid,
    kernels: [&Kernel; N],
    wrap: Wrap,
    join: &impl Join<N>,
) -> Grid {
    let (width, height, level) = (image.width, image.height, Level::new());
    let mut samples = vec![0.0; width * height];
    if width > 0 {
        let rows = strip_rows(height);
        samples.par_chunks_mut(width * rows).enumerate().for_each(|(strip, out)| {
            let mut ring = Ring::new(image, kernels, wrap);
            dispatch!(level, simd => ring.strip(simd, strip * rows, out, join));
        });
    }
    Grid { width, height, samples }
}

/// Ring buffer of the rows of a tile that are filtered along x.
struct Ring<'a, const N: usize> {
    image: &'a Grid,
    wrap: Wrap,
    kernels: [&'a Kernel; N],
    /// Weights of all kernels from the middle outwards, padded with zeros.
    weights: Vec<[f32; N]>,
    /// A part of a row near an end, with its surroundings.
    padded: Vec<f32>,
    /// For each row in the ring, the results of all kernels.
    rows: Vec<[[f32; PITCH]; N]>,
    /// Indices in `rows` of the rows around a group, from the top.
    order: Vec<usize>,
}

impl<'a, const N: usize> Ring<'a, N> {
    fn new(image: &'a Grid, kernels: [&'a Kernel; N], wrap: Wrap) -> Self {
        let radius = kernels.iter().map(|kernel| kernel.radius()).max().unwrap_or_default();
        let weight = |kernel: &Kernel, t: usize| kernel.weights().get(t).copied().unwrap_or_default();
        let count = 2 * radius + GROUP;
        Self {
            image,
            wrap,
            kernels,
            weights: (0..=radius).map(|t| kernels.map(|kernel| weight(kernel, t))).collect(),
            padded: vec![0.0; TILE + MAX_BLOCK + 2 * radius],
            rows: vec![[[0.0; PITCH]; N]; count],
            order: (0..count).collect(),
        }
    }

    /// Pixels to either side of the middle of the widest kernel.
    fn radius(&self) -> usize {
        self.weights.len() - 1
    }

    /// Filters the rows of `out`, the first of which is row `top` of the image.
    #[inline(always)]
    fn strip<S: Simd>(&mut self, simd: S, top: usize, out: &mut [f32], join: &impl Join<N>) {
        let (width, radius) = (self.image.width, self.radius());
        for from in (0..width).step_by(TILE) {
            let tile = from..(from + TILE).min(width);
            let mut next = top as i64 - radius as i64;
            for k in 0..2 * radius {
                self.along(simd, next, self.order[GROUP + k], tile.clone());
                next += 1;
            }
            for group in out.chunks_mut(GROUP * width) {
                self.order.rotate_left(GROUP);
                for k in 0..group.len() / width {
                    self.along(simd, next, self.order[2 * radius + k], tile.clone());
                    next += 1;
                }
                self.down(simd, group, tile.clone(), join);
            }
        }
    }

    /// Filters a tile of row `y` along x, into row `index` of the ring.
    #[inline(always)]
    fn along<S: Simd>(&mut self, simd: S, y: i64, index: usize, tile: Range<usize>) {
        let (radius, step) = (self.weights.len() - 1, BLOCK * S::f32s::LEN);
        let row = self.image.row(y, self.wrap);
        let len = tile.len().next_multiple_of(step);
        let inside = tile.start.checked_sub(radius).and_then(|from| row.get(from..tile.start + len + radius));
        let source = match inside {
            Some(inside) => inside,
            None => {
                let padded = &mut self.padded[..tile.len() + 2 * radius];
                copy_continued(row, tile.start as i64 - radius as i64, self.wrap, padded);
                &self.padded
            }
        };
        let (Some((middle, outer)), Some(out)) = (self.weights.split_first(), self.rows.get_mut(index))
        else {
            return;
        };
        for at in (0..len).step_by(step) {
            let own = load::<S>(simd, source, at + radius);
            let mut sums = [own; N];
            for n in 0..N {
                for k in 0..BLOCK {
                    sums[n][k] *= middle[n];
                }
            }
            for (t, weights) in outer.iter().enumerate() {
                let a = load::<S>(simd, source, at + radius - t - 1);
                let b = load::<S>(simd, source, at + radius + t + 1);
                for k in 0..BLOCK {
                    let pair = a[k] + b[k];
                    for n in 0..N {
                        sums[n][k] = pair.mul_add(S::f32s::splat(simd, weights[n]), sums[n][k]);
                    }
                }
            }
            for n in 0..N {
                for (k, out) in out[n][at..at + step].chunks_exact_mut(S::f32s::LEN).enumerate() {
                    sums[n][k].store_slice(out);
                }
            }
        }
    }

    /// Filters a group of rows along y, and combines the results.
    #[inline(always)]
    fn down<S: Simd>(&self, simd: S, group: &mut [f32], tile: Range<usize>, join: &impl Join<N>) {
        let (width, lanes) = (self.image.width, S::f32s::LEN);
        for at in (0..tile.len()).step_by(lanes) {
            let mut sums = [[S::f32s::splat(simd, 0.0); N]; GROUP];
            for n in 0..N {
                let columns = self.columns(simd, n, at);
                for g in 0..GROUP {
                    sums[g][n] = columns[g];
                }
            }
            for (g, row) in group.chunks_exact_mut(width).enumerate() {
                let joined = join.join(simd, sums[g]);
                let from = tile.start + at;
                let out = &mut row[from..from + lanes.min(tile.len() - at)];
                if out.len() == lanes {
                    joined.store_slice(out);
                } else {
                    out.iter_mut().zip(joined.as_slice()).for_each(|(out, x)| *out = *x);
                }
            }
        }
    }

    /// Sums of kernel `n` along y, in a vector of columns of each row of a group.
    #[inline(always)]
    fn columns<S: Simd>(&self, simd: S, n: usize, at: usize) -> [S::f32s; GROUP] {
        let radius = self.radius();
        let row = |k: usize| &self.rows[self.order[k]][n][at..at + S::f32s::LEN];
        let mut middle = [S::f32s::splat(simd, 0.0); GROUP];
        for g in 0..GROUP {
            middle[g] = S::f32s::from_slice(simd, row(radius + g));
        }
        let (mut above, mut below, mut sums) = (middle, middle, middle);
        let Some((own, outer)) = self.kernels[n].weights().split_first() else { return sums };
        for sum in &mut sums {
            *sum *= *own;
        }
        for (t, weight) in outer.iter().enumerate() {
            let weight = S::f32s::splat(simd, *weight);
            above = [S::f32s::from_slice(simd, row(radius - 1 - t)), above[0], above[1], above[2]];
            below = [below[1], below[2], below[3], S::f32s::from_slice(simd, row(radius + GROUP + t))];
            for g in 0..GROUP {
                sums[g] = (above[g] + below[g]).mul_add(weight, sums[g]);
            }
        }
        sums
    }
}

/// Loads [`BLOCK`] vectors.
#[inline(always)]
fn load<S: Simd>(simd: S, row: &[f32], at: usize) -> [S::f32s; BLOCK] {
    let lanes = S::f32s::LEN;
    let mut vectors = [S::f32s::splat(simd, 0.0); BLOCK];
    let block = &row[at..at + BLOCK * lanes];
    for k in 0..BLOCK {
        vectors[k] = S::f32s::from_slice(simd, &block[k * lanes..(k + 1) * lanes]);
    }
    vectors
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
        let sizes = [(1, 1), (1, 9), (3, 7), (5, 3), (16, 2), (17, 40), (65, 33), (7, 150), (TILE + 70, 5)];
        for (width, height) in sizes {
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
