//! Differences of impacts of grains from each other and from recordings.

use super::similarity::Correlator;
use crate::core::random::Random;
use crate::core::time::Rate;
use crate::dsp::{Weighting, weighted_rms};
use crate::feature::{FeatureConventions, MelCepstrum};
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::SourceKind;
use crate::grain::synthesis::{ImpactSound, RepertoireRules, impact_sounds, rendered, sources_of};
use crate::statistics::linear::inverse;

/// The sound of an impact.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedImpact {
    /// Its samples, channels averaged, with unit energy.
    pub samples: Vec<f32>,
    /// K-weighted level of its energy, dB.
    pub loudness: f64,
}

/// The first impacts that are played for the recordings with some tags.
#[must_use]
pub fn rendered_impacts(
    dictionary: &GrainDictionary,
    patterns: &CorrelationPatterns,
    tags: &str,
    rules: &RepertoireRules,
    count: usize,
    random: &Random,
) -> Vec<RenderedImpact> {
    let (sources, _) = sources_of(dictionary, tags, SourceKind::Impulsive);
    let sounds = impact_sounds(dictionary, Some(patterns), &sources, rules, random);
    let impact = |sound: &ImpactSound| {
        let (samples, energy) = rendered(dictionary, &sound.segments);
        let weighted = weighted_rms(&samples, dictionary.rate, Weighting::K).powi(2) * samples.len() as f64;
        RenderedImpact { samples, loudness: 10.0 * (weighted * energy).max(1e-30).log10() }
    };
    sounds.iter().take(count).map(impact).collect()
}

/// Greatest shift at which two sounds are compared, s.
const SHIFT: f64 = 0.01;

/// Magnitude of the greatest cross-correlation of each sound with the one before, at any shift of up to 10 ms; all have unit energy, and continue
/// with zeros.
///
/// # Complexity
/// Two transforms for each sound.
#[must_use]
pub fn successive_correlations<'a>(sounds: impl Iterator<Item = &'a [f32]> + Clone, rate: f64) -> Vec<f64> {
    let reach = (SHIFT * rate) as usize;
    let correlator = Correlator::new(sounds.clone().map(<[f32]>::len).max().unwrap_or(0), reach);
    let mut before: Option<[_; 1]> = None;
    let mut all = Vec::new();
    for x in sounds {
        let spectrum = [correlator.spectrum(x)];
        all.extend(before.map(|before| f64::from(correlator.best(&before, &spectrum, reach).1.abs())));
        before = Some(spectrum);
    }
    all
}

/// Cepstral coefficients of a frame.
const COEFFICIENTS: usize = 12;
/// Frames and hops of the features, s.
const FRAME: f64 = 0.02;
const HOP: f64 = 0.01;
/// Level below that of the loudest frame of a sound at which frames do not count.
const QUIET: f64 = 1e-4;

/// Mel cepstra of the frames of a sound that are within 40 dB of its loudest one.
fn frames(x: &[f32], rate: f64) -> Vec<[f64; COEFFICIENTS]> {
    let [frame, hop] = [FRAME, HOP].map(|s| (s * rate).round().max(2.0) as usize);
    let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let parts: Vec<&[f32]> =
        (0..x.len().max(1)).step_by(hop).map(|k| &x[k..x.len().min(k + frame)]).collect();
    let loudest = parts.iter().map(|x| energy(x)).fold(0.0, f64::max);
    let of_rate = Rate::from_f64(rate).unwrap_or(Rate::hz(48_000));
    let conventions = FeatureConventions {
        bands: 24,
        f_lo: 50.0,
        f_hi: 0.45 * rate,
        n: COEFFICIENTS as u32,
        first: 1,
        ..FeatureConventions::cloth(of_rate, frame as u32)
    };
    // Bands far below the loudest frame are as good as silent.
    let floor = 1e-7 * loudest / frame as f64;
    let mut cepstrum = MelCepstrum::new(&conventions, floor);
    let mut out = [0.0; COEFFICIENTS];
    let audible = parts.into_iter().filter(|x| energy(x) >= QUIET * loudest && loudest > 0.0);
    audible
        .map(|x| {
            cepstrum.process(x, &mut out);
            out.map(f64::from)
        })
        .collect()
}

/// The frames of some sounds, and the distances of others from them.
#[derive(Clone, Debug)]
pub struct FrameCloud {
    mean: [f64; COEFFICIENTS],
    /// Inverse of the covariance, `[COEFFICIENTS * COEFFICIENTS]`.
    inverse: Vec<f64>,
    limit: f64,
}

/// Share of the mean variance that is added to each variance, for few frames.
const SHRINKAGE: f64 = 0.01;

/// Mean and inverse covariance of frames.
fn moments(frames: &[[f64; COEFFICIENTS]]) -> ([f64; COEFFICIENTS], Vec<f64>) {
    const N: usize = COEFFICIENTS;
    let count = frames.len().max(1) as f64;
    let mean: [f64; N] = std::array::from_fn(|k| frames.iter().map(|x| x[k]).sum::<f64>() / count);
    let mut covariance = vec![0.0; N * N];
    for x in frames {
        for (k, sum) in covariance.iter_mut().enumerate() {
            *sum += (x[k / N] - mean[k / N]) * (x[k % N] - mean[k % N]) / count;
        }
    }
    let trace: f64 = (0..N).map(|k| covariance[k * N + k]).sum();
    (0..N).for_each(|k| covariance[k * N + k] += SHRINKAGE * trace / N as f64 + 1e-9);
    let inverse = inverse(&covariance, N);
    (mean, inverse.unwrap_or_else(|| vec![0.0; N * N]))
}

/// Mean Mahalanobis distance of frames.
fn mean_distance(frames: &[[f64; COEFFICIENTS]], mean: &[f64; COEFFICIENTS], inverse: &[f64]) -> f64 {
    let distance = |x: &[f64; COEFFICIENTS]| {
        let d: [f64; COEFFICIENTS] = std::array::from_fn(|k| x[k] - mean[k]);
        let rows = inverse.chunks(COEFFICIENTS).zip(&d);
        rows.map(|(row, a)| a * row.iter().zip(&d).map(|(m, b)| m * b).sum::<f64>())
            .sum::<f64>()
            .max(0.0)
            .sqrt()
    };
    frames.iter().map(distance).sum::<f64>() / frames.len().max(1) as f64
}

impl FrameCloud {
    /// The frames of recordings.
    #[must_use]
    pub fn new(sounds: &[Vec<f32>], rate: f64) -> Self {
        let of_sound: Vec<Vec<_>> = sounds.iter().map(|x| frames(x, rate)).collect();
        let all: Vec<_> = of_sound.iter().flatten().copied().collect();
        let (mean, inverse) = moments(&all);
        let from_others = |k: usize| {
            let others: Vec<_> =
                of_sound.iter().enumerate().filter(|(j, _)| *j != k).flat_map(|(_, x)| x).copied().collect();
            let (mean, inverse) = moments(&others);
            mean_distance(&of_sound[k], &mean, &inverse)
        };
        let limit = if sounds.len() > 1 {
            (0..sounds.len()).map(from_others).fold(0.0, f64::max)
        } else {
            // One recording: its own distance.
            mean_distance(&all, &mean, &inverse)
        };
        Self { mean, inverse, limit }
    }

    /// Greatest mean distance of the frames of one of the sounds from those of the others.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// Mean Mahalanobis distance of the frames of a sound.
    #[must_use]
    pub fn distance(&self, x: &[f32], rate: f64) -> f64 {
        mean_distance(&frames(x, rate), &self.mean, &self.inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn noise(n: usize, seed: u64, low_pass: f64) -> Vec<f32> {
        let mut rng = Rng::new(seed);
        let mut y = 0.0;
        let mut sample = |i: usize| {
            y += low_pass * (rng.between(-1.0, 1.0) - y);
            (y * (-(i as f64) / 2000.0).exp()) as f32
        };
        (0..n).map(&mut sample).collect()
    }

    /// With unit energy.
    fn unit(x: &[f32]) -> Vec<f32> {
        let energy = x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        x.iter().map(|x| (f64::from(*x) / energy.sqrt()) as f32).collect()
    }

    fn correlation(a: &[f32], b: &[f32], rate: f64) -> f64 {
        successive_correlations([unit(a), unit(b)].iter().map(Vec::as_slice), rate)[0]
    }

    #[test]
    fn shifted_copies_correlate_fully_and_others_do_not() {
        let x = noise(5000, 1, 1.0);
        let shifted: Vec<f32> = std::iter::repeat_n(0.0, 70).chain(x.iter().map(|x| -0.3 * x)).collect();
        for (a, b) in [(&x, &shifted), (&shifted, &x)] {
            assert!((correlation(a, b, 16_000.0) - 1.0).abs() < 1e-5);
        }
        // 70 samples are more than 10 ms at this rate.
        assert!(correlation(&x, &shifted, 4000.0) < 0.3);
        assert!(correlation(&x, &noise(5000, 2, 1.0), 16_000.0) < 0.2);
        assert_eq!(successive_correlations([&[0.0; 10][..], &[0.0; 3]].into_iter(), 16_000.0), [0.0]);
    }

    #[test]
    fn sounds_of_another_spectrum_are_outside() {
        let all: Vec<Vec<f32>> = (0..4).map(|k| noise(8000, 10 + k, 0.2)).collect();
        let cloud = FrameCloud::new(&all, 16_000.0);
        let inside = cloud.distance(&noise(8000, 20, 0.2), 16_000.0);
        assert!(inside < 1.3 * cloud.limit(), "{inside} {}", cloud.limit());
        let outside = cloud.distance(&noise(8000, 20, 0.9), 16_000.0);
        assert!(outside > 2.0 * cloud.limit(), "{outside} {}", cloud.limit());
        // The level does not count, and silence is finite.
        let loud: Vec<f32> = noise(8000, 20, 0.2).iter().map(|x| 50.0 * x).collect();
        assert!((cloud.distance(&loud, 16_000.0) - inside).abs() < 1e-3);
        assert!(cloud.distance(&[0.0; 4000], 16_000.0).is_finite());
    }
}
