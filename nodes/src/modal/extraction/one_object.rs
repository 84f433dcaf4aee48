//! A test of takes: recordings of one object have the same poles, whatever the hit point and the striker.

use super::feature::FeatureSet;
use super::onset::onset;
use super::poles::unexplained_db;
use crate::statistics::quantile;
use serde::{Deserialize, Serialize};

/// Time after the onset that is left out, s: the contact differs from take to take.
const CONTACT: f64 = 0.005;
/// Unexplained energy above which a take is not of the object of the others: the median over them, dB.
pub const ONE_OBJECT: f64 = -10.0;
/// Maximum number of takes with which each is compared.
const PARTNERS: usize = 8;

/// Energy that the modes of a take leave unexplained of another recording, from 5 ms after its onset to its end, in dB of that energy.
///
/// The modes have their frequencies and decay rates, and the amplitudes and phases that explain the most. `samples` is one impact at `rate`
/// samples a second. Without modes or sound the result is 0 dB.
///
/// # Complexity
/// O(samples modes + modes^3).
///
/// # Example
/// ```
/// use foley_nodes::modal::{Feature, FeatureSet, unexplained_by};
/// let mode = Feature { freq_hz: 880.0, decay: 12.0, amp: 0.5, ..Feature::default() };
/// let set = FeatureSet { features: vec![mode], ..FeatureSet::default() };
/// let sound = |f: f64| -> Vec<f32> {
///     (0..20_000).map(|n| f64::from(n) / 44_100.0).map(|t| ((-12.0 * t).exp() * (6.2832 * f * t).sin()) as f32).collect()
/// };
/// assert!(unexplained_by(&set, &sound(880.0), 44_100.0) < -40.0);
/// assert!(unexplained_by(&set, &sound(700.0), 44_100.0) > -3.0);
/// ```
#[must_use]
pub fn unexplained_by(set: &FeatureSet, samples: &[f32], rate: f64) -> f64 {
    let start = onset(samples, rate);
    let sound: Vec<f64> = samples[start..].iter().map(|x| f64::from(*x)).collect();
    let late = ((CONTACT * rate) as usize).min(sound.len() / 2);
    let sound = &sound[late..];
    let poles: Vec<[f64; 2]> = set.features.iter().map(|f| [f.freq_hz, f.decay]).collect();
    unexplained_db(sound, rate, &poles)
}

/// Energies of two takes of one object that the modes of the other take leave unexplained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TakePair {
    /// Indices of the takes.
    pub takes: [usize; 2],
    /// Energy of the first that the modes of the second leave unexplained, dB.
    pub first_db: f64,
    /// Energy of the second that the modes of the first leave unexplained, dB.
    pub second_db: f64,
}

impl TakePair {
    /// Mean of both figures: a strike may leave out modes that the other take has.
    #[must_use]
    pub fn mean_db(&self) -> f64 {
        0.5 * (self.first_db + self.second_db)
    }
}

/// One impact with all modes that explain it, those of the contact included.
pub(super) struct TakeSound {
    pub(super) set: FeatureSet,
    /// The recording from before its onset to the end of the impact.
    pub(super) samples: Vec<f32>,
    pub(super) rate: f64,
}

/// Compares takes of one object, each with up to [`PARTNERS`] that follow it, in both directions.
///
/// # Complexity
/// O(takes samples modes).
pub(super) fn compare_takes(takes: &[TakeSound]) -> Vec<TakePair> {
    let mut pairs: Vec<[usize; 2]> = Vec::new();
    for k in 0..takes.len() {
        let same = (1..takes.len())
            .map(|step| (k + step) % takes.len())
            .filter(|other| takes[*other].set.object == takes[k].set.object);
        for other in same.take(PARTNERS) {
            let pair = [k.min(other), k.max(other)];
            if !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
    }
    let by = |a: usize, b: usize| unexplained_by(&takes[b].set, &takes[a].samples, takes[a].rate);
    let compared =
        pairs.iter().map(|[a, b]| TakePair { takes: [*a, *b], first_db: by(*a, *b), second_db: by(*b, *a) });
    compared.collect()
}

/// Median over the pairs of a take; `None` without one.
pub(super) fn median_of_take(pairs: &[TakePair], take: usize) -> Option<f64> {
    let mut all: Vec<f64> =
        pairs.iter().filter(|pair| pair.takes.contains(&take)).map(TakePair::mean_db).collect();
    all.sort_by(f64::total_cmp);
    (!all.is_empty()).then(|| quantile(&all, 0.5))
}

#[cfg(test)]
mod tests {
    use super::super::extract::{ExtractParams, extract};
    use super::*;
    use crate::core::random::Rng;
    use std::f64::consts::{PI, TAU};

    /// An impact on an object whose modes have the given frequencies and decay rates, with amplitudes of its own.
    fn take(modes: &[(f64, f64)], object: &str, seed: u64) -> TakeSound {
        let mut rng = Rng::new(seed);
        let hit: Vec<(f64, f64)> =
            modes.iter().map(|_| (rng.between(0.05, 0.3), rng.between(-PI, PI))).collect();
        let samples: Vec<f32> = (0..30_000)
            .map(|n| {
                let t = f64::from(n) / 44_100.0;
                let mode = |((f, d), (a, p)): (&(f64, f64), &(f64, f64))| {
                    a * libm::exp(-d * t) * libm::cos(TAU * f * t + p)
                };
                modes.iter().zip(&hit).map(mode).sum::<f64>() as f32 + 1e-4 * rng.between(-1.0, 1.0) as f32
            })
            .collect();
        let params = ExtractParams { contact: true, ..ExtractParams::default() };
        let features = extract(&samples, 44_100.0, &params).unwrap().features;
        let set = FeatureSet { object: object.into(), features, ..FeatureSet::default() };
        TakeSound { set, samples, rate: 44_100.0 }
    }

    #[test]
    fn takes_of_one_object_explain_each_other_and_a_stranger_stands_out() {
        let plate = [(310.0, 9.0), (742.0, 12.0), (1290.0, 18.0), (2711.0, 30.0), (5230.0, 60.0)];
        let bowl = [(405.0, 9.0), (861.0, 12.0), (1530.0, 18.0), (3107.0, 30.0), (6011.0, 60.0)];
        let takes = [take(&plate, "a", 1), take(&plate, "a", 2), take(&plate, "a", 3), take(&bowl, "a", 4)];
        let pairs = compare_takes(&takes);
        assert_eq!(pairs.len(), 6);
        for (k, fits) in [true, true, true, false].into_iter().enumerate() {
            let median = median_of_take(&pairs, k).unwrap();
            assert_eq!(median < ONE_OBJECT, fits, "{k}: {median}");
        }
        // Takes of different objects are not compared.
        assert!(compare_takes(&[take(&plate, "a", 1), take(&bowl, "b", 2)]).is_empty());
        assert_eq!(median_of_take(&[], 0), None);
    }
}
