//! Fits of few recordings with a prior: the distribution of the parameters of the materials of a library.

use super::fit::Fit;
use super::likelihood::Likelihood;
use super::newton::{Objective, Stop, newton};
use super::point::Sample;
use super::scan::Effort;
use crate::material::damping::{DampingModel, Family};
use crate::statistics::linear::inverse;

/// Maximum number of parameters of a curve with a prior.
const MAX: usize = 3;
/// Range of the logarithm of a linear parameter in normalised units.
const LOGARITHMS: [f64; 2] = [-60.0, 27.0];
/// Minimum start of a parameter, in normalised units.
const LEAST_START: f64 = 1e-3;
/// Minimum standard deviation of a parameter over materials.
const LEAST_SPREAD: f64 = 0.05;

/// Normal distribution of the parameters of materials: of the logarithms of those that are linear in the damping, and of an exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialPrior {
    /// The family.
    pub family: Family,
    /// Number of materials.
    pub materials: usize,
    /// Mean of each parameter, in logarithms of SI units.
    pub mean: [f64; MAX],
    /// Inverse of the covariance, by rows of the number of parameters.
    precision: [f64; MAX * MAX],
}

impl MaterialPrior {
    /// The prior of dampings of one family: mean and covariance over them, with the variance of a further material,
    /// `1 + 1/n` of theirs.
    ///
    /// # Errors
    /// A description: fewer materials than parameters plus two, a material of another family or without one of the parameters, materials that
    /// are alike, and families other than `Rayleigh`, `Power` and `Hybrid`.
    pub fn new(family: Family, materials: &[(&str, &DampingModel)]) -> Result<Self, String> {
        let p = family.parameters();
        if !matches!(family, Family::Rayleigh | Family::Power | Family::Hybrid) {
            return Err("a prior needs the model Rayleigh, Power or Hybrid".into());
        }
        let n = materials.len();
        if n < p + 2 {
            return Err(format!("{n} materials; a prior of {p} parameters needs at least {}", p + 2));
        }
        let mut rows = Vec::with_capacity(n);
        for (name, model) in materials {
            let values = model.parameters();
            let same = family.model(&values, &[]) == **model;
            if !same || values.len() != p {
                return Err(format!("the damping of the material {name:?} is no {family:?} model"));
            }
            if !values.iter().all(|x| *x > 0.0) {
                return Err(format!(
                    "the material {name:?} has a parameter of 0, which has no logarithm: leave it out"
                ));
            }
            let mut row = [0.0; MAX];
            for (j, x) in values.iter().enumerate() {
                row[j] = if j < family.linear_parameters() { libm::log(*x) } else { *x };
            }
            rows.push(row);
        }
        let mut mean = [0.0; MAX];
        for (j, mean) in mean.iter_mut().enumerate() {
            *mean = rows.iter().map(|row| row[j]).sum::<f64>() / n as f64;
        }
        let factor = (1.0 + 1.0 / n as f64) / (n - 1) as f64;
        let mut covariance = vec![0.0; p * p];
        for a in 0..p {
            for b in 0..p {
                let sum: f64 = rows.iter().map(|row| (row[a] - mean[a]) * (row[b] - mean[b])).sum();
                let least = if a == b { LEAST_SPREAD * LEAST_SPREAD } else { 0.0 };
                covariance[a * p + b] = factor * sum + least;
            }
        }
        let inverse = inverse(&covariance, p).ok_or("the materials do not determine a covariance")?;
        let mut precision = [0.0; MAX * MAX];
        precision[..p * p].copy_from_slice(&inverse);
        Ok(Self { family, materials: n, mean, precision })
    }

    /// Logarithm of the density up to a constant at `w`: logarithms of the linear parameters in normalised units, and an exponent.
    /// Adds gradient and Hessian to rows of `n` entries.
    fn add(&self, sample: &Sample, w: &[f64], scale: f64, gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let (linear, p, n) = (self.family.linear_parameters(), self.family.parameters(), gradient.len());
        let (log_ls, log_ys) = (libm::log(sample.ls), libm::log(sample.ys));
        // Physical logarithms: row j is w_j plus a constant, less an exponent times ln ls for the last linear parameter.
        let mut map = [0.0; MAX * MAX];
        let mut away = [0.0; MAX];
        for j in 0..p {
            map[j * p + j] = 1.0;
            away[j] = w[j] - self.mean[j] + if j < linear { log_ys } else { 0.0 };
        }
        match self.family.has_exponent() {
            true => {
                map[(linear - 1) * p + linear] = -log_ls;
                away[linear - 1] -= w[linear] * log_ls;
            }
            false => away[1] -= log_ls,
        }
        let mut slope = [0.0; MAX];
        for (slope, row) in slope.iter_mut().zip(self.precision.chunks_exact(p)) {
            *slope = row.iter().zip(&away).map(|(x, y)| x * y).sum();
        }
        for a in 0..p {
            gradient[a] -= scale * (0..p).map(|i| map[i * p + a] * slope[i]).sum::<f64>();
            for b in 0..p {
                let mut sum = 0.0;
                for i in 0..p {
                    for j in 0..p {
                        sum += map[i * p + a] * self.precision[i * p + j] * map[j * p + b];
                    }
                }
                hessian[a * n + b] -= scale * sum;
            }
        }
        -0.5 * scale * (0..p).map(|a| away[a] * slope[a]).sum::<f64>()
    }

    /// The largest posterior density from a fit without the prior on; `responsibility` are the probabilities of the points to belong to
    /// modes, as that fit found them.
    ///
    /// The log-likelihood of the result is that of the points, with these probabilities as weights. `None` if no start converges.
    #[must_use]
    pub fn fit(&self, plain: &Fit, responsibility: Option<&[f64]>) -> Option<Fit> {
        let mut effort = plain.effort;
        let (z, gradient) = self.maximum(plain, responsibility, &plain.sample, &mut effort)?;
        let weights = weights(&plain.sample, responsibility);
        let mut likelihood = plain.options.likelihood(&plain.sample);
        likelihood = likelihood.with_weights(&weights);
        let log_likelihood = likelihood.total_weight() * likelihood.value(&z);
        let (starts, others) = (plain.starts + 2, Vec::new());
        let (sample, options) = (plain.sample.clone(), plain.options);
        Some(Fit {
            sample,
            options,
            z,
            log_likelihood,
            gradient,
            floor: plain.floor,
            effort,
            starts,
            certified: false,
            others,
        })
    }

    /// Refits a sample that differs in weights or dampings; `theta`, `sigma`, `eta` in physical units.
    ///
    /// `None` if it does not converge.
    #[must_use]
    pub fn refit(&self, fit: &Fit, responsibility: Option<&[f64]>, sample: &Sample) -> Option<Vec<f64>> {
        let (z, _) = self.maximum(fit, responsibility, sample, &mut Effort::default())?;
        Some(sample.physical_with_noise(&z))
    }

    /// Minus the Hessian of the posterior in `theta`, `ln sigma`, `ln eta` in normalised units, as of Laplace's approximation in the
    /// logarithms of the parameters.
    #[must_use]
    pub fn information(&self, fit: &Fit, responsibility: Option<&[f64]>) -> Vec<f64> {
        let weights = weights(&fit.sample, responsibility);
        let likelihood = fit.options.likelihood(&fit.sample);
        let mut posterior = Posterior { likelihood: likelihood.with_weights(&weights), prior: self };
        let total = posterior.likelihood.total_weight();
        let n = posterior.likelihood.parameters();
        let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
        posterior.derivatives(&posterior.logarithms(&fit.z), &mut g, &mut h);
        let unit = |j: usize| if j < self.family.linear_parameters() { fit.z[j] } else { 1.0 };
        (0..n * n).map(|k| -total * h[k] / (unit(k / n) * unit(k % n))).collect()
    }

    fn maximum(
        &self,
        fit: &Fit,
        responsibility: Option<&[f64]>,
        sample: &Sample,
        effort: &mut Effort,
    ) -> Option<(Vec<f64>, f64)> {
        let weights = weights(sample, responsibility);
        let likelihood = fit.options.likelihood(sample);
        let mut bounds = likelihood.bounds(fit.floor);
        bounds[..self.family.linear_parameters()].fill(LOGARITHMS);
        let mut posterior = Posterior { likelihood: likelihood.with_weights(&weights), prior: self };
        let from_fit = posterior.logarithms(&fit.z);
        let mut from_prior = from_fit.clone();
        from_prior[..self.family.parameters()].copy_from_slice(&self.normalised_mean(sample));
        let mut best: Option<(f64, Vec<f64>, f64)> = None;
        for mut w in [from_fit, from_prior] {
            let out = newton(&mut posterior, &bounds, &mut w, Stop::Gradient(1e-9), 100);
            effort.add(out.steps, out.evaluations);
            if out.value.is_finite() && best.as_ref().is_none_or(|b| out.value > b.0) {
                best = Some((out.value, w, out.gradient));
            }
        }
        best.map(|(_, w, gradient)| (posterior.parameters(&w), gradient))
    }

    /// The mean of the prior in normalised units, with logarithms of the linear parameters.
    fn normalised_mean(&self, sample: &Sample) -> Vec<f64> {
        let (linear, p) = (self.family.linear_parameters(), self.family.parameters());
        let exponent = if self.family.has_exponent() { self.mean[linear] } else { 1.0 };
        let factors = self.family.factors(sample.ls, sample.ys, exponent);
        (0..p).map(|j| self.mean[j] - factors.get(j).map_or(0.0, |f| libm::log(*f))).collect()
    }
}

/// Weights of the points with the probabilities to belong to modes.
fn weights(sample: &Sample, responsibility: Option<&[f64]>) -> Vec<f64> {
    match responsibility {
        Some(r) => sample.weight.iter().zip(r).map(|(w, r)| w * r).collect(),
        None => sample.weight.clone(),
    }
}

/// Mean log-posterior over the logarithms of the linear parameters, an exponent, `ln sigma` and `ln eta`, in normalised units.
struct Posterior<'a> {
    likelihood: Likelihood<'a>,
    prior: &'a MaterialPrior,
}

impl Posterior<'_> {
    fn linear(&self) -> usize {
        self.prior.family.linear_parameters()
    }

    fn parameters(&self, w: &[f64]) -> Vec<f64> {
        let linear = self.linear();
        w.iter().enumerate().map(|(j, w)| if j < linear { libm::exp(*w) } else { *w }).collect()
    }

    fn logarithms(&self, z: &[f64]) -> Vec<f64> {
        let linear = self.linear();
        let log = |z: f64| libm::log(z.max(LEAST_START));
        z.iter().enumerate().map(|(j, z)| if j < linear { log(*z) } else { *z }).collect()
    }
}

impl Objective for Posterior<'_> {
    fn value(&mut self, w: &[f64]) -> f64 {
        let z = self.parameters(w);
        let n = z.len();
        let share = 1.0 / self.likelihood.total_weight();
        let prior =
            self.prior.add(self.likelihood.sample(), w, share, &mut vec![0.0; n], &mut vec![0.0; n * n]);
        self.likelihood.value(&z) + prior
    }

    fn derivatives(&mut self, w: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let z = self.parameters(w);
        let (n, linear) = (z.len(), self.linear());
        let value = self.likelihood.derivatives(&z, gradient, hessian);
        for a in 0..linear {
            gradient[a] *= z[a];
            for b in 0..n {
                hessian[a * n + b] *= z[a];
                hessian[b * n + a] *= z[a];
            }
        }
        (0..linear).for_each(|a| hessian[a * n + a] += gradient[a]);
        let share = 1.0 / self.likelihood.total_weight();
        value + self.prior.add(self.likelihood.sample(), w, share, gradient, hessian)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fit::{FitOptions, fit};
    use super::super::tests::simulated;
    use super::super::uncertainty::{covariance, information};
    use super::*;
    use crate::core::random::Rng;
    use crate::material::estimation::point::DampingPoint;
    use crate::statistics::normal::normal_quantile;

    /// Table 1 of Sterling et al. (2019), Rayleigh.
    const TABLE: [(&str, [f64; 2]); 6] = [
        ("porcelain", [3.9, 1e-8]),
        ("travertine", [1.3, 2.5e-8]),
        ("wood", [39.0, 1.3e-7]),
        ("steel", [2.3, 6.9e-8]),
        ("plastic", [39.8, 1.3e-7]),
        ("glass", [2.0, 7.8e-8]),
    ];

    fn table() -> Vec<(&'static str, DampingModel)> {
        TABLE.iter().map(|(name, [a1, a2])| (*name, DampingModel::Rayleigh { a1: *a1, a2: *a2 })).collect()
    }

    fn prior() -> MaterialPrior {
        let all = table();
        let all: Vec<(&str, &DampingModel)> = all.iter().map(|(name, model)| (*name, model)).collect();
        MaterialPrior::new(Family::Rayleigh, &all).unwrap()
    }

    /// Points of some recordings of `features` modes each, held firmly: a mean support damping of 40 1/s.
    fn recordings(rng: &mut Rng, count: u32, features: usize, [a1, a2]: [f64; 2]) -> Vec<DampingPoint> {
        let each = |recording| {
            let own = simulated(rng, features, [a1, a2, 2.0, 1.0 / 40.0]);
            own.into_iter().map(move |p| DampingPoint { recording, ..p }).collect::<Vec<_>>()
        };
        (0..count).flat_map(each).collect()
    }

    /// A material of the spread of the table: the mean and the lower factor of the covariance.
    fn material(rng: &mut Rng) -> [f64; 2] {
        let logs: Vec<[f64; 2]> = TABLE.iter().map(|(_, a)| a.map(f64::ln)).collect();
        let mean = [0, 1].map(|j| logs.iter().map(|l| l[j]).sum::<f64>() / 6.0);
        let of =
            |a: usize, b: usize| logs.iter().map(|l| (l[a] - mean[a]) * (l[b] - mean[b])).sum::<f64>() / 5.0;
        let first = of(0, 0).sqrt();
        let (cross, second) = (of(0, 1) / first, (of(1, 1) - of(0, 1).powi(2) / of(0, 0)).sqrt());
        let [u, v] = [0, 1].map(|_| normal_quantile(rng.between(1e-9, 1.0)));
        [(mean[0] + first * u).exp(), (mean[1] + cross * u + second * v).exp()]
    }

    #[test]
    fn few_recordings_gain_from_the_library_and_many_do_not_need_it() {
        let prior = prior();
        let mut rng = Rng::new(41);
        let options = FitOptions::new(Family::Rayleigh);
        let mut errors = [[0.0; 2]; 2];
        let draws = 100;
        for _ in 0..draws {
            let truth = material(&mut rng);
            let plain = fit(&recordings(&mut rng, 3, 4, truth), &options).unwrap();
            let with = prior.fit(&plain, None).unwrap();
            for (k, found) in [plain.physical(), with.physical()].iter().enumerate() {
                // A parameter of 0 is an error of a factor of 100.
                (0..2).for_each(|j| {
                    errors[k][j] += (found[j] / truth[j]).max(0.01).ln().abs() / f64::from(draws)
                });
            }
        }
        eprintln!("mean errors of logarithms without and with the prior: {errors:.3?}");
        for j in 0..2 {
            assert!(errors[1][j] < 0.9 * errors[0][j], "{errors:?}");
        }
        let mut regular = 0;
        for _ in 0..5 {
            let truth = material(&mut rng);
            let plain = fit(&recordings(&mut rng, 40, 30, truth), &options).unwrap();
            let with = prior.fit(&plain, None).unwrap();
            let cov = covariance(&plain, &information(&plain));
            let Some(cov) = cov else { continue };
            regular += 1;
            for j in 0..2 {
                let change = (with.physical()[j] - plain.physical()[j]).abs() / cov[j * 4 + j].sqrt();
                assert!(change < 0.3, "{j}: {change}");
            }
        }
        assert!(regular > 1);
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let hybrid: Vec<DampingModel> = (0..6)
            .map(|k| {
                let x = f64::from(k);
                DampingModel::Hybrid {
                    g1: 2.0 + x * x,
                    g2: 1e-8 * (1.0 + x),
                    g3: 0.95 + 0.02 * (x * 2.3).sin(),
                }
            })
            .collect();
        let named: Vec<(&str, &DampingModel)> = hybrid.iter().map(|m| ("x", m)).collect();
        let prior = MaterialPrior::new(Family::Hybrid, &named).unwrap();
        let points = recordings(&mut Rng::new(4), 2, 20, [3.9, 1e-8]);
        let options = FitOptions::new(Family::Hybrid);
        let sample = options.sample(&points).unwrap();
        let mut posterior = Posterior { likelihood: options.likelihood(&sample), prior: &prior };
        let w = [-0.8, -1.1, 1.05, -1.5, 0.4];
        let (mut g, mut h) = (vec![0.0; 5], vec![0.0; 25]);
        let value = posterior.derivatives(&w, &mut g, &mut h);
        assert!((posterior.value(&w) - value).abs() < 1e-12);
        for a in 0..5 {
            let (mut up, mut down) = (w, w);
            up[a] += 1e-5;
            down[a] -= 1e-5;
            let slope = (posterior.value(&up) - posterior.value(&down)) / 2e-5;
            assert!((slope - g[a]).abs() < 1e-6 * (1.0 + g[a].abs()), "{a}: {slope} {}", g[a]);
            let (mut gu, mut gd, mut scratch) = (vec![0.0; 5], vec![0.0; 5], vec![0.0; 25]);
            posterior.derivatives(&up, &mut gu, &mut scratch);
            posterior.derivatives(&down, &mut gd, &mut scratch);
            for b in 0..5 {
                let bend = (gu[b] - gd[b]) / 2e-5;
                assert!(
                    (bend - h[a * 5 + b]).abs() < 1e-5 * (1.0 + bend.abs()),
                    "{a} {b}: {bend} {}",
                    h[a * 5 + b]
                );
            }
        }
    }

    #[test]
    fn wrong_libraries_are_named() {
        let all = table();
        let named: Vec<(&str, &DampingModel)> = all.iter().map(|(name, model)| (*name, model)).collect();
        let e = |family, list: &[(&str, &DampingModel)]| MaterialPrior::new(family, list).unwrap_err();
        assert!(
            e(Family::Rayleigh, &named[..3])
                .contains("3 materials; a prior of 2 parameters needs at least 4")
        );
        assert!(e(Family::Hybrid, &named).contains("\"porcelain\" is no Hybrid"));
        assert!(e(Family::Caughey(2), &named).contains("needs the model"));
        let zero = DampingModel::Rayleigh { a1: 0.0, a2: 1e-8 };
        let mut with_zero = named.clone();
        with_zero.push(("bell", &zero));
        assert!(e(Family::Rayleigh, &with_zero).contains("\"bell\" has a parameter of 0"));
    }
}
