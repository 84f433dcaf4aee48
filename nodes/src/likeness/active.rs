//! A sound prepared for measurement: without its mean and rumble, in blocks of 1 ms and frames of 25 ms, some of them active.

use crate::dsp::{Band, Butterworth, Cascade};
use std::f64::consts::TAU;

/// Frequencies below are not measured, Hz: unit databases remove them too.
pub(super) const LOWEST: f64 = 100.0;
/// Blocks in a frame.
pub(super) const FRAME_BLOCKS: usize = 25;
/// Frames that are softer than the loudest by more than this are not active, dB.
const RANGE: f64 = 40.0;
/// No frame below this level is active, dB of full scale.
const SILENCE: f64 = -100.0;

/// One channel of a sound, high-passed at 100 Hz, with the level of each frame of 25 ms.
///
/// A frame is active if it is at most 40 dB softer than the loudest one and above -100 dB of full scale. A sample that is not finite counts
/// as 0.
#[derive(Clone, Debug)]
pub struct ActiveSound {
    pub(super) rate: f64,
    pub(super) samples: Vec<f32>,
    /// Samples in a block.
    pub(super) block: usize,
    /// Mean square of each frame.
    powers: Vec<f64>,
    active: Vec<bool>,
}

/// A power in dB; a power of 0 is -200 dB.
pub(crate) fn power_db(power: f64) -> f64 {
    10.0 * power.max(1e-20).log10()
}

/// A periodic Hann window.
pub(super) fn hann(frame: usize) -> Vec<f32> {
    let weight = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / frame as f64).cos();
    (0..frame).map(|k| weight(k) as f32).collect()
}

impl ActiveSound {
    /// Prepares one channel at a rate in Hz. A remainder of less than a frame at its end is not measured.
    ///
    /// # Complexity
    /// Linear.
    #[must_use]
    pub fn new(mono: &[f32], rate: f64) -> Self {
        let finite = |x: &f32| if x.is_finite() { *x } else { 0.0 };
        let mean = mono.iter().map(|x| f64::from(finite(x))).sum::<f64>() / mono.len().max(1) as f64;
        let mut samples: Vec<f32> = mono.iter().map(|x| (f64::from(finite(x)) - mean) as f32).collect();
        // A rate of less than 200 Hz has nothing to remove.
        if let Ok(design) = Butterworth::design(Band::HighPass, 4, LOWEST, rate) {
            Cascade::new(&design, 1).process(&mut samples);
        }
        let block = ((rate / 1000.0).round() as usize).max(1);
        let frame = block * FRAME_BLOCKS;
        let power = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64;
        let powers: Vec<f64> = samples.chunks_exact(frame).map(power).collect();
        let loudest = powers.iter().copied().fold(0.0, f64::max);
        let least = (loudest * 10_f64.powf(-RANGE / 10.0)).max(10_f64.powf(SILENCE / 10.0));
        let active = powers.iter().map(|p| *p > least).collect();
        Self { rate, samples, block, powers, active }
    }

    /// Samples in a frame.
    #[must_use]
    pub fn frame(&self) -> usize {
        self.block * FRAME_BLOCKS
    }

    /// Length, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.samples.len() as f64 / self.rate
    }

    /// Number of active frames.
    #[must_use]
    pub fn active_frames(&self) -> usize {
        self.active.iter().filter(|active| **active).count()
    }

    /// Length of all active frames, s.
    #[must_use]
    pub fn active_seconds(&self) -> f64 {
        (self.active_frames() * self.frame()) as f64 / self.rate
    }

    /// Returns true if the frame that contains a sample is active.
    #[must_use]
    pub fn is_active(&self, sample: usize) -> bool {
        self.active.get(sample / self.frame()).copied().unwrap_or(false)
    }

    /// Levels of the active frames, dB of full scale.
    #[must_use]
    pub fn levels(&self) -> Vec<f64> {
        self.active_powers().map(power_db).collect()
    }

    /// Level of all active frames together, dB of full scale; `None` for a silent sound.
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        let count = self.active_frames();
        (count > 0).then(|| power_db(self.active_powers().sum::<f64>() / count as f64))
    }

    fn active_powers(&self) -> impl Iterator<Item = f64> + '_ {
        self.powers.iter().zip(&self.active).filter(|(_, active)| **active).map(|(p, _)| *p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_is_removed_and_a_sound_of_nothing_else_is_silent() {
        let sound = ActiveSound::new(&[0.5; 48_000], 48_000.0);
        assert_eq!((sound.active_frames(), sound.level()), (0, None));
        let sound = ActiveSound::new(&[f32::NAN; 100], 48_000.0);
        assert!(sound.samples.iter().all(|x| *x == 0.0) && sound.level().is_none());
        assert_eq!(ActiveSound::new(&[], 48_000.0).seconds(), 0.0);
    }

    #[test]
    fn frames_within_forty_decibels_of_the_loudest_are_active() {
        // A tone that becomes softer by 30 dB, and by 60 dB.
        let tone = |n: usize| (std::f64::consts::TAU * 1000.0 * n as f64 / 48_000.0).sin();
        let gain = |n: usize| [1.0, 0.0316, 0.001][n / 48_000];
        let x: Vec<f32> = (0..144_000).map(|n| (gain(n) * tone(n)) as f32).collect();
        let sound = ActiveSound::new(&x, 48_000.0);
        assert!((80..=82).contains(&sound.active_frames()), "{}", sound.active_frames());
        assert!(sound.is_active(0) && sound.is_active(60_000) && !sound.is_active(120_000));
        assert!((sound.level().unwrap() + 6.02).abs() < 0.1);
    }
}
