//! Damping of a material over frequency, as an event.

use crate::core::item::Event;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// Number of frequencies of a curve.
const POINTS: usize = 48;
/// The first and the last of them, Hz; between, their ratios are equal.
const BAND: [f64; 2] = [10.0, 40_000.0];

/// Decay rates over frequency, at 48 frequencies from 10 Hz to 40 kHz.
///
/// It is `Copy` and owns no memory, so that it may cross into the audio thread. Between the frequencies the logarithm of the decay rate is
/// linear in that of the frequency, which is exact for power laws; that of a Rayleigh damping is off by less than 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DampingCurve {
    /// Natural logarithms of the decay rates of amplitude in 1/s.
    #[serde(with = "crate::core::state::long")]
    logs: [f32; POINTS],
}

impl DampingCurve {
    /// The curve of a decay rate in 1/s as a function of the frequency in Hz; rates below 10^-6 1/s count as that.
    #[must_use]
    pub fn new(decay: impl Fn(f64) -> f64) -> Self {
        let frequency = |k: usize| BAND[0] * (BAND[1] / BAND[0]).powf(k as f64 / (POINTS - 1) as f64);
        Self { logs: std::array::from_fn(|k| decay(frequency(k)).max(1e-6).ln() as f32) }
    }

    /// The curve between this one and another, where the decay rates are interpolated geometrically; 0 is this one.
    #[must_use]
    pub fn blend(&self, other: &Self, share: f64) -> Self {
        let share = share as f32;
        Self { logs: std::array::from_fn(|k| self.logs[k] + share * (other.logs[k] - self.logs[k])) }
    }

    /// Decay rate at a frequency in Hz, 1/s; the ends of the curve count for frequencies beyond them.
    #[must_use]
    pub fn decay(&self, frequency: f64) -> f64 {
        let at = (frequency / BAND[0]).max(1.0).ln() / (BAND[1] / BAND[0]).ln() * (POINTS - 1) as f64;
        let k = (at as usize).min(POINTS - 2);
        let share = (at - k as f64).clamp(0.0, 1.0);
        let [a, b] = [self.logs[k], self.logs[k + 1]].map(f64::from);
        (a + share * (b - a)).exp()
    }

    /// Returns true if all decay rates are finite.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.logs.iter().all(|x| x.is_finite() && x.abs() < 40.0)
    }
}

impl Event for DampingCurve {
    const NAME: &'static str = "damping curves";

    fn trial(rng: &mut Rng) -> Self {
        let (low, slope) = (rng.between(0.5, 20.0), rng.between(0.0, 1e-7));
        Self::new(|f| low + slope * f * f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_laws_are_exact_and_rayleigh_damping_is_within_a_percent() {
        let power = DampingCurve::new(|f| 0.01 * f.powf(0.8));
        let rayleigh = DampingCurve::new(|f| 0.5 * (3.9 + 1e-8 * (std::f64::consts::TAU * f).powi(2)));
        for k in 0..500 {
            let f = 20.0 * 1000f64.powf(f64::from(k) / 499.0);
            assert!((power.decay(f) / (0.01 * f.powf(0.8)) - 1.0).abs() < 1e-5, "{f}");
            let expected = 0.5 * (3.9 + 1e-8 * (std::f64::consts::TAU * f).powi(2));
            assert!((rayleigh.decay(f) / expected - 1.0).abs() < 0.01, "{f}");
        }
        assert!(
            (power.blend(&rayleigh, 0.5).decay(300.0).powi(2) / (power.decay(300.0) * rayleigh.decay(300.0))
                - 1.0)
                .abs()
                < 1e-5
        );
        assert!((rayleigh.decay(0.0) - rayleigh.decay(10.0)).abs() < 1e-9);
        assert!((rayleigh.decay(1e9) / rayleigh.decay(40_000.0) - 1.0).abs() < 1e-9);
    }
}
