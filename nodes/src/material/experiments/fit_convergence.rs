//! Log-likelihood against iterations of several methods, as a node.

use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::material::damping::Family;
use crate::material::estimation::fit::{FitOptions, fit, start};
use crate::material::estimation::lbfgs::lbfgs;
use crate::material::estimation::point::{DampingPoint, EstimationError};
use crate::material::estimation::reference;
use crate::material::estimation::scan::Effort;
use crate::material::points::damping_points::DampingPoints;
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use crate::{params, ports};

/// Noise of the start, as a fraction of the least-squares residual.
const NOISE: f64 = 0.5;
/// Projected gradient at which the quasi-Newton method ends.
const TOLERANCE: f64 = 1e-9;
/// Gap to the optimum that counts as converged, nats.
const CONVERGED: f64 = 1e-3;

params! {
    /// Log-likelihood of a damping fit against iterations, for the paper's ascent along the gradient and for better methods.
    ///
    /// All start from half of the least-squares line: ascent by fixed steps along the gradient, expectation-maximisation, the
    /// quasi-Newton method L-BFGS, and the scan over shapes with Newton steps; the end and the number of steps are shown. The
    /// likelihood is that of the `Paper` preset with a Rayleigh curve.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), figure 8, which states neither step nor stopping rule.
    pub struct FitConvergenceParams {
        /// Number of steps along the gradient, and of expectation-maximisation at most.
        steps: usize = 40_000, unit "", range 10..=10_000_000;
    }
}
ports! {
    pub struct FitConvergencePorts / FitConvergenceIo {
        in {
            /// The points.
            points: Value<DampingPoints>,
        }
        out {
            /// Log-likelihood by method and iteration.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`traces`].
#[derive(Debug)]
pub struct FitConvergence;

/// Convergence of one method to the optimum.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Name of the method.
    pub method: &'static str,
    /// Iterations and log-likelihood in physical units.
    pub points: Vec<[f64; 2]>,
}

/// Log-likelihood against iterations for each method, the scan last.
///
/// # Errors
/// As [`fit`].
pub fn traces(points: &[DampingPoint], steps: usize) -> Result<Vec<Trace>, EstimationError> {
    let options = FitOptions::paper(Family::Rayleigh);
    let optimum = fit(points, &options)?;
    let sample = &optimum.sample;
    let likelihood = options.likelihood(sample);
    let total = likelihood.total_weight();
    let physical = |mean: f64| total * mean - total * libm::log(sample.ys);
    let from = start(&likelihood, 1.0, NOISE, optimum.floor);
    let mut gradient = vec![0.0; from.len()];
    let at_start = physical(likelihood.gradient(&from, &mut gradient));
    // Steps between which the methods are looked at: about ten in each factor of ten.
    let mut stops = vec![1_usize];
    while let Some(last) = stops.last().filter(|last| **last < steps) {
        stops.push(((*last as f64 * 1.26).ceil() as usize).min(steps));
    }
    let run = |method: &'static str, em: bool| {
        let (mut z, mut done, mut effort) = (from.clone(), 0, Effort::default());
        let mut trace = vec![[0.0, at_start]];
        for stop in &stops {
            let before = effort.iterations;
            let method = if em { reference::em } else { reference::gradient_ascent };
            let found = method(&likelihood, z, optimum.floor, stop - done, &mut effort);
            trace.push([effort.iterations as f64, physical(found.value)]);
            z = found.z;
            if effort.iterations - before < stop - done {
                break;
            }
            done = *stop;
        }
        Trace { method, points: trace }
    };
    let mut z = from.clone();
    let mut quasi_newton = vec![[0.0, at_start]];
    let mut evaluation = |z: &[f64], g: &mut [f64]| {
        let value = likelihood.gradient(z, g);
        let best = quasi_newton.last().map_or(at_start, |p| p[1]).max(physical(value));
        quasi_newton.push([quasi_newton.len() as f64, best]);
        value
    };
    lbfgs(&mut evaluation, &likelihood.bounds(optimum.floor), &mut z, TOLERANCE, 500);
    let end = optimum.physical_log_likelihood();
    Ok(vec![
        run("ascent", false),
        run("EM", true),
        Trace { method: "L-BFGS", points: quasi_newton },
        Trace { method: "scan, Newton", points: vec![[optimum.effort.iterations as f64, end]] },
    ])
}

impl Func for FitConvergence {
    type Params = FitConvergenceParams;
    type Ports = FitConvergencePorts;
    const NAME: &'static str = "FitConvergence";
    const VERSION: u32 = 2;

    fn eval(p: &FitConvergenceParams, _: &Build<'_>, mut io: FitConvergenceIo<'_>) -> Result<Summary, Fault> {
        let traces =
            traces(&io.points.points, p.steps).map_err(|e| Fault::new("F136", e.to_string()).at("points"))?;
        let end = traces.iter().filter_map(|t| t.points.last()).map(|p| p[1]);
        let best = end.fold(f64::NEG_INFINITY, f64::max);
        let mut table =
            ResultTable::new(&["method", "iterations", "log_likelihood", "nats_below_the_optimum"]);
        let mut methods = Vec::new();
        for trace in &traces {
            for [k, value] in &trace.points {
                table.push([
                    trace.method.into(),
                    (*k).into(),
                    (*value).into(),
                    (best - value).max(0.0).into(),
                ]);
            }
            let last = trace.points.last().copied().unwrap_or_default();
            let reached = trace.points.iter().find(|p| best - p[1] < CONVERGED);
            methods.push(match reached {
                Some([k, _]) => format!("{}: within {CONVERGED} nats after {k} iterations", trace.method),
                None => {
                    format!("{}: {:.3} nats short after {} iterations", trace.method, best - last[1], last[0])
                }
            });
        }
        let lines = |of: &dyn Fn(f64) -> f64| -> Vec<Line> {
            let line = |t: &Trace| {
                let points: Vec<[f64; 2]> = t.points.iter().map(|p| [p[0].max(1.0), of(p[1])]).collect();
                if points.len() > 1 { Line::new(t.method, points) } else { Line::dots(t.method, points) }
            };
            traces.iter().map(line).collect()
        };
        table.charts = vec![
            Chart::of("Convergence", ("iterations", true), ("log-likelihood", false), lines(&|x| x)),
            Chart::of(
                "Distance from the optimum",
                ("iterations", true),
                ("nats", true),
                lines(&|x| (best - x).max(1e-9)),
            ),
        ];
        let summary =
            vec![("points", io.points.points.len().into()), ("methods", serde_json::json!(methods))];
        io.table.set(table);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (FitConvergenceParams, MemoryFiles) {
        let p = FitConvergenceParams { steps: 20 + rng.below(200) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::independent_points;
    use super::*;

    #[test]
    fn ascent_is_slow_and_the_others_reach_one_optimum() {
        let points = independent_points(&mut Rng::new(8), 300, [3.9, 1e-8, 0.4, 0.125]);
        let traces = traces(&points, 3000).unwrap();
        let end = |k: usize| traces[k].points.last().unwrap()[1];
        assert!(
            (end(1) - end(3)).abs() < 0.01 && (end(2) - end(3)).abs() < 1e-5,
            "{} {} {}",
            end(1),
            end(2),
            end(3)
        );
        assert!(end(0) < end(3));
        assert!(traces.iter().all(|t| t.points.windows(2).all(|w| w[0][0] < w[1][0])));
    }
}
