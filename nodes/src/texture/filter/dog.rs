//! Main features of an image, by a thresholded difference of Gaussians: lines on the dark side of edges and along grooves.
//!
//! `d = G(sigma_e) * L - tau G(ratio sigma_e) * L`; the feature is `0` if `d > 0`, else `-tanh(phi_e d)`. Luminance must range
//! from 0 to 100: with 0 to 1 the feature at a step from black to white is only 0.21.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2, with the parameters of Winnemoeller, Olsen and Gooch, "Real-time video
//! abstraction" (SIGGRAPH 2006).

use super::kernel::Kernel;
use super::masked::smooth_masked;
use super::separable::{Join, blur};
use super::simd::exp2;
use crate::texture::grid::{Grid, Wrap};
use fearless_simd::prelude::*;
use std::f32::consts::LOG2_E;

/// Number of standard deviations at which the Gaussians are cut off.
const TRUNCATE: f64 = 4.0;

/// Parameters of the difference of Gaussians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DogParams {
    /// Standard deviation of the narrow Gaussian, in pixels.
    pub sigma_e: f64,
    /// Standard deviation of the wide Gaussian over that of the narrow one.
    pub ratio: f64,
    /// Weight of the wide Gaussian: sensitivity to features.
    pub tau: f64,
    /// Sharpness of the soft threshold.
    pub phi_e: f64,
}

impl Default for DogParams {
    fn default() -> Self {
        Self { sigma_e: 1.0, ratio: 1.6_f64.sqrt(), tau: 0.998, phi_e: 4.0 }
    }
}

/// Returns the difference of Gaussians `d`, in units of luminance.
///
/// # Complexity
/// `O(pixels * sigma)`, with a few rows of memory per thread in addition to the result.
#[must_use]
pub fn difference(image: &Grid, params: DogParams, wrap: Wrap) -> Grid {
    blur_both(image, params, wrap, &Difference { tau: params.tau as f32 })
}

/// Returns the features, 0 to 1, of a luminance from 0 to 100.
///
/// # Complexity
/// As [`difference`].
#[must_use]
pub fn features(image: &Grid, params: DogParams, wrap: Wrap) -> Grid {
    // -tanh(phi d) = (1 - e) / (1 + e) with e = exp(2 phi d).
    let steep = 2.0 * params.phi_e as f32 * LOG2_E;
    blur_both(image, params, wrap, &Features { difference: Difference { tau: params.tau as f32 }, steep })
}

/// Returns the features of an image with holes, which have no features and no influence.
///
/// # Complexity
/// As [`difference`], twice.
#[must_use]
pub fn features_masked(image: &Grid, holes: &[bool], params: DogParams, wrap: Wrap) -> Grid {
    let [mut narrow, wide] = [1.0, params.ratio]
        .map(|r| smooth_masked(image, holes, &Kernel::gaussian(r * params.sigma_e, TRUNCATE), wrap));
    for (n, w) in narrow.samples.iter_mut().zip(&wide.samples) {
        let d = *n - params.tau as f32 * w;
        // NaN, in a hole, is no feature either.
        *n = if d < 0.0 { (-params.phi_e as f32 * d).tanh() } else { 0.0 };
    }
    narrow
}

/// Blurs by both Gaussians, and combines the results of each pixel.
fn blur_both(image: &Grid, params: DogParams, wrap: Wrap, join: &impl Join<2>) -> Grid {
    let [narrow, wide] = [1.0, params.ratio].map(|r| Kernel::gaussian(r * params.sigma_e, TRUNCATE));
    blur(image, [&narrow, &wide], wrap, join)
}

/// The narrow Gaussian minus `tau` times the wide one.
struct Difference {
    tau: f32,
}

impl Join<2> for Difference {
    #[inline(always)]
    fn join<S: Simd>(&self, simd: S, [narrow, wide]: [S::f32s; 2]) -> S::f32s {
        wide.mul_add(S::f32s::splat(simd, -self.tau), narrow)
    }
}

/// The soft threshold of a difference.
struct Features {
    difference: Difference,
    /// Factor of the difference in an exponent of base 2.
    steep: f32,
}

impl Join<2> for Features {
    #[inline(always)]
    fn join<S: Simd>(&self, simd: S, blurred: [S::f32s; 2]) -> S::f32s {
        let difference = self.difference.join(simd, blurred);
        let one = S::f32s::splat(simd, 1.0);
        let e = exp2(simd, difference.min(S::f32s::splat(simd, 0.0)) * self.steep);
        (one - e) / (one + e)
    }
}

#[cfg(test)]
mod tests {
    use super::super::separable::smooth;
    use super::*;
    use crate::core::random::Rng;

    /// A step along x, dark to the left of column 40.
    fn step(dark: f32, bright: f32) -> Grid {
        Grid::from_fn(80, 6, |x, _| if x < 40 { dark } else { bright })
    }

    #[test]
    fn steps_give_the_features_that_the_formula_gives() {
        let cube = 1.6_f64.cbrt();
        let root = 1.6_f64.sqrt();
        // Ratio, tau, step; minimum difference, pixels with E < 0.5, minimum E.
        for (ratio, tau, dark, bright, min_difference, count, min_e) in [
            (root, 0.998, 0.0, 100.0, -5.278, 4, 0.0),
            (root, 0.998, 40.0, 60.0, -0.976, 3, 0.0008),
            (root, 0.98, 40.0, 60.0, -0.215, 1, 0.3029),
            (cube, 0.998, 0.0, 100.0, -3.405, 3, 0.0),
            (cube, 0.998, 40.0, 60.0, -0.601, 2, 0.0162),
        ] {
            let params = DogParams { ratio, tau, ..DogParams::default() };
            let d = difference(&step(dark, bright), params, Wrap::Clamp);
            let f = features(&step(dark, bright), params, Wrap::Clamp);
            let (at, min) = (0..80).map(|x| (x, d.samples[x])).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            assert!((min - min_difference).abs() < 6e-4, "{ratio} {tau} {dark}: {min} at {at}");
            assert_eq!(at, 38, "the second pixel on the dark side");
            assert_eq!(
                f.samples[..80].iter().filter(|f| 1.0 - **f < 0.5).count(),
                count,
                "{ratio} {tau} {dark}"
            );
            let e = 1.0 - f.samples[..80].iter().copied().fold(0.0, f32::max);
            assert!((e - min_e).abs() < 2e-4, "{ratio} {tau} {dark}: {e}");
        }
        let flat = difference(&Grid::from_fn(20, 20, |_, _| 40.0), DogParams::default(), Wrap::Repeat);
        assert!(flat.samples.iter().all(|d| (d - 0.08).abs() < 1e-4));
    }

    #[test]
    fn the_difference_is_that_of_two_blurred_images() {
        let mut rng = Rng::new(7);
        let params = DogParams { sigma_e: 1.0, ratio: 1.6, tau: 0.9, ..DogParams::default() };
        let kernels = [1.0, 1.6].map(|sigma| Kernel::gaussian(sigma, TRUNCATE));
        for (width, height) in [(1, 1), (3, 7), (65, 33), (7, 150), (1100, 5)] {
            let image = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let [narrow, wide] = kernels.each_ref().map(|kernel| smooth(&image, kernel, wrap));
                let d = difference(&image, params, wrap);
                for (d, (narrow, wide)) in d.samples.iter().zip(narrow.samples.iter().zip(&wide.samples)) {
                    assert!((d - (narrow - 0.9 * wide)).abs() < 4e-5, "{width}x{height} {wrap:?}");
                }
            }
        }
    }

    #[test]
    fn a_narrow_groove_is_one_line_and_a_wide_one_is_two() {
        for width in 1..=12 {
            let groove = Grid::from_fn(80, 4, |x, _| if (40..40 + width).contains(&x) { 20.0 } else { 70.0 });
            let f = features(&groove, DogParams::default(), Wrap::Repeat);
            let dark: Vec<bool> = f.samples[..80].iter().map(|f| *f > 0.5).collect();
            let lines = dark.windows(2).filter(|w| !w[0] && w[1]).count();
            assert_eq!(lines, if width <= 4 { 1 } else { 1 + usize::from(width >= 8) }, "{width} px");
        }
    }

    #[test]
    fn flat_images_have_no_features_and_features_stay_within_0_and_1() {
        for level in [0.0, 1.0, 50.0, 100.0] {
            let flat = Grid::from_fn(33, 17, |_, _| level);
            assert!(features(&flat, DogParams::default(), Wrap::Mirror).samples.iter().all(|f| *f == 0.0));
        }
        let mut rng = Rng::new(1);
        let noise = Grid::from_fn(50, 50, |_, _| rng.between(0.0, 100.0) as f32);
        let f = features(&noise, DogParams::default(), Wrap::Repeat);
        assert!(f.samples.iter().all(|f| (0.0..=1.0).contains(f)));
        let d = difference(&noise, DogParams::default(), Wrap::Repeat);
        for (f, d) in f.samples.iter().zip(d.samples) {
            let right = if d > 0.0 { 0.0 } else { -(4.0 * f64::from(d)).tanh() };
            assert!((f64::from(*f) - right).abs() < 1e-6, "{f} {right}");
        }
    }

    #[test]
    fn a_shifted_image_has_shifted_features_where_it_repeats() {
        let mut rng = Rng::new(2);
        let (w, h) = (37, 23);
        let image = Grid::from_fn(w, h, |_, _| rng.between(0.0, 100.0) as f32);
        let shifted = Grid::from_fn(w, h, |x, y| image.samples[(y + 5) % h * w + (x + 11) % w]);
        let f = features(&image, DogParams::default(), Wrap::Repeat);
        let g = features(&shifted, DogParams::default(), Wrap::Repeat);
        for (k, g) in g.samples.iter().enumerate() {
            assert!((g - f.samples[(k / w + 5) % h * w + (k % w + 11) % w]).abs() < 1e-5);
        }
    }

    #[test]
    fn luminance_from_0_to_1_gives_features_of_at_most_021() {
        let f = features(&step(0.0, 1.0), DogParams::default(), Wrap::Clamp);
        let max = f.samples.iter().copied().fold(0.0, f32::max);
        assert!((max - 0.21).abs() < 0.01, "{max}");
    }

    #[test]
    fn holes_make_no_features_of_their_own() {
        let image = Grid::from_fn(64, 48, |x, _| if x % 16 < 3 { 20.0 } else { 70.0 });
        let none = vec![false; 64 * 48];
        let plain = features(&image, DogParams::default(), Wrap::Repeat);
        let same = features_masked(&image, &none, DogParams::default(), Wrap::Repeat);
        for (a, b) in plain.samples.iter().zip(&same.samples) {
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
        let flat = Grid::from_fn(64, 48, |x, _| if x < 30 { 0.0 } else { 70.0 });
        let holes: Vec<bool> = (0..64 * 48).map(|k| k % 64 < 30).collect();
        let found = features_masked(&flat, &holes, DogParams::default(), Wrap::Clamp);
        assert!(found.samples.iter().all(|f| *f == 0.0), "the edge of a hole is no feature");
    }
}
