//! Fits of points some of which are spurious.

use super::fit::{Fit, FitOptions, fit, start};
use super::likelihood::Likelihood;
use super::newton::{Ascent, Objective, Stop, newton};
use super::point::{DampingPoint, EstimationError, Sample};
use super::scan::Effort;
use std::collections::BTreeMap;

/// Standard deviations of the noise from which fits start, in units of the median damping.
const NOISES: [f64; 3] = [0.3, 0.05, 0.01];
/// Gain in nats at which the steps of expectation and maximisation end.
const EM_GAIN: f64 = 1e-3;
/// Maximum number of such steps.
const EM_STEPS: usize = 60;
/// Counts of the prior of the share: spurious points, and all.
const PRIOR: [f64; 2] = [0.5, 10.0];

/// Least number of points of a mode cluster that may have a share of spurious points of its own.
const CLUSTER: f64 = 8.0;
/// Share of spurious points above which it has one.
const CROWDED: f64 = 0.5;
/// Maximum number of searches for clusters.
const SEARCHES: usize = 3;
/// Largest logit of the share of a cluster.
const MAX_LOGIT: f64 = 14.0;

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
    /// Logits of the shares: of most points, and of each cluster with a share of its own.
    pub logits: Vec<f64>,
    /// Index of the share of each point, `[n]`.
    pub groups: Vec<u32>,
    /// Probability of each point to belong to a mode, `[n]`.
    pub responsibility: Vec<f64>,
    /// Minus the Hessian of the penalised log-likelihood over `theta`, `ln sigma`, `ln eta` and the logits of the shares, in normalised
    /// units.
    pub information: Vec<f64>,
    /// The options.
    pub options: MixtureOptions,
    /// Penalised objective after each step of expectation and maximisation of the start that won, nats.
    pub trace: Vec<f64>,
}

/// The mixture's penalised log-likelihood over `theta`, `ln sigma`, `ln eta`, and the logit of each share.
struct Mixture<'a> {
    likelihood: Likelihood<'a>,
    /// Share of each point.
    groups: Vec<u32>,
    /// Sum of the weights of the points of each share.
    totals: Vec<f64>,
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
        let mut mixture = Mixture::new(sample, &self.options).with_groups(self.groups.clone());
        let bounds = mixture.bounds(self.fit.floor);
        let mut z = self.fit.z.clone();
        z.extend(&self.logits);
        let out = newton(&mut mixture, &bounds, &mut z, Stop::Gradient(1e-7), 60);
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
            groups: vec![0; sample.len()],
            totals: vec![sample.total_weight()],
            prior: options.prior,
            pi_max: options.pi_max,
            likelihood: options.fit.likelihood(sample),
        }
    }

    /// The same with shares of their own for some points: the index of the share of each.
    fn with_groups(mut self, groups: Vec<u32>) -> Self {
        self.totals = vec![0.0; 1 + groups.iter().max().map_or(0, |g| *g as usize)];
        for (g, w) in groups.iter().zip(&self.weight) {
            self.totals[*g as usize] += w;
        }
        Self { groups, ..self }
    }

    /// Number of parameters besides the shares.
    fn others(&self, z: &[f64]) -> usize {
        z.len() - self.totals.len()
    }

    fn bounds(&self, floor: f64) -> Vec<[f64; 2]> {
        let mut bounds = self.likelihood.bounds(floor);
        let least = -libm::log(1e6 * self.background.len() as f64);
        bounds.push([least, libm::log(self.pi_max / (1.0 - self.pi_max).max(1e-12))]);
        bounds.extend(vec![[least, MAX_LOGIT]; self.totals.len() - 1]);
        bounds
    }

    fn penalty(&self, [log_pi, log_rest]: [f64; 2]) -> f64 {
        if self.prior { PRIOR[0] * log_pi + (PRIOR[1] - PRIOR[0]) * log_rest } else { 0.0 }
    }

    fn total(&self) -> f64 {
        self.likelihood.total_weight()
    }

    /// Shares of the clusters that are mostly spurious at `z`, where a share of its own raises the likelihood of a cluster by more than the
    /// logarithm of the number of points.
    fn crowded(&self, z: &[f64], points: &[DampingPoint]) -> Vec<u32> {
        let n = self.others(z);
        let mut densities = Vec::new();
        self.likelihood.log_densities(&z[..n], &mut densities);
        let mut clusters: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, p) in points.iter().enumerate().filter(|(i, _)| self.weight[*i] > 0.0) {
            clusters.entry(p.mode_cluster).or_default().push(i);
        }
        let mut groups = vec![0; points.len()];
        let mut count = 0;
        let several = clusters.len() > 1;
        for members in clusters.into_values().filter(|_| several) {
            let size: f64 = members.iter().map(|i| self.weight[*i]).sum();
            if size < CLUSTER {
                continue;
            }
            let value = |shares: [f64; 2]| -> f64 {
                let of = |i: &usize| {
                    self.weight[*i] * log_sum(shares[1] + densities[*i], shares[0] + self.background[*i])
                };
                members.iter().map(of).sum()
            };
            let mut pi = CROWDED;
            for _ in 0..EM_STEPS {
                let [log_pi, log_rest] = [libm::log(pi), libm::log1p(-pi)];
                let spurious = |i: &usize| {
                    let own = log_pi + self.background[*i];
                    self.weight[*i] * libm::exp(own - log_sum(log_rest + densities[*i], own))
                };
                let share = members.iter().map(spurious).sum::<f64>() / size;
                pi = share.clamp(1e-6, 1.0 - 1e-6);
            }
            let gain = value([libm::log(pi), libm::log1p(-pi)]) - value(log_shares(z[n]));
            if pi > CROWDED && gain > libm::log(self.total()) {
                count += 1;
                members.iter().for_each(|i| groups[*i] = count);
            }
        }
        groups
    }

    /// Steps of expectation and maximisation, then Newton steps in all parameters; the objective after each of the former.
    fn maximise(&mut self, z: &mut [f64], bounds: &[[f64; 2]], effort: &mut Effort) -> (Ascent, Vec<f64>) {
        let n = self.others(z);
        let inner = Stop::Gain(EM_GAIN / self.total());
        let likelihood = self.likelihood.clone();
        let (mut r, mut trace) = (Vec::new(), Vec::new());
        for _ in 0..EM_STEPS {
            let value = self.responsibilities(z, &mut r);
            let gain = trace.last().map_or(f64::INFINITY, |last| value - last);
            trace.push(value);
            if gain < EM_GAIN {
                break;
            }
            let weights: Vec<f64> = r.iter().zip(&self.weight).map(|(r, w)| r * w).collect();
            let mut spurious = self.totals.clone();
            weights.iter().zip(&self.groups).for_each(|(w, g)| spurious[*g as usize] -= w);
            let [of, all] = if self.prior { PRIOR } else { [0.0; 2] };
            for (g, (spurious, total)) in spurious.iter().zip(&self.totals).enumerate() {
                let pi = ((spurious + of) / (total + all)).clamp(1e-300, 1.0 - 1e-15);
                z[n + g] = libm::log(pi / (1.0 - pi)).clamp(bounds[n + g][0], bounds[n + g][1]);
            }
            let out = newton(&mut likelihood.with_weights(&weights), &bounds[..n], &mut z[..n], inner, 12);
            effort.add(out.steps, out.evaluations);
        }
        let out = newton(self, bounds, z, Stop::Gradient(1e-12), 100);
        effort.add(out.steps, out.evaluations);
        (out, trace)
    }

    /// Responsibilities at `z`, and the penalised objective in nats.
    fn responsibilities(&self, z: &[f64], out: &mut Vec<f64>) -> f64 {
        let n = self.others(z);
        let shares: Vec<[f64; 2]> = z[n..].iter().map(|logit| log_shares(*logit)).collect();
        let mut densities = Vec::new();
        self.likelihood.log_densities(&z[..n], &mut densities);
        out.clear();
        let mut sum: f64 = shares.iter().map(|shares| self.penalty(*shares)).sum();
        let points = densities.iter().zip(&self.background).zip(&self.weight).zip(&self.groups);
        for (((l, b), w), group) in points {
            let [log_pi, log_rest] = shares[*group as usize];
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
        let n = self.others(z);
        let mut r = Vec::new();
        let value = self.responsibilities(z, &mut r);
        let pi: Vec<f64> = z[n..].iter().map(|logit| libm::exp(log_shares(*logit)[0])).collect();
        let weights: Vec<f64> = r.iter().zip(&self.weight).map(|(r, w)| r * w).collect();
        let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
        self.likelihood.with_weights(&weights).sums(&z[..n], &mut g, &mut h);
        let (rows, _) = self.likelihood.point_gradients(&z[..n]);
        let m = z.len();
        gradient.fill(0.0);
        hessian.fill(0.0);
        for (((row, r), w), group) in rows.chunks_exact(n).zip(&r).zip(&self.weight).zip(&self.groups) {
            if *w == 0.0 {
                continue;
            }
            let share = n + *group as usize;
            let pi = pi[*group as usize];
            let spread = w * r * (1.0 - r);
            gradient[share] += w * (1.0 - r - pi);
            hessian[share * m + share] += spread - w * pi * (1.0 - pi);
            if spread == 0.0 {
                continue;
            }
            for (a, ga) in row.iter().enumerate() {
                for (b, gb) in row.iter().enumerate() {
                    hessian[a * m + b] += spread * ga * gb;
                }
                hessian[a * m + share] -= spread * ga;
            }
        }
        for a in 0..n {
            for b in 0..n {
                hessian[a * m + b] += h[a * n + b];
            }
            for share in n..m {
                hessian[share * m + a] = hessian[a * m + share];
            }
        }
        if self.prior {
            for (share, pi) in (n..).zip(&pi) {
                gradient[share] += PRIOR[0] - PRIOR[1] * pi;
                hessian[share * m + share] -= PRIOR[1] * pi * (1.0 - pi);
            }
        }
        gradient[..n].copy_from_slice(&g);
        let total = self.total();
        gradient.iter_mut().for_each(|g| *g /= total);
        hessian.iter_mut().for_each(|h| *h /= total);
        value / total
    }
}

/// Fits a damping model and a background of spurious features, log-uniform in damping, at once.
///
/// `p(y) = (1 - pi) EMG(y) + pi / (y ln(hi/lo))`. From the plain optimum and from three noises, steps of expectation and maximisation find
/// the responsibilities, and Newton steps in all parameters end each; the best penalised likelihood wins. Mode clusters of at least eight
/// points that are mostly spurious, as of a striker that rings in every recording, then get a share `pi` of their own.
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
    let n = mixture.likelihood.parameters();
    let log_floor = libm::log(plain.floor);
    let bounds = mixture.bounds(plain.floor);
    let mut starts = vec![plain.z.clone()];
    for noise in NOISES {
        let exponent = plain.z.get(n.saturating_sub(3)).copied().unwrap_or(1.0);
        let mut z = start(&mixture.likelihood, exponent, 0.5, plain.floor);
        z[n - 2] = libm::log(noise).max(log_floor);
        starts.push(z);
    }
    let mut effort = plain.effort;
    let count = starts.len();
    let mut best: Option<(Ascent, Vec<f64>, Vec<f64>)> = None;
    for mut z in starts {
        z.push(libm::log(0.1 / 0.9));
        let (out, trace) = mixture.maximise(&mut z, &bounds, &mut effort);
        if best.as_ref().is_none_or(|b| out.value > b.0.value) {
            best = Some((out, z, trace));
        }
    }
    let Some((mut out, mut z, mut trace)) = best else {
        return Err(EstimationError::Option("no start converged"));
    };
    for _ in 0..SEARCHES {
        let groups = mixture.crowded(&z, points);
        if groups == mixture.groups {
            break;
        }
        mixture = mixture.with_groups(groups);
        z.truncate(n + 1);
        z.resize(n + mixture.totals.len(), 0.0);
        let bounds = mixture.bounds(plain.floor);
        (out, trace) = mixture.maximise(&mut z, &bounds, &mut effort);
    }
    let mut responsibility = Vec::new();
    let penalised = mixture.responsibilities(&z, &mut responsibility);
    let penalty: f64 = z[n..].iter().map(|logit| mixture.penalty(log_shares(*logit))).sum();
    let m = z.len();
    let (mut g, mut hessian) = (vec![0.0; m], vec![0.0; m * m]);
    mixture.derivatives(&z, &mut g, &mut hessian);
    let total = mixture.total();
    let spurious = z[n..].iter().zip(&mixture.totals).map(|(z, total)| total * libm::exp(log_shares(*z)[0]));
    Ok(MixtureFit {
        pi: spurious.sum::<f64>() / total,
        logits: z[n..].to_vec(),
        groups: mixture.groups.clone(),
        fit: Fit {
            z: z[..n].to_vec(),
            log_likelihood: penalised - penalty,
            gradient: out.gradient,
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
