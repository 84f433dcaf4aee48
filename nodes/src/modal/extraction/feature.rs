//! Modes found in one recording.

use crate::core::item::Data;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// One mode of one recording: `amp exp(-decay t) cos(2 pi freq_hz t + phase)` after the onset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feature {
    /// Damped frequency, Hz.
    pub freq_hz: f64,
    /// Amplitude at the onset, full scale 1.
    pub amp: f64,
    /// Decay rate `d` of the amplitude, 1/s.
    pub decay: f64,
    /// Phase at the onset, rad.
    pub phase: f64,
    /// Standard deviation of the frequency, Hz; 0 if unknown.
    pub sd_freq: f64,
    /// Standard deviation of the decay rate, 1/s; 0 if unknown.
    pub sd_decay: f64,
    /// Level of the multi-resolution analysis that found it.
    pub level: u8,
    /// Relative residual of its fit: 0 is perfect.
    pub quality: f32,
}

/// Largest decay rate of a mode of an object, 1/s: faster ones are part of the contact.
pub const MAX_DECAY: f64 = 500.0;
/// Smallest quality factor of a mode of an object: below, it is a thud rather than an oscillation.
const MIN_QUALITY_FACTOR: f64 = 5.0;

impl Feature {
    /// Returns true if the feature is a mode of the object rather than a part of the contact: it decays by at most 500 1/s, has a
    /// quality factor `pi f / d` of at least 5, and a decay rate with a known relative standard deviation of less than `uncertainty`.
    #[must_use]
    pub fn is_certain(&self, uncertainty: f64) -> bool {
        let quality_factor = PI * self.freq_hz / self.decay;
        self.decay <= MAX_DECAY
            && quality_factor >= MIN_QUALITY_FACTOR
            && self.sd_decay > 0.0
            && self.sd_decay < uncertainty * self.decay
    }
}

/// The modes of one recording of one impact.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureSet {
    /// Name of the recording.
    pub recording: String,
    /// Name of the object that was struck; recordings of one object share modes.
    pub object: String,
    /// Support of the object; empty if unknown.
    #[serde(default)]
    pub support: String,
    /// The modes, in the order of extraction.
    pub features: Vec<Feature>,
}

impl FeatureSet {
    /// The first value that is not finite, or out of range.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let wrong = |index: usize, field: &str, found: f64, needed: &str| {
            Some(format!("`{field}` of feature {index} is {found}; {needed}"))
        };
        self.features.iter().enumerate().find_map(|(i, f)| {
            let positive = |x: f64| x.is_finite() && x > 0.0;
            let accuracy = |x: f64| x.is_finite() && x >= 0.0;
            match f {
                _ if !positive(f.freq_hz) => {
                    wrong(i, "freq_hz", f.freq_hz, "a finite number above 0 Hz is needed")
                }
                _ if !positive(f.decay) => {
                    wrong(i, "decay", f.decay, "a finite number above 0 1/s is needed")
                }
                _ if !accuracy(f.amp) => wrong(i, "amp", f.amp, "a finite number of at least 0 is needed"),
                _ if !accuracy(f.sd_freq) => {
                    wrong(i, "sd_freq", f.sd_freq, "a finite number of at least 0 Hz is needed")
                }
                _ if !accuracy(f.sd_decay) => {
                    wrong(i, "sd_decay", f.sd_decay, "a finite number of at least 0 1/s is needed")
                }
                _ if !accuracy(f.quality.into()) => {
                    wrong(i, "quality", f.quality.into(), "a finite number of at least 0 is needed")
                }
                _ if !f.phase.is_finite() => wrong(i, "phase", f.phase, "a finite number is needed"),
                _ => None,
            }
        })
    }
}

/// The modes of several recordings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureSets {
    /// One for each impact.
    pub sets: Vec<FeatureSet>,
}

impl Data for FeatureSets {
    const NAME: &'static str = "modal features";

    fn trial(rng: &mut Rng) -> Self {
        let feature = |rng: &mut Rng| {
            let freq_hz = rng.between(5.0, 9.5).exp();
            Feature {
                freq_hz,
                amp: rng.between(-5.0, 0.0).exp(),
                decay: 2.0 + 1e-8 * freq_hz * freq_hz + rng.between(0.0, 6.0),
                phase: rng.between(-3.0, 3.0),
                sd_decay: rng.between(0.01, 0.2),
                ..Feature::default()
            }
        };
        let set = |rng: &mut Rng| {
            let features = (0..10 + rng.below(20)).map(|_| feature(rng)).collect();
            let support = format!("support {}", rng.below(3));
            FeatureSet { recording: "trial".into(), object: "trial".into(), support, features }
        };
        Self { sets: (0..1 + rng.below(3)).map(|_| set(rng)).collect() }
    }
}
