//! Lines in the spectrum of the envelope, which joins at equal intervals cause.

use super::active::{ActiveSound, hann};
use crate::dsp::{Band, Butterworth, Cascade};
use foley_fft::RealFftPlanner;
use serde::{Deserialize, Serialize};

/// The envelope is of the sound above this frequency, Hz: the rectified hum of mains has lines of its own.
const LOW: f64 = 500.0;
/// Duration of a frame, s, and that of shorter sounds; rounded to whole units.
const FRAMES: [f64; 2] = [1.0, 0.25];
/// Shortest sound that has long frames, s.
const LONG_ENOUGH: f64 = 1.5;
/// Minimum number of units in a frame: lines are farther apart than the width of their neighbourhoods.
const LEAST_UNITS: f64 = 20.0;
/// Maximum number of lines that are measured, and the highest frequency of one, Hz.
const HARMONICS: usize = 10;
const HIGHEST: f64 = 2500.0;
/// The neighbourhood of a line, in bins on both sides.
const NEIGHBOURS: std::ops::RangeInclusive<usize> = 3..=12;

/// One line of the envelope.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HarmonicLine {
    /// Frequency, Hz.
    pub hz: f64,
    /// Level above the mean of its neighbourhood, dB.
    pub db: f64,
    /// The same of the recordings.
    pub recordings_db: Option<f64>,
}

/// The mean power spectrum of the envelope of a sound, in frames of a second or a quarter of one that hold a whole number of units.
///
/// The envelope is the magnitude of the samples above 500 Hz. Each frame is divided by its mean and has a Hann window, so
/// soft frames count as much as loud ones. Noise with an amplitude of `1 + m cos(2 pi t / unit)` has, in frames of N samples, a line of
/// about `10 lg(1 + 0.29 m^2 N)` dB above its neighbourhood: four times as high in longer frames. Noise without a line has 0 dB in both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvelopeSpectrum {
    /// Sum of the power of all frames.
    power: Vec<f64>,
    frames: usize,
    /// Width of a bin, Hz.
    resolution: f64,
    /// Units in a frame: line k is in bin k times this number.
    units: usize,
}

impl EnvelopeSpectrum {
    /// The duration of frames in s that suits sounds of some lengths in s: a second, or a quarter of one if any is shorter than 1.5 s.
    #[must_use]
    pub fn frame_of(seconds: impl IntoIterator<Item = f64>) -> f64 {
        FRAMES[usize::from(seconds.into_iter().any(|s| s < LONG_ENOUGH))]
    }

    /// Measures a sound that is made of units of a duration in s, in frames of about a duration in s. Frames of which less than half is active
    /// do not count; a sound of less than a frame has no spectrum.
    ///
    /// # Complexity
    /// O(n log frame).
    #[must_use]
    pub fn new(sound: &ActiveSound, unit: f64, seconds: f64) -> Self {
        let units = (seconds / unit).round().max(LEAST_UNITS) as usize;
        let frame = ((units as f64 * unit * sound.rate).round() as usize).max(2);
        let resolution = sound.rate / frame as f64;
        let bins = frame / 2 + 1;
        let mut out = Self { power: vec![0.0; bins], frames: 0, resolution, units };
        let mut high = sound.samples.clone();
        if let Ok(design) = Butterworth::design(Band::HighPass, 4, LOW, sound.rate) {
            Cascade::new(&design, 1).process(&mut high);
        }
        let plan = RealFftPlanner::<f32>::new().plan_fft_forward(frame);
        let hann = hann(frame);
        let (mut time, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
        for start in (0..high.len().saturating_sub(frame - 1)).step_by((frame / 2).max(1)) {
            let parts = || (start..start + frame).step_by(sound.frame());
            let is_active = 2 * parts().filter(|at| sound.is_active(*at)).count() >= parts().count();
            let x = &high[start..start + frame];
            let mean = x.iter().map(|x| f64::from(x.abs())).sum::<f64>() / frame as f64;
            if !is_active || mean <= 0.0 {
                continue;
            }
            let of = |(x, w): (&f32, &f32)| ((f64::from(x.abs()) / mean - 1.0) as f32) * w;
            time.iter_mut().zip(x.iter().zip(&hann).map(of)).for_each(|(t, x)| *t = x);
            // The lengths are those of the plan.
            if plan.process(&mut time, &mut spectrum).is_ok() {
                out.power.iter_mut().zip(&spectrum).for_each(|(p, z)| *p += f64::from(z.norm_sqr()));
                out.frames += 1;
            }
        }
        out
    }

    /// The spectrum of several sounds together, measured for the same unit at the same rate.
    #[must_use]
    pub fn pooled<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = all.into_iter();
        let Some(mut sum) = all.next().cloned() else { return Self::default() };
        for other in all {
            sum.power.iter_mut().zip(&other.power).for_each(|(a, b)| *a += b);
            sum.frames += other.frames;
        }
        sum
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Power of a bin over the mean power of its neighbourhood.
    fn ratio(&self, bin: usize) -> Option<f64> {
        let near = NEIGHBOURS.flat_map(|d| [bin.checked_sub(d), Some(bin + d)]).flatten();
        let near: Vec<f64> = near.filter_map(|k| self.power.get(k).copied()).collect();
        let mean = near.iter().sum::<f64>() / near.len().max(1) as f64;
        (mean > 0.0).then(|| self.power[bin] / mean)
    }

    /// Lines at the rate of the units and its multiples, up to the tenth and 2.5 kHz: frequency in Hz and ratio of powers.
    fn ratios(&self) -> Vec<(f64, f64)> {
        let line = |k: usize| {
            let bin = k * self.units;
            let hz = bin as f64 * self.resolution;
            let is_measured = hz <= HIGHEST && bin + NEIGHBOURS.end() < self.power.len();
            is_measured.then(|| self.ratio(bin)).flatten().map(|ratio| (hz, ratio))
        };
        (1..=HARMONICS).filter_map(line).collect()
    }

    /// Level of each line above its neighbourhood: frequency in Hz and dB.
    #[must_use]
    pub fn lines(&self) -> Vec<(f64, f64)> {
        self.ratios().into_iter().map(|(hz, ratio)| (hz, 10.0 * ratio.max(1e-10).log10())).collect()
    }

    /// Mean of the ratios of all lines, dB; `None` without a frame.
    #[must_use]
    pub fn mean_line(&self) -> Option<f64> {
        let all = self.ratios();
        let mean = all.iter().map(|(_, ratio)| ratio).sum::<f64>() / all.len().max(1) as f64;
        (!all.is_empty()).then(|| 10.0 * mean.max(1e-10).log10())
    }

    /// Frequencies up to 2.5 kHz, and the power at each over that of its neighbourhood, dB.
    #[must_use]
    pub fn contrast(&self) -> Vec<[f64; 2]> {
        let last = (HIGHEST / self.resolution.max(1e-9)) as usize;
        let point = |k: usize| {
            let ratio = self.ratio(k)?;
            Some([k as f64 * self.resolution, 10.0 * ratio.max(1e-10).log10()])
        };
        (2..last.min(self.power.len())).filter_map(point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likeness::statistics::testing::gaussian;
    use std::f64::consts::TAU;

    fn modulated(depth: f64, rate: f64, samples: usize) -> ActiveSound {
        let gain = |k: usize| 1.0 + depth * (TAU * 240.0 * k as f64 / rate).cos();
        let x = gaussian(samples, 7).into_iter().enumerate().map(|(k, x)| (f64::from(x) * gain(k)) as f32);
        ActiveSound::new(&x.collect::<Vec<f32>>(), rate)
    }

    #[test]
    fn a_modulated_noise_has_a_line_of_the_expected_level() {
        for rate in [48_000.0, 44_100.0] {
            for depth in [0.05, 0.2] {
                let found = EnvelopeSpectrum::new(&modulated(depth, rate, 960_000), 1.0 / 240.0, 1.0);
                let lines = found.lines();
                // Of a magnitude of normal numbers, the mean is sqrt(2 / pi) and the variance 1 - 2 / pi.
                let per_sample = (2.0 / std::f64::consts::PI) / (6.0 * (1.0 - 2.0 / std::f64::consts::PI));
                let expected = 10.0 * (1.0 + per_sample * depth * depth * rate).log10();
                assert!((lines[0].0 - 240.0).abs() < 1e-9 && lines.len() == 10, "{lines:?}");
                assert!((lines[0].1 - expected).abs() < 1.0, "{lines:?} {expected}");
                assert!(lines[2..].iter().all(|(_, db)| db.abs() < 2.5), "{lines:?}");
            }
        }
    }

    #[test]
    fn noise_has_no_lines_and_a_short_sound_no_spectrum() {
        let found = EnvelopeSpectrum::new(&modulated(0.0, 48_000.0, 960_000), 1.0 / 240.0, 0.25);
        assert!(found.mean_line().unwrap().abs() < 0.7 && found.frames() > 70, "{:?}", found.mean_line());
        let short = EnvelopeSpectrum::new(&modulated(0.0, 48_000.0, 9000), 1.0 / 240.0, 0.25);
        assert_eq!((short.mean_line(), short.frames()), (None, 0));
        assert_eq!(
            [EnvelopeSpectrum::frame_of([2.0, 1.6]), EnvelopeSpectrum::frame_of([2.0, 0.4])],
            [1.0, 0.25]
        );
        let twice = EnvelopeSpectrum::pooled([&found, &found]);
        assert!((twice.mean_line().unwrap() - found.mean_line().unwrap()).abs() < 1e-9);
    }
}
