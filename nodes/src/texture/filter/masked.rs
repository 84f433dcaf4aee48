//! Filters of images with holes.

use super::kernel::Kernel;
use super::separable::smooth;
use crate::texture::grid::{Grid, Wrap};
use crate::texture::holes::is_hole;

/// A tone so far from any luminance that no pixel looks like it.
const NOWHERE: f32 = 1e6;

/// An image whose holes look like no pixel of it: a filter that asks who looks alike passes over them.
#[must_use]
pub fn apart(grid: &Grid, holes: &[bool]) -> Grid {
    let each = |(k, x): (usize, &f32)| if is_hole(holes, k) { NOWHERE } else { *x };
    Grid { samples: grid.samples.iter().enumerate().map(each).collect(), ..*grid }
}

/// A blurred image, in which holes and what is not finite do not count; not a number where they are.
///
/// # Complexity
/// As [`smooth`], twice where there are holes.
#[must_use]
pub fn smooth_around(grid: &Grid, holes: &[bool], kernel: &Kernel, wrap: Wrap) -> Grid {
    let missing = |k: usize, x: f32| is_hole(holes, k) || !x.is_finite();
    if !grid.samples.iter().enumerate().any(|(k, x)| missing(k, *x)) {
        return smooth(grid, kernel, wrap);
    }
    let each = |f: &dyn Fn(usize, f32) -> f32| Grid {
        samples: grid.samples.iter().enumerate().map(|(k, x)| f(k, *x)).collect(),
        ..*grid
    };
    let inside = each(&|k, x| f32::from(u8::from(!missing(k, x))));
    let filled = each(&|k, x| if missing(k, x) { 0.0 } else { x });
    let [mut sums, weights] = [filled, inside].map(|grid| smooth(&grid, kernel, wrap));
    for (k, (sum, weight)) in sums.samples.iter_mut().zip(&weights.samples).enumerate() {
        *sum = if missing(k, grid.samples[k]) { f32::NAN } else { *sum / weight };
    }
    sums
}
