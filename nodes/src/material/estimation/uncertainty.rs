//! Uncertainty of a fit: observed information, profile likelihood, bootstrap.

use super::emg::Emg;
use super::fit::{Fit, start_at_lower_bound};
use super::newton::{Stop, newton};
use super::point::{DampingPoint, Sample, recordings};
use crate::core::random::Rng;
use crate::statistics::linear::inverse;
use crate::statistics::normal::normal_quantile;
use crate::statistics::quantile;
use crate::statistics::special::t_95;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// Fall of twice the log-likelihood at the ends of a 95 % interval.
const CHI_SQUARE_95: f64 = 3.841_458_820_694_124;
/// Half width of a 95 % interval in standard errors.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Method of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum IntervalMethod {
    /// Standard errors of the observed information.
    Information,
    /// Profile likelihood.
    Profile,
    /// Reflected percentiles over resampled recordings, or points where there is one recording.
    Bootstrap,
    /// Reflected percentiles over simulated data.
    ParametricBootstrap,
}

/// A 95 % interval of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Name of the parameter.
    pub name: String,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Method.
    pub method: IntervalMethod,
}

/// The covariance of all parameters, `theta`, `sigma`, `eta` in physical units, from minus a Hessian in normalised units of `theta`,
/// `ln sigma`, `ln eta` (further rows follow and are marginalised).
///
/// `None` if it is not regular: `sigma` at its floor, where the support of the data depends on the curve, or a parameter at its bound.
#[must_use]
pub fn covariance(fit: &Fit, information: &[f64]) -> Option<Vec<f64>> {
    let family = fit.sample.family;
    let (linear, p) = (family.linear_parameters(), family.parameters());
    let bounds = family.bounds();
    let inside = |(z, [low, high]): (&f64, &[f64; 2])| *z > low + 1e-12 && *z < high - 1e-12;
    if fit.sigma_at_floor() || !fit.theta().iter().zip(&bounds).all(inside) {
        return None;
    }
    let rows = (information.len() as f64).sqrt() as usize;
    let inverse = inverse(information, rows)?;
    // Jacobian of physical parameters.
    let n = p + 2;
    let exponent = if family.has_exponent() { fit.z[linear] } else { 1.0 };
    let factors = family.factors(fit.sample.ls, fit.sample.ys, exponent);
    let mut jacobian = vec![0.0; n * n];
    for (j, factor) in factors.iter().enumerate() {
        jacobian[j * n + j] = *factor;
    }
    if family.has_exponent() {
        jacobian[linear * n + linear] = 1.0;
        let g2 = fit.z[linear - 1] * factors[linear - 1];
        jacobian[(linear - 1) * n + linear] = -g2 * libm::log(fit.sample.ls);
    }
    jacobian[p * n + p] = fit.sigma();
    jacobian[(p + 1) * n + p + 1] = fit.eta();
    let mut out = vec![0.0; n * n];
    for a in 0..n {
        for b in 0..n {
            let mut sum = 0.0;
            for c in 0..n {
                for d in 0..n {
                    sum += jacobian[a * n + c] * inverse[c * rows + d] * jacobian[b * n + d];
                }
            }
            out[a * n + b] = sum;
        }
    }
    (0..n).all(|a| out[a * n + a] > 0.0).then_some(out)
}

/// Minus the Hessian of the log-likelihood at the optimum, `theta`, `ln sigma`, `ln eta` in normalised units.
#[must_use]
pub fn information(fit: &Fit) -> Vec<f64> {
    let likelihood = fit.options.likelihood(&fit.sample);
    let n = likelihood.parameters();
    let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
    likelihood.sums(&fit.z, &mut g, &mut h);
    h.iter().map(|h| -h).collect()
}

/// Square roots of the diagonal of a covariance, row by row.
#[must_use]
pub fn standard_errors(covariance: &[f64]) -> Vec<f64> {
    let n = (covariance.len() as f64).sqrt() as usize;
    (0..n).map(|j| covariance[j * n + j].sqrt()).collect()
}

/// Intervals of two standard errors around values.
#[must_use]
pub fn wald(names: &[String], values: &[f64], errors: &[f64]) -> Vec<Interval> {
    let each = names.iter().zip(values).zip(errors);
    each.map(|((name, value), error)| {
        let (reach, method) = (NORMAL_95 * error, IntervalMethod::Information);
        Interval { name: name.clone(), low: value - reach, high: value + reach, method }
    })
    .collect()
}

/// The interval of linear parameter `j`, or of an exponent, from the profile likelihood; in physical units for a parameter whose unit
/// does not depend on an exponent, otherwise `None`.
#[must_use]
pub fn profile(fit: &Fit, j: usize) -> Option<[f64; 2]> {
    let family = fit.sample.family;
    let linear = family.linear_parameters();
    if family.has_exponent() && j + 1 == linear {
        return None;
    }
    let likelihood = fit.options.likelihood(&fit.sample);
    let total = likelihood.total_weight();
    let bounds = likelihood.bounds(fit.floor);
    let mut z = fit.z.clone();
    let mut fall = |at: f64| {
        let mut fixed = bounds.clone();
        fixed[j] = [at; 2];
        z[j] = at;
        let mut from = z.clone();
        let out = newton(&mut likelihood.clone(), &fixed, &mut from, Stop::Gradient(1e-10), 50);
        z.copy_from_slice(&from);
        2.0 * (fit.log_likelihood - total * out.value) - CHI_SQUARE_95
    };
    let best = fit.z[j];
    let mut end = |direction: f64| {
        let limit = if direction < 0.0 { bounds[j][0] } else { bounds[j][1] };
        let (mut inner, mut outer, mut step) = (best, best, 0.01 * best.max(1e-4));
        loop {
            outer += direction * step;
            let at_limit = direction * (outer - limit) >= 0.0;
            if at_limit {
                outer = limit;
            }
            if fall(outer) > 0.0 {
                break;
            }
            if at_limit || step > 1e9 {
                return limit;
            }
            inner = outer;
            step *= 2.0;
        }
        for _ in 0..40 {
            let middle = 0.5 * (inner + outer);
            if fall(middle) > 0.0 {
                outer = middle
            } else {
                inner = middle
            }
            if (outer - inner).abs() < 1e-7 * outer.abs().max(1e-9) {
                break;
            }
        }
        0.5 * (inner + outer)
    };
    let ends = [end(-1.0), end(1.0)];
    if family.has_exponent() && j == linear {
        return Some(ends);
    }
    let factor = family.factors(fit.sample.ls, fit.sample.ys, 1.0)[j];
    Some(ends.map(|e| e * factor))
}

/// Refits a sample that differs in weights or dampings, from the optimum on; `theta`, `sigma`, `eta` in physical units.
///
/// `None` if it does not converge.
#[must_use]
pub fn refit(fit: &Fit, sample: &Sample) -> Option<Vec<f64>> {
    optimum(fit, sample).map(|z| sample.physical_with_noise(&z))
}

/// As [`refit`]; `theta`, `ln sigma`, `ln eta` in normalised units.
pub(super) fn optimum(fit: &Fit, sample: &Sample) -> Option<Vec<f64>> {
    let mut likelihood = fit.options.likelihood(sample);
    let bounds = likelihood.bounds(fit.floor);
    let mut starts = vec![fit.z.clone()];
    if fit.sigma_at_floor() || fit.z[fit.z.len() - 2] < libm::log(10.0 * fit.floor) {
        starts.push(start_at_lower_bound(sample, fit.floor));
    }
    let mut best: Option<(f64, Vec<f64>)> = None;
    for mut z in starts {
        let out = newton(&mut likelihood, &bounds, &mut z, Stop::Gradient(1e-7), 60);
        if out.value.is_finite() && best.as_ref().is_none_or(|b| out.value > b.0) {
            best = Some((out.value, z));
        }
    }
    best.map(|(_, z)| z)
}

/// Refits of resampled or simulated data.
#[derive(Clone, Debug, PartialEq)]
pub struct Replicates {
    /// Parameters of each that converged.
    pub parameters: Vec<Vec<f64>>,
    /// Number that did not.
    pub failed: usize,
    /// Number of recordings or points that were resampled; `None` for simulated data.
    pub groups: Option<usize>,
    /// Method of the intervals from them.
    pub method: IntervalMethod,
}

/// Draws `draws` samples with replacement, of whole recordings, or of points where there is one recording, and refits each.
///
/// Recordings are drawn because the features of one share a support.
#[must_use]
pub fn bootstrap(
    sample: &Sample,
    points: &[DampingPoint],
    draws: usize,
    seed: u64,
    refit: impl Fn(&Sample) -> Option<Vec<f64>> + Sync + Send,
) -> Replicates {
    let ids = recordings(points);
    let group: Vec<usize> = if ids.len() > 1 {
        points.iter().map(|p| ids.binary_search(&p.recording).unwrap_or(0)).collect()
    } else {
        (0..points.len()).collect()
    };
    let groups = if ids.len() > 1 { ids.len() } else { points.len() };
    let draw = |k: usize| {
        let mut rng = Rng::new(seed.wrapping_mul(0x9E37_79B9).wrapping_add(k as u64));
        let mut count = vec![0.0; groups];
        (0..groups).for_each(|_| count[rng.below(groups)] += 1.0);
        let weight = sample.weight.iter().zip(&group).map(|(w, g)| w * count[*g]).collect();
        refit(&Sample { weight, ..sample.clone() })
    };
    Replicates { groups: Some(groups), ..collect(draws, IntervalMethod::Bootstrap, draw) }
}

/// Simulates `draws` data sets of the fitted model at the same frequencies, and refits each.
#[must_use]
pub fn parametric_bootstrap(
    fit: &Fit,
    draws: usize,
    seed: u64,
    refit: impl Fn(&Sample) -> Option<Vec<f64>> + Sync + Send,
) -> Replicates {
    let draw = |k: usize| refit(&simulate(fit, seed, k));
    collect(draws, IntervalMethod::ParametricBootstrap, draw)
}

fn collect(
    draws: usize,
    method: IntervalMethod,
    draw: impl Fn(usize) -> Option<Vec<f64>> + Sync + Send,
) -> Replicates {
    let all: Vec<Option<Vec<f64>>> = (0..draws).into_par_iter().map(draw).collect();
    let failed = all.iter().filter(|x| x.is_none()).count();
    Replicates { parameters: all.into_iter().flatten().collect(), failed, groups: None, method }
}

/// A data set of the fitted model at the same frequencies.
#[must_use]
pub fn simulate(fit: &Fit, seed: u64, k: usize) -> Sample {
    let mut rng = Rng::new(seed.wrapping_mul(0x85EB_CA6B).wrapping_add(k as u64));
    let sample = &fit.sample;
    let p = sample.family.parameters();
    let (sigma, eta) = (libm::exp(fit.z[p]), libm::exp(fit.z[p + 1]));
    let low = fit.options.truncated_below.map_or(0.0, |low| low / sample.ys);
    let curve = sample.curve(fit.theta());
    let y = (0..sample.len())
        .map(|i| {
            let variance = if fit.options.per_feature { sample.variance[i] } else { 0.0 };
            let sd = (sigma * sigma + variance).sqrt();
            let mut y = 0.0;
            // Truncated draws are drawn again.
            for _ in 0..1000 {
                let noise = sd * normal_quantile(rng.between(1e-15, 1.0));
                y = curve[i] + noise - libm::log(1.0 - rng.uniform()) / eta;
                if y > low {
                    break;
                }
            }
            y.max(1e-9)
        })
        .collect();
    Sample { y, ..sample.clone() }
}

impl Replicates {
    /// Half the width of a 95 % interval, in standard deviations of the replicates.
    fn half_width(&self) -> f64 {
        self.groups.filter(|n| *n > 1).map_or(NORMAL_95, |n| {
            let n = n as f64;
            (n / (n - 1.0)).sqrt() * t_95(n - 1.0)
        })
    }

    /// The interval of a figure of each replicate, whose value for the estimate itself is `best`: the percentiles, reflected around it,
    /// because the estimate lies above a steep edge of the data and its error is skewed. A figure of at least 0 has an interval above 0.
    ///
    /// Resampling `n` groups underestimates their variance by `1 - 1/n`, and treats it as known: the percentiles are those of
    /// `sqrt(n / (n - 1)) t` standard deviations, with Student's t of `n - 1` degrees of freedom.
    ///
    /// # Source
    /// Hesterberg, "What teachers should know about the bootstrap" (The American Statistician 69(4), 2015), section 5, for the percentiles.
    #[must_use]
    pub fn interval(&self, best: f64, figure: impl Fn(&[f64]) -> f64) -> [f64; 2] {
        let mut values: Vec<f64> =
            self.parameters.iter().map(|p| figure(p)).filter(|x| x.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let tail = 0.5 * libm::erfc(self.half_width() * FRAC_1_SQRT_2);
        // Of n draws, a share k / (n + 1) of the distribution lies below draw k from 1 on.
        let n = values.len() as f64;
        let [low, high] =
            [tail, 1.0 - tail].map(|share| quantile(&values, (share * (n + 1.0) - 1.0) / (n - 1.0).max(1.0)));
        let reflected = 2.0 * best - high;
        [if best >= 0.0 { reflected.max(0.0) } else { reflected }, 2.0 * best - low]
    }

    /// Intervals of all parameters.
    #[must_use]
    pub fn intervals(&self, names: &[String], values: &[f64]) -> Vec<Interval> {
        let each = names.iter().zip(values).enumerate();
        each.map(|(j, (name, value))| {
            let [low, high] = self.interval(*value, |p| p[j]);
            Interval { name: name.clone(), low, high, method: self.method }
        })
        .collect()
    }
}

/// The distribution of the damping of point `i`, 1/s.
#[must_use]
pub fn distribution(fit: &Fit, i: usize, curve: &[f64]) -> Emg {
    let p = fit.sample.family.parameters();
    let sigma = libm::exp(fit.z[p]);
    let variance = if fit.options.per_feature { fit.sample.variance[i] } else { 0.0 };
    let ys = fit.sample.ys;
    Emg { c: ys * curve[i], sigma: ys * (sigma * sigma + variance).sqrt(), eta: libm::exp(fit.z[p + 1]) / ys }
}
