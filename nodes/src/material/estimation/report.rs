//! Report of a fit.

use super::fit::OtherMaximum;
use super::uncertainty::Interval;
use crate::material::damping::DampingModel;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Frequencies at which dampings are reported, Hz.
pub const REPORTED_HZ: [f64; 5] = [100.0, 300.0, 1000.0, 3000.0, 10_000.0];

/// Decomposition of one point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointReport {
    /// Damping of the material at its frequency, 1/s.
    pub c_hat: f64,
    /// Expected damping by the support, 1/s.
    pub support_part: f64,
    /// The rest, 1/s.
    pub noise_part: f64,
    /// Probability of a smaller damping: uniform if the model is right.
    pub pit: f64,
    /// Probability to belong to a mode; 1 without a mixture.
    pub responsibility: f64,
}

/// A reason to doubt a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum FitWarning {
    /// The noise is at its floor: the curve is a lower bound, and its likelihood is not comparable.
    SigmaAtFloor,
    /// Another optimum is nearly as likely.
    SecondMode(OtherMaximum),
    /// Standard errors do not exist: the named parameter is at a bound, or the noise at its floor.
    NonRegular(String),
    /// Fewer recordings than an estimate of the constant part needs.
    FewRecordings(usize),
    /// The noise is wider than the excess: the constant part and the mean support damping can hardly be separated. The sum is
    /// `a1 + 1/eta`, 1/s.
    SupportConfounded {
        /// `eta sigma`.
        shape: f64,
        /// `c(0) + 1/eta`, 1/s.
        sum: f64,
    },
    /// The frequencies span less than an octave, or the highest adds less than `sigma + 1/eta` to the damping.
    NoLeverage {
        /// Octaves of the points.
        octaves: f64,
    },
    /// The gamma shape of the support parts, far from that of an exponential.
    ExcessShape(f64),
    /// Rank correlation of the probability integral transform with the frequency.
    Heteroscedastic(f64),
    /// A recording whose absence moves a parameter by more than two standard errors.
    RecordingEffect {
        /// Index of the recording.
        recording: u32,
        /// Name of the parameter.
        parameter: String,
        /// Shift in standard errors.
        shift: f64,
    },
    /// The points are not distributed as the model says: p value of their distance.
    PoorFit(f64),
    /// Share of spurious points, when it is at its maximum.
    ManySpurious(f64),
    /// Fits of resampled data that did not converge.
    FailedDraws(usize),
}

impl fmt::Display for FitWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SigmaAtFloor => f.write_str(
                "the noise is at its floor, so the curve is the lower bound of the points; one point too low would ruin it",
            ),
            Self::SecondMode(other) => write!(
                f,
                "another optimum with a noise of {:.3} 1/s is {:.2} nats less likely",
                other.sigma, other.gap
            ),
            Self::NonRegular(why) => write!(f, "standard errors do not exist: {why}; see the other intervals"),
            Self::FewRecordings(found) => {
                write!(f, "{found} recordings; 10 to 20 are needed for the constant part of the damping")
            }
            Self::SupportConfounded { shape, sum } => write!(
                f,
                "the noise is {shape:.2} times the mean support damping: the constant part and the support can hardly be separated, \
                 but their sum is {sum:.4} 1/s"
            ),
            Self::NoLeverage { octaves } => write!(
                f,
                "frequencies span {octaves:.1} octaves, or the highest adds less damping than noise and support: the frequency \
                 dependence is not determined"
            ),
            Self::ExcessShape(shape) => write!(
                f,
                "support dampings have a gamma shape of {shape:.2}, not 1; try another shape of the excess"
            ),
            Self::Heteroscedastic(rho) => {
                write!(f, "the spread depends on frequency (rank correlation {rho:.2}); try noise per feature or another model")
            }
            Self::RecordingEffect { recording, parameter, shift } => {
                write!(f, "without recording {recording} `{parameter}` moves by {shift:.1} standard errors")
            }
            Self::PoorFit(p) => write!(f, "the points do not follow the model (p = {p:.3})"),
            Self::ManySpurious(pi) => write!(f, "{:.0} % of the points are spurious, the most that is allowed", 100.0 * pi),
            Self::FailedDraws(failed) => write!(f, "{failed} fits of resampled data did not converge"),
        }
    }
}

/// One family in a comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The model.
    pub model: DampingModel,
    /// Log-likelihood.
    pub log_lik: f64,
    /// Akaike's criterion.
    pub aic: f64,
    /// Bayesian criterion over the number of points.
    pub bic: f64,
    /// Bayesian criterion over the number of modes.
    pub bic_modes: f64,
}

/// Damping at one frequency, as a listener can compare it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtFrequency {
    /// Hz.
    pub frequency: f64,
    /// Decay rate of the amplitude `d = c/2`, 1/s.
    pub d: f64,
    /// 95 % interval of `d`; equal ends if it is unknown.
    pub d_interval: [f64; 2],
    /// Time of a decay by 60 dB, s.
    pub t60: f64,
    /// Quality factor.
    pub q: f64,
}

impl AtFrequency {
    /// The figures of a model.
    #[must_use]
    pub fn of(model: &DampingModel, frequency: f64, d_interval: Option<[f64; 2]>) -> Self {
        let d = model.decay(frequency).max(1e-12);
        Self {
            frequency,
            d,
            d_interval: d_interval.unwrap_or([d; 2]),
            t60: libm::log(1000.0) / d,
            q: std::f64::consts::PI * frequency / d,
        }
    }
}

/// Tests of a fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Diagnostics {
    /// Distance of the probability integral transform from a uniform distribution.
    pub ks: f64,
    /// Its p value, by simulation and refits; 1 if none was simulated.
    pub ks_p: f64,
    /// Gamma shape of the support parts, by moments and by maximum likelihood.
    pub excess_shape: [f64; 2],
    /// Rank correlation of the transform with the frequency, and with the recording.
    pub correlation: [f64; 2],
    /// Families on the same points, if they were compared; the best criterion first.
    pub comparisons: Vec<Comparison>,
    /// p value of an exponent of 1 within the hybrid family.
    pub straight_p: Option<f64>,
}

/// Result of an estimator, in physical units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Name of the estimator.
    pub estimator: String,
    /// The damping of the material.
    pub model: DampingModel,
    /// Names of the parameters of the covariance.
    pub names: Vec<String>,
    /// Standard deviation of the noise, 1/s.
    pub sigma: f64,
    /// Rate of the support damping, s, whose mean is `1/eta`; `None` for least squares, which has none.
    pub eta: Option<f64>,
    /// Log-likelihood in physical units.
    pub log_lik: f64,
    /// Number of points.
    pub n: usize,
    /// Number of recordings.
    pub n_recordings: usize,
    /// Unit of `lambda` in the fit, rad^2/s^2.
    pub lambda_unit: f64,
    /// Unit of `c` in the fit, 1/s.
    pub c_unit: f64,
    /// True if the noise is at its floor.
    pub sigma_at_floor: bool,
    /// True if the scan proves that the optimum is global.
    pub certified: bool,
    /// Share of spurious points; 0 without a mixture.
    pub pi: f64,
    /// Covariance of the curve's parameters, `sigma` and `eta`, row by row; `None` where it does not exist.
    pub cov: Option<Vec<f64>>,
    /// 95 % intervals.
    pub ci: Vec<Interval>,
    /// Steps of all starts.
    pub iterations: usize,
    /// Evaluations of the likelihood.
    pub evaluations: usize,
    /// Number of starts.
    pub starts: usize,
    /// Damping at some frequencies.
    pub at: Vec<AtFrequency>,
    /// Tests of the fit.
    pub diagnostics: Diagnostics,
    /// Reasons to doubt it.
    pub warnings: Vec<FitWarning>,
    /// Mean support damping of each recording, 1/s, from a hierarchical fit; empty otherwise.
    pub supports: Vec<f64>,
    /// The points: squared frequency in rad^2/s^2 and damping in 1/s.
    pub points: Vec<[f64; 2]>,
    /// One report for each point.
    pub per_point: Vec<PointReport>,
}
