//! Recordings of the tests of this module.

use crate::core::computation::NotStored;
use crate::core::random::Rng;
use crate::grain::correlation::{CorrelateRules, CorrelationPatterns, correlate};
use crate::grain::dictionary::{ExtractRules, GrainDictionary, extract};
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};

/// Decaying impacts of one body: modes of random amplitudes and a little noise.
pub(super) fn impacts(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut x = vec![0.0_f32; n];
    for start in (200..n).step_by(5000) {
        let modes: Vec<(f64, f64)> =
            [0.031, 0.083, 0.142, 0.207].iter().map(|f| (*f, rng.between(0.05, 0.2))).collect();
        for (i, y) in x[start..].iter_mut().enumerate().take(4500) {
            let t = i as f64;
            let ring: f64 = modes.iter().map(|(f, a)| a * (std::f64::consts::TAU * f * t).sin()).sum();
            *y += ((-t / 800.0).exp() * (ring + rng.between(-0.02, 0.02))) as f32;
        }
    }
    x
}

/// Several recordings of such impacts, with their grains and their patterns.
pub(super) fn stored(count: u64) -> (GrainRecordings, GrainDictionary, CorrelationPatterns) {
    let recording = |k: u64| GrainRecording {
        name: format!("impacts_{k}.wav"),
        parts: vec![Part { component: Component::Whole, channels: vec![impacts(20_000, k)] }],
        ..GrainRecording::default()
    };
    let all = GrainRecordings { rate: 44_100.0, recordings: (0..count).map(recording).collect() };
    let (dictionary, _) = extract(&all, &ExtractRules::at_rate(44_100.0));
    let patterns = correlate(&all, &dictionary, &CorrelateRules::default(), &|_| false, &NotStored).unwrap();
    (all, dictionary, patterns)
}
