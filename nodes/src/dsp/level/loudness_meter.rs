//! Integrated loudness of programmes.
//!
//! # Source
//! ITU-R BS.1770-4, annex 1: K-weighting, blocks of 400 ms that overlap by three quarters, gates at -70 LUFS and 10 LU below the mean.

use super::weighting::{LUFS_OFFSET, Weighting, WeightingFilter};
use crate::impl_state;

/// Blocks of 400 ms advance by a quarter of their length.
const HOPS: usize = 4;
/// Loudness of the absolute gate, LUFS.
const GATE: f64 = -70.0;
/// Relative gate below the mean of the blocks that pass the absolute gate, LU.
const RELATIVE: f64 = 10.0;
/// Classes of block loudness per LU, and their number: -70 to +30 LUFS.
const PER_LU: f64 = 10.0;
const CLASSES: usize = 1000;

/// Measures the integrated loudness in blocks of any length, in constant memory.
///
/// The relative gate has a resolution of 0.1 LU. A sound shorter than one block of 400 ms is measured as a whole, without gates.
///
/// # Complexity
/// O(1) per sample.
#[derive(Clone, Debug)]
pub struct LoudnessMeter {
    filter: WeightingFilter,
    weights: Vec<f64>,
    /// Frames per hop of 100 ms.
    hop: usize,
    /// Frames of the current hop, and all frames.
    frames: usize,
    total: u64,
    /// Power sums of the current hop, of the hops before it, and of all.
    power: f64,
    hops: [f64; HOPS],
    finished: u64,
    sum: f64,
    /// Number of blocks and sum of their mean powers, by loudness.
    counts: Vec<u64>,
    powers: Vec<f64>,
}
impl_state!(LoudnessMeter { filter, frames, total, power, hops, finished, sum, counts, powers });

/// Weight of a channel: surround channels count more, low-frequency effects not at all.
fn channel_weight(channel: usize, channels: usize) -> f64 {
    match (channels, channel) {
        (6, 3) => 0.0,
        (5 | 6, k) if k + 2 >= channels => 1.41,
        _ => 1.0,
    }
}

/// Loudness of a mean power, LUFS.
fn lufs(power: f64) -> f64 {
    10.0 * power.log10() + LUFS_OFFSET
}

impl LoudnessMeter {
    /// A meter for interleaved audio of a rate in Hz.
    #[must_use]
    pub fn new(rate: f64, channels: usize) -> Self {
        Self {
            filter: Weighting::K.filter(rate, channels),
            weights: (0..channels).map(|k| channel_weight(k, channels)).collect(),
            hop: ((0.1 * rate).round() as usize).max(1),
            frames: 0,
            total: 0,
            power: 0.0,
            hops: [0.0; HOPS],
            finished: 0,
            sum: 0.0,
            counts: vec![0; CLASSES],
            powers: vec![0.0; CLASSES],
        }
    }

    /// Adds interleaved samples.
    pub fn process(&mut self, samples: &[f32]) {
        for frame in samples.chunks_exact(self.weights.len().max(1)) {
            for (k, x) in frame.iter().enumerate() {
                self.power += self.weights[k] * self.filter.tick(k, *x).powi(2);
            }
            self.frames += 1;
            if self.frames == self.hop {
                self.end_hop();
            }
        }
    }

    fn end_hop(&mut self) {
        self.hops.rotate_left(1);
        self.hops[HOPS - 1] = self.power;
        self.sum += self.power;
        self.total += self.frames as u64;
        self.finished += 1;
        (self.power, self.frames) = (0.0, 0);
        if self.finished < HOPS as u64 {
            return;
        }
        let mean = self.hops.iter().sum::<f64>() / (HOPS * self.hop) as f64;
        let class = PER_LU * (lufs(mean) - GATE);
        // NaN and silence are below the gate.
        if class >= 0.0 {
            let class = (class as usize).min(CLASSES - 1);
            self.counts[class] += 1;
            self.powers[class] += mean;
        }
    }

    /// Loudness of all samples so far, LUFS; minus infinity for silence.
    #[must_use]
    pub fn integrated(&self) -> f64 {
        if self.finished < HOPS as u64 {
            let frames = self.total + self.frames as u64;
            return lufs((self.sum + self.power) / frames.max(1) as f64);
        }
        let mean = |from: usize| {
            let blocks: u64 = self.counts[from..].iter().sum();
            self.powers[from..].iter().sum::<f64>() / blocks as f64
        };
        let all = mean(0);
        if all.is_nan() {
            return f64::NEG_INFINITY;
        }
        let relative = PER_LU * (lufs(all) - RELATIVE - GATE);
        lufs(mean((relative.max(0.0) as usize).min(CLASSES - 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sine(level_db: f64, seconds: f64, rate: f64) -> Vec<f32> {
        let a = 10_f64.powf(level_db / 20.0);
        let n = (seconds * rate) as usize;
        (0..n).map(|n| (a * (TAU * 1000.0 * n as f64 / rate).sin()) as f32).collect()
    }

    fn stereo(parts: &[(f64, f64)], rate: f64) -> Vec<f32> {
        parts.iter().flat_map(|(db, s)| sine(*db, *s, rate)).flat_map(|x| [x, x]).collect()
    }

    fn integrated(samples: &[f32], rate: f64, channels: usize, block: usize) -> f64 {
        let mut meter = LoudnessMeter::new(rate, channels);
        samples.chunks(block * channels).for_each(|block| meter.process(block));
        meter.integrated()
    }

    #[test]
    fn test_signals_of_tech_3341_have_their_loudness() {
        // EBU Tech 3341, table 1, cases 1 to 4: stereo sines of 1 kHz.
        for rate in [44_100.0, 48_000.0, 96_000.0] {
            for (parts, right) in [
                (&[(-23.0, 20.0)][..], -23.0),
                (&[(-33.0, 20.0)], -33.0),
                (&[(-36.0, 10.0), (-23.0, 60.0), (-36.0, 10.0)], -23.0),
                (&[(-72.0, 10.0), (-36.0, 10.0), (-23.0, 60.0), (-36.0, 10.0), (-72.0, 10.0)], -23.0),
            ] {
                let found = integrated(&stereo(parts, rate), rate, 2, 4096);
                assert!((found - right).abs() < 0.1, "{parts:?} at {rate} Hz: {found}");
            }
        }
    }

    #[test]
    fn blocks_and_short_sounds_do_not_matter_and_silence_has_no_loudness() {
        let sound = stereo(&[(-20.0, 1.3), (-60.0, 1.0), (-15.0, 0.7)], 48_000.0);
        let whole = integrated(&sound, 48_000.0, 2, usize::MAX / 4);
        for block in [1, 77, 4800] {
            assert_eq!(integrated(&sound, 48_000.0, 2, block), whole);
        }
        let short = integrated(&sine(-20.0, 0.05, 48_000.0), 48_000.0, 1, 64);
        assert!((short + 23.0).abs() < 0.5, "{short}");
        assert_eq!(integrated(&[0.0; 96_000], 48_000.0, 1, 512), f64::NEG_INFINITY);
        assert_eq!(LoudnessMeter::new(48_000.0, 2).integrated(), f64::NEG_INFINITY);
    }
}
