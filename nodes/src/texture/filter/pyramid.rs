//! Images at half, a quarter, an eighth of their density: what a fast contact reads, so that nothing folds down.

use super::kernel::Kernel;
use super::rows::map_rows;
use super::separable::smooth;
use crate::texture::grid::{Grid, Wrap};

/// Octaves over which a level takes over from the one before: from steps of two of that one's pixels to two and a half.
const TAKE_OVER: f32 = 0.321_928_1;

/// One level of a [`Pyramid`].
#[derive(Clone, Debug, PartialEq)]
pub struct PyramidLevel {
    /// The image.
    pub grid: Grid,
    /// Pixels of the full image from one pixel of this one to the next, along x and y: pixel `i` lies at `i * scale`.
    pub scale: [f64; 2],
}

/// An image, the same without what is finest in it, and halvings of that, down to a single pixel.
///
/// Levels but the first hold nothing above a fifth of a cycle per pixel: 63 dB below what it was. So none folds down when it is
/// read in steps of up to two and a half of its pixels, and what a cubic spline draws between the pixels has no images above -60 dB. Waves
/// keep their size within 0.5 dB up to 0.13 cycles per pixel of the level.
///
/// Pixel 0 lies in the same place on every level, so that place `u` of the full image is `u / scale` of a level. An image that
/// repeats has the same period on all levels: where a side is odd, the scale is a little below 2 instead.
///
/// # Source
/// Burt and Adelson, "The Laplacian pyramid as a compact image code" (1983), whose filter 1 4 6 4 1 lets through a hundredth of what then
/// folds down; [`Kernel::low_pass`] is in its place, and levels are twice as dense as theirs.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid {
    /// The full image first.
    pub levels: Vec<PyramidLevel>,
    /// What lies beyond the border, of all levels.
    pub wrap: Wrap,
}

impl Pyramid {
    /// All levels of an image.
    ///
    /// # Complexity
    /// `O(pixels)`; four thirds more memory than the image.
    #[must_use]
    pub fn new(image: Grid, wrap: Wrap) -> Self {
        let mut levels = vec![PyramidLevel { grid: image, scale: [1.0; 2] }];
        while let Some(last) = levels.last() {
            if last.grid.width <= 1 && last.grid.height <= 1 {
                break;
            }
            let PyramidLevel { grid, scale } =
                if levels.len() > 1 { halved(last, wrap) } else { last.clone() };
            levels.push(PyramidLevel { grid: smooth(&grid, &Kernel::low_pass(), wrap), scale });
        }
        Self { levels, wrap }
    }
}

/// Which level to read where the binary logarithm of a step in pixels is `octaves`: 0 up to half a pixel, 1 from one to two pixels. The
/// part behind the point says how far to go over to the next level.
///
/// A level is read alone for as long as the next one would lack what it still holds, up to steps of two of its pixels; it is gone at
/// two and a half, where it would begin to fold.
#[inline(always)]
pub(crate) fn level_for(octaves: f32) -> f32 {
    if octaves <= 0.0 {
        return (1.0 + octaves).max(0.0);
    }
    let beyond = (octaves - 1.0).max(0.0);
    let whole = beyond.floor();
    1.0 + whole + ((beyond - whole) / TAKE_OVER).min(1.0)
}

/// How many pixels half of a side has, and the step between them: just under 2 where an odd side repeats.
fn half(len: usize, wrap: Wrap) -> (usize, f64) {
    let half = len.div_ceil(2).max(1);
    let step = match wrap {
        _ if len <= 1 => 1.0,
        Wrap::Repeat => len as f64 / half as f64,
        Wrap::Mirror | Wrap::Clamp => 2.0,
    };
    (half, step)
}

/// Every other pixel of a level that holds nothing which would fold down.
fn halved(above: &PyramidLevel, wrap: Wrap) -> PyramidLevel {
    let image = &above.grid;
    let ((width, step_x), (height, step_y)) = (half(image.width, wrap), half(image.height, wrap));
    let grid = map_rows(
        width,
        height,
        || (),
        |(), y, out| {
            let (y, down) = split(y, step_y);
            let (upper, lower) = (image.row(y, wrap), image.row(y + 1, wrap));
            for (x, out) in out.iter_mut().enumerate() {
                let (x, right) = split(x, step_x);
                let at =
                    |row: &[f32], x: i64| row.get(wrap.index(x, image.width)).copied().unwrap_or_default();
                let along = |row| at(row, x) + right * (at(row, x + 1) - at(row, x));
                *out = along(upper) + down * (along(lower) - along(upper));
            }
        },
    );
    PyramidLevel { grid, scale: [above.scale[0] * step_x, above.scale[1] * step_y] }
}

/// The place of pixel `k` among pixels `step` times as dense: the one before it, and how far beyond that it lies.
fn split(k: usize, step: f64) -> (i64, f32) {
    let place = k as f64 * step;
    (place.floor() as i64, place.fract() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn every_level_halves_down_to_one_pixel() {
        let pyramid = Pyramid::new(Grid::from_fn(512, 64, |x, y| (x * y) as f32), Wrap::Repeat);
        let sizes: Vec<_> = pyramid.levels.iter().map(|l| (l.grid.width, l.grid.height)).collect();
        assert_eq!(sizes[..4], [(512, 64), (512, 64), (256, 32), (128, 16)]);
        assert_eq!((sizes.len(), sizes[10]), (11, (1, 1)));
        assert_eq!(pyramid.levels[4].scale, [8.0, 8.0]);
        assert_eq!(pyramid.levels[10].scale, [512.0, 64.0]);
    }

    #[test]
    fn the_mean_of_an_image_that_repeats_is_kept() {
        let image = Grid::from_fn(64, 32, |x, y| ((x * 7 + y * 13) % 31) as f32);
        let mean = |grid: &Grid| grid.samples.iter().sum::<f32>() / grid.samples.len() as f32;
        let pyramid = Pyramid::new(image, Wrap::Repeat);
        let right = mean(&pyramid.levels[0].grid);
        for level in &pyramid.levels {
            assert!((mean(&level.grid) - right).abs() < 1e-3, "{} against {right}", mean(&level.grid));
        }
    }

    /// What the filter leaves of a wave of `w` radians per pixel.
    fn response(w: f64) -> f64 {
        let kernel = Kernel::low_pass();
        let weights = kernel.weights().iter().map(|x| f64::from(*x));
        let sum: f64 = weights.enumerate().map(|(t, x)| 2.0 * x * (w * t as f64).cos()).sum();
        sum - f64::from(kernel.weights()[0])
    }

    #[test]
    fn the_filter_keeps_and_takes_what_it_says() {
        let level = |cycles: f64| 20.0 * response(TAU * cycles).abs().log10();
        assert!((0..=13).all(|k| level(0.01 * f64::from(k)).abs() < 0.5));
        assert!((210..=500).all(|k| level(0.001 * f64::from(k)) < -62.9));
        // The image of a wave, which the spline takes to the fourth power of a sinc.
        for k in 1..500 {
            let f = 0.001 * f64::from(k);
            let x = TAU / 2.0 * (1.0 - f);
            let image = level(f) + 80.0 * (x.sin() / x).abs().log10();
            assert!(image < -63.0, "{f}: {image} dB");
        }
    }

    #[test]
    fn a_wave_keeps_its_place_and_loses_what_the_filter_takes() {
        // Three waves over an odd width that repeats: every level shows the same three.
        for width in [64, 63, 61] {
            let wave = |x: f64| (TAU * 3.0 * x / width as f64 + 0.4).cos();
            let image = Grid::from_fn(width, 8, |x, _| wave(x as f64) as f32);
            let pyramid = Pyramid::new(image, Wrap::Repeat);
            let mut height = 1.0;
            for (k, level) in pyramid.levels[..4].iter().enumerate() {
                assert!((level.scale[0] * level.grid.width as f64 - width as f64).abs() < 1e-9);
                for (x, value) in level.grid.samples[..level.grid.width].iter().enumerate() {
                    let right = height * wave(x as f64 * level.scale[0]);
                    let allowed = if width % 2 == 0 { 1e-5 } else { 0.06 };
                    assert!((f64::from(*value) - right).abs() < allowed, "{width}: {x}: {value} {right}");
                }
                let next = if k == 0 { 1.0 } else { 2.0 * level.scale[0] };
                height *= response(TAU * 3.0 / width as f64 * next);
            }
        }
    }

    #[test]
    fn a_constant_stays_whatever_lies_beyond_the_border() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let pyramid = Pyramid::new(Grid::from_fn(37, 21, |_, _| 5.0), wrap);
            let flat = |level: &PyramidLevel| level.grid.samples.iter().all(|x| (x - 5.0).abs() < 1e-5);
            assert!(pyramid.levels.iter().all(flat), "{wrap:?}");
        }
    }

    #[test]
    fn the_level_follows_the_step() {
        for (step, level) in [
            (0.01, 0.0),
            (0.5, 0.0),
            (1.0, 1.0),
            (1.9, 1.0),
            (2.0, 1.0),
            (2.5, 2.0),
            (4.0, 2.0),
            (5.0, 3.0),
            (7.9, 3.0),
            (10.0, 4.0),
        ] {
            let found = level_for(f32::log2(step));
            assert!((found - level).abs() < 1e-4, "{step}: {found}");
        }
        let half = level_for(f32::log2(2.0 * 1.25_f32.sqrt()));
        assert!((half - 1.5).abs() < 1e-4, "{half}");
        // It never goes back, and never jumps.
        let mut before = 0.0;
        for k in -300..1000 {
            let now = level_for(0.01 * k as f32);
            assert!(now >= before && now - before < 0.04, "{k}: {before} {now}");
            before = now;
        }
    }
}
