//! Distances between a recording and its resynthesis.

use super::bands::{Octave, Spectrum, decay_curve, third_octaves};
use super::onset::onset;
use crate::statistics::quantile;
use foley_fft::FftPlanner;

/// Range below the loudest third of an octave within which bands count, dB.
const RANGE: f64 = 40.0;
/// Levels of the energy decay curve between which a decay is measured, dB: T20.
const DECAY: [f64; 2] = [-5.0, -25.0];
/// Part of an octave on each side of its centre that is measured in full.
const FLAT: f64 = 0.5;
/// Time over which the spectral distance is measured, s.
const FIRST: f64 = 0.3;

/// One band of a comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandLevel {
    /// Centre, Hz.
    pub centre: f64,
    /// Energy of the reference, dB, full scale per sample.
    pub reference_db: f64,
    /// Energy of the other sound.
    pub audio_db: f64,
}

/// The decay of an octave in both sounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandDecay {
    /// Centre, Hz.
    pub centre: f64,
    /// Three times T20 of the reference, s.
    pub reference_s: f64,
    /// Three times T20 of the other sound, s.
    pub audio_s: f64,
}

/// Distances between a reference and another sound that begin together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Index of the onset in the reference.
    pub onset: usize,
    /// Energy of the difference relative to the reference from the onset to the end, dB.
    pub difference_db: f64,
    /// The same from 5 ms after the onset on.
    pub late_difference_db: f64,
    /// Thirds of an octave within 40 dB of the loudest, from the onset to the end.
    pub levels: Vec<BandLevel>,
    /// Octaves whose decay by 25 dB stands above the noise of the reference.
    pub decays: Vec<BandDecay>,
    /// Root mean square difference of the levels of thirds of an octave in the first 300 ms, dB.
    pub spectral_distance_db: f64,
}

fn median(mut x: Vec<f64>) -> Option<f64> {
    x.sort_by(f64::total_cmp);
    (!x.is_empty()).then(|| quantile(&x, 0.5))
}

impl Comparison {
    /// Median and largest difference of the levels of thirds of an octave, dB.
    #[must_use]
    pub fn level_differences(&self) -> Option<[f64; 2]> {
        let all: Vec<f64> = self.levels.iter().map(|b| (b.audio_db - b.reference_db).abs()).collect();
        let max = all.iter().copied().fold(0.0, f64::max);
        median(all).map(|median| [median, max])
    }

    /// Median relative difference of the decay times.
    #[must_use]
    pub fn decay_difference(&self) -> Option<f64> {
        median(self.decays.iter().map(|b| (b.audio_s / b.reference_s - 1.0).abs()).collect())
    }
}

/// Compares a sound with a reference; both have the sample rate `rate` and begin at the same time.
///
/// # Complexity
/// O(samples log samples).
///
/// # Source
/// Schroeder, "New method of measuring reverberation time" (JASA 37, 1965), for decay times.
#[must_use]
pub fn compare(reference: &[f32], audio: &[f32], rate: f64) -> Comparison {
    if reference.is_empty() {
        return Comparison::default();
    }
    let onset = onset(reference, rate);
    let length = reference.len() - onset;
    let from = |x: &[f32]| -> Vec<f64> {
        (0..length).map(|n| x.get(onset + n).copied().map_or(0.0, f64::from)).collect()
    };
    let [a, b] = [reference, audio].map(from);
    let difference_db = |from: usize| {
        let difference: f64 = a[from..].iter().zip(&b[from..]).map(|(a, b)| (a - b).powi(2)).sum();
        let energy: f64 = a[from..].iter().map(|a| a * a).sum();
        10.0 * (difference.max(1e-30) / energy.max(1e-30)).log10()
    };
    let late = ((0.005 * rate) as usize).min(length / 2);
    Comparison {
        onset,
        difference_db: difference_db(0),
        late_difference_db: difference_db(late),
        levels: band_levels(&a, &b, rate),
        decays: band_decays(&a, &b, rate),
        spectral_distance_db: spectral_distance_db(&a, &b, rate),
    }
}

/// Root mean square difference of the levels of thirds of an octave in the first 300 ms, dB, of sounds of one length that begin at the
/// onset; of bands within 40 dB of the loudest of the reference.
///
/// # Complexity
/// O(samples log samples).
#[must_use]
pub fn spectral_distance_db(reference: &[f64], audio: &[f64], rate: f64) -> f64 {
    let first = ((FIRST * rate) as usize).min(reference.len()).min(audio.len());
    let start = band_levels(&reference[..first], &audio[..first], rate);
    let square = |b: &BandLevel| (b.audio_db - b.reference_db).clamp(-RANGE, RANGE).powi(2);
    (start.iter().map(square).sum::<f64>() / start.len().max(1) as f64).sqrt()
}

/// Levels of thirds of an octave within 40 dB of the loudest of the reference.
fn band_levels(reference: &[f64], audio: &[f64], rate: f64) -> Vec<BandLevel> {
    let [reference, audio] = [reference, audio].map(|x| Spectrum::new(x, rate));
    let db = |x: &Spectrum, low: f64, high: f64| 10.0 * x.energy(low, high).max(1e-30).log10();
    let level = |[low, centre, high]: [f64; 3]| BandLevel {
        centre,
        reference_db: db(&reference, low, high),
        audio_db: db(&audio, low, high),
    };
    let mut levels: Vec<BandLevel> = third_octaves(rate).map(level).collect();
    let loudest = levels.iter().map(|b| b.reference_db).fold(f64::NEG_INFINITY, f64::max);
    levels.retain(|b| b.reference_db > loudest - RANGE);
    levels
}

/// Decays of the octaves from 125 Hz to 16 kHz, where a decay by 25 dB stands above the noise in both sounds.
fn band_decays(reference: &[f64], audio: &[f64], rate: f64) -> Vec<BandDecay> {
    let [reference, audio] = [reference, audio].map(|x| Spectrum::new(x, rate));
    let mut planner = FftPlanner::new();
    let centres = (-3..=4).map(|k| 1000.0 * 2.0_f64.powi(k)).filter(|f| f * 2.0_f64.sqrt() < 0.5 * rate);
    let decay = |centre: f64| {
        let [reference, audio] =
            [&reference, &audio].map(|x| decay_time(&x.octave(centre, FLAT, &mut planner)));
        Some(BandDecay { centre, reference_s: reference?, audio_s: audio? })
    };
    centres.filter_map(decay).collect()
}

/// Three times T20, s; `None` where a decay by 25 dB does not stand above the noise.
pub(super) fn decay_time(octave: &Octave) -> Option<f64> {
    let Octave { energies, step, .. } = octave;
    // The noise is that of the last tenth: it must lie 35 dB below the maximum of a smoothed envelope.
    let width = (0.01 / step).ceil() as usize;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    let max = energies.chunks(width.max(1)).map(mean).fold(0.0, f64::max);
    let noise = mean(&energies[energies.len() - energies.len().div_ceil(10)..]);
    if max <= 0.0 || noise > 10f64.powf(-3.5) * max {
        return None;
    }
    let curve = decay_curve(energies, 0.0);
    let below = |db: f64| curve.iter().position(|e| *e <= curve[0] * 10f64.powf(0.1 * db));
    let (from, to) = (below(DECAY[0])?, below(DECAY[1])?);
    (to > from).then(|| 3.0 * (to - from) as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn burst(d: f64, gain: f64, seed: u64) -> Vec<f32> {
        let mut rng = Rng::new(seed);
        (0..88_200)
            .map(|n| {
                if n < 1000 {
                    0.0
                } else {
                    (gain * libm::exp(-d * f64::from(n - 1000) / 44_100.0) * rng.between(-1.0, 1.0)) as f32
                }
            })
            .collect()
    }

    #[test]
    fn a_sound_equals_itself() {
        let x = burst(20.0, 0.5, 1);
        let found = compare(&x, &x, 44_100.0);
        assert!(found.difference_db < -200.0 && found.spectral_distance_db == 0.0);
        assert_eq!(
            (found.level_differences().unwrap(), found.decay_difference().unwrap()),
            ([0.0, 0.0], 0.0)
        );
        // T60 is 6.908 / d.
        let decay = found.decays.iter().find(|b| b.centre == 4000.0).unwrap().reference_s;
        assert!((decay / (6.908 / 20.0) - 1.0).abs() < 0.1, "{decay}");
    }

    #[test]
    fn levels_and_decays_differ_by_what_was_changed() {
        let (a, b) = (burst(20.0, 0.5, 1), burst(40.0, 1.0, 2));
        let found = compare(&a, &b, 44_100.0);
        let [median, _] = found.level_differences().unwrap();
        // Twice the amplitude, half of the time: 3 dB.
        assert!((median - 3.0).abs() < 0.5, "{median}");
        assert!((found.decay_difference().unwrap() - 0.5).abs() < 0.05, "{found:?}");
        assert!((found.difference_db - 4.8).abs() < 0.3, "{}", found.difference_db);
    }

    #[test]
    fn silence_and_short_sounds_have_distances_too() {
        assert_eq!(compare(&[], &[], 44_100.0), Comparison::default());
        let found = compare(&[0.0; 100], &[0.5], 44_100.0);
        assert!(found.difference_db.is_finite() && found.decays.is_empty());
        assert!(compare(&burst(20.0, 0.5, 1), &[], 44_100.0).difference_db.abs() < 1e-6);
    }
}
