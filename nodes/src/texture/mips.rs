//! A line of noise at half, a quarter, an eighth of its density, for contacts that pass many samples at once.

use super::item::NoiseProfile;
use super::pyramid::level_for;
use std::f64::consts::PI;

/// Taps to either side of the middle of the half-band filter: 31 in all.
const SIDE: i64 = 15;
/// Shape of the Kaiser window: 60 dB of attenuation.
const BETA: f64 = 5.653;

/// A loop of noise and its halvings.
///
/// Sample 0 lies in the same place on every level and every level is as long in metres, so that the place of a tip in metres is
/// divided by the level's own spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileMips {
    /// The profile as it came first; each next has half as many samples, rounded up.
    pub levels: Vec<NoiseProfile>,
}

impl ProfileMips {
    /// All levels, down to fewer samples than the filter has taps.
    ///
    /// # Complexity
    /// `O(31 samples)`.
    #[must_use]
    pub fn new(profile: NoiseProfile) -> Self {
        let mut levels = vec![profile];
        while let Some(last) = levels.last().filter(|last| last.samples.len() > 2 * SIDE as usize) {
            let next = halved(last);
            levels.push(next);
        }
        Self { levels }
    }

    /// Which level to read for steps of `footprint` samples of the first: as [`super::Pyramid::level_for`].
    #[must_use]
    pub fn level_for(&self, footprint: f64) -> f64 {
        level_for(footprint, self.levels.len())
    }
}

/// A windowed sinc that keeps the lower half of the band, as a function of place so that loops of odd length work too.
fn half_band(x: f64) -> f64 {
    let sinc = if x == 0.0 { 1.0 } else { (PI * x / 2.0).sin() / (PI * x / 2.0) };
    let r = x / (SIDE + 1) as f64;
    if r.abs() >= 1.0 { 0.0 } else { 0.5 * sinc * bessel(BETA * (1.0 - r * r).sqrt()) / bessel(BETA) }
}

/// The modified Bessel function of order 0, by its series.
fn bessel(x: f64) -> f64 {
    let mut term = 1.0;
    (1..40).fold(1.0, |sum, k| {
        term *= (x / 2.0 / f64::from(k)).powi(2);
        sum + term
    })
}

fn halved(profile: &NoiseProfile) -> NoiseProfile {
    let n = profile.samples.len();
    let half = n.div_ceil(2);
    let step = n as f64 / half as f64;
    let taps = |part: f64| -> Vec<f64> {
        let taps: Vec<f64> = (-SIDE..=SIDE + 1).map(|t| half_band(t as f64 - part)).collect();
        let sum: f64 = taps.iter().sum();
        taps.iter().map(|t| t / sum).collect()
    };
    let whole = taps(0.0);
    let sample = |k: usize| {
        let place = k as f64 * step;
        let (at, part) = (place.floor() as i64, place.fract());
        let own = (part > 0.0).then(|| taps(part));
        let weights = own.as_ref().unwrap_or(&whole);
        let sum = (at - SIDE..).zip(weights).map(|(at, w)| {
            let at = at.rem_euclid(n as i64) as usize;
            w * f64::from(profile.samples.get(at).copied().unwrap_or_default())
        });
        sum.sum::<f64>() as f32
    };
    NoiseProfile { samples: (0..half).map(sample).collect(), spacing: profile.spacing * step }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn wave(n: usize, cycles: f64) -> NoiseProfile {
        let sample = |k: usize| (TAU * cycles * k as f64 / n as f64).cos() as f32;
        NoiseProfile { samples: (0..n).map(sample).collect(), spacing: 0.001 }
    }

    fn rms(samples: &[f32]) -> f64 {
        (samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
    }

    #[test]
    fn what_the_next_level_can_hold_stays_and_what_would_fold_goes() {
        let n = 4096;
        let level = |part: f64| {
            let mips = ProfileMips::new(wave(n, (n as f64 * part / 2.0).round()));
            20.0 * (rms(&mips.levels[1].samples) * 2_f64.sqrt()).log10()
        };
        // By the part of the band: kept up to 0.4, and 60 dB down from 0.62 on.
        for part in [0.01, 0.1, 0.2, 0.3, 0.4] {
            assert!(level(part).abs() < 0.1, "{part}: {}", level(part));
        }
        for part in [0.62, 0.7, 0.8, 0.9, 0.99] {
            assert!(level(part) < -59.0, "{part}: {}", level(part));
        }
    }

    #[test]
    fn levels_are_as_long_and_in_the_same_place() {
        for n in [1024, 1023, 257] {
            let mips = ProfileMips::new(wave(n, 3.0));
            assert!(mips.levels.len() >= 5);
            for level in &mips.levels[..4] {
                let length = level.spacing * level.samples.len() as f64;
                assert!((length / (0.001 * n as f64) - 1.0).abs() < 1e-12);
                for (k, x) in level.samples.iter().enumerate() {
                    let right = (TAU * 3.0 * k as f64 / level.samples.len() as f64).cos();
                    assert!((f64::from(*x) - right).abs() < 4e-3, "{n}: {k}: {x} {right}");
                }
            }
        }
    }

    #[test]
    fn the_filter_has_31_taps_and_every_second_is_zero() {
        assert!(half_band(15.0).abs() > 1e-6 && half_band(16.0) == 0.0);
        assert!((1..8).all(|k| half_band(2.0 * f64::from(k)).abs() < 1e-12));
    }
}
