//! Symmetric kernels: Gaussian, binomial and a windowed low-pass.

use std::f64::consts::{PI, TAU};

/// A symmetric kernel of odd length: its weights from the middle outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel(Vec<f32>);

impl Kernel {
    /// A Gaussian of standard deviation `sigma` pixels, cut off at `truncate` standard deviations, of sum 1.
    ///
    /// The kernel is that of `scipy.ndimage.gaussian_filter` with the same `truncate`. A `sigma` of 0 is the identity.
    #[must_use]
    pub fn gaussian(sigma: f64, truncate: f64) -> Self {
        let radius = (truncate * sigma + 0.5).clamp(0.0, 4096.0) as usize;
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

    /// A low-pass filter: within 0.5 dB up to 0.13 cycles per pixel, -6 dB at 0.16, and at most -63 dB from 0.21 on.
    ///
    /// The filtered image can be decimated by 2, and interpolated by a cubic spline with spectral images below -63 dB.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_sum_to_one_and_follow_the_formula() {
        let kernel = Kernel::gaussian(1.0, 4.0);
        assert_eq!(kernel.radius(), 4);
        let w = kernel.weights();
        assert!((w[0] + 2.0 * w[1..].iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((w[1] / w[0] - (-0.5_f32).exp()).abs() < 1e-6);
        assert_eq!(Kernel::gaussian(0.0, 4.0).weights(), [1.0]);
    }
}
