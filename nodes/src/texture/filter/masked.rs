//! Filters of images with holes.

use super::kernel::Kernel;
use super::separable::smooth;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::holes::is_hole;

/// A value far from any luminance.
const OUTLIER: f32 = 1e6;

/// Sets holes to an outlier value, so that a filter that weights by similarity ignores them.
#[must_use]
pub fn holes_as_outliers(grid: &Grid, holes: &[bool]) -> Grid {
    let value = |(k, x): (usize, &f32)| if is_hole(holes, k) { OUTLIER } else { *x };
    Grid { samples: grid.samples.iter().enumerate().map(value).collect(), ..*grid }
}

/// Blurs an image without its holes and its values that are not finite; the result is NaN there.
///
/// # Complexity
/// As [`smooth`], twice if there are holes.
#[must_use]
pub fn smooth_masked(grid: &Grid, holes: &[bool], kernel: &Kernel, wrap: Wrap) -> Grid {
    let missing = |k: usize, x: f32| is_hole(holes, k) || !x.is_finite();
    if !grid.samples.iter().enumerate().any(|(k, x)| missing(k, *x)) {
        return smooth(grid, kernel, wrap);
    }
    let map = |f: &dyn Fn(usize, f32) -> f32| Grid {
        samples: grid.samples.iter().enumerate().map(|(k, x)| f(k, *x)).collect(),
        ..*grid
    };
    let inside = map(&|k, x| f32::from(u8::from(!missing(k, x))));
    let filled = map(&|k, x| if missing(k, x) { 0.0 } else { x });
    let [mut sums, weights] = [filled, inside].map(|grid| smooth(&grid, kernel, wrap));
    for (k, (sum, weight)) in sums.samples.iter_mut().zip(&weights.samples).enumerate() {
        *sum = if missing(k, grid.samples[k]) { f32::NAN } else { *sum / weight };
    }
    sums
}
