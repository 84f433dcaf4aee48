//! Gradients of an image by the Sobel operator, in units of luminance per pixel.
//!
//! `gx = [1 2 1]^T [-1 0 1] / 8 * L`, `gy` transposed. A ramp of one unit per pixel results in exactly 1.
//!
//! # Source
//! Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.1.

use super::rows::{map_row_pairs, map_rows};
use super::simd::{LANES, store};
use crate::texture::grid::{Grid, Wrap};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};

/// Returns the gradient along x and along y.
///
/// # Complexity
/// `O(pixels)`, without memory in addition to the result.
#[must_use]
pub fn gradient(image: &Grid, wrap: Wrap) -> [Grid; 2] {
    let level = Level::new();
    map_row_pairs(
        image.width,
        image.height,
        || (),
        |(), y, gx, gy| {
            let rows = Rows::around(image, y, wrap);
            dispatch!(level, simd => rows.gradients(simd, #[inline(always)] |x, y, at| {
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
    let level = Level::new();
    map_rows(
        image.width,
        image.height,
        || (),
        |(), y, out| {
            let rows = Rows::around(image, y, wrap);
            dispatch!(level, simd => rows.gradients(simd, #[inline(always)] |x, y, at| {
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

/// A row of an image between its neighbours.
struct Rows<'a> {
    /// The row above, the row and the row below.
    rows: [&'a [f32]; 3],
    wrap: Wrap,
}

/// Sixteen pixels with one more at either end.
const WINDOW: usize = LANES + 2;

impl<'a> Rows<'a> {
    fn around(image: &'a Grid, y: usize, wrap: Wrap) -> Self {
        Self { rows: [-1, 0, 1].map(|t| image.row(y as i64 + t, wrap)), wrap }
    }

    /// Calls `emit` with the gradient along x and y of sixteen pixels and the index of the first one.
    #[inline(always)]
    fn gradients<S: Simd>(&self, simd: S, mut emit: impl FnMut(f32x16<S>, f32x16<S>, usize)) {
        let [above, row, below] = self.rows;
        let width = above.len().min(row.len()).min(below.len());
        for at in (0..width).step_by(LANES) {
            let [x, y] = if at > 0 && at + LANES < width {
                let window = at - 1..at + LANES + 1;
                sobel(simd, [&above[window.clone()], &row[window.clone()], &below[window]])
            } else {
                let ends = self.rows.map(|row| window_at_end(row, at, self.wrap));
                sobel(simd, [&ends[0], &ends[1], &ends[2]])
            };
            emit(x, y, at);
        }
    }
}

/// Pixels around those from `at` on, some of which are beyond the ends of the row.
fn window_at_end(row: &[f32], at: usize, wrap: Wrap) -> [f32; WINDOW] {
    std::array::from_fn(|k| row.get(wrap.index((at + k) as i64 - 1, row.len())).copied().unwrap_or_default())
}

/// Gradient along x and y of the pixels in the middle of three windows.
#[inline(always)]
fn sobel<S: Simd>(simd: S, windows: [&[f32]; 3]) -> [f32x16<S>; 2] {
    let [left_sum, left_change] = column(simd, windows, 0);
    let [_, change] = column(simd, windows, 1);
    let [right_sum, right_change] = column(simd, windows, 2);
    let (x, y) = (right_sum - left_sum, left_change + (change + change) + right_change);
    [x * 0.125, y * 0.125]
}

/// Sum by 1 2 1 and difference along y, from column `x` on.
#[inline(always)]
fn column<S: Simd>(simd: S, [above, row, below]: [&[f32]; 3], x: usize) -> [f32x16<S>; 2] {
    let a = f32x16::from_slice(simd, &above[x..x + LANES]);
    let b = f32x16::from_slice(simd, &row[x..x + LANES]);
    let c = f32x16::from_slice(simd, &below[x..x + LANES]);
    [a + (b + b) + c, c - a]
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
        let sizes = [(1, 1), (3, 7), (3, 70), (16, 5), (17, 5), (18, 5), (33, 34), (65, 33)];
        for ((width, height), wrap) in sizes
            .into_iter()
            .flat_map(|size| [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].map(|wrap| (size, wrap)))
        {
            let image = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
            let [gx, gy] = gradient(&image, wrap);
            let (g, fused) = (length(&gx, &gy), magnitude(&image, wrap));
            for (k, (a, b)) in g.samples.iter().zip(&fused.samples).enumerate() {
                assert!((a - b).abs() < 1e-4, "{width}x{height} {wrap:?}: {k}");
                let (x, y) = ((k % width) as i64, (k / width) as i64);
                let at = |u: i64, v: i64| image.row(y + v, wrap)[wrap.index(x + u, width)];
                let side = |u| at(u, -1) + (at(u, 0) + at(u, 0)) + at(u, 1);
                let change = |u| at(u, 1) - at(u, -1);
                assert_eq!(gx.samples[k], (side(1) - side(-1)) / 8.0, "{width}x{height} {wrap:?}: {k}");
                let right = (change(-1) + (change(0) + change(0)) + change(1)) / 8.0;
                assert_eq!(gy.samples[k], right, "{width}x{height} {wrap:?}: {k}");
            }
        }
        let flat = Grid::from_fn(9, 9, |_, _| 3.0);
        assert!(magnitude(&flat, Wrap::Repeat).samples.iter().all(|g| *g == 0.0));
    }
}
