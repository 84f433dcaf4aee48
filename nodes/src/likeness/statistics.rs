//! Statistics of one sound, which can be added to those of other sounds.

use super::active::{ActiveSound, power_db};
use super::bands::{Moments, band_energies, octaves, third_octaves};
use super::modulation::{MODULATION_BANDS, MODULATION_EDGES, modulation_spectrum};
use crate::statistics::quantile;
use rayon::prelude::*;

/// A band of modulation is measured if its upper edge is at most this share of the centre of the carrier: the envelope of a band follows
/// nothing faster than the width of the band.
const FASTEST: f64 = 0.7;

/// Width of a third of an octave and of an octave, relative to the centre.
const THIRD: f64 = 0.2316;
const OCTAVE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Standard error of a power that is relatively 1, dB.
const POWER_ERROR: f64 = 4.343;

/// Power in each band of modulation with the duration in s that it is of.
type WeightedPowers = [Option<(f64, f64)>; MODULATION_BANDS];

/// A value with the quantity that it is of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Measured {
    pub quantity: &'static str,
    pub unit: &'static str,
    pub band_hz: Option<f64>,
    pub modulation_hz: Option<[f64; 2]>,
    pub value: Option<f64>,
    /// Standard error of noise of this length: dB, or relative for kurtosis.
    pub error: f64,
}

/// Levels, moments and modulation of a sound by band.
#[derive(Clone, Debug, Default)]
pub struct SoundStatistics {
    /// Samples per second.
    rate: f64,
    /// Levels of the active frames, dB.
    pub levels: Vec<f64>,
    /// Moments of all active frames.
    pub all: Moments,
    /// Moments by third of an octave: centre in Hz and moments.
    pub thirds: Vec<(f64, Moments)>,
    /// Moments by octave.
    pub octaves: Vec<(f64, Moments)>,
    /// Power of modulation of the whole sound, without a centre, and of each octave.
    modulation: Vec<(Option<f64>, WeightedPowers)>,
}

/// Percentile of values; `None` without values.
pub(super) fn percentile(sorted: &[f64], share: f64) -> Option<f64> {
    (!sorted.is_empty()).then(|| quantile(sorted, share))
}

impl SoundStatistics {
    /// Measures a sound in the bands below a limit in Hz.
    ///
    /// # Complexity
    /// Linear in samples, for each of up to 31 bands.
    #[must_use]
    pub fn new(sound: &ActiveSound, limit: f64) -> Self {
        let rate = sound.rate / sound.block as f64;
        let weight = sound.seconds();
        let modulation_of = |centre: Option<f64>, energies: &[f64]| {
            let mut powers = modulation_spectrum(energies, rate).map(|p| p.map(|p| (p, weight)));
            for (power, edges) in powers.iter_mut().zip(MODULATION_EDGES.windows(2)) {
                if centre.is_some_and(|centre| edges[1] > FASTEST * centre) {
                    *power = None;
                }
            }
            (centre, powers)
        };
        let (all, energies) = band_energies(sound, None);
        let mut modulation = vec![modulation_of(None, &energies)];
        let thirds = third_octaves(limit).into_par_iter();
        let thirds = thirds.map(|band| (band.centre, band_energies(sound, Some(&band)).0)).collect();
        let in_octaves: Vec<_> = octaves(limit)
            .into_par_iter()
            .map(|band| {
                let (moments, energies) = band_energies(sound, Some(&band));
                ((band.centre, moments), modulation_of(Some(band.centre), &energies))
            })
            .collect();
        let (octaves, of_octaves): (Vec<_>, Vec<_>) = in_octaves.into_iter().unzip();
        modulation.extend(of_octaves);
        Self { rate: sound.rate, levels: sound.levels(), all, thirds, octaves, modulation }
    }

    /// The statistics of several sounds as one; all were measured with the same limit.
    #[must_use]
    pub fn pooled<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = all.into_iter();
        let Some(mut sum) = all.next().cloned() else { return Self::default() };
        for other in all {
            sum.levels.extend(&other.levels);
            sum.all = sum.all.with(other.all);
            let bands = sum.thirds.iter_mut().zip(&other.thirds);
            bands.chain(sum.octaves.iter_mut().zip(&other.octaves)).for_each(|(a, b)| a.1 = a.1.with(b.1));
            for (a, b) in sum.modulation.iter_mut().zip(&other.modulation) {
                for (a, b) in a.1.iter_mut().zip(b.1) {
                    *a = match (*a, b) {
                        (Some((p, u)), Some((q, v))) => Some(((p * u + q * v) / (u + v), u + v)),
                        (a, b) => a.or(b),
                    };
                }
            }
        }
        sum
    }

    /// Range between the 10th and the 90th percentile of the levels of active frames, dB.
    #[must_use]
    pub fn level_spread(&self) -> Option<f64> {
        let mut levels = self.levels.clone();
        levels.sort_unstable_by(f64::total_cmp);
        Some(percentile(&levels, 0.9)? - percentile(&levels, 0.1)?)
    }

    /// Number of independent values in the active frames of a band of a width in Hz.
    fn independent(&self, width: f64) -> f64 {
        (2.0 * width * self.all.count / self.rate.max(1.0)).max(1.0)
    }

    /// All values in a fixed order.
    pub(super) fn measured(&self) -> Vec<Measured> {
        let one = |quantity, unit, band_hz, modulation_hz, value: Option<f64>, error| {
            let value = value.filter(|x| x.is_finite());
            Measured { quantity, unit, band_hz, modulation_hz, value, error }
        };
        let mut out = vec![one("level spread", "dB", None, None, self.level_spread(), 0.0)];
        for (centre, moments) in &self.thirds {
            let share = (self.all.second > 0.0).then(|| power_db(moments.second / self.all.second));
            let error = POWER_ERROR * (2.0 / self.independent(THIRD * centre)).sqrt();
            out.push(one("third octave", "dB", Some(*centre), None, share, error));
        }
        // The variance of the kurtosis of n normal numbers is 24 / n.
        let error = |width: f64| (24.0 / self.independent(width)).sqrt() / 3.0;
        out.push(one("kurtosis", "", None, None, self.all.kurtosis(), error(self.rate / 2.0)));
        for (centre, moments) in &self.octaves {
            out.push(one("kurtosis", "", Some(*centre), None, moments.kurtosis(), error(OCTAVE * centre)));
        }
        for (centre, powers) in &self.modulation {
            for (power, edges) in powers.iter().zip(MODULATION_EDGES.windows(2)) {
                let value = power.map(|(power, _)| power_db(power));
                // A Hann window correlates the bins of the spectrum: it is as if there were half as many.
                let bins = power.map_or(1.0, |(_, seconds)| 0.5 * seconds * (edges[1] - edges[0]));
                let error = POWER_ERROR * bins.max(1.0).recip().sqrt();
                out.push(one("modulation", "dB", *centre, Some([edges[0], edges[1]]), value, error));
            }
        }
        out
    }
}

#[cfg(test)]
pub(super) mod testing {
    use crate::core::random::Rng;

    /// Independent samples of a normal distribution with a standard deviation of 0.1.
    pub fn gaussian(samples: usize, seed: u64) -> Vec<f32> {
        let mut rng = Rng::new(seed);
        let mut one = || {
            let radius = (-2.0 * (1.0 - rng.uniform()).ln()).sqrt();
            (0.1 * radius * (std::f64::consts::TAU * rng.uniform()).cos()) as f32
        };
        (0..samples).map(|_| one()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::testing::gaussian;
    use super::*;

    #[test]
    fn the_parts_of_a_sound_together_have_its_statistics() {
        let x = gaussian(192_000, 3);
        let of = |x: &[f32]| SoundStatistics::new(&ActiveSound::new(x, 48_000.0), 24_000.0);
        let (whole, parts) = (of(&x), [of(&x[..96_000]), of(&x[96_000..])]);
        let pooled = SoundStatistics::pooled(&parts);
        for (a, b) in whole.measured().iter().zip(pooled.measured()) {
            let same = (a.quantity, a.band_hz, a.modulation_hz) == (b.quantity, b.band_hz, b.modulation_hz);
            // The slowest band is too slow for a half.
            let (Some(x), Some(y)) = (a.value, b.value) else { continue };
            let close = (x - y).abs() < 0.3 + 2.0 * a.error;
            assert!(same && close && a.error <= b.error + 1e-9, "{a:?} {b:?}");
        }
        assert!(SoundStatistics::pooled([]).measured()[0].value.is_none());
    }

    #[test]
    fn the_spread_of_two_levels_is_their_difference() {
        let x: Vec<f32> = gaussian(96_000, 5)
            .iter()
            .enumerate()
            .map(|(k, x)| x * if k < 48_000 { 1.0 } else { 0.1 })
            .collect();
        let found = SoundStatistics::new(&ActiveSound::new(&x, 48_000.0), 24_000.0);
        assert!((found.level_spread().unwrap() - 20.0).abs() < 0.7, "{:?}", found.level_spread());
    }
}
