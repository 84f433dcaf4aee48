//! Families of damping models that estimators fit.

use super::model::{DampingModel, EXPONENT, KNOTS, MAX_TERMS};
use super::monotone_spline::MonotoneSpline;
use serde::{Deserialize, Serialize};

/// A damping model without its parameters.
///
/// Each is linear in its parameters `theta >= 0`, except for the exponent of the power laws, which is then the last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Family {
    /// `a1 + a2 lambda`.
    Rayleigh,
    /// `g2 lambda^g3`.
    Power,
    /// `sum_j a_j lambda^j` with this number of terms, 1 to 6.
    Caughey(usize),
    /// `g1 + g2 lambda^g3`.
    Hybrid,
    /// A monotone spline in `ln lambda` with this number of knots, 4 to 8.
    Spline(usize),
}

impl Family {
    /// Number of parameters, with the exponent.
    #[must_use]
    pub fn parameters(self) -> usize {
        self.linear_parameters() + usize::from(self.has_exponent())
    }

    /// Number of parameters without the exponent.
    #[must_use]
    pub fn linear_parameters(self) -> usize {
        match self {
            Self::Power => 1,
            Self::Rayleigh | Self::Hybrid => 2,
            Self::Caughey(terms) => terms.clamp(1, MAX_TERMS),
            Self::Spline(knots) => MonotoneSpline::terms(knots.clamp(KNOTS[0], KNOTS[1])),
        }
    }

    /// Returns true if the last parameter is an exponent.
    #[must_use]
    pub fn has_exponent(self) -> bool {
        matches!(self, Self::Power | Self::Hybrid)
    }

    /// Bounds of each parameter in normalised units.
    #[must_use]
    pub fn bounds(self) -> Vec<[f64; 2]> {
        let mut bounds = vec![[0.0, 1e12]; self.linear_parameters()];
        if self.has_exponent() {
            bounds.push(EXPONENT);
        }
        bounds
    }

    /// Knots of a spline over data, in `ln lambda`: quantiles, the outer ones at the extremes. Empty for other families.
    ///
    /// Returns `None` if fewer distinct values than knots exist.
    #[must_use]
    pub fn knots(self, log_lambda: &[f64]) -> Option<Vec<f64>> {
        let Self::Spline(count) = self else { return Some(Vec::new()) };
        let count = count.clamp(KNOTS[0], KNOTS[1]);
        let mut sorted = log_lambda.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        if sorted.len() < count {
            return None;
        }
        Some((0..count).map(|k| sorted[k * (sorted.len() - 1) / (count - 1)]).collect())
    }

    /// Values of the linear basis functions at `lambda` in normalised units, for an exponent where there is one.
    pub fn basis(self, spline: &MonotoneSpline, x: f64, exponent: f64, out: &mut [f64]) {
        match self {
            Self::Rayleigh => out[..2].copy_from_slice(&[1.0, x]),
            Self::Power => out[0] = libm::pow(x, exponent),
            Self::Hybrid => out[..2].copy_from_slice(&[1.0, libm::pow(x, exponent)]),
            Self::Caughey(_) => {
                let mut power = 1.0;
                for out in out.iter_mut() {
                    *out = power;
                    power *= x;
                }
            }
            Self::Spline(_) => spline.basis(libm::log(x), out),
        }
    }

    /// Factor of each linear parameter from normalised units to physical ones: `lambda = ls x`, `c = ys c_hat`.
    #[must_use]
    pub fn factors(self, ls: f64, ys: f64, exponent: f64) -> Vec<f64> {
        match self {
            Self::Rayleigh => vec![ys, ys / ls],
            Self::Power => vec![ys / libm::pow(ls, exponent)],
            Self::Hybrid => vec![ys, ys / libm::pow(ls, exponent)],
            Self::Caughey(_) => (0..self.linear_parameters()).map(|j| ys / libm::pow(ls, j as f64)).collect(),
            Self::Spline(_) => vec![ys; self.linear_parameters()],
        }
    }

    /// The model of parameters in physical units; `knots` in rad^2/s^2.
    #[must_use]
    pub fn model(self, theta: &[f64], knots: &[f64]) -> DampingModel {
        let at = |k: usize| theta.get(k).copied().unwrap_or(0.0);
        match self {
            Self::Rayleigh => DampingModel::Rayleigh { a1: at(0), a2: at(1) },
            Self::Power => DampingModel::Power { g2: at(0), g3: at(1) },
            Self::Caughey(_) => DampingModel::Caughey { a: theta.to_vec() },
            Self::Hybrid => DampingModel::Hybrid { g1: at(0), g2: at(1), g3: at(2) },
            Self::Spline(_) => DampingModel::Spline { knots: knots.to_vec(), rises: theta.to_vec() },
        }
    }
}
