//! Power spectrum of windowed frames, in double precision.

use fearless_simd::{Level, dispatch};
use foley_fft::FftPlanner;
use realfft::num_complex::Complex;
use rustfft::Fft;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Bins that are computed together.
const LANES: usize = 8;

/// Squared magnitudes of the spectrum of frames under a window.
///
/// A frame of real samples is transformed as half as many complex ones: even samples are their real parts, odd ones their imaginary parts.
#[derive(Clone)]
pub struct FramePower {
    window: Vec<f64>,
    fft: Arc<dyn Fft<f64>>,
    /// `exp(-i pi k / m)` for bin `k` from 1 to half of the bins, `m` the length of the transform.
    twiddles: Vec<Complex<f64>>,
    samples: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    power: Vec<f64>,
    scale: f64,
    level: Level,
}

impl FramePower {
    /// Plans the transform of `length` samples, of which the window has at most as many. Squared magnitudes are multiplied by `scale`, half of
    /// it for the first and the last bin.
    ///
    /// # Panics
    /// If `length` is odd or 0.
    #[must_use]
    pub fn new(window: Vec<f64>, length: usize, scale: f64) -> Self {
        assert!(length > 0 && length.is_multiple_of(2), "a transform of {length} samples has no halves");
        let half = length / 2;
        let fft = FftPlanner::new().plan_fft_forward(half);
        let twiddle = |k: usize| Complex::from_polar(1.0, -TAU * k as f64 / length as f64);
        Self {
            window,
            twiddles: (1..=half / 2).map(twiddle).collect(),
            samples: vec![Complex::default(); half],
            scratch: vec![Complex::default(); fft.get_inplace_scratch_len()],
            power: vec![0.0; half + 1],
            scale,
            fft,
            level: Level::new(),
        }
    }

    /// Samples under the window.
    #[must_use]
    pub fn frame(&self) -> usize {
        self.window.len()
    }

    /// The squared magnitudes of a frame; samples that are missing are 0.
    ///
    /// # Shapes
    /// `[length / 2 + 1]`
    pub fn process(&mut self, frame: &[f32]) -> &[f64] {
        let Self { window, samples, power, twiddles, .. } = self;
        dispatch!(self.level, _simd => fill(frame, window, samples));
        self.fft.process_with_scratch(samples, &mut self.scratch);
        dispatch!(self.level, _simd => powers(samples, twiddles, self.scale, power));
        &self.power
    }
}

/// Windowed samples in pairs; all instruction sets compute the same bits, as in [`powers`].
#[inline(always)]
fn fill(frame: &[f32], window: &[f64], samples: &mut [Complex<f64>]) {
    let len = frame.len().min(window.len());
    let (pairs, last) = frame[..len].as_chunks::<2>();
    let (weights, last_weight) = window[..len].as_chunks::<2>();
    for ((z, x), w) in samples.iter_mut().zip(pairs).zip(weights) {
        *z = Complex::new(f64::from(x[0]) * w[0], f64::from(x[1]) * w[1]);
    }
    samples[len / 2..].fill(Complex::default());
    if let ([x], [w]) = (last, last_weight) {
        samples[len / 2].re = f64::from(*x) * w;
    }
}

/// Squared magnitudes of bins `k` and `m - k` of the spectrum of real samples from bins `a` and `b` of those of their pairs, without the scale.
#[inline(always)]
fn pair(a: Complex<f64>, b: Complex<f64>, twiddle: Complex<f64>) -> [f64; 2] {
    let sum = [a.re + b.re, a.im - b.im];
    let difference = [a.re - b.re, a.im + b.im];
    let turned = [
        twiddle.re * difference[1] + twiddle.im * difference[0],
        twiddle.im * difference[1] - twiddle.re * difference[0],
    ];
    let square = |x: f64, y: f64| x * x + y * y;
    [square(sum[0] + turned[0], sum[1] + turned[1]), square(sum[0] - turned[0], sum[1] - turned[1])]
}

#[inline(always)]
fn powers(z: &[Complex<f64>], twiddles: &[Complex<f64>], scale: f64, power: &mut [f64]) {
    let m = z.len();
    let quarter = 0.25 * scale;
    power[0] = 0.5 * scale * (z[0].re + z[0].im).powi(2);
    power[m] = 0.5 * scale * (z[0].re - z[0].im).powi(2);
    let (whole, _) = twiddles.as_chunks::<LANES>();
    // Bins and those that mirror them, as long as they do not meet.
    let count = (m - 1) / (2 * LANES);
    for (chunk, twiddles) in whole.iter().take(count).enumerate() {
        let k = 1 + chunk * LANES;
        let (low, high) = (&z[k..k + LANES], &z[m - k - LANES + 1..=m - k]);
        let [mut below, mut above] = [[0.0; LANES]; 2];
        for j in 0..LANES {
            let [x, y] = pair(low[j], high[LANES - 1 - j], twiddles[j]);
            (below[j], above[LANES - 1 - j]) = (quarter * x, quarter * y);
        }
        power[k..k + LANES].copy_from_slice(&below);
        power[m - k - LANES + 1..=m - k].copy_from_slice(&above);
    }
    for (k, twiddle) in (1..).zip(twiddles).skip(count * LANES) {
        let [x, y] = pair(z[k], z[m - k], *twiddle);
        (power[m - k], power[k]) = (quarter * y, quarter * x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn powers_are_those_of_the_definition() {
        let mut rng = Rng::new(8);
        for (length, frame) in
            [(2, 2), (2, 1), (4, 3), (8, 8), (32, 31), (64, 50), (66, 66), (512, 403), (1000, 1000)]
        {
            let window: Vec<f64> = (0..frame).map(|_| rng.uniform()).collect();
            let x: Vec<f32> = (0..frame).map(|_| rng.between(-1.0, 1.0) as f32).collect();
            let mut power = FramePower::new(window.clone(), length, 0.7);
            let found = power.process(&x).to_vec();
            assert_eq!(found.len(), length / 2 + 1);
            for (k, found) in found.iter().enumerate() {
                let bin: Complex<f64> = (0..frame)
                    .map(|n| {
                        let turn = (k * n % length) as f64 / length as f64;
                        Complex::from_polar(window[n] * f64::from(x[n]), -TAU * turn)
                    })
                    .sum();
                let scale = if k == 0 || k == length / 2 { 0.35 } else { 0.7 };
                let error = (found - scale * bin.norm_sqr()).abs();
                assert!(error < 1e-12 * length as f64, "{length} {frame} {k}: {error}");
            }
            // Missing samples are 0, whatever the frame before.
            assert!(power.process(&[]).iter().all(|p| *p == 0.0));
        }
    }
}
