//! Errors of sounds that are played from grains.

use foley_fft::RealFftPlanner;
use std::f64::consts::PI;

/// Duration of a frame of the segmental signal-to-noise ratio, s.
const SEGMENT: f64 = 0.02;
/// Range of the ratio of a frame, dB.
const RATIO: [f64; 2] = [-10.0, 35.0];
/// Level below that of the loudest frame at which frames do not count, dB.
const QUIET: f64 = -60.0;
/// Duration of a frame of the log-spectral distance, s, rounded to a power of two of samples.
const FRAME: f64 = 0.04;

/// Sums over frames of the errors of sounds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    ratios: f64,
    segments: usize,
    distances: f64,
    frames: usize,
}

impl Distortion {
    /// Adds the frames of one sound.
    ///
    /// # Complexity
    /// Two transforms for each 10 ms, and the memory of one frame.
    pub fn add(&mut self, reference: &[f32], sound: &[f32], rate: f64) {
        self.add_ratios(reference, sound, rate);
        self.add_distances(reference, sound, rate);
    }

    fn add_ratios(&mut self, reference: &[f32], sound: &[f32], rate: f64) {
        let len = ((SEGMENT * rate) as usize).max(1);
        let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let loudest = reference.chunks(len).map(|x| energy(x) / x.len() as f64).fold(0.0, f64::max);
        let limit = loudest * 10f64.powf(QUIET / 10.0);
        for (k, x) in reference.chunks(len).enumerate() {
            let signal = energy(x);
            if signal <= limit * x.len() as f64 {
                continue;
            }
            let at = |n: usize| sound.get(k * len + n).copied().unwrap_or(0.0);
            let noise: f64 =
                x.iter().enumerate().map(|(n, x)| (f64::from(*x) - f64::from(at(n))).powi(2)).sum();
            let ratio = 10.0 * (signal / noise.max(1e-30)).log10();
            self.ratios += ratio.clamp(RATIO[0], RATIO[1]);
            self.segments += 1;
        }
    }

    fn add_distances(&mut self, reference: &[f32], sound: &[f32], rate: f64) {
        let size = ((FRAME * rate) as usize).max(16).next_power_of_two();
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(size);
        let window: Vec<f64> =
            (0..size).map(|i| 0.5 - 0.5 * (2.0 * PI * i as f64 / size as f64).cos()).collect();
        let (mut input, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
        let windowed =
            |x: &[f32], start: usize, i: usize| window[i] * x.get(start + i).copied().map_or(0.0, f64::from);
        let energy = |start: usize| (0..size).map(|i| windowed(reference, start, i).powi(2)).sum::<f64>();
        let mut powers = |x: &[f32], start: usize| -> Vec<f64> {
            input.iter_mut().enumerate().for_each(|(i, y)| *y = windowed(x, start, i));
            // Lengths agree by construction.
            if plan.process(&mut input, &mut spectrum).is_err() {
                return vec![0.0; size / 2 + 1];
            }
            spectrum.iter().map(|x| x.norm_sqr()).collect()
        };
        let starts = || (0..reference.len()).step_by(size / 4);
        let total = |x: &[f64]| x.iter().sum::<f64>();
        let limit = starts().map(energy).fold(0.0, f64::max) * 10f64.powf(QUIET / 10.0);
        for start in starts().filter(|start| energy(*start) > limit) {
            let (x, y) = (powers(reference, start), powers(sound, start));
            // Bins far below the mean of the frame do not count.
            let floor = total(&x) / x.len() as f64 * 10f64.powf(QUIET / 10.0);
            let square = |(x, y): (&f64, &f64)| (10.0 * (x.max(floor) / y.max(floor)).log10()).powi(2);
            let mean = x.iter().zip(&y).map(square).sum::<f64>() / x.len() as f64;
            self.distances += mean.sqrt();
            self.frames += 1;
        }
    }

    /// The frames of both.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            ratios: self.ratios + other.ratios,
            segments: self.segments + other.segments,
            distances: self.distances + other.distances,
            frames: self.frames + other.frames,
        }
    }

    /// Mean signal-to-noise ratio of frames of 20 ms, dB, each between -10 and 35 dB; frames 60 dB below the loudest one do not count.
    ///
    /// # Source
    /// Hansen and Pellom, "An effective quality evaluation protocol for speech enhancement algorithms" (ICSLP 1998).
    #[must_use]
    pub fn segmental_ratio(&self) -> f64 {
        self.ratios / self.segments.max(1) as f64
    }

    /// Mean over frames of about 40 ms of the root mean square difference of the power spectra in dB; bins 60 dB below the mean of their
    /// frame count as that level.
    ///
    /// # Source
    /// Gray and Markel, "Distance measures for speech processing" (IEEE Transactions on ASSP 24(5), 1976).
    #[must_use]
    pub fn log_spectral_distance(&self) -> f64 {
        self.distances / self.frames.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn noise(n: usize, seed: u64) -> Vec<f32> {
        let mut rng = Rng::new(seed);
        (0..n).map(|_| rng.between(-0.5, 0.5) as f32).collect()
    }

    fn of(x: &[f32], y: &[f32]) -> Distortion {
        let mut all = Distortion::default();
        all.add(x, y, 44_100.0);
        all
    }

    #[test]
    fn known_errors_have_known_figures() {
        let x = noise(44_100, 1);
        let same = of(&x, &x);
        assert_eq!((same.segmental_ratio(), same.log_spectral_distance()), (35.0, 0.0));
        // 6.02 dB of level: the error has a quarter of the energy, each bin differs by 6.02 dB.
        let half: Vec<f32> = x.iter().map(|x| 0.5 * x).collect();
        let level = of(&x, &half);
        assert!((level.segmental_ratio() - 6.0206).abs() < 1e-3);
        assert!((level.log_spectral_distance() - 6.0206).abs() < 1e-2);
        // Noise of a tenth of the amplitude.
        let with: Vec<f32> = x.iter().zip(noise(44_100, 2)).map(|(x, n)| x + 0.1 * n).collect();
        assert!((of(&x, &with).segmental_ratio() - 20.0).abs() < 0.2);
        // Silence is worth nothing; other noise less than nothing, with a distance of some dB.
        let silent = of(&x, &[]);
        assert!(silent.segmental_ratio().abs() < 1e-9 && silent.log_spectral_distance() > 40.0);
        let other = of(&x, &noise(44_100, 3));
        assert!((other.segmental_ratio() + 3.0103).abs() < 0.1);
        assert!((5.0..9.0).contains(&other.log_spectral_distance()));
    }

    #[test]
    fn quiet_frames_and_empty_sounds_do_not_count() {
        let mut x = noise(8820, 4);
        x.extend(noise(8820, 5).iter().map(|x| 1e-4 * x));
        let all = of(&x, &x[..8820]);
        assert!(all.segmental_ratio() > 34.9, "{}", all.segmental_ratio());
        assert_eq!((of(&[], &[]).segmental_ratio(), of(&[0.0; 100], &[]).segments), (0.0, 0));
    }
}
