//! Tests of a fit against its own assumptions.

use super::fit::{Fit, FitOptions, fit};
use super::point::{DampingPoint, EstimationError, Sample, recordings};
use super::report::{Comparison, FitWarning, PointReport};
use super::uncertainty::{distribution, optimum, refit, simulate};
use crate::material::damping::{DampingModel, Family};
use crate::statistics::ranks::{distance_to_uniform, spearman};
use crate::statistics::special::{chi_square_above, digamma};
use rayon::prelude::*;

/// Gamma shapes of the support parts that an exponential may have.
const SHAPES: [f64; 2] = [0.7, 1.5];
/// Largest rank correlation of the transform with the frequency without a warning.
const MAX_CORRELATION: f64 = 0.2;
/// Largest shift by one recording, in standard errors, without a warning.
const MAX_SHIFT: f64 = 2.0;
/// Number of recordings below which there is a warning.
const MIN_RECORDINGS: usize = 10;
/// Maximum number of recordings that are left out one by one.
const MAX_LEFT_OUT: usize = 200;

/// The parts of every point; without responsibilities all belong to modes.
#[must_use]
pub fn point_reports(fit: &Fit, points: &[DampingPoint], responsibility: Option<&[f64]>) -> Vec<PointReport> {
    let curve = fit.sample.curve(fit.theta());
    let each = |(i, p): (usize, &DampingPoint)| {
        let emg = distribution(fit, i, &curve);
        let (support_part, _) = emg.excess(p.c);
        PointReport {
            c_hat: emg.c,
            support_part,
            noise_part: p.c - emg.c - support_part,
            pit: emg.cdf(p.c),
            responsibility: responsibility.and_then(|r| r.get(i)).copied().unwrap_or(1.0),
        }
    };
    points.iter().enumerate().map(each).collect()
}

/// Transforms of the points that belong to modes.
fn transforms(fit: &Fit) -> Vec<f64> {
    let sample = &fit.sample;
    let curve = sample.curve(fit.theta());
    (0..sample.len())
        .filter(|i| sample.weight[*i] > 0.0)
        .map(|i| distribution(fit, i, &curve).cdf(sample.ys * sample.y[i]))
        .collect()
}

/// p value of the distance of the transform from a uniform distribution, over `draws` simulated data sets that are fitted again;
/// the tables of Kolmogorov and Smirnov hold for known parameters alone.
#[must_use]
pub fn distance_p(fit: &Fit, distance: f64, draws: usize, seed: u64) -> f64 {
    let larger = |k: &usize| {
        let sample = simulate(fit, seed ^ 0x5EED, *k);
        let Some(z) = optimum(fit, &sample) else { return false };
        distance_to_uniform(&transforms(&Fit { sample, z, ..fit.clone() })) >= distance
    };
    let count = (0..draws).into_par_iter().filter(larger).count();
    (count + 1) as f64 / (draws + 1) as f64
}

/// Gamma shape of positive values, by moments and by maximum likelihood.
#[must_use]
pub fn gamma_shape(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    let log_mean = values.iter().map(|x| libm::log(*x)).sum::<f64>() / n;
    let moments = mean * mean / variance;
    // ln k - digamma(k) = ln mean - mean ln.
    let target = libm::log(mean) - log_mean;
    if !(target > 0.0 && moments.is_finite()) {
        return [1.0; 2];
    }
    let (mut low, mut high) = (1e-3_f64, 1e4_f64);
    for _ in 0..80 {
        let k = (low * high).sqrt();
        if libm::log(k) - digamma(k) > target { low = k } else { high = k }
    }
    [moments, (low * high).sqrt()]
}

/// Distances, shapes and correlations of the points that belong to modes.
#[must_use]
pub fn tests_of_points(points: &[DampingPoint], reports: &[PointReport]) -> (f64, [f64; 2], [f64; 2]) {
    let used: Vec<(&DampingPoint, &PointReport)> =
        points.iter().zip(reports).filter(|(p, r)| p.weight > 0.0 && r.responsibility >= 0.5).collect();
    let column = |f: &dyn Fn(&DampingPoint, &PointReport) -> f64| {
        used.iter().map(|(p, r)| f(p, r)).collect::<Vec<f64>>()
    };
    let pit = column(&|_, r| r.pit);
    let frequency = column(&|p, _| libm::log(p.lambda));
    let recording = column(&|p, _| f64::from(p.recording));
    let support = column(&|_, r| r.support_part.max(1e-300));
    let correlation = [spearman(&pit, &frequency), spearman(&pit, &recording)];
    (distance_to_uniform(&pit), gamma_shape(&support), correlation)
}

/// Families fitted to the same points, by Akaike's criterion, and the p value of an exponent of 1 within the hybrid.
///
/// # Errors
/// As [`fit`].
pub fn compare(
    points: &[DampingPoint],
    options: &FitOptions,
) -> Result<(Vec<Comparison>, Option<f64>), EstimationError> {
    let mut modes: Vec<u32> = points.iter().map(|p| p.mode_cluster).collect();
    modes.sort_unstable();
    modes.dedup();
    let n = points.iter().filter(|p| p.weight > 0.0).count() as f64;
    let modes = if modes.len() > 1 { modes.len() as f64 } else { n };
    let mut found = Vec::new();
    let mut likelihoods = [None; 2];
    for family in [Family::Rayleigh, Family::Power, Family::Hybrid, Family::Caughey(3)] {
        let fit = match fit(points, &FitOptions { family, ..*options }) {
            Ok(fit) => fit,
            Err(EstimationError::TooFewPoints { .. } | EstimationError::RankDeficient { .. }) => continue,
            Err(e) => return Err(e),
        };
        let log_lik = fit.physical_log_likelihood();
        match family {
            Family::Rayleigh => likelihoods[0] = Some(log_lik),
            Family::Hybrid => likelihoods[1] = Some(log_lik),
            _ => {}
        }
        let count = (family.parameters() + 2) as f64;
        found.push(Comparison {
            model: family.model(&fit.physical(), &fit.sample.physical_knots()),
            log_lik,
            aic: 2.0 * (count - log_lik),
            bic: count * libm::log(n) - 2.0 * log_lik,
            bic_modes: count * libm::log(modes) - 2.0 * log_lik,
        });
    }
    found.sort_by(|a, b| a.aic.total_cmp(&b.aic));
    // A hybrid that gains no more than two units is no better than a Rayleigh curve.
    let hybrid = found.iter().position(|c| matches!(c.model, DampingModel::Hybrid { .. }));
    let rayleigh = found.iter().position(|c| matches!(c.model, DampingModel::Rayleigh { .. }));
    if let (Some(h), Some(r)) = (hybrid, rayleigh)
        && h < r
        && found[r].aic - found[h].aic <= 2.0
    {
        let moved = found.remove(r);
        found.insert(h, moved);
    }
    let straight = match likelihoods {
        [Some(straight), Some(hybrid)] => Some(chi_square_above(2.0 * (hybrid - straight))),
        _ => None,
    };
    Ok((found, straight))
}

/// The recording whose absence moves a parameter most, if by more than two standard errors.
#[must_use]
pub fn recording_effect(
    fit: &Fit,
    points: &[DampingPoint],
    responsibility: Option<&[f64]>,
    covariance: &[f64],
) -> Option<FitWarning> {
    let ids = recordings(points);
    if !(2..=MAX_LEFT_OUT).contains(&ids.len()) {
        return None;
    }
    let p = fit.sample.family.parameters();
    let n = p + 2;
    let names = fit.sample.family.model(&fit.physical(), &fit.sample.physical_knots()).names();
    let weights: Vec<f64> = match responsibility {
        Some(r) => fit.sample.weight.iter().zip(r).map(|(w, r)| w * r).collect(),
        None => fit.sample.weight.clone(),
    };
    let best = refit(fit, &Sample { weight: weights.clone(), ..fit.sample.clone() })?;
    let shift = |id: &u32| {
        let weight: Vec<f64> =
            weights.iter().zip(points).map(|(w, p)| if p.recording == *id { 0.0 } else { *w }).collect();
        let without = refit(fit, &Sample { weight, ..fit.sample.clone() })?;
        let of = |j: usize| (without[j] - best[j]).abs() / covariance[j * n + j].sqrt();
        let j = (0..p).max_by(|a, b| of(*a).total_cmp(&of(*b)))?;
        Some((*id, j, of(j)))
    };
    let (recording, j, shift) =
        ids.par_iter().filter_map(shift).max_by(|a, b| a.2.total_cmp(&b.2).then(b.0.cmp(&a.0)))?;
    (shift > MAX_SHIFT).then(|| FitWarning::RecordingEffect { recording, parameter: names[j].clone(), shift })
}

/// Warnings that need the fit alone.
#[must_use]
pub fn warnings(fit: &Fit, points: &[DampingPoint]) -> Vec<FitWarning> {
    let mut out = Vec::new();
    let (sigma, eta) = (fit.sigma(), fit.eta());
    if fit.sigma_at_floor() {
        out.push(FitWarning::SigmaAtFloor);
    }
    if let Some(other) = fit.others.iter().find(|o| o.gap < 2.0) {
        out.push(FitWarning::SecondMode(*other));
    }
    let curve = fit.sample.curve(fit.theta());
    let least = curve.iter().copied().fold(f64::INFINITY, f64::min) * fit.sample.ys;
    if sigma * eta > 1.0 {
        out.push(FitWarning::SupportConfounded { shape: sigma * eta, sum: least + 1.0 / eta });
    }
    let extreme = |f: fn(f64, f64) -> f64, from: f64| points.iter().map(|p| p.lambda).fold(from, f);
    let span = extreme(f64::max, 0.0) / extreme(f64::min, f64::INFINITY);
    let octaves = 0.5 * libm::log2(span);
    let highest = curve.iter().copied().fold(0.0, f64::max) * fit.sample.ys;
    if octaves < 1.0 || highest - least < sigma + 1.0 / eta {
        out.push(FitWarning::NoLeverage { octaves });
    }
    out.extend(few_recordings(points));
    out
}

/// A warning for fewer than ten recordings.
#[must_use]
pub fn few_recordings(points: &[DampingPoint]) -> Option<FitWarning> {
    let found = recordings(points).len();
    (found < MIN_RECORDINGS).then_some(FitWarning::FewRecordings(found))
}

/// Warnings about the distribution of the points.
#[must_use]
pub fn distribution_warnings(shape: f64, correlation: f64, p: f64) -> Vec<FitWarning> {
    let mut out = Vec::new();
    if !(SHAPES[0]..=SHAPES[1]).contains(&shape) {
        out.push(FitWarning::ExcessShape(shape));
    }
    if correlation.abs() > MAX_CORRELATION {
        out.push(FitWarning::Heteroscedastic(correlation));
    }
    if p < 0.01 {
        out.push(FitWarning::PoorFit(p));
    }
    out
}
