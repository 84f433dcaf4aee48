//! Gradients of an image by the Sobel operator, in units of luminance per pixel.
//!
//! `gx = [1 2 1]^T [-1 0 1] / 8 * L`, `gy` transposed. A ramp of one unit per pixel results in exactly 1.
//!
//! # Source
//! Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.1.

use super::rows::{map_row_pairs, map_rows, pad};
use super::simd::{LANES, load, store};
use crate::texture::grid::{Grid, Wrap};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};

/// Returns the gradient along x and along y.
///
/// # Complexity
/// `O(pixels)`, with two rows of memory per thread in addition to the result.
#[must_use]
pub fn gradient(image: &Grid, wrap: Wrap) -> [Grid; 2] {
    let sobel = Sobel::new(image, wrap);
    map_row_pairs(
        image.width,
        image.height,
        || sobel.columns(),
        |columns, y, gx, gy| {
            sobel.row(columns, y);
            let level = sobel.level;
            dispatch!(level, simd => along(simd, columns, #[inline(always)] |x, y, at| {
                store(x, gx, at);
                store(y, gy, at);
            }));
        },
    )
}

/// Returns the magnitude of the gradient.
///
/// `skimage.filters.sobel` returns `sqrt(2)` times this value.
///
/// # Complexity
/// As [`gradient`].
#[must_use]
pub fn magnitude(image: &Grid, wrap: Wrap) -> Grid {
    let sobel = Sobel::new(image, wrap);
    map_rows(
        image.width,
        image.height,
        || sobel.columns(),
        |columns, y, out| {
            sobel.row(columns, y);
            let level = sobel.level;
            dispatch!(level, simd => along(simd, columns, #[inline(always)] |x, y, at| {
                store(x.mul_add(x, y * y).sqrt(), out, at);
            }));
        },
    )
}

/// Returns the length of each vector of two grids of the same size.
#[must_use]
pub fn length(gx: &Grid, gy: &Grid) -> Grid {
    let samples = gx.samples.iter().zip(&gy.samples).map(|(x, y)| (x * x + y * y).sqrt()).collect();
    Grid { samples, ..*gx }
}

/// Column filters of one row, padded by one pixel at both ends.
struct ColumnSums {
    /// Sum along y, by 1 2 1.
    sum: Vec<f32>,
    /// Difference along y.
    change: Vec<f32>,
    width: usize,
}

struct Sobel<'a> {
    image: &'a Grid,
    wrap: Wrap,
    level: Level,
}

impl<'a> Sobel<'a> {
    fn new(image: &'a Grid, wrap: Wrap) -> Self {
        Self { image, wrap, level: Level::new() }
    }

    fn columns(&self) -> ColumnSums {
        let line = vec![0.0; self.image.width + 2 + LANES];
        ColumnSums { sum: line.clone(), change: line, width: self.image.width }
    }

    fn row(&self, columns: &mut ColumnSums, y: usize) {
        let rows = [-1, 0, 1].map(|t| self.image.row(y as i64 + t, self.wrap));
        let level = self.level;
        dispatch!(level, simd => down(simd, rows, columns));
        for line in [&mut columns.sum, &mut columns.change] {
            pad(line, 1, self.image.width, self.wrap);
        }
    }
}

#[inline(always)]
fn down<S: Simd>(simd: S, [above, row, below]: [&[f32]; 3], columns: &mut ColumnSums) {
    for at in (0..columns.width).step_by(LANES) {
        let (a, b, c) = (load(simd, above, at), load(simd, row, at), load(simd, below, at));
        store(a + (b + b) + c, &mut columns.sum, at + 1);
        store(c - a, &mut columns.change, at + 1);
    }
}

#[inline(always)]
fn along<S: Simd>(simd: S, columns: &ColumnSums, mut emit: impl FnMut(f32x16<S>, f32x16<S>, usize)) {
    for at in (0..columns.width).step_by(LANES) {
        let gx = load(simd, &columns.sum, at + 2) - load(simd, &columns.sum, at);
        let middle = load(simd, &columns.change, at + 1);
        let gy = load(simd, &columns.change, at) + (middle + middle) + load(simd, &columns.change, at + 2);
        emit(gx * 0.125, gy * 0.125, at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn the_gradient_of_a_ramp_is_its_slope() {
        for (a, b) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-2.0, 0.5)] {
            let ramp = Grid::from_fn(40, 20, |x, y| a * x as f32 + b * y as f32);
            let [gx, gy] = gradient(&ramp, Wrap::Clamp);
            let g = magnitude(&ramp, Wrap::Clamp);
            for y in 1..19 {
                for k in 40 * y + 1..40 * y + 39 {
                    assert_eq!((gx.samples[k], gy.samples[k]), (a, b));
                    assert!((g.samples[k] - a.hypot(b)).abs() < 1e-6);
                }
            }
        }
    }

    /// `scipy.ndimage.sobel(image, axis, mode) / 8` of `image[y, x] = (7 x^2 + 3 x y + 5 y) % 11` of 5 x 4 pixels,
    /// for the modes `wrap`, `reflect` and `nearest`.
    const ORACLE: [(Wrap, [[f32; 20]; 2]); 3] = include!("../testdata/sobel.in");

    #[test]
    fn gradients_are_those_of_scipy() {
        let image = Grid::from_fn(5, 4, |x, y| ((7 * x * x + 3 * x * y + 5 * y) % 11) as f32);
        for (wrap, [x, y]) in ORACLE {
            let [gx, gy] = gradient(&image, wrap);
            assert_eq!((&gx.samples[..], &gy.samples[..]), (&x[..], &y[..]), "{wrap:?}");
        }
    }

    #[test]
    fn magnitudes_are_those_of_skimage_over_the_root_of_two() {
        // skimage.filters.sobel of the same image, whose border is reflected.
        let image = Grid::from_fn(5, 4, |x, y| ((7 * x * x + 3 * x * y + 5 * y) % 11) as f32);
        let g = magnitude(&image, Wrap::Mirror);
        for (row, oracle) in SKIMAGE.into_iter().enumerate() {
            for (x, right) in oracle.into_iter().enumerate() {
                assert!((g.samples[5 * row + x] * 2_f32.sqrt() - right).abs() < 1e-5, "{row} {x}");
            }
        }
    }

    const SKIMAGE: [[f32; 5]; 4] = include!("../testdata/sobel_skimage.in");

    #[test]
    fn a_thin_line_gives_a_negative_and_a_positive_gradient() {
        let line = Grid::from_fn(20, 5, |x, _| if x == 10 { 30.0 } else { 70.0 });
        let [gx, _] = gradient(&line, Wrap::Repeat);
        let g = magnitude(&line, Wrap::Repeat);
        for x in 0..20 {
            let right: f32 = match x {
                9 => -20.0,
                11 => 20.0,
                _ => 0.0,
            };
            assert_eq!((gx.samples[40 + x], g.samples[40 + x]), (right, right.abs()), "{x}");
        }
    }

    #[test]
    fn the_length_is_the_magnitude_and_sizes_need_not_fit_the_vectors() {
        let mut rng = Rng::new(8);
        for (width, height) in [(1, 1), (3, 70), (33, 34)] {
            let image = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
            let [gx, gy] = gradient(&image, Wrap::Repeat);
            let (g, fused) = (length(&gx, &gy), magnitude(&image, Wrap::Repeat));
            for (k, (a, b)) in g.samples.iter().zip(&fused.samples).enumerate() {
                assert!((a - b).abs() < 1e-4, "{width}x{height}: {k}");
                let (x, y) = ((k % width) as i64, (k / width) as i64);
                let at = |u: i64, v: i64| image.row(y + v, Wrap::Repeat)[Wrap::Repeat.index(x + u, width)];
                let side = |u| at(u, -1) + 2.0 * at(u, 0) + at(u, 1);
                assert!((gx.samples[k] - (side(1) - side(-1)) / 8.0).abs() < 1e-4);
            }
        }
        let flat = Grid::from_fn(9, 9, |_, _| 3.0);
        assert!(magnitude(&flat, Wrap::Repeat).samples.iter().all(|g| *g == 0.0));
    }
}
