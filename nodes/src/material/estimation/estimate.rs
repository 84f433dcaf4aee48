//! One call from points to a report.

use super::diagnostics;
use super::emg::Emg;
use super::fit::{Fit, FitOptions, fit};
use super::hierarchical::fit_hierarchical;
use super::least_squares::{LeastSquares, Space};
use super::lower_bound::lower_bound;
use super::mixture::{MixtureFit, MixtureOptions, fit_mixture};
use super::point::{DampingPoint, EstimationError, Sample, recordings};
use super::prior::MaterialPrior;
use super::report::{AtFrequency, Diagnostics, FitReport, FitWarning, PointReport, REPORTED_HZ};
use super::uncertainty::{
    Replicates, bootstrap, covariance, information, parametric_bootstrap, refit, standard_errors, wald,
};
use crate::material::damping::DampingModel;
use serde::{Deserialize, Serialize};

/// Number of points above which the p value of the distance is not simulated.
const MAX_SIMULATED: usize = 4000;

/// An estimator of damping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Estimator {
    /// Maximum likelihood with a background of spurious features.
    Mixture,
    /// Maximum likelihood.
    Likelihood,
    /// Maximum likelihood with a support rate for each recording.
    Hierarchical,
    /// Non-negative least squares.
    LeastSquares,
    /// The highest curve below all points.
    LowerBound,
}

/// Settings of [`estimate`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The estimator.
    pub estimator: Estimator,
    /// Options of the mixture, with those of the likelihood.
    pub mixture: MixtureOptions,
    /// Quantity of a least-squares fit.
    pub space: Space,
    /// Ordinary least squares.
    pub unconstrained: bool,
    /// Number of refits for intervals; 0 for standard errors alone.
    pub draws: usize,
    /// Number of simulations for the p value of the fit; 0 for none.
    pub ks_draws: usize,
    /// Seed of both.
    pub seed: u64,
    /// Fits the other families as well.
    pub compare: bool,
    /// Prior of the parameters, for `Mixture` and `Likelihood`.
    pub prior: Option<MaterialPrior>,
}

impl Settings {
    /// The defaults of an estimator with options of the likelihood.
    #[must_use]
    pub fn new(estimator: Estimator, fit: FitOptions) -> Self {
        Self {
            estimator,
            mixture: MixtureOptions::new(fit),
            space: Space::Linear,
            unconstrained: false,
            draws: 500,
            ks_draws: 99,
            seed: 1,
            compare: true,
            prior: None,
        }
    }
}

/// Estimates the damping of a material from points.
///
/// # Errors
/// As the estimator: too few points, values out of range.
pub fn estimate(points: &[DampingPoint], settings: &Settings) -> Result<FitReport, EstimationError> {
    match settings.estimator {
        Estimator::Likelihood => {
            let fit = fit(points, &settings.mixture.fit)?;
            if let Some(prior) = &settings.prior {
                return prior_report(prior, &fit, None, points, settings);
            }
            let information = information(&fit);
            likelihood_report("Likelihood", &fit, &information, None, points, settings)
        }
        Estimator::Mixture => {
            let found = fit_mixture(points, &settings.mixture)?;
            if let Some(prior) = &settings.prior {
                return prior_report(prior, &found.fit, Some(&found), points, settings);
            }
            likelihood_report("Mixture", &found.fit, &found.information, Some(&found), points, settings)
        }
        Estimator::Hierarchical => hierarchical_report(points, settings),
        Estimator::LeastSquares | Estimator::LowerBound => simple_report(points, settings),
    }
}

fn names(fit: &Fit) -> Vec<String> {
    let model = fit.sample.family.model(&fit.physical(), &fit.sample.physical_knots());
    let mut names = model.names();
    names.extend(["sigma".into(), "eta".into()]);
    names
}

/// Damping at the reported frequencies, with intervals from replicates.
fn at_frequencies(
    model_of: impl Fn(&[f64]) -> DampingModel,
    values: &[f64],
    replicates: Option<&Replicates>,
) -> Vec<AtFrequency> {
    let model = model_of(values);
    let each = |&frequency: &f64| {
        let figure = |p: &[f64]| model_of(p).decay(frequency);
        let interval = replicates.map(|r| r.interval(model.decay(frequency), figure));
        AtFrequency::of(&model, frequency, interval.filter(|i| i[0].is_finite()))
    };
    REPORTED_HZ.iter().map(each).collect()
}

/// The report of a fit with a prior, from one without it.
fn prior_report(
    prior: &MaterialPrior,
    plain: &Fit,
    mixture: Option<&MixtureFit>,
    points: &[DampingPoint],
    settings: &Settings,
) -> Result<FitReport, EstimationError> {
    if prior.family != plain.sample.family {
        return Err(EstimationError::Option("the prior is that of another family of curves"));
    }
    let responsibility = mixture.map(|m| m.responsibility.as_slice());
    let found = prior.fit(plain, responsibility);
    let fit = found.ok_or(EstimationError::Option("the fit with the prior does not converge"))?;
    let information = prior.information(&fit, responsibility);
    let name = if mixture.is_some() { "Mixture" } else { "Likelihood" };
    let name = format!("{name} with a prior of {} materials", prior.materials);
    likelihood_report(&name, &fit, &information, mixture, points, settings)
}

fn likelihood_report(
    estimator: &str,
    fit: &Fit,
    information: &[f64],
    mixture: Option<&MixtureFit>,
    points: &[DampingPoint],
    settings: &Settings,
) -> Result<FitReport, EstimationError> {
    let family = fit.sample.family;
    let names = names(fit);
    let values = fit.sample.physical_with_noise(&fit.z);
    let cov = covariance(fit, information);
    let mut warnings = diagnostics::warnings(fit, points);
    if cov.is_none() {
        let why =
            if fit.sigma_at_floor() { "the noise is at its floor" } else { "a parameter is at its bound" };
        warnings.push(FitWarning::NonRegular(why.into()));
    }
    let responsibility = mixture.map(|m| m.responsibility.as_slice());
    let again = |sample: &Sample| match (&settings.prior, mixture) {
        (Some(prior), _) => prior.refit(fit, responsibility, sample),
        (None, Some(mixture)) => mixture.refit(sample),
        (None, None) => refit(fit, sample),
    };
    let replicates = (settings.draws > 0).then(|| {
        // Points of one recording are as independent as the model says.
        if fit.sigma_at_floor() || (mixture.is_none() && recordings(points).len() == 1) {
            parametric_bootstrap(fit, settings.draws, settings.seed, again)
        } else {
            bootstrap(&fit.sample, points, settings.draws, settings.seed, again)
        }
    });
    let ci = match (&replicates, &cov) {
        (Some(replicates), _) => replicates.intervals(&names, &values),
        (None, Some(cov)) => wald(&names, &values, &standard_errors(cov)),
        (None, None) => Vec::new(),
    };
    if let Some(failed) = replicates.as_ref().map(|r| r.failed).filter(|f| *f > 0) {
        warnings.push(FitWarning::FailedDraws(failed));
    }
    let per_point = diagnostics::point_reports(fit, points, responsibility);
    let (ks, excess_shape, correlation) = diagnostics::tests_of_points(points, &per_point);
    // Simulated data and those without a recording are fitted without the prior.
    let simulated = settings.ks_draws > 0 && points.len() <= MAX_SIMULATED && settings.prior.is_none();
    let ks_p =
        if simulated { diagnostics::distance_p(fit, ks, settings.ks_draws, settings.seed) } else { 1.0 };
    warnings.extend(diagnostics::distribution_warnings(excess_shape[1], correlation[0], ks_p));
    if let Some(cov) = cov.as_ref().filter(|_| settings.prior.is_none()) {
        warnings.extend(diagnostics::recording_effect(fit, points, responsibility, cov));
    }
    let (comparisons, straight_p) = if settings.compare {
        // A mixture compares families on the points that belong to modes.
        let weighted: Vec<DampingPoint> = points
            .iter()
            .zip(&per_point)
            .map(|(p, r)| DampingPoint { weight: p.weight * r.responsibility, ..*p })
            .collect();
        diagnostics::compare(&weighted, &fit.options)?
    } else {
        (Vec::new(), None)
    };
    let pi = mixture.map_or(0.0, |m| m.pi);
    if pi > 0.98 * settings.mixture.pi_max {
        warnings.push(FitWarning::ManySpurious(pi));
    }
    let knots = fit.sample.physical_knots();
    let model = |p: &[f64]| family.model(&p[..family.parameters()], &knots);
    Ok(FitReport {
        estimator: estimator.into(),
        model: model(&values),
        names,
        sigma: fit.sigma(),
        eta: Some(fit.eta()),
        log_lik: fit.physical_log_likelihood(),
        n: points.len(),
        n_recordings: recordings(points).len(),
        lambda_unit: fit.sample.ls,
        c_unit: fit.sample.ys,
        sigma_at_floor: fit.sigma_at_floor(),
        certified: fit.certified,
        pi,
        cov,
        ci,
        iterations: fit.effort.iterations,
        evaluations: fit.effort.evaluations,
        starts: fit.starts,
        at: at_frequencies(model, &values, replicates.as_ref()),
        diagnostics: Diagnostics { ks, ks_p, excess_shape, correlation, comparisons, straight_p },
        warnings,
        supports: Vec::new(),
        points: points.iter().map(|p| [p.lambda, p.c]).collect(),
        per_point,
    })
}

/// The report of a joint fit of recordings, with intervals of two standard errors.
fn hierarchical_report(points: &[DampingPoint], settings: &Settings) -> Result<FitReport, EstimationError> {
    let options = &settings.mixture.fit;
    let found = fit_hierarchical(points, options)?;
    let sample = options.sample(points)?;
    let knots = sample.physical_knots();
    let model = options.family.model(&found.theta, &knots);
    let names = model.names();
    let ci = found.standard_errors.as_ref().map(|errors| wald(&names, &found.theta, errors));
    let ci = ci.unwrap_or_default();
    let part = |p: &DampingPoint| {
        let sd = if options.per_feature {
            (found.sigma * found.sigma + p.sd_c * p.sd_c).sqrt()
        } else {
            found.sigma
        };
        let eta = found.eta.get(p.recording as usize).copied().unwrap_or(1.0);
        let emg = Emg { c: model.c(p.lambda), sigma: sd, eta };
        let (support_part, _) = emg.excess(p.c);
        PointReport {
            c_hat: emg.c,
            support_part,
            noise_part: p.c - emg.c - support_part,
            pit: emg.cdf(p.c),
            responsibility: 1.0,
        }
    };
    let per_point: Vec<PointReport> = points.iter().map(part).collect();
    let (ks, excess_shape, correlation) = diagnostics::tests_of_points(points, &per_point);
    let mut warnings = diagnostics::distribution_warnings(excess_shape[1], correlation[0], 1.0);
    warnings.extend(diagnostics::few_recordings(points));
    if ci.is_empty() {
        warnings
            .push(FitWarning::NonRegular("the noise is at its floor, or a parameter at its bound".into()));
    }
    let model_of = |p: &[f64]| options.family.model(p, &knots);
    Ok(FitReport {
        estimator: "Hierarchical".into(),
        at: at_frequencies(model_of, &found.theta, None),
        model,
        names,
        sigma: found.sigma,
        eta: Some(libm::exp(found.mean_ln_eta)),
        log_lik: found.log_likelihood,
        n: points.len(),
        n_recordings: recordings(points).len(),
        lambda_unit: sample.ls,
        c_unit: sample.ys,
        sigma_at_floor: found.sigma <= 1.001 * options.floor_of(&sample) * sample.ys,
        certified: false,
        pi: 0.0,
        cov: None,
        ci,
        iterations: found.iterations,
        evaluations: found.iterations,
        starts: 1,
        diagnostics: Diagnostics { ks, ks_p: 1.0, excess_shape, correlation, ..Diagnostics::default() },
        warnings,
        supports: found.eta.iter().map(|eta| 1.0 / eta).collect(),
        points: points.iter().map(|p| [p.lambda, p.c]).collect(),
        per_point,
    })
}

/// The report of least squares or of a lower bound.
fn simple_report(points: &[DampingPoint], settings: &Settings) -> Result<FitReport, EstimationError> {
    let sample = settings.mixture.fit.sample(points)?;
    let family = sample.family;
    let bound = settings.estimator == Estimator::LowerBound;
    let least_squares = LeastSquares { space: settings.space, unconstrained: settings.unconstrained };
    let theta = |sample: &Sample| if bound { lower_bound(sample).0 } else { least_squares.fit(sample) };
    let best = theta(&sample);
    let curve = sample.curve(&best);
    let total = sample.total_weight();
    let sum = |f: &dyn Fn(f64) -> f64| -> f64 {
        (0..sample.len()).map(|i| sample.weight[i] * f(sample.y[i] - curve[i])).sum::<f64>() / total
    };
    let (mean, square) = (sum(&|r| r) * sample.ys, sum(&|r| r * r).sqrt() * sample.ys);
    let (sigma, eta) = if bound { (0.0, Some(1.0 / mean.max(1e-12))) } else { (square, None) };
    let log_lik = match eta {
        Some(eta) => total * (libm::log(eta) - 1.0),
        None => -0.5 * total * (libm::log(std::f64::consts::TAU * square * square) + 1.0),
    };
    let values = sample.physical(&best);
    let knots = sample.physical_knots();
    let model = |p: &[f64]| family.model(p, &knots);
    let replicates = (settings.draws > 0)
        .then(|| bootstrap(&sample, points, settings.draws, settings.seed, |s| Some(s.physical(&theta(s)))));
    let names = model(&values).names();
    let ci = replicates.as_ref().map(|r| r.intervals(&names, &values)).unwrap_or_default();
    let parts = |(p, c): (&DampingPoint, &f64)| PointReport {
        c_hat: c * sample.ys,
        support_part: if bound { p.c - c * sample.ys } else { 0.0 },
        noise_part: if bound { 0.0 } else { p.c - c * sample.ys },
        pit: 0.5,
        responsibility: 1.0,
    };
    Ok(FitReport {
        estimator: if bound { "LowerBound" } else { "LeastSquares" }.into(),
        model: model(&values),
        names,
        sigma,
        eta,
        log_lik,
        n: points.len(),
        n_recordings: recordings(points).len(),
        lambda_unit: sample.ls,
        c_unit: sample.ys,
        sigma_at_floor: bound,
        certified: false,
        pi: 0.0,
        cov: None,
        ci,
        iterations: 1,
        evaluations: 1,
        starts: 1,
        at: at_frequencies(model, &values, replicates.as_ref()),
        diagnostics: Diagnostics { ks_p: 1.0, ..Diagnostics::default() },
        warnings: diagnostics::few_recordings(points).into_iter().collect(),
        supports: Vec::new(),
        points: points.iter().map(|p| [p.lambda, p.c]).collect(),
        per_point: points.iter().zip(&curve).map(parts).collect(),
    })
}
