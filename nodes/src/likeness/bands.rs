//! Energies of a sound in bands of an octave and of a third of one.

use super::active::ActiveSound;
use crate::dsp::{self, Butterworth, Cascade};

/// Order of each edge of a band.
const ORDER: usize = 4;
/// Bands per octave, and the octaves below 1 kHz.
const OCTAVES_BELOW: i32 = 3;
/// The highest centre is four octaves above 1 kHz.
const OCTAVES_ABOVE: i32 = 4;

/// A band of frequencies, Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Lower edge.
    pub low: f64,
    /// Geometric mean of the edges.
    pub centre: f64,
    /// Upper edge.
    pub high: f64,
}

/// Bands whose upper edges are below a limit, from 125 Hz on.
fn bands(per_octave: i32, limit: f64) -> Vec<Band> {
    let ratio = |k: f64| 2_f64.powf(k / f64::from(per_octave));
    let band = |k: i32| {
        let centre = 1000.0 * ratio(f64::from(k));
        Band { low: centre * ratio(-0.5), centre, high: centre * ratio(0.5) }
    };
    let all = (-OCTAVES_BELOW * per_octave..=OCTAVES_ABOVE * per_octave).map(band);
    all.filter(|band| band.high < 0.95 * limit).collect()
}

/// Thirds of an octave with centres from 125 Hz to 16 kHz, below a limit in Hz.
#[must_use]
pub fn third_octaves(limit: f64) -> Vec<Band> {
    bands(3, limit)
}

/// Octaves with centres from 125 Hz to 16 kHz, below a limit in Hz.
#[must_use]
pub fn octaves(limit: f64) -> Vec<Band> {
    bands(1, limit)
}

/// Sums of powers of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of samples.
    pub count: f64,
    /// Sum of their squares.
    pub second: f64,
    /// Sum of their fourth powers.
    pub fourth: f64,
}

impl Moments {
    /// Fourth moment over the squared second one: 3 for Gaussian noise, 1.5 for a sine; `None` for silence.
    #[must_use]
    pub fn kurtosis(&self) -> Option<f64> {
        (self.second > 0.0).then(|| self.fourth * self.count / (self.second * self.second))
    }

    /// Adds samples.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            second: self.second + other.second,
            fourth: self.fourth + other.fourth,
        }
    }
}

/// The moments of the active frames of a sound in a band, or of the whole sound, and the energy of each block of a millisecond.
///
/// # Complexity
/// Linear.
#[must_use]
pub fn band_energies(sound: &ActiveSound, band: Option<&Band>) -> (Moments, Vec<f64>) {
    let design = |pass, cutoff: f64| Butterworth::design(pass, ORDER, cutoff, sound.rate).ok();
    let designs = band.map(|b| [design(dsp::Band::HighPass, b.low), design(dsp::Band::LowPass, b.high)]);
    let mut filters: Vec<Cascade> =
        designs.into_iter().flatten().flatten().map(|d| Cascade::new(&d, 1)).collect();
    let (mut moments, mut energies) = (Moments::default(), Vec::new());
    let mut y = vec![0.0; sound.block];
    for (k, x) in sound.samples.chunks_exact(sound.block).enumerate() {
        y.copy_from_slice(x);
        filters.iter_mut().for_each(|filter| filter.process(&mut y));
        let squares = || y.iter().map(|y| f64::from(*y).powi(2));
        let second: f64 = squares().sum();
        energies.push(second);
        if sound.is_active(k * sound.block) {
            let fourth = squares().map(|p| p * p).sum();
            moments = moments.with(Moments { count: y.len() as f64, second, fourth });
        }
    }
    (moments, energies)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::likeness::statistics::testing::gaussian;

    #[test]
    fn bands_meet_and_end_below_the_limit() {
        let thirds = third_octaves(24_000.0);
        assert!(thirds.windows(2).all(|w| (w[0].high / w[1].low - 1.0).abs() < 1e-12));
        assert!((thirds[0].centre - 125.0).abs() < 1e-9 && thirds.len() == 22);
        assert_eq!(octaves(24_000.0).len(), 8);
        assert!(octaves(11_025.0).iter().all(|b| b.high < 11_025.0));
        assert!(octaves(100.0).is_empty());
    }

    #[test]
    fn a_white_noise_has_the_energy_of_each_width_and_the_kurtosis_of_a_gaussian() {
        let sound = ActiveSound::new(&gaussian(480_000, 1), 48_000.0);
        let (all, _) = band_energies(&sound, None);
        // The lowest octave reaches below the high-pass.
        for band in octaves(24_000.0).into_iter().skip(1) {
            let (moments, energies) = band_energies(&sound, Some(&band));
            let share = moments.second / all.second;
            // Edges of fourth order are 2.6 % wider than ideal ones.
            let expected = 1.026 * (band.high - band.low) / 23_900.0;
            assert!((10.0 * (share / expected).log10()).abs() < 0.4, "{band:?} {share} {expected}");
            assert!((moments.kurtosis().unwrap() - 3.0).abs() < 0.25, "{band:?} {moments:?}");
            assert!((energies.iter().sum::<f64>() / moments.second - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn sparse_samples_have_the_kurtosis_of_their_density() {
        // Of samples that are 0 but for a share p, with a sign each: 1 / p. The high-pass widens each a little.
        let mut rng = Rng::new(4);
        let sparse = |_| match rng.uniform() {
            u if u < 0.005 => -1.0,
            u if u < 0.01 => 1.0,
            _ => 0.0,
        };
        let x: Vec<f32> = (0..480_000).map(sparse).collect();
        let (moments, _) = band_energies(&ActiveSound::new(&x, 48_000.0), None);
        let found = moments.kurtosis().unwrap();
        assert!((found / 100.0 - 1.0).abs() < 0.05, "{found}");
    }
}
