//! The estimators that experiments compare, on a Rayleigh curve.

use crate::material::damping::Family;
use crate::material::estimation::fit::{FitOptions, fit};
use crate::material::estimation::hierarchical::fit_hierarchical;
use crate::material::estimation::least_squares::LeastSquares;
use crate::material::estimation::lower_bound::lower_bound;
use crate::material::estimation::mixture::{MixtureOptions, fit_mixture};
use crate::material::estimation::point::{DampingPoint, Sample};
use crate::statistics::quantile;

/// An estimator of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// Maximum likelihood with one noise, without accuracies: the paper's.
    Paper,
    /// Maximum likelihood with the noise of each feature.
    PerFeature,
    /// The same with a background of spurious features: the default of `DampingFit`.
    Mixture,
    /// Maximum likelihood with a mean support damping for each sound.
    Hierarchical,
    /// Non-negative least squares.
    LeastSquares,
    /// The highest line below all points.
    LowerBound,
}

impl Compared {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Paper,
        Self::PerFeature,
        Self::Mixture,
        Self::Hierarchical,
        Self::LeastSquares,
        Self::LowerBound,
    ];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::PerFeature => "per feature",
            Self::Mixture => "mixture",
            Self::Hierarchical => "hierarchical",
            Self::LeastSquares => "least squares",
            Self::LowerBound => "lower bound",
        }
    }

    /// `a1` in 1/s and `a2` in s; `None` if the points are too few.
    #[must_use]
    pub fn estimate(self, points: &[DampingPoint]) -> Option<[f64; 2]> {
        let options = FitOptions::new(Family::Rayleigh);
        let sample = || Sample::new(points, Family::Rayleigh).ok();
        let found = match self {
            Self::Paper => {
                let bare: Vec<DampingPoint> =
                    points.iter().map(|p| DampingPoint { sd_c: 0.0, ..*p }).collect();
                fit(&bare, &FitOptions::paper(Family::Rayleigh)).ok()?.physical()
            }
            Self::PerFeature => fit(points, &options).ok()?.physical(),
            Self::Mixture => fit_mixture(points, &MixtureOptions::new(options)).ok()?.fit.physical(),
            Self::Hierarchical => fit_hierarchical(points, &options).ok()?.theta,
            Self::LeastSquares => {
                let sample = sample()?;
                sample.physical(&LeastSquares::default().fit(&sample))
            }
            Self::LowerBound => {
                let sample = sample()?;
                sample.physical(&lower_bound(&sample).0)
            }
        };
        Some([*found.first()?, *found.get(1)?])
    }
}

/// Relative errors of both parameters.
#[must_use]
pub fn relative_errors(found: [f64; 2], truth: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|j| (found[j] / truth[j] - 1.0).abs())
}

/// Median and mean of each parameter's errors; `None` without errors.
#[must_use]
pub fn median_and_mean(errors: &[[f64; 2]]) -> Option<[[f64; 2]; 2]> {
    let of = |j: usize| {
        let mut all: Vec<f64> = errors.iter().map(|e| e[j]).collect();
        all.sort_by(f64::total_cmp);
        [quantile(&all, 0.5), all.iter().sum::<f64>() / all.len() as f64]
    };
    (!errors.is_empty()).then(|| [of(0), of(1)])
}
