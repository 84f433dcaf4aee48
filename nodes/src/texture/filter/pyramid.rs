//! Image pyramids: halved densities for fast contacts, without aliasing.

use super::kernel::Kernel;
use super::rows::map_rows;
use super::separable::smooth;
use crate::texture::grid::{Grid, Wrap};

/// Width in octaves of the transition between two levels: from steps of 2 to 2.5 pixels of the finer one.
const TRANSITION: f32 = 0.321_928_1;

/// One level of a [`Pyramid`].
#[derive(Clone, Debug, PartialEq)]
pub struct PyramidLevel {
    /// The image.
    pub grid: Grid,
    /// Distance between pixels in pixels of the full image, along x and y: pixel `i` lies at `i * scale`.
    pub scale: [f64; 2],
}

/// An image, a low-pass filtered copy, and successive halvings of that, down to a single pixel.
///
/// Levels after the first are attenuated by 63 dB above a fifth of a cycle per pixel. So there is no aliasing when a level is read
/// in steps of up to 2.5 of its pixels, and a cubic spline between the pixels has no spectral images above -60 dB. Up to 0.13
/// cycles per pixel of the level, amplitudes are within 0.5 dB.
///
/// Pixel 0 has the same position on every level: position `u` of the full image is `u / scale` of a level. A periodic image has
/// the same period on all levels; for an odd side the scale is a little below 2.
///
/// # Source
/// Burt and Adelson, "The Laplacian pyramid as a compact image code" (1983). [`Kernel::low_pass`] replaces their filter 1 4 6 4 1,
/// which passes a hundredth of the aliasing frequencies, and levels are twice as dense as theirs.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid {
    /// The levels, from the full image.
    pub levels: Vec<PyramidLevel>,
    /// Continuation of all levels beyond the border.
    pub wrap: Wrap,
}

impl Pyramid {
    /// Computes all levels of an image.
    ///
    /// # Complexity
    /// `O(pixels)`, with additional memory of 4/3 of the image.
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

/// Returns the level for steps of `2^octaves` pixels: 0 up to half a pixel, 1 from one to two pixels. The fraction is the weight of
/// the next level.
///
/// A level is read alone up to steps of two of its pixels, since the next level has less detail. It has no weight from 2.5 pixels
/// on, where aliasing would begin.
#[inline(always)]
pub(crate) fn level_for(octaves: f32) -> f32 {
    if octaves <= 0.0 {
        return (1.0 + octaves).max(0.0);
    }
    let coarser = (octaves - 1.0).max(0.0);
    let steps = coarser.floor();
    1.0 + steps + ((coarser - steps) / TRANSITION).min(1.0)
}

/// Pixels of a halved side, and the step between them: a little below 2 for a periodic odd side.
fn half(len: usize, wrap: Wrap) -> (usize, f64) {
    let half = len.div_ceil(2).max(1);
    let step = match wrap {
        _ if len <= 1 => 1.0,
        Wrap::Repeat => len as f64 / half as f64,
        Wrap::Mirror | Wrap::Clamp => 2.0,
    };
    (half, step)
}

/// Decimates a low-pass filtered level by 2.
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

/// Position of pixel `k` among pixels `step` times as dense, as integer and fraction.
fn split(k: usize, step: f64) -> (i64, f32) {
    let position = k as f64 * step;
    (position.floor() as i64, position.fract() as f32)
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
    fn levels_of_a_periodic_image_have_its_mean() {
        let image = Grid::from_fn(64, 32, |x, y| ((x * 7 + y * 13) % 31) as f32);
        let mean = |grid: &Grid| grid.samples.iter().sum::<f32>() / grid.samples.len() as f32;
        let pyramid = Pyramid::new(image, Wrap::Repeat);
        let right = mean(&pyramid.levels[0].grid);
        for level in &pyramid.levels {
            assert!((mean(&level.grid) - right).abs() < 1e-3, "{} against {right}", mean(&level.grid));
        }
    }

    /// Response of the filter at `w` radians per pixel.
    fn response(w: f64) -> f64 {
        let kernel = Kernel::low_pass();
        let weights = kernel.weights().iter().map(|x| f64::from(*x));
        let sum: f64 = weights.enumerate().map(|(t, x)| 2.0 * x * (w * t as f64).cos()).sum();
        sum - f64::from(kernel.weights()[0])
    }

    #[test]
    fn the_filter_has_its_documented_response() {
        let level = |cycles: f64| 20.0 * response(TAU * cycles).abs().log10();
        assert!((0..=13).all(|k| level(0.01 * f64::from(k)).abs() < 0.5));
        assert!((210..=500).all(|k| level(0.001 * f64::from(k)) < -62.9));
        // The spectral image of a wave: the spline attenuates it by the fourth power of a sinc.
        for k in 1..500 {
            let f = 0.001 * f64::from(k);
            let x = TAU / 2.0 * (1.0 - f);
            let image = level(f) + 80.0 * (x.sin() / x).abs().log10();
            assert!(image < -63.0, "{f}: {image} dB");
        }
    }

    #[test]
    fn a_wave_has_the_same_phase_on_all_levels_and_the_response_of_the_filter() {
        // Three waves over a period of odd width.
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
    fn a_constant_is_constant_on_all_levels_at_any_border() {
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
        // It never decreases, and never jumps.
        let mut before = 0.0;
        for k in -300..1000 {
            let now = level_for(0.01 * k as f32);
            assert!(now >= before && now - before < 0.04, "{k}: {before} {now}");
            before = now;
        }
    }
}
