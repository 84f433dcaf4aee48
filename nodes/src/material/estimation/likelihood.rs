//! The likelihood of points under a damping model, with its derivatives.

use super::emg::{Terms, log_shape, negative_log_survivor, terms};
use super::gamma_excess::GammaExcess;
use super::newton::Objective;
use super::point::Sample;
use crate::material::damping::Family;

/// Distribution of the excess that supports add to the damping of a material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Excess {
    /// Exponential, of mean `1/eta`.
    #[default]
    Exponential,
    /// Gamma of this shape and of rate `eta`: 0.44 fits a support without friction, 1 one of friction 0.5.
    Gamma(f64),
}

/// Largest `sigma` in normalised units.
pub const SIGMA_MAX: f64 = 100.0;
/// Bounds of `eta` in normalised units.
pub const ETA: [f64; 2] = [1e-4, 1e4];

/// Mean log-likelihood over the parameters `theta`, `ln sigma`, `ln eta` in normalised units.
///
/// # Complexity
/// O(n p^2) for n points and p parameters.
#[derive(Clone, Debug)]
pub struct Likelihood<'a> {
    sample: &'a Sample,
    weight: &'a [f64],
    total: f64,
    excess: Option<GammaExcess>,
    per_feature: bool,
    truncated_below: Option<f64>,
    basis: Vec<f64>,
}

impl<'a> Likelihood<'a> {
    /// The likelihood of a sample: one `sigma` for all points, or with the variance of each added; `truncated_below` in
    /// normalised units.
    #[must_use]
    pub fn new(sample: &'a Sample, per_feature: bool, truncated_below: Option<f64>, excess: Excess) -> Self {
        let excess = match excess {
            Excess::Exponential => None,
            Excess::Gamma(shape) => Some(GammaExcess::new(shape)),
        };
        let basis = if sample.family.has_exponent() { Vec::new() } else { sample.basis.clone() };
        let per_feature = per_feature && sample.variance.iter().any(|v| *v > 0.0);
        let weight = &sample.weight;
        Self { sample, weight, total: sample.total_weight(), excess, per_feature, truncated_below, basis }
    }

    /// The same with other weights; the mean is still over the sum of the sample's weights.
    #[must_use]
    pub fn with_weights(&self, weight: &'a [f64]) -> Self {
        Self { weight, ..self.clone() }
    }

    /// The sample.
    #[must_use]
    pub fn sample(&self) -> &'a Sample {
        self.sample
    }

    /// Number of parameters: those of the curve, `ln sigma`, `ln eta`.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.sample.family.parameters() + 2
    }

    /// Sum of the weights.
    #[must_use]
    pub fn total_weight(&self) -> f64 {
        self.total
    }

    /// Returns true if the scan over shapes is a proof for this likelihood: one `sigma`, no options.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        !self.per_feature && self.truncated_below.is_none() && self.excess.is_none()
    }

    /// Bounds of all parameters with a smallest `sigma`.
    #[must_use]
    pub fn bounds(&self, floor: f64) -> Vec<[f64; 2]> {
        let mut bounds = self.sample.family.bounds();
        bounds.push([libm::log(floor), libm::log(SIGMA_MAX)]);
        bounds.push(ETA.map(libm::log));
        bounds
    }

    fn terms(&self, u: f64, k: f64) -> Terms {
        self.excess.as_ref().map_or_else(|| terms(u, k), |gamma| gamma.terms(u, k))
    }

    /// Curve at point `i`, and the values of its linear basis functions.
    fn curve(&self, i: usize, z: &[f64], power: &mut [f64; 2]) -> f64 {
        let p = self.sample.family.linear_parameters();
        if self.basis.is_empty() {
            let exponent = z[p];
            power[1] = libm::exp(exponent * self.sample.log_x[i]);
            return match self.sample.family {
                Family::Power => z[0] * power[1],
                _ => z[0] + z[1] * power[1],
            };
        }
        self.basis[i * p..(i + 1) * p].iter().zip(z).map(|(b, t)| b * t).sum()
    }

    /// Standard deviation at point `i`, and its share that is `sigma`.
    fn noise(&self, i: usize, sigma: f64) -> (f64, f64) {
        if !self.per_feature {
            return (sigma, 1.0);
        }
        let square = sigma * sigma + self.sample.variance[i];
        (square.sqrt(), sigma * sigma / square)
    }

    /// Log density of each point in normalised units, `[n]`.
    pub fn log_densities(&self, z: &[f64], out: &mut Vec<f64>) {
        let p = self.sample.family.parameters();
        let (sigma, eta) = (libm::exp(z[p]), libm::exp(z[p + 1]));
        let mut power = [0.0; 2];
        out.clear();
        for i in 0..self.sample.len() {
            let c = self.curve(i, z, &mut power);
            let (sd, _) = self.noise(i, sigma);
            let k = eta * sd;
            let u = (self.sample.y[i] - c) / sd;
            let shape = match &self.excess {
                None => log_shape(u, k),
                Some(gamma) => gamma.terms(u, k).value,
            };
            let below =
                self.truncated_below.map_or(0.0, |low| negative_log_survivor((low - c) / sd, k).value);
            out.push(z[p + 1] + shape + below);
        }
    }

    /// Derivatives of the log density of one point, added to the sums with a weight; returns the log density.
    fn add(
        &self,
        i: usize,
        z: &[f64],
        [sigma, eta]: [f64; 2],
        weight: f64,
        gradient: &mut [f64],
        mut hessian: Option<&mut [f64]>,
    ) -> f64 {
        let family = self.sample.family;
        let (linear, p) = (family.linear_parameters(), family.parameters());
        let n = p + 2;
        let mut power = [1.0, 1.0];
        let c = self.curve(i, z, &mut power);
        let (sd, rho) = self.noise(i, sigma);
        let (u, k) = ((self.sample.y[i] - c) / sd, eta * sd);
        let mut row = [0.0; 16];
        let dc = &mut row[..p];
        let mut bend = [0.0; 2];
        if self.basis.is_empty() {
            let slope = z[linear - 1] * power[1] * self.sample.log_x[i];
            dc[0] = 1.0;
            dc[linear - 1] = power[1];
            dc[linear] = slope;
            bend = [power[1] * self.sample.log_x[i], slope * self.sample.log_x[i]];
        } else {
            dc.copy_from_slice(&self.basis[i * linear..(i + 1) * linear]);
        }
        let mut value = z[p + 1];
        gradient[p + 1] += weight;
        let low = self.truncated_below.map(|low| (low - c) / sd);
        for (u, truncated) in [(Some(u), false), (low, true)] {
            let Some(u) = u else { continue };
            let t = if truncated { negative_log_survivor(u, k) } else { self.terms(u, k) };
            value += t.value;
            let by_c = -weight * t.u / sd;
            dc.iter().zip(&mut gradient[..p]).for_each(|(d, g)| *g += by_c * d);
            gradient[p] += weight * rho * (t.k * k - t.u * u);
            gradient[p + 1] += weight * t.k * k;
            let Some(hessian) = hessian.as_deref_mut() else { continue };
            let (cc, c_sigma) = (weight * t.uu / (sd * sd), weight * rho / sd * (t.uu * u - t.uk * k + t.u));
            let c_eta = -weight * t.uk * k / sd;
            for (a, da) in dc.iter().enumerate() {
                let out = &mut hessian[a * n..(a + 1) * n];
                for (b, db) in dc.iter().enumerate().skip(a) {
                    out[b] += cc * da * db;
                }
                out[p] += c_sigma * da;
                out[p + 1] += c_eta * da;
            }
            if self.basis.is_empty() {
                hessian[(linear - 1) * n + linear] += by_c * bend[0];
                hessian[linear * n + linear] += by_c * bend[1];
            }
            let second = t.uu * u * u - 2.0 * t.uk * u * k + t.kk * k * k;
            hessian[p * n + p] += weight
                * (rho * rho * second + t.u * u * rho * (3.0 * rho - 2.0) + t.k * k * rho * (2.0 - rho));
            hessian[p * n + p + 1] += weight * rho * (t.kk * k * k - t.uk * u * k + t.k * k);
            hessian[(p + 1) * n + p + 1] += weight * (t.kk * k * k + t.k * k);
        }
        value
    }

    /// Sum of weighted log densities with the gradient and the Hessian of the sum, `[n * n]`.
    pub fn sums(&self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let p = self.sample.family.parameters();
        let noise = [libm::exp(z[p]), libm::exp(z[p + 1])];
        gradient.fill(0.0);
        hessian.fill(0.0);
        let mut sum = 0.0;
        for (i, weight) in self.weight.iter().enumerate() {
            if *weight > 0.0 {
                sum += weight * self.add(i, z, noise, *weight, gradient, Some(hessian));
            }
        }
        let n = self.parameters();
        for a in 0..n {
            for b in 0..a {
                hessian[a * n + b] = hessian[b * n + a];
            }
        }
        sum
    }

    /// Gradient of the log density of each point, `[n, parameters]`, and the log densities.
    #[must_use]
    pub fn point_gradients(&self, z: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let p = self.sample.family.parameters();
        let noise = [libm::exp(z[p]), libm::exp(z[p + 1])];
        let mut gradients = vec![0.0; self.sample.len() * (p + 2)];
        let rows = gradients.chunks_exact_mut(p + 2).enumerate();
        let values = rows.map(|(i, row)| self.add(i, z, noise, 1.0, row, None)).collect();
        (gradients, values)
    }

    /// Mean log-likelihood and its gradient.
    pub fn gradient(&self, z: &[f64], gradient: &mut [f64]) -> f64 {
        let p = self.sample.family.parameters();
        let noise = [libm::exp(z[p]), libm::exp(z[p + 1])];
        gradient.fill(0.0);
        let mut sum = 0.0;
        for (i, weight) in self.weight.iter().enumerate() {
            if *weight > 0.0 {
                sum += weight * self.add(i, z, noise, *weight, gradient, None);
            }
        }
        gradient.iter_mut().for_each(|g| *g /= self.total);
        sum / self.total
    }
}

impl Objective for Likelihood<'_> {
    fn value(&mut self, z: &[f64]) -> f64 {
        let mut densities = Vec::with_capacity(self.sample.len());
        self.log_densities(z, &mut densities);
        let weighted = densities.iter().zip(self.weight).filter(|(_, w)| **w > 0.0);
        weighted.map(|(l, w)| l * w).sum::<f64>() / self.total
    }

    fn derivatives(&mut self, z: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let sum = self.sums(z, gradient, hessian);
        gradient.iter_mut().for_each(|g| *g /= self.total);
        hessian.iter_mut().for_each(|h| *h /= self.total);
        sum / self.total
    }
}
