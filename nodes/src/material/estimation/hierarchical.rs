//! Joint fits of recordings, each with a support of its own.

use super::fit::{FitOptions, fit};
use super::likelihood::{ETA, Likelihood};
use super::newton::{Objective, Stop, newton};
use super::point::{DampingPoint, EstimationError};
use crate::statistics::linear::inverse;

/// Standard deviation of the logarithm of support rates over recordings.
pub const SD_LN_ETA: f64 = 0.7;
/// Recordings with fewer features share the mean support rate.
const MIN_FEATURES: usize = 4;
/// Number of recordings above which the spread of support rates is estimated.
const MIN_FOR_SPREAD: usize = 8;
/// Most recordings with rates of their own; more share the mean.
const MAX_RECORDINGS: usize = 400;

/// Maximum number of recordings that are distinguished; later ones share the mean.
const MAX_INDEX: usize = 1 << 20;

/// A joint fit.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchicalFit {
    /// Parameters of the curve in physical units.
    pub theta: Vec<f64>,
    /// Standard errors of these by Laplace's approximation; `None` where it is not regular.
    pub standard_errors: Option<Vec<f64>>,
    /// Standard deviation of the noise, 1/s.
    pub sigma: f64,
    /// Rate of the support damping of each recording, s, by index of the recording.
    pub eta: Vec<f64>,
    /// Mean of `ln eta` over recordings, `eta` in s.
    pub mean_ln_eta: f64,
    /// Standard deviation of `ln eta` over recordings.
    pub sd_ln_eta: f64,
    /// Log-likelihood in physical units, without the prior.
    pub log_likelihood: f64,
    /// Newton steps.
    pub iterations: usize,
}

/// The penalised log-likelihood over `theta`, `ln sigma`, the mean `ln eta`, and `ln eta` of each group.
struct Joint<'a> {
    groups: Vec<Likelihood<'a>>,
    /// Index in `z` of each group's `ln eta`.
    place: Vec<usize>,
    spread: f64,
    total: f64,
}

impl Joint<'_> {
    fn local(&self, z: &[f64], group: usize) -> Vec<f64> {
        let p = self.groups[group].parameters() - 1;
        let mut local = z[..p].to_vec();
        local.push(z[self.place[group]]);
        local
    }
}

impl Objective for Joint<'_> {
    fn value(&mut self, z: &[f64]) -> f64 {
        let mut sum = 0.0;
        let mean = self.groups.first().map_or(0, |g| g.parameters() - 1);
        for k in 0..self.groups.len() {
            let local = self.local(z, k);
            let mut group = self.groups[k].clone();
            sum += group.total_weight() * group.value(&local);
        }
        for b in &z[mean + 1..] {
            sum -= 0.5 * ((b - z[mean]) / self.spread).powi(2);
        }
        sum / self.total
    }

    fn derivatives(&mut self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let n = z.len();
        gradient.fill(0.0);
        hessian.fill(0.0);
        let mean = self.groups.first().map_or(0, |g| g.parameters() - 1);
        let m = mean + 1;
        let (mut g, mut h) = (vec![0.0; m], vec![0.0; m * m]);
        let mut sum = 0.0;
        for (k, group) in self.groups.iter().enumerate() {
            sum += group.sums(&self.local(z, k), &mut g, &mut h);
            let place = |a: usize| if a == mean { self.place[k] } else { a };
            for a in 0..m {
                gradient[place(a)] += g[a];
                for b in 0..m {
                    hessian[place(a) * n + place(b)] += h[a * m + b];
                }
            }
        }
        let precision = self.spread.powi(-2);
        for i in mean + 1..n {
            let away = z[i] - z[mean];
            sum -= 0.5 * precision * away * away;
            gradient[i] -= precision * away;
            gradient[mean] += precision * away;
            hessian[i * n + i] -= precision;
            hessian[mean * n + mean] -= precision;
            hessian[i * n + mean] += precision;
            hessian[mean * n + i] += precision;
        }
        gradient.iter_mut().for_each(|g| *g /= self.total);
        hessian.iter_mut().for_each(|h| *h /= self.total);
        sum / self.total
    }
}

/// Fits one material to recordings with a support rate each: `ln eta_r` is normal around a common mean.
///
/// The maximum of the penalised likelihood, and Laplace's approximation around it. With more than eight recordings the spread of the
/// rates is estimated, otherwise it is 0.7. Recordings of fewer than four features share the mean. Recordings of several objects of
/// one material are fitted alike.
///
/// # Errors
/// As [`fit`].
///
/// # Complexity
/// O(n p^2 + r^3) a Newton step for r recordings.
pub fn fit_hierarchical(
    points: &[DampingPoint],
    options: &FitOptions,
) -> Result<HierarchicalFit, EstimationError> {
    let plain = fit(points, options)?;
    let sample = &plain.sample;
    let count = points.iter().map(|p| p.recording as usize + 1).max().unwrap_or(0).min(MAX_INDEX);
    let p = sample.family.parameters();
    let mean = p + 1;
    let mut shared = Vec::new();
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (i, point) in points.iter().enumerate() {
        if point.weight > 0.0 {
            members.get_mut(point.recording as usize).unwrap_or(&mut shared).push(i);
        }
    }
    let own = |list: &Vec<usize>| list.len() >= MIN_FEATURES;
    let mut groups = Vec::new();
    let mut index_of = vec![mean; count];
    let mut next = mean + 1;
    for (r, list) in members.iter().enumerate() {
        if own(list) && next - mean <= MAX_RECORDINGS {
            index_of[r] = next;
            groups.push((sample.subset(list), next));
            next += 1;
        } else {
            shared.extend(list);
        }
    }
    if !shared.is_empty() {
        groups.push((sample.subset(&shared), mean));
    }
    let recordings = next - mean - 1;
    let mut joint = Joint {
        groups: groups.iter().map(|(s, _)| options.likelihood(s)).collect(),
        place: groups.iter().map(|(_, place)| *place).collect(),
        spread: SD_LN_ETA,
        total: sample.total_weight(),
    };
    let mut bounds = plain.options.likelihood(sample).bounds(plain.floor);
    bounds.resize(next, ETA.map(libm::log));
    let mut z = plain.z.clone();
    z.resize(next, plain.z[mean]);
    let (mut information, mut iterations) = (Vec::new(), 0);
    for _ in 0..20 {
        iterations += newton(&mut joint, &bounds, &mut z, Stop::Gradient(1e-11), 100).steps;
        let (mut g, mut h) = (vec![0.0; next], vec![0.0; next * next]);
        joint.derivatives(&z, &mut g, &mut h);
        information = h.iter().map(|h| -h * joint.total).collect();
        if recordings <= MIN_FOR_SPREAD {
            break;
        }
        // The expected square of the rates around their mean, under a half-normal prior of the spread of variance 1.
        let square: f64 = (mean + 1..next)
            .map(|i| (z[i] - z[mean]).powi(2) + 1.0 / information[i * next + i].max(1e-9))
            .sum();
        let r = recordings as f64;
        let variance = (r * r + 4.0 * square).sqrt() - r;
        let spread = (0.5 * variance).sqrt().clamp(0.05, 3.0);
        let change = (spread / joint.spread - 1.0).abs();
        joint.spread = spread;
        if change < 1e-4 {
            break;
        }
    }
    let log_likelihood = (0..joint.groups.len())
        .map(|k| {
            let local = joint.local(&z, k);
            let mut group = joint.groups[k].clone();
            group.total_weight() * group.value(&local)
        })
        .sum::<f64>();
    let theta = sample.physical(&z[..p]);
    let linear = sample.family.linear_parameters();
    let regular = z[p] > libm::log(plain.floor) + 1e-6 && z[..linear].iter().all(|t| *t > 1e-12);
    let standard_errors = inverse(&information, next).filter(|_| regular).map(|cov| {
        let exponent = z.get(linear).copied().filter(|_| sample.family.has_exponent()).unwrap_or(1.0);
        let factors = sample.family.factors(sample.ls, sample.ys, exponent);
        (0..p).map(|j| cov[j * next + j].max(0.0).sqrt() * factors.get(j).copied().unwrap_or(1.0)).collect()
    });
    let log_ys = libm::log(sample.ys);
    Ok(HierarchicalFit {
        theta,
        standard_errors,
        sigma: sample.ys * libm::exp(z[p]),
        eta: index_of.iter().map(|i| libm::exp(z[*i]) / sample.ys).collect(),
        mean_ln_eta: z[mean] - log_ys,
        sd_ln_eta: joint.spread,
        log_likelihood: log_likelihood - sample.total_weight() * log_ys,
        iterations,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::material::damping::Family;
    use crate::material::estimation::point::Sample;

    /// Recordings whose mean support dampings differ by factors.
    fn recordings(rng: &mut Rng, count: u32, spread: f64) -> (Vec<DampingPoint>, Vec<f64>) {
        let (mut points, mut supports) = (Vec::new(), Vec::new());
        for recording in 0..count {
            let support =
                8.0 * (spread * crate::statistics::normal::normal_quantile(rng.between(1e-6, 1.0))).exp();
            supports.push(support);
            let own = super::super::tests::simulated(rng, 30, [3.9, 1e-8, 0.4, 1.0 / support]);
            points.extend(own.into_iter().map(|p| DampingPoint { recording, ..p }));
        }
        (points, supports)
    }

    #[test]
    fn each_recording_gets_its_support_and_all_share_the_material() {
        let mut rng = Rng::new(17);
        let (points, supports) = recordings(&mut rng, 20, 0.7);
        let found = fit_hierarchical(&points, &FitOptions::new(Family::Rayleigh)).unwrap();
        for (eta, support) in found.eta.iter().zip(&supports) {
            let ratio = 1.0 / eta / support;
            assert!((0.5..2.0).contains(&ratio), "{ratio}: {found:?}");
        }
        assert!((0.4..1.1).contains(&found.sd_ln_eta), "{}", found.sd_ln_eta);
        let errors = found.standard_errors.as_ref().unwrap();
        for (j, truth) in [3.9, 1e-8].into_iter().enumerate() {
            assert!((found.theta[j] - truth).abs() < 4.0 * errors[j], "{:?} {errors:?}", found.theta);
        }
        // One rate for all is less likely.
        let plain = fit(&points, &FitOptions::new(Family::Rayleigh)).unwrap();
        assert!(found.log_likelihood > plain.physical_log_likelihood() + 10.0);
    }

    #[test]
    fn the_gradient_agrees_with_differences_and_few_features_share_the_mean() {
        let mut rng = Rng::new(5);
        let (mut points, _) = recordings(&mut rng, 3, 0.3);
        let lone = DampingPoint { recording: 3, ..points[0] };
        points.push(lone);
        let found = fit_hierarchical(&points, &FitOptions::new(Family::Rayleigh)).unwrap();
        assert!((found.eta[3].ln() - found.mean_ln_eta).abs() < 1e-12 && found.sd_ln_eta == SD_LN_ETA);
        let sample = Sample::new(&points, Family::Rayleigh).unwrap();
        let halves =
            [sample.subset(&(0..40).collect::<Vec<_>>()), sample.subset(&(40..91).collect::<Vec<_>>())];
        let likelihoods = halves.iter().map(|s| FitOptions::new(Family::Rayleigh).likelihood(s)).collect();
        let mut joint = Joint { groups: likelihoods, place: vec![4, 5], spread: 0.7, total: 91.0 };
        let z = [0.3, 0.4, -1.0, 0.2, 0.5, -0.3];
        let (mut g, mut h) = (vec![0.0; 6], vec![0.0; 36]);
        joint.derivatives(&z, &mut g, &mut h);
        for a in 0..6 {
            let (mut up, mut down) = (z, z);
            up[a] += 1e-5;
            down[a] -= 1e-5;
            let slope = (joint.value(&up) - joint.value(&down)) / 2e-5;
            assert!((slope - g[a]).abs() < 1e-7, "{a}: {slope} {}", g[a]);
            let (mut gu, mut gd, mut scratch) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 36]);
            joint.derivatives(&up, &mut gu, &mut scratch);
            joint.derivatives(&down, &mut gd, &mut scratch);
            for b in 0..6 {
                assert!(((gu[b] - gd[b]) / 2e-5 - h[a * 6 + b]).abs() < 1e-6, "{a} {b}");
            }
        }
    }
}
