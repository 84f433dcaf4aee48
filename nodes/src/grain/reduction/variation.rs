//! How impacts of grains differ from each other and from recordings.

use crate::core::random::Random;
use crate::core::time::Rate;
use crate::feature::{FeatureConventions, MelCepstrum};
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::SourceKind;
use crate::grain::synthesis::{GrainSegment, RepertoireRules, impact_sounds, sources_of};
use crate::material::estimation::linear::inverse;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// The sound of an impact.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedImpact {
    /// Its samples, channels averaged.
    pub samples: Vec<f32>,
    /// Sum of their squares.
    pub energy: f64,
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
    let event = |segments: &[GrainSegment], frames: i64| {
        let mut samples = vec![0.0; frames.max(0) as usize];
        segments.iter().for_each(|s| s.add(dictionary, 0, 1, &mut samples));
        let energy = samples.iter().map(|x| f64::from(*x).powi(2)).sum();
        RenderedImpact { samples, energy }
    };
    sounds.iter().take(count).map(|sound| event(&sound.segments, sound.frames)).collect()
}

/// Greatest shift at which two sounds are compared, s.
const SHIFT: f64 = 0.01;

/// Greatest normalised cross-correlation of two sounds at any shift of up to 10 ms; both continue with zeros.
///
/// # Complexity
/// O(n log n).
#[must_use]
pub fn largest_shifted_correlation(a: &[f32], b: &[f32], rate: f64) -> f64 {
    let reach = (SHIFT * rate) as usize;
    let size = (a.len().max(b.len()) + reach + 1).next_power_of_two().max(16);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
    let spectrum = |x: &[f32]| -> Vec<Complex<f64>> {
        let (mut input, mut out) = (forward.make_input_vec(), forward.make_output_vec());
        input.iter_mut().zip(x).for_each(|(y, x)| *y = f64::from(*x));
        // Lengths agree by construction.
        if forward.process(&mut input, &mut out).is_err() {
            out.fill(Complex::default());
        }
        out
    };
    let mut product: Vec<Complex<f64>> =
        spectrum(a).iter().zip(spectrum(b)).map(|(a, b)| a * b.conj()).collect();
    let mut out = inverse.make_output_vec();
    // The first and the last bin of real signals are real.
    for k in [0, size / 2] {
        product[k].im = 0.0;
    }
    if inverse.process(&mut product, &mut out).is_err() {
        return 0.0;
    }
    let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let norm = (energy(a) * energy(b)).sqrt() * size as f64;
    let near = out[..=reach].iter().chain(&out[size - reach..]);
    if norm > 0.0 { near.fold(0.0, |best: f64, x| best.max(x / norm)) } else { 0.0 }
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

/// The frames of some sounds, and how far others are from them.
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

    #[test]
    fn shifted_copies_correlate_fully_and_others_do_not() {
        let x = noise(5000, 1, 1.0);
        let shifted: Vec<f32> = std::iter::repeat_n(0.0, 70).chain(x.iter().map(|x| 0.3 * x)).collect();
        for (a, b) in [(&x, &shifted), (&shifted, &x)] {
            assert!((largest_shifted_correlation(a, b, 16_000.0) - 1.0).abs() < 1e-6);
        }
        // 70 samples are more than 10 ms at this rate.
        assert!(largest_shifted_correlation(&x, &shifted, 4000.0) < 0.3);
        assert!(largest_shifted_correlation(&x, &noise(5000, 2, 1.0), 16_000.0) < 0.2);
        assert_eq!(largest_shifted_correlation(&x, &[0.0; 10], 16_000.0), 0.0);
    }

    #[test]
    fn the_direct_sum_gives_the_same_correlation() {
        let (a, b) = (noise(300, 3, 0.4), noise(250, 4, 0.4));
        let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let at = |lag: i64| -> f64 {
            let sample =
                |i: i64| usize::try_from(i).ok().and_then(|i| b.get(i)).map_or(0.0, |x| f64::from(*x));
            a.iter().zip(0..).map(|(x, i)| f64::from(*x) * sample(i - lag)).sum()
        };
        let direct = (-20..=20).map(at).fold(0.0, f64::max) / (energy(&a) * energy(&b)).sqrt();
        assert!((largest_shifted_correlation(&a, &b, 2000.0) - direct).abs() < 1e-9);
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
