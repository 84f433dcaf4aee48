//! Pairs of grains that sound nearly the same.

use crate::core::time::Rate;
use crate::feature::{FeatureConventions, MelCepstrum};
use crate::grain::dictionary::{Grain, GrainDictionary};
use crate::statistics::squared;
use foley_fft::RealFftPlanner;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};
use std::sync::Arc;

/// Bands of the features of a grain.
const BANDS: usize = 24;
/// Mean and deviation of each band, and the length.
const DIMS: usize = 2 * BANDS + 1;
/// Duration of the frames of the features, s.
const FRAME: f64 = 0.0116;
/// Greatest ratio of the lengths of two similar grains.
const LENGTH_RATIO: f64 = 1.25;
/// Greatest shift of two similar grains, as a share of the shorter one.
const LAG: f64 = 0.1;
/// Correlation below which a pair is not stored.
const LEAST: f32 = 0.3;

/// Two grains and the shift at which they correlate most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimilarPair {
    /// Indices of the grains, `a < b`.
    pub grains: [u32; 2],
    /// Samples by which the window of `b` begins after that of `a`.
    pub lag: i32,
    /// Normalised cross-correlation at the shift, -1 to 1; both windows continue with zeros.
    pub correlation: f32,
}

/// Norm of each windowed grain, over all channels.
#[must_use]
pub fn norms(dictionary: &GrainDictionary) -> Vec<f64> {
    let energy = |x: Vec<f32>| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let norm = |grain: &Grain| -> f64 {
        (0..dictionary.channels(grain))
            .map(|c| energy(dictionary.windowed_channel(grain, c)))
            .sum::<f64>()
            .sqrt()
    };
    dictionary.grains.par_iter().map(norm).collect()
}

/// Mean and deviation of the logarithm of each band over the frames of a grain of unit power, and the logarithm of its length.
fn features(x: &[f32], mel: &mut MelCepstrum) -> [f64; DIMS] {
    let frame = mel.frame();
    let power = x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len().max(1) as f64;
    let floor = 1e-6 * power.max(1e-30);
    let (mut sums, mut squares, mut count) = ([0.0; BANDS], [0.0; BANDS], 0.0);
    for start in (0..x.len().saturating_sub(frame / 2).max(1)).step_by((frame / 2).max(1)) {
        let energies = mel.energies(x.get(start..x.len().min(start + frame)).unwrap_or_default());
        for ((sum, square), energy) in sums.iter_mut().zip(&mut squares).zip(energies) {
            let level = (energy.max(floor) / power.max(1e-30)).ln();
            (*sum, *square) = (*sum + level, *square + level * level);
        }
        count += 1.0;
    }
    let mut all = [0.0; DIMS];
    for (k, (sum, square)) in sums.iter().zip(&squares).enumerate() {
        let mean = sum / count;
        all[k] = mean;
        all[BANDS + k] = (square / count - mean * mean).max(0.0).sqrt();
    }
    all[DIMS - 1] = (x.len().max(1) as f64).ln();
    all
}

/// Scales each dimension to zero mean and unit deviation.
fn standardise(points: &mut [[f64; DIMS]]) {
    let count = points.len().max(1) as f64;
    for k in 0..DIMS {
        let mean = points.iter().map(|p| p[k]).sum::<f64>() / count;
        let variance = points.iter().map(|p| (p[k] - mean).powi(2)).sum::<f64>() / count;
        let scale = if variance > 1e-12 { variance.sqrt().recip() } else { 0.0 };
        points.iter_mut().for_each(|p| p[k] = (p[k] - mean) * scale);
    }
}

/// Features of some grains, standardised: 24 bands, their deviation over time, and the length.
pub(crate) fn grain_features(dictionary: &GrainDictionary, grains: &[usize]) -> Vec<[f64; DIMS]> {
    let rate = Rate::from_f64(dictionary.rate).unwrap_or(Rate::hz(48_000));
    let frame = ((FRAME * dictionary.rate).max(8.0) as u32).next_power_of_two();
    let base = FeatureConventions::cloth(rate, frame);
    let conventions =
        FeatureConventions { frame, bands: BANDS as u32, f_lo: 50.0, f_hi: 0.45 * dictionary.rate, ..base };
    let of_grain =
        |mel: &mut MelCepstrum, k: &usize| features(&dictionary.windowed(&dictionary.grains[*k]), mel);
    let mut points: Vec<[f64; DIMS]> =
        grains.par_iter().map_init(|| MelCepstrum::new(&conventions, 1e-30), of_grain).collect();
    standardise(&mut points);
    points
}

/// Pairs of each point and its `count` nearest ones of similar length. The points are sorted by length.
fn neighbours(points: &[[f64; DIMS]], lengths: &[usize], count: usize) -> Vec<[usize; 2]> {
    let of_point = |i: usize| -> Vec<[usize; 2]> {
        let first = lengths.partition_point(|len| (*len as f64) * LENGTH_RATIO < lengths[i] as f64);
        let last = lengths.partition_point(|len| *len as f64 <= LENGTH_RATIO * lengths[i] as f64);
        let distance = |j: usize| squared(&points[i], &points[j]);
        let mut near: Vec<(f64, usize)> =
            (first..last).filter(|j| *j != i).map(|j| (distance(j), j)).collect();
        let by_distance = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if near.len() > count {
            near.select_nth_unstable_by(count, by_distance);
            near.truncate(count);
        }
        near.into_iter().map(|(_, j)| [i.min(j), i.max(j)]).collect()
    };
    let mut pairs: Vec<[usize; 2]> = (0..points.len()).into_par_iter().flat_map_iter(of_point).collect();
    pairs.par_sort_unstable();
    pairs.dedup();
    pairs
}

/// Transforms of pairs of sounds.
pub(super) struct Correlator {
    size: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
}

impl Correlator {
    /// Creates a correlator of sounds of up to `longest` samples at shifts of up to `reach`.
    pub fn new(longest: usize, reach: usize) -> Self {
        let size = (longest + reach + 1).next_power_of_two().max(16);
        let mut planner = RealFftPlanner::<f32>::new();
        Self { size, forward: planner.plan_fft_forward(size), inverse: planner.plan_fft_inverse(size) }
    }

    pub fn spectrum(&self, x: &[f32]) -> Vec<Complex<f32>> {
        let (mut input, mut out) = (self.forward.make_input_vec(), self.forward.make_output_vec());
        input.iter_mut().zip(x).for_each(|(y, x)| *y = *x);
        // Lengths agree by construction.
        if self.forward.process(&mut input, &mut out).is_err() {
            out.fill(Complex::default());
        }
        out
    }

    /// The shift of `b` after `a`, of up to `reach` samples either way, at which the magnitude of `sum_n a[n + lag] b[n]` is greatest.
    pub fn best(&self, a: &[Vec<Complex<f32>>], b: &[Vec<Complex<f32>>], reach: usize) -> (i32, f32) {
        let (mut product, mut out) = (self.inverse.make_input_vec(), self.inverse.make_output_vec());
        for (a, b) in a.iter().zip(b) {
            product.iter_mut().zip(a.iter().zip(b)).for_each(|(p, (x, y))| *p += x * y.conj());
        }
        // The first and the last bin of real signals are real.
        let last = product.len() - 1;
        (product[0].im, product[last].im) = (0.0, 0.0);
        if self.inverse.process(&mut product, &mut out).is_err() {
            return (0, 0.0);
        }
        let reach = reach.min(self.size / 2 - 1) as i32;
        let value = |lag: i32| out[lag.rem_euclid(self.size as i32) as usize] / self.size as f32;
        let mut best = (0, value(0));
        // The nearest of equal ones.
        for lag in (1..=reach).flat_map(|lag| [lag, -lag]) {
            if value(lag).abs() > best.1.abs() {
                best = (lag, value(lag));
            }
        }
        best
    }
}

/// Finds pairs of similar grains: of the `count` nearest grains of equal kind, component and channels in the levels of 24 mel bands, whose
/// lengths differ by at most a quarter, those that correlate at a shift of up to a tenth of the shorter one.
///
/// `stop` receives the share of the work that is done, and returns true to stop: then the result is `None`.
///
/// # Complexity
/// O(grains^2) distances of 49 numbers, and one transform for each grain and for each pair, on all cores.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 6, which
/// names clusters of similar grains as future work.
#[must_use]
pub fn similar_pairs(
    dictionary: &GrainDictionary,
    count: usize,
    stop: &dyn Fn(f64) -> bool,
) -> Option<Vec<SimilarPair>> {
    let key = |k: usize| {
        let grain = &dictionary.grains[k];
        let source = dictionary.source(grain);
        (source.map(|s| (s.kind as u8, s.component as u8)), dictionary.channels(grain))
    };
    let mut order: Vec<usize> = (0..dictionary.len()).collect();
    order.sort_by_key(|k| (key(*k), dictionary.grains[*k].window_len(), *k));
    let norms = norms(dictionary);
    let mut all = Vec::new();
    let (mut done, total) = (0, order.len().max(1));
    for group in order.chunk_by(|a, b| key(*a) == key(*b)) {
        all.extend(pairs_of_group(dictionary, group, &norms, count, &|share| {
            stop((done as f64 + share * group.len() as f64) / total as f64)
        })?);
        done += group.len();
    }
    all.sort_unstable_by_key(|pair| pair.grains);
    Some(all)
}

/// Pairs whose spectra are in memory at once.
const PAIRS_AT_ONCE: usize = 4096;

fn pairs_of_group(
    dictionary: &GrainDictionary,
    group: &[usize],
    norms: &[f64],
    count: usize,
    stop: &dyn Fn(f64) -> bool,
) -> Option<Vec<SimilarPair>> {
    let lengths: Vec<usize> = group.iter().map(|k| dictionary.grains[*k].window_len()).collect();
    let points = grain_features(dictionary, group);
    let candidates = neighbours(&points, &lengths, count);
    let longest = lengths.last().copied().unwrap_or(0);
    let correlator = Correlator::new(longest, (LAG * longest as f64).ceil() as usize);
    let channels = group.first().map_or(1, |k| dictionary.channels(&dictionary.grains[*k]));
    let spectra = |k: usize| -> Vec<Vec<Complex<f32>>> {
        let grain = &dictionary.grains[group[k]];
        (0..channels).map(|c| correlator.spectrum(&dictionary.windowed_channel(grain, c))).collect()
    };
    let mut pairs = Vec::new();
    for (round, some) in candidates.chunks(PAIRS_AT_ONCE).enumerate() {
        if stop((round * PAIRS_AT_ONCE) as f64 / candidates.len() as f64) {
            return None;
        }
        // Candidates are sorted by their first grain: its spectra are computed once.
        let of_first = |same: &[[usize; 2]]| -> Vec<SimilarPair> {
            let first = spectra(same[0][0]);
            let pair = |[i, j]: &[usize; 2]| {
                let reach = (LAG * lengths[*i].min(lengths[*j]) as f64) as usize;
                let (lag, product) = correlator.best(&first, &spectra(*j), reach);
                let (a, b) = (group[*i], group[*j]);
                let norm = norms[a] * norms[b];
                let correlation = if norm > 0.0 { (f64::from(product) / norm) as f32 } else { 0.0 };
                let (grains, lag) = if a < b { ([a, b], lag) } else { ([b, a], -lag) };
                SimilarPair {
                    grains: grains.map(|k| k as u32),
                    lag,
                    correlation: correlation.clamp(-1.0, 1.0),
                }
            };
            same.iter().map(pair).filter(|pair| pair.correlation.abs() >= LEAST).collect()
        };
        let by_first: Vec<&[[usize; 2]]> = some.chunk_by(|a, b| a[0] == b[0]).collect();
        pairs.extend(by_first.par_iter().flat_map_iter(|same| of_first(same)).collect::<Vec<_>>());
    }
    Some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grain::trial_dictionary;

    /// The greatest correlation of two grains by the definition.
    fn direct(a: &[f32], b: &[f32]) -> (i32, f64) {
        let reach = (LAG * a.len().min(b.len()) as f64) as i32;
        let norm = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        let at = |lag: i32| -> f64 {
            let product = |(n, y): (usize, &f32)| {
                let x = usize::try_from(n as i32 + lag).ok().and_then(|n| a.get(n));
                f64::from(x.copied().unwrap_or(0.0)) * f64::from(*y)
            };
            b.iter().enumerate().map(product).sum::<f64>() / (norm(a) * norm(b))
        };
        let all = (-reach..=reach).map(|lag| (lag, at(lag)));
        all.max_by(|x, y| x.1.abs().total_cmp(&y.1.abs())).unwrap()
    }

    #[test]
    fn pairs_have_the_greatest_correlation_by_the_definition() {
        let dictionary = trial_dictionary();
        let pairs = similar_pairs(&dictionary, 8, &|_| false).unwrap();
        assert!(!pairs.is_empty());
        for pair in &pairs {
            let [a, b] = pair.grains.map(|k| dictionary.windowed(&dictionary.grains[k as usize]));
            let (lag, correlation) = direct(&a, &b);
            assert!((f64::from(pair.correlation) - correlation).abs() < 1e-5, "{pair:?} {correlation}");
            assert!(pair.lag == lag || (correlation.abs() - f64::from(pair.correlation.abs())).abs() < 1e-4);
        }
        assert!(similar_pairs(&dictionary, 8, &|_| true).is_none());
    }
}
