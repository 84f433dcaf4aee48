//! A test of recordings: are they impacts on one object?

use crate::core::random::Rng;
use crate::modal::extraction::poles::unexplained_db;
use rayon::prelude::*;

/// Number of shifted copies of the poles that an explanation is compared with.
const SHIFTS: usize = 19;
/// Range of the relative shifts of the frequencies: wider than heavily damped modes are.
const SHIFT: [f64; 2] = [0.03, 0.15];
/// Standard deviation of a uniform rank.
const RANK_DEVIATION: f64 = 0.288_675;
/// The normal variable that 5 % exceed.
const ONE_SIDED_5: f64 = 1.645;
/// Duration that is explained, s.
const LONGEST: f64 = 1.0;

/// One take of an object: its sound from the onset on, and the frequencies in Hz and decay rates in 1/s that were found in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knock<'a> {
    /// Samples from the onset on.
    pub sound: &'a [f64],
    /// Sample rate, Hz.
    pub rate: f64,
    /// Frequencies and decay rates.
    pub poles: &'a [[f64; 2]],
}

/// Result of [`one_object`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OneObject {
    /// Number of takes.
    pub takes: usize,
    /// Number of ordered pairs of takes.
    pub pairs: usize,
    /// Mean over pairs of the rank of the poles among their shifted copies: 0.5 by chance, near 0 for one object.
    pub mean_rank: f64,
    /// Median over pairs of the unexplained energy by the poles of another take, dB.
    pub unexplained_db: f64,
    /// Median over pairs of that by shifted poles minus it, dB.
    pub gain_db: f64,
}

impl OneObject {
    /// True if the mean rank is lower than chance has it in 5 % of the sets of as many independent takes.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.pairs > 0 && self.mean_rank < 0.5 - ONE_SIDED_5 * RANK_DEVIATION / (self.takes as f64).sqrt()
    }
}

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    crate::material::statistics::quantile(&x, 0.5)
}

/// Tests whether takes are impacts on one object, whose frequencies do not depend on where it is struck.
///
/// The poles of each take explain each other take with free amplitudes. The same is done with 19 copies whose frequencies are multiplied
/// by a factor that differs from 1 by 3 to 15 %, which explain as much by chance: heavily damped sines explain much of any dull hit. The
/// rank of the poles among them is uniform if frequencies have nothing in common. The test takes each take as one independent rank.
///
/// # Complexity
/// O(pairs 20 (samples poles + poles^3)), in parallel.
#[must_use]
pub fn one_object(takes: &[Knock<'_>], seed: u64) -> OneObject {
    let pair = |k: usize| {
        let (of, on) = (k / takes.len(), k % takes.len());
        if of == on || takes[of].poles.is_empty() {
            return None;
        }
        let (poles, take) = (takes[of].poles, &takes[on]);
        let sound = &take.sound[..take.sound.len().min((LONGEST * take.rate) as usize)];
        let found = unexplained_db(sound, take.rate, poles);
        let mut rng = Rng::new(seed.wrapping_add(k as u64));
        let shifted: Vec<f64> = (0..SHIFTS)
            .map(|_| {
                let size = rng.between(SHIFT[0], SHIFT[1]);
                let factor = if rng.below(2) == 0 { 1.0 + size } else { 1.0 - size };
                let poles: Vec<[f64; 2]> = poles.iter().map(|[f, d]| [f * factor, *d]).collect();
                unexplained_db(sound, take.rate, &poles)
            })
            .collect();
        let better = shifted.iter().filter(|db| **db <= found).count();
        Some((found, median(shifted) - found, (better as f64 + 0.5) / (SHIFTS + 1) as f64))
    };
    let all: Vec<(f64, f64, f64)> = (0..takes.len() * takes.len()).into_par_iter().filter_map(pair).collect();
    if all.is_empty() {
        return OneObject::default();
    }
    OneObject {
        takes: takes.len(),
        pairs: all.len(),
        mean_rank: all.iter().map(|p| p.2).sum::<f64>() / all.len() as f64,
        unexplained_db: median(all.iter().map(|p| p.0).collect()),
        gain_db: median(all.iter().map(|p| p.1).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::Feature;
    use crate::modal::extraction::poles::resynthesis;

    fn take(rng: &mut Rng, frequencies: &[f64]) -> (Vec<f64>, Vec<[f64; 2]>) {
        let feature = |f: &f64| Feature {
            freq_hz: *f,
            decay: rng.between(5.0, 30.0),
            amp: rng.between(0.01, 0.3),
            phase: rng.between(-3.0, 3.0),
            ..Feature::default()
        };
        let features: Vec<Feature> = frequencies.iter().map(feature).collect();
        let poles = features.iter().map(|f| [f.freq_hz, f.decay]).collect();
        (resynthesis(&features, 44_100.0, 22_050, |f| f.decay), poles)
    }

    #[test]
    fn takes_of_one_object_pass_and_those_of_several_do_not() {
        let mut rng = Rng::new(3);
        let own: Vec<f64> = (0..12).map(|_| rng.between(5.3, 9.0).exp()).collect();
        let same: Vec<_> = (0..3).map(|_| take(&mut rng, &own)).collect();
        let different: Vec<_> = (0..3)
            .map(|_| {
                let own: Vec<f64> = (0..12).map(|_| rng.between(5.3, 9.0).exp()).collect();
                take(&mut rng, &own)
            })
            .collect();
        let test = |takes: &[(Vec<f64>, Vec<[f64; 2]>)]| {
            let knocks: Vec<Knock<'_>> =
                takes.iter().map(|(sound, poles)| Knock { sound, rate: 44_100.0, poles }).collect();
            one_object(&knocks, 1)
        };
        let (same, different) = (test(&same), test(&different));
        assert!(same.holds() && same.mean_rank < 0.05, "{same:?}");
        assert!(!different.holds(), "{different:?}");
        assert!(!test(&[]).holds());
    }
}
