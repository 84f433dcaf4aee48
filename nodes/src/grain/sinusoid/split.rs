//! Steady and transient part of a recording.

use super::peaks::{PeakFinder, PeakRules};
use super::synthesis::add_tracks;
use super::tracks::{PartialTracker, Track, TrackRules, tracks_of};
use crate::feature::{FluxFrames, ONSET_RISE, onsets};

/// A recording as the sum of two.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SteadyTransient {
    /// Sum of its sinusoids.
    pub steady: Vec<f32>,
    /// The sound without them: `x - steady`.
    pub transient: Vec<f32>,
    /// The sinusoids.
    pub tracks: Vec<Track>,
}

/// Finds the sinusoidal tracks of a recording; frame `k` is centred on sample `k hop`.
#[must_use]
pub fn find_tracks(x: &[f32], peaks: PeakRules, tracks: TrackRules, rate: f64) -> Vec<Track> {
    let (mut finder, hop) = (PeakFinder::new(peaks, rate), peaks.hop.max(1));
    let frames = (0..=x.len() / hop).map(|k| {
        let mut found = Vec::new();
        finder.find_at(x, (k * hop) as i64, &mut found);
        found
    });
    tracks_of(frames, PartialTracker::new(tracks, peaks.max_peaks, hop as f64 / rate))
}

/// The sample within reach of an onset at which the signal begins to differ from the samples before.
fn attack_near(x: &[f32], onset: usize, reach: usize) -> usize {
    let from = onset.saturating_sub(reach);
    let near = x.get(from..x.len().min(onset + reach)).unwrap_or_default();
    let peak = near.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    let before = x.get(from.saturating_sub(reach)..from).unwrap_or_default();
    let quiet = before.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    let limit = (0.03 * peak).max(1.5 * quiet);
    // An onset that does not stand out stays where the flux rises.
    near.iter().position(|x| x.abs() > limit).map_or(onset, |k| from + k)
}

/// The samples at which attacks of a recording begin.
pub(super) fn attacks(x: &[f32], rate: f64) -> Vec<usize> {
    let frames = FluxFrames::at_rate(rate);
    let attack = |onset: usize| attack_near(x, onset, frames.frame);
    onsets(x, frames, rate, ONSET_RISE).into_iter().map(attack).collect()
}

/// Splits a recording into its sinusoids and the residual. `steady + transient` is the recording up to rounding.
///
/// # Complexity
/// One transform a hop, and O(samples) for each track.
///
/// # Source
/// Serra and Smith, "Spectral modeling synthesis" (Computer Music Journal 14(4), 1990); Picard, Tsingos and Faure, "Retargetting Example
/// Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.1: the residual stays a signal, without a model of noise.
#[must_use]
pub fn split(x: &[f32], peaks: PeakRules, rules: TrackRules, rate: f64) -> SteadyTransient {
    let tracks = find_tracks(x, peaks, rules, rate);
    let attacks = attacks(x, rate);
    let mut steady = vec![0.0; x.len()];
    add_tracks(&tracks, &attacks, [peaks.hop, peaks.window / 2], rate, &mut steady);
    let transient = x.iter().zip(&steady).map(|(x, s)| x - s).collect();
    SteadyTransient { steady, transient, tracks }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use std::f64::consts::TAU;

    const RATE: f64 = 44_100.0;

    fn split_of(x: &[f32]) -> SteadyTransient {
        let peaks = PeakRules::at_rate(RATE);
        split(x, peaks, TrackRules::at_rate(RATE, peaks.hop), RATE)
    }

    fn energy(x: &[f32]) -> f64 {
        x.iter().map(|x| f64::from(*x).powi(2)).sum()
    }

    fn tone(f: f64, n: usize) -> Vec<f32> {
        (0..n).map(|i| (0.4 * (TAU * f * i as f64 / RATE + 0.3).cos()) as f32).collect()
    }

    #[test]
    fn a_tone_leaves_no_residual_and_the_parts_add_up() {
        let x = tone(1234.5, 44_100);
        let parts = split_of(&x);
        let inner = 3000..41_000;
        let left = 10.0 * (energy(&parts.transient[inner.clone()]) / energy(&x[inner])).log10();
        assert!(left < -65.0, "{left}");
        assert!(
            x.iter().zip(&parts.steady).zip(&parts.transient).all(|((x, s), t)| (x - s - t).abs() < 1e-6)
        );
    }

    #[test]
    fn tones_and_noise_are_separated() {
        let mut rng = Rng::new(2);
        let noise: Vec<f32> = (0..88_200)
            .map(|_| ((0..12).map(|_| rng.uniform()).sum::<f64>() - 6.0) as f32 * 0.0099)
            .collect();
        let x: Vec<f32> = tone(700.0, 88_200)
            .iter()
            .zip(tone(2113.0, 88_200))
            .zip(&noise)
            .map(|((a, b), n)| a + b + n)
            .collect();
        // A threshold above the noise, as it is for two tones 40 dB above it.
        let peaks = PeakRules { threshold: -50.0, ..PeakRules::at_rate(RATE) };
        let parts = split(&x, peaks, TrackRules::at_rate(RATE, peaks.hop), RATE);
        let inner = 3000..85_000;
        let rms = |x: &[f32]| (energy(x) / x.len() as f64).sqrt();
        let (left, truth) = (rms(&parts.transient[inner.clone()]), rms(&noise[inner]));
        assert!((left / truth - 1.0).abs() < 0.01, "{left} {truth}");
    }

    #[test]
    fn an_attack_has_no_pre_echo() {
        let mut x = vec![0.0_f32; 44_100];
        let attack = 20_011;
        for f in [523.0, 1370.0, 3100.0] {
            for (i, y) in x[attack..].iter_mut().enumerate() {
                *y += (0.3 * (-(i as f64) / 8000.0).exp() * (TAU * f * i as f64 / RATE).sin()) as f32;
            }
        }
        let parts = split_of(&x);
        let peak = x.iter().fold(0.0_f32, |p, x| p.max(x.abs()));
        let before = parts.steady[..attack - 44].iter().fold(0.0_f32, |p, x| p.max(x.abs()));
        assert!(20.0 * (before / peak).log10() < -50.0, "{}", 20.0 * (before / peak).log10());
        // Most of the ring is steady.
        assert!(energy(&parts.transient) < 0.1 * energy(&x), "{}", energy(&parts.transient) / energy(&x));
    }
}
