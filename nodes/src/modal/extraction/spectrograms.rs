//! Spectrograms of several resolutions of a sound that begins with an impact, and the spectra of damped sines in them.

use super::exponentials::{C, exp};
use super::noise_floor::NoiseFloor;
use foley_fft::RealFftPlanner;
use std::f64::consts::TAU;

/// Samples of the frames, at 44.1 kHz.
const WINDOWS: [usize; 5] = [512, 1024, 2048, 4096, 8192];
/// Frames per window.
const OVERLAP: usize = 8;
/// Time from the first frame on that is analysed, s.
const LONGEST: f64 = 1.0;
/// Bins on each side of a mode that are recomputed when it is subtracted.
const TOUCHED: usize = 24;
/// Bins on each side of a mode in which it is fitted.
pub(super) const NEAR: usize = 3;
/// Minimum level of noise that is assumed, relative to the loudest bin.
const LEAST_NOISE: f64 = 1e-10;

/// A spectrogram with one length of frames.
pub(super) struct Level {
    /// Samples of a frame, and between two frames.
    pub(super) window: usize,
    pub(super) hop: usize,
    /// Number of frames.
    pub(super) frames: usize,
    /// `[frames][bins]`, scaled such that a steady sine of amplitude 1 has a peak of 1.
    spectra: Vec<C>,
    bins: usize,
    /// Power of the noise in each bin.
    pub(super) noise: Vec<f64>,
    /// Bins in which nothing is searched any more.
    pub(super) masked: Vec<bool>,
}

/// Spectrograms of a sound from a sample on.
pub(super) struct Spectrograms {
    pub(super) levels: Vec<Level>,
    /// First sample of the first frame.
    pub(super) first: usize,
}

impl Level {
    pub(super) fn at(&self, frame: usize, bin: usize) -> C {
        self.spectra[frame * self.bins + bin]
    }

    /// Bin of a frequency in radians a sample, within the spectrum without its ends.
    pub(super) fn bin(&self, omega: f64) -> usize {
        let last = self.bins.saturating_sub(NEAR + 2);
        ((omega * self.window as f64 / TAU).round() as usize).clamp(1, last.max(1))
    }

    pub(super) fn bins(&self) -> usize {
        self.bins
    }

    /// The spectrum of `exp(s n)` in one frame that begins at n = 0, and its derivative by s; scaled for `Re(a exp(s n))`.
    ///
    /// With a Hann window it is a sum of three geometric series.
    pub(super) fn of_exponential(&self, s: C, bin: usize) -> [C; 2] {
        let n = self.window as f64;
        let end = exp(s * n);
        let series = |k: f64| {
            let u = exp(s - C::new(0.0, TAU * k / n));
            let gap = C::new(1.0, 0.0) - u;
            if gap.norm() < 1e-8 {
                return [C::new(n, 0.0), C::new(0.5 * n * (n - 1.0), 0.0)];
            }
            let sum = (C::new(1.0, 0.0) - end) / gap;
            [sum, (sum * u - end * n) / gap]
        };
        let k = bin as f64;
        let [below, middle, above] = [series(k - 1.0), series(k), series(k + 1.0)];
        // The peak of a sine of amplitude 1 is a quarter of the length: half of the sum of the window, half of it in each sideband.
        [0, 1].map(|i| (middle[i] * 0.5 - (below[i] + above[i]) * 0.25) * (2.0 / n))
    }

    /// Subtracts `Re(a exp(s n))`, n from the first frame on, in the bins around its frequency.
    fn subtract(&mut self, s: C, a: C) {
        let centre = self.bin(s.im);
        let range = centre.saturating_sub(TOUCHED)..(centre + TOUCHED + 1).min(self.bins);
        for (s, a) in [(s, a), (s.conj(), a.conj())] {
            let step = exp(s * self.hop as f64);
            let shapes: Vec<C> = range.clone().map(|bin| self.of_exponential(s, bin)[0]).collect();
            let mut a = a;
            for frame in self.spectra.chunks_exact_mut(self.bins) {
                for (z, w) in frame[range.clone()].iter_mut().zip(&shapes) {
                    *z -= a * w;
                }
                a *= step;
            }
        }
    }

    fn transform(&mut self, x: &[f64], planner: &mut RealFftPlanner<f64>) {
        let plan = planner.plan_fft_forward(self.window);
        let (mut time, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
        let n = self.window as f64;
        let window: Vec<f64> =
            (0..self.window).map(|k| (0.5 - 0.5 * libm::cos(TAU * k as f64 / n)) * 4.0 / n).collect();
        for (t, frame) in self.spectra.chunks_exact_mut(self.bins).enumerate() {
            let part = &x[t * self.hop..];
            time.iter_mut().zip(part.iter().zip(&window)).for_each(|(t, (x, w))| *t = x * w);
            if plan.process(&mut time, &mut spectrum).is_ok() {
                frame.copy_from_slice(&spectrum);
            }
        }
    }
}

impl Spectrograms {
    /// Transforms a sound from the sample `first` on; windows of more than a quarter of it are left out.
    ///
    /// # Complexity
    /// O(samples log window).
    pub(super) fn new(x: &[f64], first: usize, rate: f64, noise: &NoiseFloor) -> Self {
        let count = x.len() - first;
        let scaled = |n: usize| ((n as f64 * rate / 44_100.0) as usize).next_power_of_two();
        let mut windows: Vec<usize> = WINDOWS.map(scaled).into_iter().filter(|n| *n <= count / 4).collect();
        if windows.is_empty() {
            windows.push((count / 4).next_power_of_two().max(32) / 2);
        }
        let level = |window: usize| {
            let hop = (window / OVERLAP).max(1);
            let frames = (count - window).min((LONGEST * rate) as usize) / hop + 1;
            let bins = window / 2 + 1;
            let (spectra, masked) = (vec![C::default(); frames * bins], vec![false; bins]);
            Level { window, hop, frames, spectra, bins, noise: Vec::new(), masked }
        };
        let mut out = Self { levels: windows.into_iter().map(level).collect(), first };
        out.transform(x);
        for level in &mut out.levels {
            level.noise = noise_power(level, rate, noise);
        }
        out
    }

    /// Transforms another sound of the same length.
    pub(super) fn transform(&mut self, x: &[f64]) {
        let mut planner = RealFftPlanner::new();
        let first = self.first;
        self.levels.iter_mut().for_each(|level| level.transform(&x[first..], &mut planner));
    }

    /// Subtracts `Re(a exp(s n))`, n from the start of the sound on.
    pub(super) fn subtract(&mut self, s: C, a: C) {
        let a = a * exp(s * self.first as f64);
        self.levels.iter_mut().for_each(|level| level.subtract(s, a));
    }

    /// Excludes the bins around a bin of a level from the search.
    pub(super) fn mask(&mut self, level: usize, bin: usize) {
        let level = &mut self.levels[level];
        let end = (bin + NEAR + 1).min(level.masked.len());
        level.masked[bin.saturating_sub(NEAR)..end].fill(true);
    }

    /// Includes all bins again.
    pub(super) fn unmask(&mut self) {
        self.levels.iter_mut().for_each(|level| level.masked.fill(false));
    }
}

/// Power of the noise per bin: as measured without the impact, else the 20th percentile over time.
fn noise_power(level: &Level, rate: f64, noise: &NoiseFloor) -> Vec<f64> {
    let n = level.window as f64;
    let powers = |bin: usize| (0..level.frames).map(move |t| level.at(t, bin).norm_sqr());
    let loudest = (0..level.bins).flat_map(powers).fold(0.0, f64::max);
    let of_bin = |bin: usize| {
        // The sum of squares of the window, 3/8 of its length, over the square of a quarter of its length.
        let variance = noise.variance(bin as f64 * rate / n);
        let measured = variance * 6.0 / n;
        let least = LEAST_NOISE * loudest;
        if measured > 0.0 {
            return measured.max(least);
        }
        let mut all: Vec<f64> = powers(bin).collect();
        let fifth = all.len() / 5;
        all.select_nth_unstable_by(fifth, f64::total_cmp).1.max(least)
    };
    (0..level.bins).map(of_bin).collect()
}

#[cfg(test)]
mod tests {
    use super::super::exponentials::{add, energy};
    use super::*;

    #[test]
    fn a_damped_sine_has_the_closed_form_and_is_subtracted() {
        let s = C::new(-2e-3, 0.31);
        let a = C::new(0.4, -0.3);
        let mut x = vec![0.0; 20_000];
        add(&mut x, &[s], &[a]);
        let silence = vec![0.0_f32; 20_000];
        let noise = NoiseFloor::new(&silence, 0, 44_100.0);
        let mut found = Spectrograms::new(&x, 220, 44_100.0, &noise);
        assert_eq!(found.levels.len(), 4);
        for level in &found.levels {
            let bin = level.bin(s.im);
            let start = a * exp(s * 220.0);
            for t in [0, 3] {
                let expected = start * exp(s * (t * level.hop) as f64) * level.of_exponential(s, bin)[0];
                let image = start.conj() * exp(s.conj() * (t * level.hop) as f64);
                let image = image * level.of_exponential(s.conj(), bin)[0];
                let error = (level.at(t, bin) - expected - image).norm();
                assert!(error < 1e-10 * expected.norm().max(1e-12), "{error} {expected}");
            }
            let [w, slope] = level.of_exponential(s, bin);
            let step = C::new(1e-7, 0.0);
            let difference = (level.of_exponential(s + step, bin)[0] - w) / step;
            assert!((difference - slope).norm() < 1e-4 * slope.norm());
        }
        let before: f64 = found.levels.iter().flat_map(|l| &l.spectra).map(|z| z.norm_sqr()).sum();
        found.subtract(s, a);
        let after: f64 = found.levels.iter().flat_map(|l| &l.spectra).map(|z| z.norm_sqr()).sum();
        assert!(after < 1e-6 * before && energy(&x) > 0.0, "{after} {before}");
    }
}
