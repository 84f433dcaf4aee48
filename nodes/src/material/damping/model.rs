//! Damping models with their parameters.

use super::monotone_spline::MonotoneSpline;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use thiserror::Error;

/// Maximum number of terms of a polynomial.
pub const MAX_TERMS: usize = 6;
/// Minimum and maximum number of knots of a spline.
pub const KNOTS: [usize; 2] = [4, 8];
/// Minimum and maximum exponent of a power law.
pub const EXPONENT: [f64; 2] = [0.25, 2.0];

/// The quantity that a damping represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Convention {
    /// `c` of the mode equation `z'' + c z' + lambda z = p`, 1/s.
    C,
    /// Decay rate `d = c / 2` of the amplitude, 1/s.
    D,
}

/// Damping `c` in 1/s as a function of `lambda = omega_n^2` in rad^2/s^2.
///
/// # Source
/// Rayleigh: (6), hybrid: (7) of Sterling et al. (IEEE TVCG 25(5), 2019); Caughey and O'Kelly, "Classical normal modes in damped
/// linear dynamic systems" (J. Appl. Mech. 32, 1965); Adhikari, "Damping modelling using generalized proportional damping" (J.
/// Sound Vib. 293, 2006), for the spline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum DampingModel {
    /// `a1 + a2 lambda`.
    Rayleigh {
        /// 1/s.
        a1: f64,
        /// s.
        a2: f64,
    },
    /// `g2 lambda^g3`.
    Power {
        /// `s^(2 g3 - 1)`.
        g2: f64,
        /// Exponent, 0.25 to 2.
        g3: f64,
    },
    /// `sum_j a_j lambda^j`.
    Caughey {
        /// Coefficients, `s^(2 j - 1)`, 1 to 6 of them.
        a: Vec<f64>,
    },
    /// `g1 + g2 lambda^g3`.
    Hybrid {
        /// 1/s.
        g1: f64,
        /// `s^(2 g3 - 1)`.
        g2: f64,
        /// Exponent, 0.25 to 2.
        g3: f64,
    },
    /// A non-decreasing spline in `ln lambda`; constant beyond its knots.
    Spline {
        /// Increasing knots, rad^2/s^2, 4 to 8 of them.
        knots: Vec<f64>,
        /// Coefficients of the constant and of the integrated splines, 1/s, two more than knots.
        rises: Vec<f64>,
    },
}

/// Error in a damping model.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A parameter out of range.
    #[error("`{parameter}` is {found}; {needed}")]
    Range {
        /// Name of the parameter.
        parameter: String,
        /// The value.
        found: f64,
        /// The range.
        needed: String,
    },
    /// Lists of the wrong length.
    #[error("`{field}` holds {found} numbers; {needed}")]
    Length {
        /// Name of the field.
        field: &'static str,
        /// Number of values.
        found: usize,
        /// The number that is needed.
        needed: String,
    },
}

impl DampingModel {
    /// Damping `c` at `lambda > 0`, 1/s.
    #[must_use]
    pub fn c(&self, lambda: f64) -> f64 {
        match self {
            Self::Rayleigh { a1, a2 } => a1 + a2 * lambda,
            Self::Power { g2, g3 } => g2 * libm::pow(lambda, *g3),
            Self::Caughey { a } => a.iter().rev().fold(0.0, |sum, a| sum * lambda + a),
            Self::Hybrid { g1, g2, g3 } => g1 + g2 * libm::pow(lambda, *g3),
            Self::Spline { knots, rises } => {
                let logs: Vec<f64> = knots.iter().map(|x| libm::log(*x)).collect();
                let mut basis = vec![0.0; rises.len()];
                MonotoneSpline::new(&logs).basis(libm::log(lambda), &mut basis);
                basis.iter().zip(rises).map(|(b, r)| b * r).sum()
            }
        }
    }

    /// Decay rate `d = c / 2` of the amplitude of a mode of `frequency` in Hz, 1/s.
    #[must_use]
    pub fn decay(&self, frequency: f64) -> f64 {
        let omega = TAU * frequency;
        0.5 * self.c(omega * omega)
    }

    /// Names of the parameters, in the order of [`parameters`](Self::parameters).
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Rayleigh { .. } => vec!["a1".into(), "a2".into()],
            Self::Power { .. } => vec!["g2".into(), "g3".into()],
            Self::Caughey { a } => (0..a.len()).map(|j| format!("a[{j}]")).collect(),
            Self::Hybrid { .. } => vec!["g1".into(), "g2".into(), "g3".into()],
            Self::Spline { rises, .. } => (0..rises.len()).map(|j| format!("rises[{j}]")).collect(),
        }
    }

    /// Values of the parameters; a spline's knots are none.
    #[must_use]
    pub fn parameters(&self) -> Vec<f64> {
        match self {
            Self::Rayleigh { a1, a2 } => vec![*a1, *a2],
            Self::Power { g2, g3 } => vec![*g2, *g3],
            Self::Caughey { a } => a.clone(),
            Self::Hybrid { g1, g2, g3 } => vec![*g1, *g2, *g3],
            Self::Spline { rises, .. } => rises.clone(),
        }
    }

    /// Checks ranges and lengths.
    ///
    /// # Errors
    /// The first parameter out of range, with the range; swapped parameters of a Rayleigh model are named as such.
    pub fn validate(&self) -> Result<(), ModelError> {
        let length = |field, found, good: bool, needed: String| {
            if good { Ok(()) } else { Err(ModelError::Length { field, found, needed }) }
        };
        match self {
            Self::Caughey { a } => {
                let needed = format!("1 to {MAX_TERMS} are needed");
                length("a", a.len(), (1..=MAX_TERMS).contains(&a.len()), needed)?;
            }
            Self::Spline { knots, rises } => {
                let [least, most] = KNOTS;
                let needed = format!("{least} to {most} are needed");
                length("knots", knots.len(), (least..=most).contains(&knots.len()), needed)?;
                let terms = MonotoneSpline::terms(knots.len());
                length(
                    "rises",
                    rises.len(),
                    rises.len() == terms,
                    format!("{terms} are needed: two more than knots"),
                )?;
                let mut last = 0.0;
                for &knot in knots {
                    if !(knot.is_finite() && knot > last) {
                        return Err(range(
                            "knots",
                            knot,
                            &format!("each must be above the one before, {last} rad^2/s^2"),
                        ));
                    }
                    last = knot;
                }
            }
            _ => {}
        }
        for (name, value) in self.names().into_iter().zip(self.parameters()) {
            let [low, high] = if name == "g3" { EXPONENT } else { [0.0, 1e9] };
            if !(low..=high).contains(&value) {
                return Err(range(&name, value, &format!("a number from {low} to {high} is needed")));
            }
        }
        match *self {
            // Above 1e-3 s a mode at 100 Hz has a damping of 400 1/s.
            Self::Rayleigh { a1, a2 } if a2 > 1e-3 && a1 < 1e-3 => {
                Err(range("a2", a2, "it is in s and below 0.001; a1 in 1/s and a2 may be swapped"))
            }
            Self::Rayleigh { a2, .. } if a2 > 1e-3 => Err(range("a2", a2, "it is in s, and 0 to 0.001")),
            _ => Ok(()),
        }
    }
}

fn range(parameter: &str, found: f64, needed: &str) -> ModelError {
    ModelError::Range { parameter: parameter.into(), found, needed: needed.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_columns_of_the_paper_for_porcelain_agree_with_its_quoted_decays() {
        let hybrid = DampingModel::Hybrid { g1: 3.9, g2: 5.2e-9, g3: 1.027 };
        assert!((hybrid.decay(1e4) - 20.6).abs() < 0.05, "the paper quotes 20 1/s");
        let straight = DampingModel::Hybrid { g1: 3.9, g2: 5.2e-9, g3: 1.0 };
        assert!((straight.decay(1e4) - 12.2).abs() < 0.05, "the paper quotes 12 1/s");
        let rayleigh = DampingModel::Rayleigh { a1: 3.9, a2: 1e-8 };
        let polynomial = DampingModel::Caughey { a: vec![3.9, 1e-8] };
        assert!((rayleigh.decay(1e4) - 21.7).abs() < 0.05);
        assert_eq!(rayleigh.c(1e9), polynomial.c(1e9));
        let power = DampingModel::Power { g2: 5.2e-9, g3: 1.027 };
        assert!((hybrid.c(1e9) - 3.9 - power.c(1e9)).abs() < 1e-12);
    }

    #[test]
    fn a_spline_is_constant_beyond_its_knots() {
        let knots = vec![1e6, 1e7, 1e8, 1e9];
        let spline = DampingModel::Spline { knots, rises: vec![2.0, 1.0, 0.0, 3.0, 0.0, 4.0] };
        spline.validate().unwrap();
        assert_eq!(spline.c(1e3), 2.0);
        assert!((spline.c(1e12) - 10.0).abs() < 1e-12);
        assert!(spline.c(3e7) > spline.c(2e7));
    }

    #[test]
    fn errors_name_the_parameter_and_its_range() {
        for (model, part) in [
            (DampingModel::Rayleigh { a1: 1e-8, a2: 3.9 }, "may be swapped"),
            (DampingModel::Rayleigh { a1: -1.0, a2: 1e-8 }, "`a1` is -1; a number from 0"),
            (DampingModel::Rayleigh { a1: 3.0, a2: f64::NAN }, "`a2` is NaN"),
            (DampingModel::Hybrid { g1: 1.0, g2: 1e-9, g3: 2.5 }, "`g3` is 2.5; a number from 0.25 to 2"),
            (DampingModel::Caughey { a: vec![0.0; 7] }, "`a` holds 7 numbers; 1 to 6"),
            (
                DampingModel::Spline { knots: vec![1.0; 4], rises: vec![0.0; 6] },
                "`knots` is 1; each must be above",
            ),
            (DampingModel::Spline { knots: vec![1.0, 2.0, 3.0, 4.0], rises: vec![] }, "6 are needed"),
        ] {
            let e = model.validate().unwrap_err().to_string();
            assert!(e.contains(part), "{e}");
        }
    }
}
