//! Recordings for trials.

use crate::core::random::Rng;
use crate::io::trial_wav;
use std::f64::consts::TAU;

/// Half a second of one mode at 8 kHz, as a WAV file.
pub(super) fn trial_impact(rng: &mut Rng) -> Vec<u8> {
    let (f, d) = (rng.between(200.0, 2000.0), rng.between(5.0, 30.0));
    let sample = |n: usize| {
        let t = n as f64 / 8000.0;
        (0.5 * (-d * t).exp() * (TAU * f * t).sin()) as f32
    };
    trial_wav(&(0..4000).map(sample).collect::<Vec<_>>(), 8000)
}
