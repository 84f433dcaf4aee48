//! Points of damping over frequency, and their normalised form.

use crate::material::damping::{Family, MonotoneSpline};
use crate::statistics::quantile;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One mode of one recording, as estimators read it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DampingPoint {
    /// Squared natural frequency, rad^2/s^2.
    pub lambda: f64,
    /// Damping `c = 2 d`, 1/s.
    pub c: f64,
    /// Standard deviation of `c`, 1/s; 0 if unknown.
    pub sd_c: f64,
    /// Weight.
    pub weight: f64,
    /// Index of its recording.
    pub recording: u32,
    /// Index of the mode of its object that it belongs to.
    pub mode_cluster: u32,
}

impl DampingPoint {
    /// A point of weight 1 and unknown accuracy.
    #[must_use]
    pub fn new(lambda: f64, c: f64) -> Self {
        Self { lambda, c, sd_c: 0.0, weight: 1.0, recording: 0, mode_cluster: 0 }
    }
}

/// The recordings of points, each once, in order.
#[must_use]
pub fn recordings(points: &[DampingPoint]) -> Vec<u32> {
    let mut ids: Vec<u32> = points.iter().map(|p| p.recording).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// Error in points, or in the model to be fitted to them.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EstimationError {
    /// Too few points for the parameters.
    #[error("{found} points; a fit of {parameters} parameters needs at least {needed}")]
    TooFewPoints {
        /// Number of points of positive weight.
        found: usize,
        /// Number of parameters of the curve.
        parameters: usize,
        /// Number of points that suffices.
        needed: usize,
    },
    /// Frequencies that do not determine the curve.
    #[error(
        "the points have {distinct} distinct frequencies; {needed} are needed to determine the parameters"
    )]
    RankDeficient {
        /// Number of distinct frequencies.
        distinct: usize,
        /// Number that suffices.
        needed: usize,
    },
    /// A value out of range.
    #[error("`{field}` of point {index} is {found}; {needed}")]
    Value {
        /// Index of the point, from 0.
        index: usize,
        /// Name of the field.
        field: &'static str,
        /// The value.
        found: f64,
        /// The range.
        needed: &'static str,
    },
    /// A damping outside of the range of the background of a mixture.
    #[error("`c` of point {index} is {found} 1/s; the background of the mixture covers {lo} to {hi} 1/s")]
    Outside {
        /// Index of the point, from 0.
        index: usize,
        /// The value, 1/s.
        found: f64,
        /// Lower end, 1/s.
        lo: f64,
        /// Upper end, 1/s.
        hi: f64,
    },
    /// An option that an estimator does not have.
    #[error("{0}")]
    Option(&'static str),
}

/// Checks points.
///
/// # Errors
/// The first value that is not finite or out of range, with the index of its point.
pub fn check_points(points: &[DampingPoint]) -> Result<(), EstimationError> {
    for (index, p) in points.iter().enumerate() {
        let wrong = |field, found, needed| Err(EstimationError::Value { index, field, found, needed });
        if !(p.lambda.is_finite() && p.lambda > 0.0) {
            return wrong("lambda", p.lambda, "a finite number above 0 rad^2/s^2 is needed");
        }
        if !(p.c.is_finite() && p.c > 0.0) {
            return wrong("c", p.c, "a finite number above 0 1/s is needed");
        }
        if !(p.sd_c.is_finite() && p.sd_c >= 0.0) {
            return wrong("sd_c", p.sd_c, "a finite number of at least 0 1/s is needed");
        }
        if !(p.weight.is_finite() && p.weight >= 0.0) {
            return wrong("weight", p.weight, "a finite number of at least 0 is needed");
        }
    }
    Ok(())
}

/// Points in normalised units: frequencies by their geometric mean, dampings by their median.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The family.
    pub family: Family,
    /// Unit of `lambda`, rad^2/s^2.
    pub ls: f64,
    /// Unit of `c`, 1/s.
    pub ys: f64,
    /// `lambda / ls`, `[n]`.
    pub x: Vec<f64>,
    /// `ln x`, `[n]`.
    pub log_x: Vec<f64>,
    /// `c / ys`, `[n]`.
    pub y: Vec<f64>,
    /// `(sd_c / ys)^2`, `[n]`.
    pub variance: Vec<f64>,
    /// Weights, `[n]`.
    pub weight: Vec<f64>,
    /// Basis functions of a family without an exponent, `[n, linear_parameters]`; empty otherwise.
    pub basis: Vec<f64>,
    /// Knots of a spline in units of `ls`, in logarithms.
    pub knots: Vec<f64>,
}

impl Sample {
    /// Normalises points.
    ///
    /// # Errors
    /// As [`check_points`]; points that cannot determine the family's parameters.
    pub fn new(points: &[DampingPoint], family: Family) -> Result<Self, EstimationError> {
        check_points(points)?;
        let used = || points.iter().filter(|p| p.weight > 0.0);
        let (found, parameters) = (used().count(), family.parameters());
        if found < parameters + 2 {
            return Err(EstimationError::TooFewPoints { found, parameters, needed: parameters + 2 });
        }
        let mut distinct: Vec<f64> = used().map(|p| p.lambda).collect();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-12);
        let needed = match family {
            Family::Spline(knots) => knots,
            _ => parameters,
        };
        if distinct.len() < needed {
            return Err(EstimationError::RankDeficient { distinct: distinct.len(), needed });
        }
        let ls = libm::exp(used().map(|p| libm::log(p.lambda)).sum::<f64>() / found as f64);
        let mut dampings: Vec<f64> = used().map(|p| p.c).collect();
        dampings.sort_by(f64::total_cmp);
        let ys = quantile(&dampings, 0.5);
        let x: Vec<f64> = points.iter().map(|p| p.lambda / ls).collect();
        let log_x: Vec<f64> = x.iter().map(|x| libm::log(*x)).collect();
        let knots = family
            .knots(&log_x)
            .ok_or(EstimationError::RankDeficient { distinct: distinct.len(), needed })?;
        let mut this = Self {
            family,
            ls,
            ys,
            y: points.iter().map(|p| p.c / ys).collect(),
            variance: points.iter().map(|p| (p.sd_c / ys).powi(2)).collect(),
            weight: points.iter().map(|p| p.weight).collect(),
            basis: Vec::new(),
            knots,
            x,
            log_x,
        };
        if !family.has_exponent() {
            this.basis = this.basis_of(1.0);
        }
        Ok(this)
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.y.len()
    }

    /// Returns true if there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.y.is_empty()
    }

    /// The basis functions for an exponent, `[n, linear_parameters]`.
    #[must_use]
    pub fn basis_of(&self, exponent: f64) -> Vec<f64> {
        if !self.basis.is_empty() {
            return self.basis.clone();
        }
        let (p, spline) = (self.family.linear_parameters(), MonotoneSpline::new(&self.knots));
        let mut out = vec![0.0; p * self.len()];
        for (row, x) in out.chunks_exact_mut(p).zip(&self.x) {
            self.family.basis(&spline, *x, exponent, row);
        }
        out
    }

    /// Some of the points, in the same units.
    #[must_use]
    pub fn subset(&self, which: &[usize]) -> Self {
        let of = |x: &[f64]| which.iter().map(|i| x[*i]).collect::<Vec<f64>>();
        let p = self.family.linear_parameters();
        let rows = |i: &usize| self.basis.get(i * p..(i + 1) * p).unwrap_or_default().iter().copied();
        Self {
            x: of(&self.x),
            log_x: of(&self.log_x),
            y: of(&self.y),
            variance: of(&self.variance),
            weight: of(&self.weight),
            basis: which.iter().flat_map(rows).collect(),
            knots: self.knots.clone(),
            ..*self
        }
    }

    /// Sum of the weights.
    #[must_use]
    pub fn total_weight(&self) -> f64 {
        self.weight.iter().sum()
    }

    /// Values of the curve at the points, in normalised units.
    #[must_use]
    pub fn curve(&self, theta: &[f64]) -> Vec<f64> {
        let p = self.family.linear_parameters();
        let exponent = if self.family.has_exponent() { theta[p] } else { 1.0 };
        let basis = self.basis_of(exponent);
        basis.chunks_exact(p).map(|row| row.iter().zip(theta).map(|(b, t)| b * t).sum()).collect()
    }

    /// Parameters in physical units.
    #[must_use]
    pub fn physical(&self, theta: &[f64]) -> Vec<f64> {
        let p = self.family.linear_parameters();
        let exponent = theta.get(p).copied().unwrap_or(1.0);
        let factors = self.family.factors(self.ls, self.ys, exponent);
        let mut out: Vec<f64> = theta[..p].iter().zip(&factors).map(|(t, f)| t * f).collect();
        if self.family.has_exponent() {
            out.push(exponent);
        }
        out
    }

    /// Parameters of the curve, `sigma` and `eta` in physical units, of `theta`, `ln sigma` and `ln eta` in normalised ones.
    #[must_use]
    pub fn physical_with_noise(&self, z: &[f64]) -> Vec<f64> {
        let p = self.family.parameters();
        let mut out = self.physical(&z[..p]);
        out.extend([self.ys * libm::exp(z[p]), libm::exp(z[p + 1]) / self.ys]);
        out
    }

    /// Knots of a spline in rad^2/s^2.
    #[must_use]
    pub fn physical_knots(&self) -> Vec<f64> {
        self.knots.iter().map(|k| self.ls * libm::exp(*k)).collect()
    }
}
