//! From frequencies and dampings to the numbers of the recursion, in double precision.

use super::modes::Modes;
use std::f64::consts::TAU;

/// Share of the sample rate above which a mode is left out: so near to half the rate it is no tone any more.
pub(crate) const HIGHEST: f64 = 0.49;

/// Least decay, in nepers per sample: below it, rounding in single precision could let a mode grow. At 44.1 kHz, 60 dB then
/// take eight minutes.
const SLOWEST: f64 = 3e-7;

/// One mode at one sample rate.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mode {
    /// Radians per sample.
    angle: f64,
    /// Nepers per sample.
    decay: f64,
    /// `sin(angle)`, after the pitch.
    sin: f64,
    /// `1 - cos(angle)`, after the pitch, without cancellation.
    versine: f64,
    /// Whether the pitch leaves it below half the rate.
    sounds: bool,
}

impl Mode {
    fn new(frequency: f64, damping: f64, rate: f64) -> Self {
        let mut mode = Self { angle: TAU * frequency / rate, decay: damping / rate, ..Self::default() };
        mode.set_pitch(1.0);
        mode
    }

    /// Multiplies its frequency.
    pub fn set_pitch(&mut self, factor: f64) {
        let angle = self.angle * factor;
        self.sounds = angle < TAU * HIGHEST;
        self.sin = libm::sin(angle);
        self.versine = 2.0 * libm::sin(0.5 * angle).powi(2);
    }

    /// One step of the recursion, `exp(-decay + i angle) - 1`, as real and imaginary part.
    ///
    /// Slow modes hardly turn in one sample: what is left after taking away 1 keeps all its digits in single precision, so
    /// that neither their frequency nor their damping moves.
    pub fn step(&self, damping: f64) -> (f32, f32) {
        if !self.sounds {
            return (-1.0, 0.0);
        }
        let shrink = expm1(-(self.decay * damping).max(SLOWEST));
        let radius = 1.0 + shrink;
        ((shrink - radius * self.versine) as f32, (radius * self.sin) as f32)
    }
}

/// `exp(x) - 1` for `x <= 0`: a Taylor series where it is short, for dampings move many times a second.
fn expm1(x: f64) -> f64 {
    if x < -0.125 {
        return libm::expm1(x);
    }
    // The next term, x^9/9!, is less than 2e-13 of the first.
    const INVERSE: [f64; 7] = [1.0 / 8.0, 1.0 / 7.0, 1.0 / 6.0, 1.0 / 5.0, 1.0 / 4.0, 1.0 / 3.0, 1.0 / 2.0];
    INVERSE.iter().fold(1.0, |sum, k| 1.0 + x * k * sum) * x
}

/// The modes of an object that can sound at a rate, and their places among all of them.
pub(crate) fn audible(modes: &Modes, rate: f64) -> Vec<(usize, Mode)> {
    let all = modes.frequencies.iter().zip(&modes.dampings).enumerate();
    let heard = all.filter(|(_, (f, _))| **f < HIGHEST * rate);
    heard.map(|(i, (&f, &d))| (i, Mode::new(f, d, rate))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_series_is_as_good_as_the_library() {
        for k in 0..2000 {
            let x = -0.0001 * f64::from(k);
            assert!((expm1(x) - libm::expm1(x)).abs() <= 2e-13 * x.abs(), "{x}");
        }
    }

    #[test]
    fn a_step_is_the_complex_exponential_less_one() {
        for (f, d) in [(20.0, 0.5), (440.0, 5.0), (15_000.0, 300.0), (100.0, 20_000.0)] {
            let (re, im) = Mode::new(f, d, 44_100.0).step(2.0);
            let (r, w) = ((-2.0 * d / 44_100.0).exp(), TAU * f / 44_100.0);
            assert!((f64::from(re) - (r * w.cos() - 1.0)).abs() < 1e-7, "{f}");
            assert!((f64::from(im) - r * w.sin()).abs() < 1e-7, "{f}");
        }
    }

    #[test]
    fn a_mode_that_the_pitch_takes_beyond_half_the_rate_falls_silent() {
        let mut mode = Mode::new(15_000.0, 3.0, 44_100.0);
        mode.set_pitch(2.0);
        assert_eq!(mode.step(1.0), (-1.0, 0.0));
        mode.set_pitch(1.0);
        assert_ne!(mode.step(1.0), (-1.0, 0.0));
    }
}
