//! Several fits of the same points beside each other, as a node.

use super::estimators::Compared;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::material::damping::{DampingModel, Family};
use crate::material::estimation::least_squares::{LeastSquares, Space};
use crate::material::estimation::point::{DampingPoint, Sample};
use crate::material::points::damping_points::DampingPoints;
use crate::plot::{Chart, Line};
use crate::table::{Cell, ResultTable};
use crate::{choices, params, ports};
use std::f64::consts::TAU;

/// Number of points of a curve.
const STEPS: usize = 80;
/// Maximum number of points that are drawn.
const MAX_DRAWN: usize = 4000;

choices! {
    /// The fits beside each other.
    pub enum Curves {
        /// A Rayleigh curve by the paper's maximum likelihood, by the mixture, by least squares, and as a lower bound.
        Estimators,
        /// A Rayleigh curve, a power law and a hybrid, by least squares.
        Models,
    }
}

params! {
    /// Several fits of the same points beside each other: estimators, or models of damping.
    ///
    /// Each link of `points` is a panel of the figure with its points and curves, and a few rows of the table with the parameters. A power
    /// law minimises squares of logarithms.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), figure 3 (models) and figure 6 (estimators).
    pub struct FitComparisonParams {
        /// The fits.
        curves: Curves = Curves::Estimators;
    }
}
ports! {
    pub struct FitComparisonPorts / FitComparisonIo {
        in {
            /// The points: a panel each.
            points: Many<Value<DampingPoints>>,
        }
        out {
            /// Parameters of each fit.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`fits`].
#[derive(Debug)]
pub struct FitComparison;

/// Names and models of the fits of points; fits with too few points are left out.
#[must_use]
pub fn fits(points: &[DampingPoint], curves: Curves) -> Vec<(&'static str, DampingModel)> {
    match curves {
        Curves::Estimators => {
            let all = [Compared::Paper, Compared::Mixture, Compared::LeastSquares, Compared::LowerBound];
            let fit = |e: Compared| {
                e.estimate(points).map(|[a1, a2]| (e.name(), DampingModel::Rayleigh { a1, a2 }))
            };
            all.into_iter().filter_map(fit).collect()
        }
        Curves::Models => {
            let all = [
                ("Rayleigh", Family::Rayleigh, Space::Linear),
                ("power law", Family::Power, Space::Log),
                ("hybrid", Family::Hybrid, Space::Linear),
            ];
            let fit = |(name, family, space): (&'static str, Family, Space)| {
                let sample = Sample::new(points, family).ok()?;
                let theta = LeastSquares { space, unconstrained: false }.fit(&sample);
                Some((name, family.model(&sample.physical(&theta), &[])))
            };
            all.into_iter().filter_map(fit).collect()
        }
    }
}

fn panel(k: usize, points: &[DampingPoint], fits: &[(&'static str, DampingModel)]) -> Chart {
    let place = |lambda: f64| lambda.sqrt() / TAU;
    let every = points.len() / MAX_DRAWN + 1;
    let dots: Vec<[f64; 2]> = points.iter().step_by(every).map(|p| [place(p.lambda), p.c]).collect();
    let frequencies = || dots.iter().map(|p| p[0]);
    let low = frequencies().fold(f64::INFINITY, f64::min).max(1e-3);
    let high = frequencies().fold(0.0, f64::max).max(low);
    let lowest = 0.5 * dots.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let curve = |model: &DampingModel| -> Vec<[f64; 2]> {
        let at = |k: usize| low * libm::pow(high / low, k as f64 / STEPS as f64);
        (0..=STEPS).map(at).map(|f| [f, model.c((TAU * f).powi(2))]).filter(|p| p[1] > lowest).collect()
    };
    let mut lines = vec![Line::dots("modes", dots.clone())];
    lines.extend(fits.iter().map(|(name, model)| Line::new(*name, curve(model))));
    let title = format!("({}) {} modes", char::from(b'a' + (k % 26) as u8), points.len());
    Chart::of(title, ("natural frequency, Hz", true), ("damping c, 1/s", true), lines)
}

impl Func for FitComparison {
    type Params = FitComparisonParams;
    type Ports = FitComparisonPorts;
    const NAME: &'static str = "FitComparison";
    const VERSION: u32 = 2;

    fn check(_: &FitComparisonParams, s: &mut Shape<'_, '_, FitComparisonPorts>) -> Result<(), Reject> {
        if !s.linked(FitComparisonPorts::points) {
            s.wrong(
                Reject::new("F136", "there are no points").at("points").help("link those of a FeatureGate"),
            );
        }
        Ok(())
    }

    fn eval(p: &FitComparisonParams, _: &Build<'_>, mut io: FitComparisonIo<'_>) -> Result<Summary, Fault> {
        let mut table = ResultTable::new(&["panel", "modes", "fit", "parameters", "c_at_1_khz_per_s"]);
        let mut count = 0;
        for (k, points) in io.points.iter().enumerate() {
            let fits = fits(&points.points, p.curves);
            for (name, model) in &fits {
                let named = model.names().into_iter().zip(model.parameters());
                let parameters: Vec<String> =
                    named.map(|(name, value)| format!("{name} = {}", Cell::from(value).text())).collect();
                table.push([
                    (k + 1).into(),
                    points.points.len().into(),
                    (*name).into(),
                    parameters.join(", ").into(),
                    model.c((TAU * 1000.0).powi(2)).into(),
                ]);
            }
            count += fits.len();
            table.charts.push(panel(k, &points.points, &fits));
        }
        io.table.set(table);
        Ok(vec![("fits", count.into())])
    }

    fn trial(rng: &mut Rng) -> (FitComparisonParams, MemoryFiles) {
        (FitComparisonParams::trial(rng), MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::independent_points;
    use super::*;

    #[test]
    fn least_squares_overestimates_and_the_likelihood_does_not() {
        let points = independent_points(&mut Rng::new(3), 400, [3.9, 1e-8, 0.4, 0.125]);
        let found = fits(&points, Curves::Estimators);
        let a1 = |k: usize| match found[k].1 {
            DampingModel::Rayleigh { a1, .. } => a1,
            _ => f64::NAN,
        };
        assert!((a1(0) / 3.9 - 1.0).abs() < 0.2 && a1(2) > 8.0 && a1(3) < a1(0), "{found:?}");
        let models = fits(&points, Curves::Models);
        assert_eq!(models.iter().map(|m| m.0).collect::<Vec<_>>(), ["Rayleigh", "power law", "hybrid"]);
        assert!(panel(1, &points, &models).draw().contains("(b) 400 modes"));
    }
}
