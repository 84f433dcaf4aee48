//! One band of the noise of an impact.

use serde::{Deserialize, Serialize};

/// Maximum number of bands of an object.
pub const MAX_BANDS: usize = 32;

/// Noise between two frequencies that starts with an impact and decays exponentially.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseBand {
    /// Lower edge, Hz.
    pub low: f64,
    /// Upper edge, Hz.
    pub high: f64,
    /// Decay rate of the amplitude, 1/s.
    pub damping: f64,
    /// Amplitude at the onset, full scale per N s: the RMS value is this over the square root of 2.
    pub gain: f32,
}

impl NoiseBand {
    /// The geometric mean of the edges, Hz.
    #[must_use]
    pub fn centre(&self) -> f64 {
        (self.low * self.high).sqrt()
    }

    /// The first value that is not finite or out of range: the field, the value and what is needed.
    #[must_use]
    pub fn fault(&self) -> Option<(&'static str, f64, &'static str)> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if !positive(self.low) {
            return Some(("low", self.low, " and above 0 Hz"));
        }
        if !(self.high.is_finite() && self.high > self.low) {
            return Some(("high", self.high, " and above `low`"));
        }
        if !positive(self.damping) {
            return Some(("damping", self.damping, " and above 0 1/s"));
        }
        (!self.gain.is_finite()).then_some(("gain", self.gain.into(), ""))
    }
}
