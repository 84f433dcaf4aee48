//! Extension of a noise profile above the Nyquist frequency of its image, with the slope of its spectrum.
//!
//! A map has no frequencies above half its density in cycles per metre: at 1 m/s and 1024 px/m none above 512 Hz.
//!
//! # Source
//! van den Doel, Kry and Pai, "FoleyAutomatic" (SIGGRAPH 2001), for the spacing: one sample of audio at the highest speed.

use crate::core::random::Random;
use crate::texture::maps::{NoisePart, NoiseProfile, NoiseValue};
use foley_fft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Maximum length of an extended profile, in samples.
pub const MAX_EXTENDED: usize = 1 << 20;
/// Samples of the shortest profile that gets detail.
const SHORTEST: usize = 64;
/// Maximum added variance, relative to the profile.
const MAX_ADDED: f64 = 0.25;
/// Sample rate of audio for spacings, in Hz.
pub const NOMINAL_RATE: f64 = 44_100.0;

/// Figures of an extension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extension {
    /// Factor of the number of samples.
    pub factor: usize,
    /// Slope of the continued spectrum, in dB per octave.
    pub slope_db: f64,
    /// Added variance, relative to the profile.
    pub added: f64,
}

/// A loop of noise as it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseLine {
    /// One period of the loop.
    pub samples: Vec<f32>,
    /// Distance between samples, m.
    pub spacing: f64,
}

impl NoiseProfile {
    /// The loop with its detail, as heights or as slopes.
    ///
    /// # Complexity
    /// `O(n log n)` in the samples with detail.
    #[must_use]
    pub fn line(&self, value: NoiseValue) -> NoiseLine {
        self.extended(value).0
    }

    /// The same, and the figures of the detail.
    ///
    /// The spectrum of the samples does not change; above it, normal noise follows the slope of its upper two octaves.
    #[must_use]
    pub fn extended(&self, value: NoiseValue) -> (NoiseLine, Extension) {
        let factor = self.detail.map_or(1, |detail| detail.factor.max(1) as usize);
        let plain = NoiseLine { samples: self.samples.clone(), spacing: self.spacing };
        let same = Extension { factor: 1, slope_db: 0.0, added: 0.0 };
        let factor = if self.samples.len() < SHORTEST { 1 } else { factor };
        if self.samples.is_empty()
            || factor == 1 && value == NoiseValue::Height && self.part == NoisePart::Whole
        {
            return (plain, same);
        }
        let seed = self.detail.map_or(0, |detail| detail.seed);
        spectrum(self, factor, value, &Random::new(seed, "detail")).unwrap_or((plain, same))
    }
}

/// Returns the smallest power of two for the spacing of audio samples at `v_max` m/s, within [`MAX_EXTENDED`] samples.
#[must_use]
pub fn factor_for(profile: &NoiseProfile, v_max: f64) -> usize {
    let wanted = profile.spacing / (v_max / NOMINAL_RATE);
    let room = (MAX_EXTENDED / profile.samples.len().max(1)).max(1);
    let mut factor = 1;
    while (factor as f64) < wanted && 2 * factor <= room {
        factor *= 2;
    }
    factor
}

/// The loop by its spectrum. The buffers are from the plans, so that lengths match: it is `None` for no input.
fn spectrum(
    profile: &NoiseProfile,
    factor: usize,
    value: NoiseValue,
    random: &Random,
) -> Option<(NoiseLine, Extension)> {
    let n = profile.samples.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let mut line: Vec<f64> = profile.samples.iter().map(|x| f64::from(*x)).collect();
    let forward = planner.plan_fft_forward(n);
    let mut bins = forward.make_output_vec();
    forward.process(&mut line, &mut bins).ok()?;
    let length = n * factor;
    let mut wide = vec![Complex::new(0.0, 0.0); length / 2 + 1];
    let top = if factor == 1 { n / 2 } else { (n - 1) / 2 };
    wide.iter_mut().zip(&bins).take(top + 1).for_each(|(w, b)| *w = *b);
    let mut extension = Extension { factor, slope_db: 0.0, added: 0.0 };
    if factor > 1 {
        let (slope, level) = slope(&bins, n);
        let present: f64 = bins.iter().take(top + 1).skip(1).map(|b| b.norm_sqr()).sum();
        let mut added = 0.0;
        for (k, bin) in wide.iter_mut().enumerate().take(length / 2).skip(top + 1) {
            let power = (level + slope * (k as f64).ln()).exp();
            // Real and imaginary part are normal, so the squared magnitude is exponential.
            let magnitude = (-(1.0 - random.uniform(1, k as u64, 0)).ln() * power).sqrt();
            *bin = Complex::from_polar(magnitude, TAU * random.uniform(1, k as u64, 1));
            added += bin.norm_sqr();
        }
        let allowed = MAX_ADDED * present;
        let gain = if added > allowed { (allowed / added).sqrt() } else { 1.0 };
        wide.iter_mut().skip(top + 1).for_each(|bin| *bin *= gain);
        extension.added = if present > 0.0 { added * gain * gain / present } else { 0.0 };
        extension.slope_db = slope * 10.0 * 2_f64.log10();
    }
    if profile.part == NoisePart::Detail {
        wide.iter_mut().take(top + 1).for_each(|bin| *bin = Complex::new(0.0, 0.0));
    }
    if value == NoiseValue::Slope {
        // Per sample of the profile, which is a pixel.
        let turn = |k: usize| Complex::new(0.0, TAU * k as f64 / n as f64);
        wide.iter_mut().enumerate().for_each(|(k, bin)| *bin *= turn(k));
    }
    if let Some(last) = wide.last_mut().filter(|_| length.is_multiple_of(2)) {
        last.im = 0.0;
    }
    let backward = planner.plan_fft_inverse(length);
    let mut out = backward.make_output_vec();
    backward.process(&mut wide, &mut out).ok()?;
    let samples = out.iter().map(|x| (x / n as f64) as f32).collect();
    Some((NoiseLine { samples, spacing: profile.spacing / factor as f64 }, extension))
}

/// Fits a line to log power over log frequency, in eight bands of the upper two octaves. Returns slope and intercept.
fn slope(bins: &[Complex<f64>], n: usize) -> (f64, f64) {
    const BANDS: usize = 8;
    let edge = |k: usize| (n as f64 / 8.0 * 4_f64.powf(k as f64 / BANDS as f64)) as usize;
    let points: Vec<[f64; 2]> = (0..BANDS)
        .filter_map(|k| {
            let band = bins.get(edge(k)..edge(k + 1).min(n / 2)).filter(|band| !band.is_empty())?;
            let power = band.iter().map(|b| b.norm_sqr()).sum::<f64>() / band.len() as f64;
            let middle = (edge(k) as f64 * edge(k + 1) as f64).sqrt();
            (power > 0.0).then(|| [middle.ln(), power.ln()])
        })
        .collect();
    if points.len() < 2 {
        return (0.0, f64::NEG_INFINITY);
    }
    let count = points.len() as f64;
    let [x, y] = [0, 1].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / count);
    let over: f64 = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    let under: f64 = points.iter().map(|p| (p[0] - x).powi(2)).sum();
    // A rising spectrum is continued as flat.
    let slope = (over / under).min(0.0);
    (slope, y - slope * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::maps::Detail;
    use crate::texture::noise::profile::variance;

    /// Noise with a power proportional to frequency to the power of `slope`.
    fn noise(slope: f64) -> NoiseProfile {
        let n = 4096;
        let random = Random::new(3, "p");
        let mut planner = RealFftPlanner::<f64>::new();
        let backward = planner.plan_fft_inverse(n);
        let mut bins = backward.make_input_vec();
        for (k, bin) in bins.iter_mut().enumerate().take(n / 2).skip(1) {
            *bin = Complex::from_polar((k as f64).powf(slope / 2.0), TAU * random.uniform(0, k as u64, 0));
        }
        let mut out = backward.make_output_vec();
        backward.process(&mut bins, &mut out).unwrap();
        NoiseProfile {
            samples: out.iter().map(|x| *x as f32).collect(),
            spacing: 1.0 / 512.0,
            ..Default::default()
        }
    }

    fn extend(profile: &NoiseProfile, factor: u32) -> (NoiseLine, Extension) {
        let detail = Some(Detail { factor, seed: 1 });
        NoiseProfile { detail, ..profile.clone() }.extended(NoiseValue::Height)
    }

    fn powers(samples: &[f32]) -> Vec<f64> {
        let mut line: Vec<f64> = samples.iter().map(|x| f64::from(*x)).collect();
        let n = line.len() as f64;
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(line.len());
        let mut bins = plan.make_output_vec();
        plan.process(&mut line, &mut bins).unwrap();
        bins.iter().map(|b| b.norm_sqr() / (n * n)).collect()
    }

    #[test]
    fn the_slope_continues_above_the_spectrum_of_the_image() {
        let base = noise(-2.0);
        let (fine, extension) = extend(&base, 16);
        assert_eq!((fine.samples.len(), fine.spacing), (16 * 4096, base.spacing / 16.0));
        assert!((extension.slope_db + 6.02).abs() < 0.3, "{extension:?}");
        let (old, new) = (powers(&base.samples), powers(&fine.samples));
        for k in 1..2047 {
            assert!((new[k] / old[k] - 1.0).abs() < 1e-3, "bin {k} is unchanged");
        }
        let band = |p: &[f64], from: usize| p[from..2 * from].iter().sum::<f64>() / from as f64;
        for from in [2048, 4096, 8192] {
            let db = 10.0 * (band(&new, from) / band(&old, 1024) * (from as f64 / 1024.0).powi(2)).log10();
            assert!(db.abs() < 1.0, "{from}: {db} dB");
        }
    }

    #[test]
    fn at_most_a_quarter_of_the_variance_is_added() {
        for slope in [0.0, -0.5, -2.0, 1.0] {
            let base = noise(slope);
            let (fine, extension) = extend(&base, 8);
            let grown = variance(fine.samples.iter().copied()) / variance(base.samples.iter().copied()) - 1.0;
            assert!(
                (grown - extension.added).abs() < 0.01 && extension.added <= 0.2501,
                "{slope}: {grown} {extension:?}"
            );
        }
    }

    #[test]
    fn the_spacing_is_that_of_audio_at_the_highest_speed_within_the_maximum_length() {
        let profile = NoiseProfile { samples: vec![0.0; 8192], spacing: 1.0 / 512.0, ..Default::default() };
        assert_eq!(factor_for(&profile, 2.0), 64);
        assert_eq!(factor_for(&profile, 1000.0), 1);
        assert_eq!(factor_for(&profile, 1e-3), 128);
        let (same, extension) = extend(&profile, 1);
        assert_eq!((&same.samples, extension.factor), (&profile.samples, 1));
        let (quiet, extension) = extend(&profile, 4);
        assert!(quiet.samples.iter().all(|x| *x == 0.0) && extension.added == 0.0);
    }

    #[test]
    fn slopes_are_those_of_the_heights_per_pixel() {
        let sine = |k: usize, n: usize| (TAU * 5.0 * k as f64 / n as f64).sin() as f32;
        for n in [255, 256] {
            let samples: Vec<f32> = (0..n).map(|k| sine(k, n)).collect();
            let profile = NoiseProfile { samples, spacing: 0.002, ..Default::default() };
            let line = profile.line(NoiseValue::Slope);
            for (k, slope) in line.samples.iter().enumerate() {
                let w = TAU * 5.0 / n as f64;
                assert!((f64::from(*slope) - w * (w * k as f64).cos()).abs() < 1e-5, "{k}");
            }
            assert_eq!(line.spacing, 0.002);
        }
    }

    #[test]
    fn the_detail_alone_has_nothing_that_an_image_holds_and_both_parts_add_up() {
        let base = NoiseProfile { detail: Some(Detail { factor: 8, seed: 3 }), ..noise(-1.5) };
        let detail = NoiseProfile { part: NoisePart::Detail, ..base.clone() };
        for value in [NoiseValue::Height, NoiseValue::Slope] {
            let (whole, fine) = (base.line(value), detail.line(value));
            let (whole, fine) = (powers(&whole.samples), powers(&fine.samples));
            let all: f64 = whole.iter().sum();
            assert!(fine[..2048].iter().sum::<f64>() < 1e-10 * all);
            assert!(fine[2048..].iter().zip(&whole[2048..]).all(|(a, b)| (a - b).abs() <= 1e-6 * b + 1e-12));
            assert!(fine[2048..].iter().sum::<f64>() > 1e-3 * all);
        }
    }
}
