//! Figures of a whole sound: its levels, and the distribution of its energy over frequency.

use super::loudness_meter::LoudnessMeter;
use super::meter::LevelMeter;
use super::ramp::linear_to_db;
use super::weighting::{Weighting, WeightingFilter};
use foley_fft::RealFftPlanner;
use realfft::RealToComplex;
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use std::sync::Arc;

/// Samples of a frame of the power spectrum; frames overlap by half.
const FRAME: usize = 8192;
/// Energy below this frequency is hardly heard, Hz.
const LOW: f64 = 60.0;
/// Energy above this frequency makes a sound bright, Hz.
const HIGH: f64 = 1000.0;

/// Levels and spectral figures of a whole sound, over all channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SoundFigures {
    /// Length, s.
    pub seconds: f64,
    /// Largest magnitude.
    pub peak_db: f64,
    /// Root mean square, dB of full scale.
    pub rms_db: f64,
    /// A-weighted root mean square, dB of full scale.
    pub dba: f64,
    /// Integrated loudness, LUFS.
    pub lufs: f64,
    /// Share of the energy below 60 Hz.
    pub below_60_hz: f64,
    /// Share of the energy above 1 kHz.
    pub above_1_khz: f64,
    /// Centroid of the power spectrum, Hz.
    pub centroid_hz: f64,
}

/// Measures [`SoundFigures`] in blocks of any length.
///
/// Shares and centroid are of Hann-windowed spectra of 8192 samples.
///
/// # Complexity
/// O(log 8192) per sample.
pub struct SoundMeter {
    rate: f64,
    channels: usize,
    level: LevelMeter,
    loudness: LoudnessMeter,
    a: WeightingFilter,
    a_power: f64,
    samples: u64,
    fft: Arc<dyn RealToComplex<f32>>,
    window: Vec<f32>,
    /// The last samples of each channel, up to a frame.
    waiting: Vec<Vec<f32>>,
    power: Vec<f64>,
}

impl fmt::Debug for SoundMeter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SoundMeter")
            .field("rate", &self.rate)
            .field("samples", &self.samples)
            .finish_non_exhaustive()
    }
}

impl SoundMeter {
    /// A meter for interleaved audio of a rate in Hz.
    #[must_use]
    pub fn new(rate: f64, channels: usize) -> Self {
        let hann = |n: usize| (0.5 - 0.5 * (TAU * n as f64 / FRAME as f64).cos()) as f32;
        Self {
            rate,
            channels,
            level: LevelMeter::default(),
            loudness: LoudnessMeter::new(rate, channels),
            a: Weighting::A.filter(rate, channels),
            a_power: 0.0,
            samples: 0,
            fft: RealFftPlanner::new().plan_fft_forward(FRAME),
            window: (0..FRAME).map(hann).collect(),
            waiting: vec![vec![0.0; FRAME / 2]; channels],
            power: vec![0.0; FRAME / 2 + 1],
        }
    }

    /// Adds interleaved samples.
    pub fn process(&mut self, samples: &[f32]) {
        self.level.process(samples);
        self.loudness.process(samples);
        for frame in samples.chunks_exact(self.channels.max(1)) {
            for (k, x) in frame.iter().enumerate() {
                self.a_power += self.a.tick(k, *x).powi(2);
                self.samples += 1;
                self.waiting[k].push(*x);
                if self.waiting[k].len() == FRAME {
                    spectrum(&*self.fft, &self.window, &self.waiting[k], &mut self.power);
                    self.waiting[k].drain(..FRAME / 2);
                }
            }
        }
    }

    /// Figures of all samples so far.
    #[must_use]
    pub fn figures(&self) -> SoundFigures {
        let mut power = self.power.clone();
        for waiting in &self.waiting {
            // The end, padded so that each sample counts twice.
            let mut rest = waiting.clone();
            rest.resize(FRAME, 0.0);
            spectrum(&*self.fft, &self.window, &rest, &mut power);
            let mut rest = rest.split_off(FRAME / 2);
            rest.resize(FRAME, 0.0);
            spectrum(&*self.fft, &self.window, &rest, &mut power);
        }
        let hz = |k: usize| k as f64 * self.rate / FRAME as f64;
        let sum = |keep: &dyn Fn(f64) -> bool| -> f64 {
            power.iter().enumerate().filter(|(k, _)| keep(hz(*k))).map(|(_, p)| p).sum()
        };
        let total = sum(&|_| true).max(f64::MIN_POSITIVE);
        let moment: f64 = power.iter().enumerate().map(|(k, p)| hz(k) * p).sum();
        let level = self.level.level();
        SoundFigures {
            seconds: self.samples as f64 / (self.rate * self.channels.max(1) as f64),
            peak_db: linear_to_db(level.peak.into()),
            rms_db: linear_to_db(level.rms),
            dba: linear_to_db((self.a_power / self.samples.max(1) as f64).sqrt()),
            lufs: self.loudness.integrated(),
            below_60_hz: sum(&|hz| hz < LOW) / total,
            above_1_khz: sum(&|hz| hz > HIGH) / total,
            centroid_hz: moment / total,
        }
    }
}

/// Adds the power spectrum of one frame.
fn spectrum(fft: &dyn RealToComplex<f32>, window: &[f32], samples: &[f32], power: &mut [f64]) {
    let mut frame: Vec<f32> = samples.iter().zip(window).map(|(x, w)| x * w).collect();
    let mut bins = fft.make_output_vec();
    // The lengths are those of the plan.
    if fft.process(&mut frame, &mut bins).is_ok() {
        power.iter_mut().zip(bins).for_each(|(power, bin)| *power += f64::from(bin.norm_sqr()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sines_have_their_shares_levels_and_centroid() {
        // 40 Hz with three quarters of the power, 2 kHz with a quarter, on the left only.
        let sine = |f: f64, n: usize| (TAU * f * n as f64 / 48_000.0).sin();
        let one = |n: usize| (0.3 * (3.0_f64.sqrt() * sine(40.0, n) + sine(2000.0, n))) as f32;
        let sound: Vec<f32> = (0..96_000).flat_map(|n| [one(n), 0.0]).collect();
        let mut meter = SoundMeter::new(48_000.0, 2);
        sound.chunks(1234).for_each(|block| meter.process(block));
        let found = meter.figures();
        assert_eq!(found.seconds, 2.0);
        assert!(
            (found.below_60_hz - 0.75).abs() < 0.01 && (found.above_1_khz - 0.25).abs() < 0.01,
            "{found:?}"
        );
        assert!((found.centroid_hz - 530.0).abs() < 10.0, "{found:?}");
        assert!((found.rms_db - 10.0 * (0.09_f64).log10()).abs() < 0.05, "{found:?}");
        // A takes 34.6 dB off 40 Hz and adds 1.2 to 2 kHz.
        assert!((found.dba - (10.0 * (0.25 * 0.09_f64).log10() + 1.2)).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn an_empty_sound_is_silent() {
        let found = SoundMeter::new(44_100.0, 1).figures();
        assert_eq!((found.seconds, found.peak_db, found.below_60_hz), (0.0, f64::NEG_INFINITY, 0.0));
    }
}
