//! A damped sine over half a Fourier frame, as a sum of a few bins.

use crate::statistics::linear::inverse;
use realfft::num_complex::Complex;
use std::f64::consts::{PI, TAU};

type C = Complex<f64>;

/// Maximum number of bins of a mode.
pub(crate) const MAX_BINS: usize = 12;
/// Weight of the first and of the last sample of a hop, as a fraction of the length of the hop. It takes 10 dB from the step between hops
/// and adds 2 dB to the mean error.
const END_WEIGHT: f64 = 0.125;

/// Fits damped sines over one hop by the bins of a frame of two hops.
///
/// Only the first half of a frame of `N` samples is used, so the second half is free. The fit is the sum of the bins nearest to a mode that
/// has the least squared error over the half, with additional weight on its two ends. Every hop follows from the states of the
/// modes at its start: hops do not overlap, there is no latency, and a new impulse changes nothing before it.
///
/// Error relative to a mode at the worst offset between two bins, in dB, over the whole hop, and step from one hop to the next:
///
/// | bins | d N/fs <= 1.2 | step | d N/fs = 4.65 | step |
/// |---|---|---|---|---|
/// | 3 | -25 | -18 | -18 | -21 |
/// | 5 | -42 | -39 | -34 | -41 |
/// | 7 | -59 | -59 | -50 | -61 |
/// | 9 | -76 | -78 | -67 | -80 |
/// | 12 | -100 | -113 | -91 | -108 |
///
/// # Source
/// Bonneel, Drettakis, Tsingos, Viaud-Delmon and James, "Fast modal sounds with scalable frequency-domain synthesis" (ACM TOG 27(3),
/// 2008), add bins of windowed frames that overlap. With Hann windows five bins leave -32 dB for d N/fs <= 1.2 and -18 dB for 4.65, and the
/// state of a new impulse would have to fade in over a hop.
#[derive(Clone, Debug)]
pub(crate) struct HopFit {
    /// Length of the frame, samples.
    size: usize,
    bins: usize,
    /// Inverse of the matrix of scalar products of the bins, row by row. They are centred in the hop, so it is real.
    inverse: Vec<f64>,
}

/// The complex number of magnitude 1 at an angle.
fn turn(angle: f64) -> C {
    C::new(libm::cos(angle), libm::sin(angle))
}

/// Hyperbolic sine and cosine of `x + iy`, from those of `x` and from `exp(i y)`.
fn hyperbolic([sinh, cosh]: [f64; 2], y: C) -> [C; 2] {
    [C::new(sinh * y.re, cosh * y.im), C::new(cosh * y.re, sinh * y.im)]
}

/// Hyperbolic sine and cosine of a real number.
fn real_hyperbolic(x: f64) -> [f64; 2] {
    [libm::sinh(x), libm::cosh(x)]
}

impl HopFit {
    /// Creates the fit for frames of `size` samples, an even number, and `bins` bins from 1 to [`MAX_BINS`].
    pub fn new(size: usize, bins: usize) -> Self {
        let (bins, hop) = (bins.clamp(1, MAX_BINS), (size / 2) as f64);
        let scalar_product = |a: usize, b: usize| {
            let distance = TAU * (b as f64 - a as f64) / size as f64;
            let sum = if a == b { hop } else { libm::sin(0.5 * distance * hop) / libm::sin(0.5 * distance) };
            sum + 2.0 * END_WEIGHT * hop * libm::cos(0.5 * distance * (hop - 1.0))
        };
        let matrix: Vec<f64> = (0..bins * bins).map(|k| scalar_product(k / bins, k % bins)).collect();
        // It is positive definite.
        Self { size, bins, inverse: inverse(&matrix, bins).unwrap_or_default() }
    }

    /// Finds the bins of a mode that decays by `decay` nepers and turns by `angle` radians per sample.
    ///
    /// With a state `z` before the hop, its samples are the imaginary parts of `z exp((-decay + i angle) (j + 1))`, `j` from 0. They are the
    /// inverse real transform, without scale, of `z` times the coefficients written to `re` and `im`, at the bins from the returned one on.
    /// A bin below 0 or above half the frame stands for its mirror image, conjugated; one at 0 or at half the frame has twice its real part.
    ///
    /// # Complexity
    /// O(bins^2).
    pub fn coefficients(&self, decay: f64, angle: f64, re: &mut [f32], im: &mut [f32]) -> i32 {
        let (size, hop) = (self.size as f64, (self.size / 2) as f64);
        let centre = 0.5 * (hop - 1.0);
        let lowest = (angle * size / TAU - 0.5 * self.bins as f64).ceil();
        // From bin to bin: u = -decay + i (angle - 2 pi bin / N), x = u hop / 2, y = u / 2.
        let offset = angle - TAU * lowest / size;
        let [mut sinh_x, mut cosh_x] =
            hyperbolic(real_hyperbolic(-0.5 * decay * hop), turn(0.5 * offset * hop));
        let of_decay = real_hyperbolic(-0.5 * decay);
        let (mut y, next_y) = (turn(0.5 * offset), turn(-PI / size));
        let mut products = [C::ZERO; MAX_BINS];
        for product in &mut products[..self.bins] {
            let [sinh_y, cosh_y] = hyperbolic(of_decay, y);
            let ends = cosh_x * cosh_y - sinh_x * sinh_y;
            *product = sinh_x / sinh_y + ends * (2.0 * END_WEIGHT * hop);
            // A turn by -i.
            (sinh_x, cosh_x) = (C::new(cosh_x.im, -cosh_x.re), C::new(sinh_x.im, -sinh_x.re));
            y *= next_y;
        }
        // The product with -i / 2 makes imaginary parts of real ones.
        let middle = turn(angle * (1.0 + centre)) * (0.5 * libm::exp(-decay * (1.0 + centre)));
        let mut factor = C::new(middle.im, -middle.re) * turn(-TAU * lowest / size * centre);
        let next_factor = turn(-TAU / size * centre);
        for (row, (re, im)) in self.inverse.chunks_exact(self.bins).zip(re.iter_mut().zip(im)) {
            let sum: C = row.iter().zip(&products).map(|(x, product)| product * x).sum();
            let coefficient = sum * factor;
            (*re, *im) = (coefficient.re as f32, coefficient.im as f32);
            factor *= next_factor;
        }
        lowest as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::linear_to_db;

    const FS: f64 = 44_100.0;

    /// The error of a mode of state `z` in dB of its hop, and that of its last sample less that of the first of the next, of 1.
    fn errors(size: usize, bins: usize, bin: f64, d: f64, phase: f64) -> [f64; 2] {
        let fit = HopFit::new(size, bins);
        let (decay, angle) = (d / FS, TAU * bin / size as f64);
        let (mut re, mut im) = ([0.0; MAX_BINS], [0.0; MAX_BINS]);
        let lowest = fit.coefficients(decay, angle, &mut re, &mut im);
        let z = turn(phase);
        let right = |j: f64| (-decay * (j + 1.0)).exp() * (phase + angle * (j + 1.0)).sin();
        let sample = |z: C, j: usize| {
            let mut sum = 0.0;
            for (k, (re, im)) in re.iter().zip(&im).take(bins).enumerate() {
                let value = z * C::new(f64::from(*re), f64::from(*im));
                let at = TAU * f64::from(lowest + k as i32) * j as f64 / size as f64;
                sum += 2.0 * (value.re * at.cos() - value.im * at.sin());
            }
            sum
        };
        let hop = size / 2;
        let [mut error, mut power] = [0.0, 0.0];
        for j in 0..hop {
            error += (sample(z, j) - right(j as f64)).powi(2);
            power += right(j as f64).powi(2);
        }
        let next = z * turn(angle * hop as f64) * (-decay * hop as f64).exp();
        let (last, first) =
            (sample(z, hop - 1) - right(hop as f64 - 1.0), sample(next, 0) - right(hop as f64));
        [0.5 * linear_to_db(error / power), linear_to_db((last - first).abs())]
    }

    #[test]
    fn the_error_of_a_hop_is_that_stated() {
        let stated = [
            (3, [-25.0, -18.0], [-18.0, -21.0]),
            (5, [-42.0, -39.0], [-34.0, -41.0]),
            (7, [-59.0, -59.0], [-50.0, -61.0]),
            (9, [-76.0, -78.0], [-67.0, -80.0]),
            (12, [-100.0, -113.0], [-91.0, -108.0]),
        ];
        for (bins, slow, fast) in stated {
            for (d, stated) in [(0.5, slow), (50.0, slow), (200.0, fast)] {
                let mut worst = [-300.0_f64; 2];
                for k in 0..=40 {
                    let found = errors(1024, bins, 100.0 + 0.025 * f64::from(k), d, 0.3 * f64::from(k));
                    worst = [0, 1].map(|i| worst[i].max(found[i]));
                }
                assert!(worst[0] < stated[0] + 0.5 && worst[1] < stated[1] + 0.5, "{bins} {d}: {worst:?}");
            }
        }
    }

    #[test]
    fn bins_below_zero_and_above_half_the_frame_are_fitted_as_any() {
        for bin in [0.3, 1.0, 2.4, 510.0, 501.7] {
            for size in [128, 1024] {
                let [error, _] = errors(size, 5, bin * size as f64 / 1024.0, 20.0, 0.8);
                assert!(error < -30.0, "{bin} of {size}: {error} dB");
            }
        }
    }
}
