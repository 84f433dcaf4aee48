//! Sinusoids in a frame: peaks of its spectrum with interpolated frequency, amplitude and phase.

use crate::choices;
use crate::dsp::db_to_linear;
use foley_fft::RealFftPlanner;
use realfft::RealToComplex;
use realfft::num_complex::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::Arc;

choices! {
    /// Window of the frames in which sinusoids are found.
    pub enum PeakWindow {
        /// Four terms: side lobes at -92 dB.
        BlackmanHarris,
        /// Three terms: side lobes at -58 dB, and a main lobe of three quarters of the width.
        Blackman,
        /// Two terms: side lobes at -31 dB, and a main lobe of half the width.
        Hann,
        /// Two terms: side lobes at -43 dB that do not fall off, and a main lobe of half the width.
        Hamming,
    }
}

impl PeakWindow {
    /// The window of an odd length, symmetric.
    fn samples(self, len: usize) -> Vec<f64> {
        let a = match self {
            Self::BlackmanHarris => [0.35875, 0.48829, 0.14128, 0.01168],
            Self::Blackman => [0.42, 0.5, 0.08, 0.0],
            Self::Hann => [0.5, 0.5, 0.0, 0.0],
            Self::Hamming => [0.54, 0.46, 0.0, 0.0],
        };
        let x = |n: usize| TAU * n as f64 / (len.max(2) - 1) as f64;
        (0..len)
            .map(|n| a[0] - a[1] * x(n).cos() + a[2] * (2.0 * x(n)).cos() - a[3] * (3.0 * x(n)).cos())
            .collect()
    }
}

/// Frames and selection of peaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeakRules {
    /// Shape of the window.
    pub shape: PeakWindow,
    /// Samples of the window, an odd number.
    pub window: usize,
    /// Samples of the transform.
    pub size: usize,
    /// Samples from one frame to the next.
    pub hop: usize,
    /// Lowest level of a peak, dB of full scale.
    pub threshold: f64,
    /// Maximum number of peaks of a frame; the largest count.
    pub max_peaks: usize,
}

impl PeakRules {
    /// A window of 2047 samples every 256 samples at 44.1 kHz, of the same duration at other rates.
    #[must_use]
    pub fn at_rate(rate: f64) -> Self {
        let scaled = |n: f64| (n * rate / 44_100.0).round().max(8.0) as usize;
        let window = scaled(2047.0) | 1;
        let size = Self::transform(window);
        let shape = PeakWindow::BlackmanHarris;
        Self { shape, window, size, hop: scaled(256.0), threshold: -80.0, max_peaks: 100 }
    }

    /// Samples of the transform for a window: twice as many, rounded up to a power of two.
    #[must_use]
    pub fn transform(window: usize) -> usize {
        2 * window.next_power_of_two()
    }
}

/// A sinusoid at the centre of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SinePeak {
    /// Frequency, Hz.
    pub frequency: f64,
    /// Amplitude, full scale 1.
    pub amplitude: f64,
    /// Phase of the cosine at the centre of the frame, rad.
    pub phase: f64,
}

/// Finds the peaks of frames.
///
/// A parabola through the levels of a bin and of its neighbours gives frequency and amplitude; the phase is that of the nearest bin, since
/// the transform of a window that is symmetric about sample 0 has a constant phase over its main lobe.
///
/// # Source
/// Serra and Smith, "Spectral modeling synthesis" (Computer Music Journal 14(4), 1990). A stationary tone between 300 and 5000 Hz is found
/// within 0.01 Hz and 0.005 dB at the default window.
pub struct PeakFinder {
    rules: PeakRules,
    rate: f64,
    plan: Arc<dyn RealToComplex<f64>>,
    window: Vec<f64>,
    /// A frame at the ends of a recording.
    frame: Vec<f32>,
    input: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    levels: Vec<f64>,
}

impl PeakFinder {
    /// A finder at a rate in Hz.
    #[must_use]
    pub fn new(rules: PeakRules, rate: f64) -> Self {
        let size = rules.size.max(rules.window + 1).next_multiple_of(2);
        let plan = RealFftPlanner::new().plan_fft_forward(size);
        let window = rules.shape.samples(rules.window);
        // A real sinusoid of amplitude A reads A.
        let scale = 2.0 / window.iter().sum::<f64>();
        Self {
            rate,
            window: window.into_iter().map(|w| scale * w).collect(),
            frame: vec![0.0; rules.window],
            input: plan.make_input_vec(),
            levels: vec![0.0; size / 2 + 1],
            spectrum: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            plan,
            rules,
        }
    }

    /// Most peaks that a frame can have before the largest are selected.
    #[must_use]
    pub fn room(&self) -> usize {
        self.levels.len() / 2 + 1
    }

    /// Finds the peaks of the frame that is centred on sample `centre` of `x`, the largest first. Outside `x` is silence.
    pub fn find_at(&mut self, x: &[f32], centre: i64, peaks: &mut Vec<SinePeak>) {
        let first = centre - (self.rules.window / 2) as i64;
        let inside = usize::try_from(first).ok().and_then(|first| x.get(first..first + self.rules.window));
        if let Some(frame) = inside {
            return self.find(frame, peaks);
        }
        let mut frame = std::mem::take(&mut self.frame);
        for (i, y) in (first..).zip(frame.iter_mut()) {
            *y = usize::try_from(i).ok().and_then(|i| x.get(i)).copied().unwrap_or(0.0);
        }
        self.find(&frame, peaks);
        self.frame = frame;
    }

    /// Finds the peaks of a frame, the largest first.
    ///
    /// # Shapes
    /// `frame: [rules.window]`, centred on the time of the peaks.
    pub fn find(&mut self, frame: &[f32], peaks: &mut Vec<SinePeak>) {
        peaks.clear();
        let half = self.rules.window / 2;
        let size = self.input.len();
        self.input.fill(0.0);
        // Rotated, so that the centre is sample 0.
        for (k, (x, w)) in frame.iter().zip(&self.window).enumerate() {
            let at = if k < half { size + k - half } else { k - half };
            self.input[at] = f64::from(*x) * w;
        }
        // Lengths agree by construction.
        if self.plan.process_with_scratch(&mut self.input, &mut self.spectrum, &mut self.scratch).is_err() {
            return;
        }
        for (level, x) in self.levels.iter_mut().zip(&self.spectrum) {
            *level = 10.0 * x.norm_sqr().max(1e-30).log10();
        }
        for b in 1..self.levels.len().saturating_sub(1) {
            let [before, at, after] = [self.levels[b - 1], self.levels[b], self.levels[b + 1]];
            if at <= self.rules.threshold || at <= before || at < after {
                continue;
            }
            let curvature = before - 2.0 * at + after;
            if curvature >= -1e-9 {
                continue;
            }
            let offset = 0.5 * (before - after) / curvature;
            let level = at - 0.25 * (before - after) * offset;
            peaks.push(SinePeak {
                frequency: (b as f64 + offset) * self.rate / size as f64,
                amplitude: db_to_linear(level),
                phase: self.spectrum[b].arg(),
            });
        }
        let order = |a: &SinePeak, b: &SinePeak| b.amplitude.total_cmp(&a.amplitude);
        peaks.sort_unstable_by(|a, b| order(a, b).then(a.frequency.total_cmp(&b.frequency)));
        peaks.truncate(self.rules.max_peaks);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn tones_are_found_within_the_stated_errors() {
        let rate = 44_100.0;
        let rules = PeakRules::at_rate(rate);
        assert_eq!((rules.window, rules.size, rules.hop), (2047, 4096, 256));
        let mut finder = PeakFinder::new(rules, rate);
        let (mut rng, mut peaks) = (Rng::new(5), Vec::new());
        for _ in 0..40 {
            let (f, a, phase) = (rng.between(300.0, 5000.0), rng.between(0.01, 0.9), rng.between(-3.1, 3.1));
            let at = |i: usize| TAU * f * (i as f64 - 1023.0) / rate + phase;
            let frame: Vec<f32> = (0..2047).map(|i| (a * at(i).cos()) as f32).collect();
            finder.find(&frame, &mut peaks);
            let peak = peaks[0];
            assert!((peak.frequency - f).abs() < 0.01, "{} {f}", peak.frequency);
            assert!((20.0 * (peak.amplitude / a).log10()).abs() < 0.005);
            let error =
                (peak.phase - phase + 3.0 * std::f64::consts::PI).rem_euclid(TAU) - std::f64::consts::PI;
            assert!(error.abs() < 0.02, "{error}");
        }
    }

    #[test]
    fn each_window_finds_tones_within_its_own_errors() {
        let rate = 44_100.0;
        // The errors of 3000 tones at random frequencies, in Hz and dB.
        for (shape, hz, db) in [
            (PeakWindow::BlackmanHarris, 0.0085, 0.0025),
            (PeakWindow::Blackman, 0.017, 0.005),
            (PeakWindow::Hann, 0.036, 0.0145),
            (PeakWindow::Hamming, 0.08, 0.03),
        ] {
            let mut finder = PeakFinder::new(PeakRules { shape, ..PeakRules::at_rate(rate) }, rate);
            let (mut rng, mut peaks, mut errors) = (Rng::new(6), Vec::new(), [0.0_f64; 2]);
            for _ in 0..60 {
                let (f, phase) = (rng.between(300.0, 5000.0), rng.between(-3.1, 3.1));
                let tone = |i: usize| (0.5 * (TAU * f * i as f64 / rate + phase).cos()) as f32;
                finder.find(&(0..2047).map(tone).collect::<Vec<_>>(), &mut peaks);
                let found = [peaks[0].frequency - f, 20.0 * (peaks[0].amplitude / 0.5).log10()];
                errors = [errors[0].max(found[0].abs()), errors[1].max(found[1].abs())];
            }
            assert!(errors[0] < hz && errors[1] < db, "{shape:?}: {errors:?}");
            assert!(errors[0] > 0.4 * hz && errors[1] > 0.4 * db, "{shape:?}: {errors:?}");
        }
    }

    #[test]
    fn silence_and_levels_below_the_threshold_have_no_peaks() {
        let mut finder = PeakFinder::new(PeakRules::at_rate(44_100.0), 44_100.0);
        let mut peaks = vec![SinePeak::default()];
        finder.find(&[0.0; 2047], &mut peaks);
        assert!(peaks.is_empty());
        let quiet: Vec<f32> = (0..2047).map(|i| 5e-5 * (0.3 * i as f32).sin()).collect();
        finder.find(&quiet, &mut peaks);
        assert!(peaks.is_empty());
    }
}
