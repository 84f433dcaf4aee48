//! Fits of points some of which are spurious.

use super::fit::{Fit, FitOptions, fit, start};
use super::likelihood::Likelihood;
use super::newton::{Objective, newton};
use super::point::{DampingPoint, EstimationError, Sample};

/// Standard deviations of the noise from which fits start, in units of the median damping.
const NOISES: [f64; 3] = [0.3, 0.05, 0.01];
/// Gain in nats at which the steps of expectation and maximisation end.
const EM_GAIN: f64 = 1e-3;
/// Maximum number of such steps.
const EM_STEPS: usize = 60;
/// Counts of the prior of the share: spurious points, and all.
const PRIOR: [f64; 2] = [0.5, 10.0];

/// Options of a mixture fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureOptions {
    /// Options of the likelihood.
    pub fit: FitOptions,
    /// Lowest damping of a spurious feature, 1/s; 0.5 by default.
    pub lo: f64,
    /// Highest damping of a spurious feature, 1/s; by default the larger of 2000 and twice the largest.
    pub hi: Option<f64>,
    /// Maximum share of spurious features.
    pub pi_max: f64,
    /// Prior of the share: Beta(1.5, 10.5).
    pub prior: bool,
}

impl MixtureOptions {
    /// The defaults over options of the likelihood.
    #[must_use]
    pub fn new(fit: FitOptions) -> Self {
        Self { fit, lo: 0.5, hi: None, pi_max: 0.5, prior: true }
    }
}

/// A fit with spurious points set apart.
#[derive(Clone, Debug, PartialEq)]
pub struct MixtureFit {
    /// The fit; its log-likelihood is that of the mixture.
    pub fit: Fit,
    /// Share of spurious points.
    pub pi: f64,
    /// Probability of each point to belong to a mode, `[n]`.
    pub responsibility: Vec<f64>,
    /// Minus the Hessian of the penalised log-likelihood over `theta`, `ln sigma`, `ln eta` and the logit of the share, in normalised
    /// units.
    pub information: Vec<f64>,
    /// The options.
    pub options: MixtureOptions,
    /// Penalised objective after each step of expectation and maximisation of the start that won, nats.
    pub trace: Vec<f64>,
}

/// The mixture's penalised log-likelihood over `theta`, `ln sigma`, `ln eta`, `logit pi`.
struct Mixture<'a> {
    likelihood: Likelihood<'a>,
    /// Log density of the background at each point.
    background: Vec<f64>,
    weight: Vec<f64>,
    prior: bool,
    pi_max: f64,
}

impl MixtureFit {
    /// Refits a sample that differs in weights or dampings, from the optimum on; `theta`, `sigma`, `eta` in physical units.
    ///
    /// `None` if it does not converge.
    #[must_use]
    pub fn refit(&self, sample: &Sample) -> Option<Vec<f64>> {
        let mut mixture = Mixture::new(sample, &self.options);
        let bounds = mixture.bounds(self.fit.floor);
        let mut z = self.fit.z.clone();
        z.push(libm::log(self.pi / (1.0 - self.pi)));
        let out = newton(&mut mixture, &bounds, &mut z, 1e-7, 60);
        out.value.is_finite().then(|| sample.physical_with_noise(&z))
    }
}

/// `ln(exp(a) + exp(b))`.
fn log_sum(a: f64, b: f64) -> f64 {
    let (low, high) = (a.min(b), a.max(b));
    if high == f64::NEG_INFINITY { high } else { high + libm::log1p(libm::exp(low - high)) }
}

/// `ln pi` and `ln(1 - pi)` of a logit.
fn log_shares(logit: f64) -> [f64; 2] {
    [-log_sum(0.0, -logit), -log_sum(0.0, logit)]
}

impl<'a> Mixture<'a> {
    fn new(sample: &'a Sample, options: &MixtureOptions) -> Self {
        let span = libm::log(libm::log(options.hi.unwrap_or(2000.0) / options.lo));
        Self {
            background: sample.y.iter().map(|y| -libm::log(*y) - span).collect(),
            weight: sample.weight.clone(),
            prior: options.prior,
            pi_max: options.pi_max,
            likelihood: options.fit.likelihood(sample),
        }
    }

    fn bounds(&self, floor: f64) -> Vec<[f64; 2]> {
        let mut bounds = self.likelihood.bounds(floor);
        let least = -libm::log(1e6 * self.background.len() as f64);
        bounds.push([least, libm::log(self.pi_max / (1.0 - self.pi_max).max(1e-12))]);
        bounds
    }

    fn penalty(&self, [log_pi, log_rest]: [f64; 2]) -> f64 {
        if self.prior { PRIOR[0] * log_pi + (PRIOR[1] - PRIOR[0]) * log_rest } else { 0.0 }
    }

    fn total(&self) -> f64 {
        self.likelihood.total_weight()
    }

    /// Responsibilities at `z`, and the penalised objective in nats.
    fn responsibilities(&self, z: &[f64], out: &mut Vec<f64>) -> f64 {
        let n = z.len() - 1;
        let [log_pi, log_rest] = log_shares(z[n]);
        let mut densities = Vec::new();
        self.likelihood.log_densities(&z[..n], &mut densities);
        out.clear();
        let mut sum = self.penalty([log_pi, log_rest]);
        for ((l, b), w) in densities.iter().zip(&self.background).zip(&self.weight) {
            let whole = log_sum(log_rest + l, log_pi + b);
            out.push(libm::exp(log_rest + l - whole));
            if *w > 0.0 {
                sum += w * whole;
            }
        }
        sum
    }
}

impl Objective for Mixture<'_> {
    fn value(&mut self, z: &[f64]) -> f64 {
        self.responsibilities(z, &mut Vec::new()) / self.total()
    }

    fn derivatives(&mut self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let n = z.len() - 1;
        let mut r = Vec::new();
        let value = self.responsibilities(z, &mut r);
        let pi = libm::exp(log_shares(z[n])[0]);
        let weights: Vec<f64> = r.iter().zip(&self.weight).map(|(r, w)| r * w).collect();
        let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
        self.likelihood.with_weights(&weights).sums(&z[..n], &mut g, &mut h);
        let (rows, _) = self.likelihood.point_gradients(&z[..n]);
        let m = n + 1;
        hessian.fill(0.0);
        let (mut by_pi, mut pi_pi) = (0.0, 0.0);
        for ((row, r), w) in rows.chunks_exact(n).zip(&r).zip(&self.weight) {
            if *w == 0.0 {
                continue;
            }
            let spread = w * r * (1.0 - r);
            by_pi += w * (1.0 - r - pi);
            pi_pi += spread - w * pi * (1.0 - pi);
            if spread == 0.0 {
                continue;
            }
            for (a, ga) in row.iter().enumerate() {
                for (b, gb) in row.iter().enumerate() {
                    hessian[a * m + b] += spread * ga * gb;
                }
                hessian[a * m + n] -= spread * ga;
            }
        }
        for a in 0..n {
            for b in 0..n {
                hessian[a * m + b] += h[a * n + b];
            }
            hessian[n * m + a] = hessian[a * m + n];
        }
        if self.prior {
            by_pi += PRIOR[0] - PRIOR[1] * pi;
            pi_pi -= PRIOR[1] * pi * (1.0 - pi);
        }
        hessian[n * m + n] = pi_pi;
        gradient[..n].copy_from_slice(&g);
        gradient[n] = by_pi;
        let total = self.total();
        gradient.iter_mut().for_each(|g| *g /= total);
        hessian.iter_mut().for_each(|h| *h /= total);
        value / total
    }
}

/// Fits a damping model and a background of spurious features, log-uniform in damping, at once.
///
/// `p(y) = (1 - pi) EMG(y) + pi / (y ln(hi/lo))`. From the plain optimum and from three noises, steps of expectation and maximisation find
/// the responsibilities, and Newton steps in all parameters end each; the best penalised likelihood wins.
///
/// # Errors
/// As [`fit`], and a damping outside of `lo` to `hi`.
///
/// # Source
/// Dempster, Laird and Rubin (J. R. Statist. Soc. B 39, 1977) for the steps; Sterling et al. (IEEE TVCG 25(5), 2019), section 7, name
/// spurious features as future work.
pub fn fit_mixture(points: &[DampingPoint], options: &MixtureOptions) -> Result<MixtureFit, EstimationError> {
    let plain = fit(points, &options.fit)?;
    let largest = points.iter().map(|p| p.c).fold(0.0, f64::max);
    let (lo, hi) = (options.lo, options.hi.unwrap_or((2.0 * largest).max(2000.0)));
    if let Some(index) = points.iter().position(|p| !(lo..=hi).contains(&p.c)) {
        return Err(EstimationError::Outside { index, found: points[index].c, lo, hi });
    }
    let options = &MixtureOptions { hi: Some(hi), ..*options };
    let sample = &plain.sample;
    let mut mixture = Mixture::new(sample, options);
    let likelihood = mixture.likelihood.clone();
    let n = likelihood.parameters();
    let log_floor = libm::log(plain.floor);
    let bounds = mixture.bounds(plain.floor);
    let mut starts = vec![plain.z.clone()];
    for noise in NOISES {
        let mut z =
            start(&likelihood, plain.z.get(n.saturating_sub(3)).copied().unwrap_or(1.0), 0.5, plain.floor);
        z[n - 2] = libm::log(noise).max(log_floor);
        starts.push(z);
    }
    let mut effort = plain.effort;
    let count = starts.len();
    let mut best: Option<(f64, Vec<f64>, f64, Vec<f64>)> = None;
    for mut z in starts {
        z.push(libm::log(0.1 / 0.9));
        let mut r = Vec::new();
        let mut trace = Vec::new();
        for _ in 0..EM_STEPS {
            let value = mixture.responsibilities(&z, &mut r);
            let gain = trace.last().map_or(f64::INFINITY, |last| value - last);
            trace.push(value);
            if gain < EM_GAIN {
                break;
            }
            let weights: Vec<f64> = r.iter().zip(&mixture.weight).map(|(r, w)| r * w).collect();
            let spurious = mixture.total() - weights.iter().sum::<f64>();
            let [of, all] = if options.prior { PRIOR } else { [0.0; 2] };
            let pi = ((spurious + of) / (mixture.total() + all)).clamp(1e-300, options.pi_max);
            z[n] = libm::log(pi / (1.0 - pi)).clamp(bounds[n][0], bounds[n][1]);
            let out = newton(&mut likelihood.with_weights(&weights), &bounds[..n], &mut z[..n], 1e-8, 12);
            effort.add(out.steps, out.evaluations);
        }
        let out = newton(&mut mixture, &bounds, &mut z, 1e-12, 100);
        effort.add(out.steps, out.evaluations);
        if best.as_ref().is_none_or(|b| out.value > b.0) {
            best = Some((out.value, z, out.gradient, trace));
        }
    }
    let Some((_, z, gradient, trace)) = best else {
        return Err(EstimationError::Option("no start converged"));
    };
    let mut responsibility = Vec::new();
    let penalised = mixture.responsibilities(&z, &mut responsibility);
    let log_likelihood = penalised - mixture.penalty(log_shares(z[n]));
    let (mut g, mut hessian) = (vec![0.0; n + 1], vec![0.0; (n + 1) * (n + 1)]);
    mixture.derivatives(&z, &mut g, &mut hessian);
    let total = mixture.total();
    Ok(MixtureFit {
        pi: libm::exp(log_shares(z[n])[0]),
        fit: Fit {
            z: z[..n].to_vec(),
            log_likelihood,
            gradient,
            effort,
            starts: count + plain.starts,
            certified: false,
            others: Vec::new(),
            ..plain
        },
        responsibility,
        options: *options,
        information: hessian.iter().map(|h| -h * total).collect(),
        trace,
    })
}
