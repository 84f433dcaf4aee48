//! The attenuation of sound by an obstacle.

use serde::{Deserialize, Serialize};

/// A crossfade between the direct sound and an attenuated, low-passed version of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OcclusionFilter {
    /// Coefficient of the low-pass.
    low_pass: f64,
    /// Coefficient of the transition between free and blocked.
    transition: f64,
    gain: f64,
    /// State of the low-pass.
    filtered: f64,
    /// Degree of occlusion, from 0 to 1.
    occlusion: f64,
}

impl OcclusionFilter {
    /// Creates an unblocked filter at `fs` hertz. Blocked, it passes frequencies up to `cutoff` hertz at `gain`. The transition has the time
    /// constant `time` in seconds.
    #[must_use]
    pub fn new(cutoff: f64, gain: f64, time: f64, fs: f64) -> Self {
        let rise = |seconds: f64| 1.0 - libm::exp(-1.0 / (seconds * fs).max(1e-9));
        Self {
            low_pass: rise(1.0 / (std::f64::consts::TAU * cutoff)),
            transition: rise(time),
            gain,
            filtered: 0.0,
            occlusion: 0.0,
        }
    }

    /// Filters one sample. `blocked` is the state of the line of sight.
    pub fn process(&mut self, x: f32, blocked: bool) -> f32 {
        let x = f64::from(x);
        self.filtered += self.low_pass * (x - self.filtered);
        self.occlusion += self.transition * (f64::from(u8::from(blocked)) - self.occlusion);
        // Small values become 0 before they are denormal.
        if self.occlusion < 1e-9 {
            self.occlusion = 0.0;
        }
        if self.filtered.abs() < 1e-30 {
            self.filtered = 0.0;
        }
        if self.occlusion == 0.0 {
            x as f32
        } else {
            (x + self.occlusion * (self.gain * self.filtered - x)) as f32
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocked_sound_is_6_db_softer_and_another_3_db_at_the_cutoff() {
        let fs = 96_000.0;
        let level = |hz: f64| {
            let mut filter = OcclusionFilter::new(1500.0, 0.5, 0.05, fs);
            let tone = |k: usize| (std::f64::consts::TAU * hz * k as f64 / fs).sin() as f32;
            let out: Vec<f64> = (0..96_000).map(|k| f64::from(filter.process(tone(k), true))).collect();
            let square = out[48_000..].iter().map(|x| x * x).sum::<f64>() / 48_000.0;
            10.0 * (2.0 * square).log10()
        };
        assert!((level(20.0) + 6.02).abs() < 0.05, "{}", level(20.0));
        assert!((level(1500.0) + 9.03).abs() < 0.3, "{}", level(1500.0));
        assert!(level(12_000.0) < -22.0);
    }

    #[test]
    fn the_transition_takes_50_ms_and_free_sound_is_unchanged() {
        let mut filter = OcclusionFilter::new(1500.0, 0.5, 0.05, 48_000.0);
        assert!((0..100).all(|k| filter.process(k as f32, false) == k as f32));
        let mut filter = OcclusionFilter::new(1500.0, 0.5, 0.05, 48_000.0);
        (0..4800).for_each(|_| {
            filter.process(1.0, false);
        });
        let out: Vec<f32> = (0..4800).map(|_| filter.process(1.0, true)).collect();
        let expected = 1.0 - 0.5 * (1.0 - (-1.0_f32).exp());
        assert!((out[2399] - expected).abs() < 1e-3, "{}", out[2399]);
        assert!(out.windows(2).all(|w| (w[1] - w[0]).abs() < 3e-4), "no step");
    }
}
