//! Maximum likelihood fits.

use super::lbfgs::lbfgs;
use super::least_squares::LeastSquares;
use super::likelihood::{ETA, Excess, Likelihood};
use super::lower_bound::lower_bound;
use super::newton::{Stop, newton};
use super::point::{DampingPoint, EstimationError, Sample};
use super::reference;
use super::scan::{Effort, LocalMaximum, scan};
use crate::material::damping::Family;
use serde::{Deserialize, Serialize};

/// Smallest `sigma` in units of the median damping.
pub const SIGMA_FLOOR: f64 = 1e-3;
/// Exponents from which a power law is fitted.
const EXPONENTS: [f64; 5] = [0.6, 0.8, 1.0, 1.2, 1.4];
/// Standard deviations of the noise from which fits start, in those of the least-squares residual.
const NOISES: [f64; 3] = [0.5, 0.05, 0.005];
/// Quasi-Newton steps from a start before Newton steps.
const ROUGH_STEPS: usize = 15;
/// Iterations of the reference methods.
const REFERENCE_STEPS: usize = 5_000;

/// Method by which the likelihood is maximised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Method {
    /// A scan over shapes, or starts at several exponents and noises, then Newton steps.
    #[default]
    Scan,
    /// The paper's ascent along the gradient, for comparison.
    GradientAscent,
    /// Expectation-maximisation, for comparison.
    Em,
}

/// Options of a maximum likelihood fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Family of the curve.
    pub family: Family,
    /// Adds the variance of each point to that of the noise.
    pub per_feature: bool,
    /// Relative standard deviation of `c` for points that state none; 0 for none.
    pub relative_noise: f64,
    /// Damping in 1/s below which features were dropped.
    pub truncated_below: Option<f64>,
    /// Distribution of the excess.
    pub excess: Excess,
    /// Smallest `sigma` in units of the median damping.
    pub floor: f64,
    /// A finer grid of shapes, and a scan at each exponent.
    pub thorough: bool,
    /// Method.
    pub method: Method,
}

impl FitOptions {
    /// The defaults: noise of each feature.
    #[must_use]
    pub fn new(family: Family) -> Self {
        Self {
            family,
            per_feature: true,
            relative_noise: 0.0,
            truncated_below: None,
            excess: Excess::Exponential,
            floor: SIGMA_FLOOR,
            thorough: false,
            method: Method::Scan,
        }
    }

    /// The paper's likelihood: one `sigma`, and no options.
    #[must_use]
    pub fn paper(family: Family) -> Self {
        Self { per_feature: false, ..Self::new(family) }
    }

    /// The normalised sample, with the noise that these options require.
    pub(crate) fn sample(&self, points: &[DampingPoint]) -> Result<Sample, EstimationError> {
        let mut sample = Sample::new(points, self.family)?;
        if self.relative_noise > 0.0 {
            let relative = |(v, y): (&mut f64, &f64)| {
                if *v == 0.0 {
                    *v = (self.relative_noise * y).powi(2);
                }
            };
            sample.variance.iter_mut().zip(&sample.y).for_each(relative);
        }
        if let Some(low) = self.truncated_below
            && let Some(index) = points.iter().position(|p| p.weight > 0.0 && p.c < low)
        {
            let needed = "no point may be below the damping at which features were dropped";
            return Err(EstimationError::Value { index, field: "c", found: points[index].c, needed });
        }
        Ok(sample)
    }

    pub(crate) fn likelihood<'a>(&self, sample: &'a Sample) -> Likelihood<'a> {
        let low = self.truncated_below.map(|low| low / sample.ys);
        Likelihood::new(sample, self.per_feature, low, self.excess)
    }

    /// The floor of `sigma` in normalised units: at least the median accuracy, if it is known but not used.
    pub(crate) fn floor_of(&self, sample: &Sample) -> f64 {
        if self.per_feature {
            return self.floor;
        }
        let mut sd: Vec<f64> = sample.variance.iter().map(|v| v.sqrt()).collect();
        sd.sort_by(f64::total_cmp);
        self.floor.max(sd.get(sd.len() / 2).copied().unwrap_or(0.0))
    }
}

/// Another local maximum of the likelihood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherMaximum {
    /// Its `sigma`, 1/s.
    pub sigma: f64,
    /// Log-likelihood below that of the optimum, nats.
    pub gap: f64,
}

/// A fit in normalised units.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The points.
    pub sample: Sample,
    /// The options.
    pub options: FitOptions,
    /// `theta`, `ln sigma`, `ln eta`.
    pub z: Vec<f64>,
    /// Log-likelihood in normalised units.
    pub log_likelihood: f64,
    /// Largest component of the projected gradient of the mean log-likelihood.
    pub gradient: f64,
    /// Floor of `sigma`.
    pub floor: f64,
    /// Effort of all starts.
    pub effort: Effort,
    /// Number of starts.
    pub starts: usize,
    /// True if the scan proves the optimum to be global within its grid of shapes.
    pub certified: bool,
    /// Other local maxima.
    pub others: Vec<OtherMaximum>,
}

impl Fit {
    /// Parameters of the curve in normalised units.
    #[must_use]
    pub fn theta(&self) -> &[f64] {
        &self.z[..self.sample.family.parameters()]
    }

    /// Parameters of the curve in physical units.
    #[must_use]
    pub fn physical(&self) -> Vec<f64> {
        self.sample.physical(self.theta())
    }

    /// Standard deviation of the noise, 1/s.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sample.ys * libm::exp(self.z[self.sample.family.parameters()])
    }

    /// Rate of the excess, s.
    #[must_use]
    pub fn eta(&self) -> f64 {
        libm::exp(self.z[self.sample.family.parameters() + 1]) / self.sample.ys
    }

    /// Log-likelihood in physical units.
    #[must_use]
    pub fn physical_log_likelihood(&self) -> f64 {
        self.log_likelihood - self.sample.total_weight() * libm::log(self.sample.ys)
    }

    /// Returns true if `sigma` is at its floor.
    #[must_use]
    pub fn sigma_at_floor(&self) -> bool {
        self.z[self.sample.family.parameters()] <= libm::log(self.floor) + 1e-6
    }
}

/// Fits a damping model by maximum likelihood.
///
/// A curve that is linear in its parameters, without options of the likelihood, is found by [`scan`], which is global within its
/// grid of shapes. Others start from least squares at five exponents and three noises, from the plain scan, and from the lower bound.
///
/// # Errors
/// As [`Sample::new`].
///
/// # Complexity
/// O(n) a step; about 75 Newton steps for a scan, 600 quasi-Newton steps for 15 starts.
///
/// # Source
/// Sterling et al. (IEEE TVCG 25(5), 2019), section 4.4, for the likelihood.
pub fn fit(points: &[DampingPoint], options: &FitOptions) -> Result<Fit, EstimationError> {
    if matches!(options.excess, Excess::Gamma(_)) && options.truncated_below.is_some() {
        return Err(EstimationError::Option("a gamma excess cannot be truncated: leave out one of the two"));
    }
    let sample = options.sample(points)?;
    let floor = options.floor_of(&sample);
    let likelihood = options.likelihood(&sample);
    let mut effort = Effort::default();
    let (mut found, starts, certified) = match options.method {
        Method::GradientAscent | Method::Em => {
            let start = start(&likelihood, 1.0, NOISES[0], floor);
            let run = if options.method == Method::Em { reference::em } else { reference::gradient_ascent };
            (vec![run(&likelihood, start, floor, REFERENCE_STEPS, &mut effort)], 1, false)
        }
        Method::Scan if likelihood.is_plain() && !options.family.has_exponent() => {
            let start = start(&likelihood, 1.0, NOISES[0], floor);
            (scan(&likelihood, None, &start, floor, options.thorough, &mut effort), 1, true)
        }
        Method::Scan => {
            let (found, starts) = from_starts(&likelihood, floor, options.thorough, &mut effort);
            (found, starts, false)
        }
    };
    let total = likelihood.total_weight();
    let best = if found.is_empty() { None } else { Some(found.remove(0)) };
    let Some(best) = best else {
        return Err(EstimationError::Option("the likelihood has no maximum within its bounds"));
    };
    let p = options.family.parameters();
    let other = |m: &LocalMaximum| OtherMaximum {
        sigma: sample.ys * libm::exp(m.z[p]),
        gap: total * (best.value - m.value),
    };
    let others = found.iter().map(other).collect();
    Ok(Fit {
        options: *options,
        log_likelihood: total * best.value,
        gradient: best.gradient,
        z: best.z,
        sample,
        floor,
        effort,
        starts,
        certified,
        others,
    })
}

/// A start: half of the least-squares curve, noise as a fraction of its residual, and its residual as the mean excess.
pub(crate) fn start(likelihood: &Likelihood<'_>, exponent: f64, noise: f64, floor: f64) -> Vec<f64> {
    let sample = likelihood.sample();
    let p = sample.family.linear_parameters();
    let (mut z, _) = LeastSquares::default().linear(sample, exponent);
    if sample.family.has_exponent() {
        z.push(exponent);
    }
    let curve = sample.curve(&z);
    let square = curve.iter().zip(&sample.y).map(|(c, y)| (y - c).powi(2)).sum::<f64>() / sample.len() as f64;
    let sd = square.sqrt().clamp(1e-6, 1e6);
    z[..p].iter_mut().for_each(|t| *t *= 0.5);
    z.push(libm::log((noise * sd).max(floor)));
    z.push(libm::log((1.0 / sd).clamp(ETA[0], ETA[1])));
    z
}

/// The start at the lower bound, with the least noise.
pub(crate) fn start_at_lower_bound(sample: &Sample, floor: f64) -> Vec<f64> {
    let (mut z, excess) = lower_bound(sample);
    z.push(libm::log(floor));
    z.push(libm::log((1.0 / excess.max(1e-12)).clamp(ETA[0], ETA[1])));
    z
}

fn from_starts(
    likelihood: &Likelihood<'_>,
    floor: f64,
    thorough: bool,
    effort: &mut Effort,
) -> (Vec<LocalMaximum>, usize) {
    let sample = likelihood.sample();
    let family = sample.family;
    let bounds = likelihood.bounds(floor);
    let exponents: &[f64] = if family.has_exponent() { &EXPONENTS } else { &EXPONENTS[2..3] };
    let mut starts = vec![start_at_lower_bound(sample, floor)];
    for g3 in exponents {
        starts.extend(NOISES.map(|noise| start(likelihood, *g3, noise, floor)));
    }
    // The optimum for one sigma; for a family with an exponent at an exponent of 1, or at all if thorough.
    let plain = Likelihood::new(sample, false, None, Excess::Exponential);
    let fixed: Vec<Option<f64>> = match (family.has_exponent(), thorough) {
        (false, _) => vec![None],
        (true, false) => vec![Some(1.0)],
        (true, true) => EXPONENTS.map(Some).to_vec(),
    };
    for exponent in fixed {
        let from = start(&plain, exponent.unwrap_or(1.0), NOISES[0], floor);
        starts
            .extend(scan(&plain, exponent, &from, floor, thorough, effort).into_iter().map(|m| m.z).take(2));
    }
    let count = starts.len();
    let mut found: Vec<LocalMaximum> = starts
        .into_iter()
        .map(|mut z| {
            let rough = lbfgs(|z, g| likelihood.gradient(z, g), &bounds, &mut z, 1e-4, ROUGH_STEPS);
            effort.add(rough.steps, rough.evaluations);
            let out = newton(&mut likelihood.clone(), &bounds, &mut z, Stop::Gradient(1e-12), 60);
            effort.add(out.steps, out.evaluations);
            LocalMaximum { z, value: out.value, gradient: out.gradient }
        })
        .filter(|m| m.value.is_finite())
        .collect();
    found.sort_by(|a, b| b.value.total_cmp(&a.value));
    let total = likelihood.total_weight();
    found.dedup_by(|b, a| total * (a.value - b.value) < 1e-6);
    (found, count)
}
