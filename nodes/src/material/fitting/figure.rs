//! The figure of a fit: points with the fitted curve, and the distribution of the excess.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::material::damping::Family;
use crate::material::estimation::emg::Emg;
use crate::material::estimation::estimate::{Estimator, Settings, estimate};
use crate::material::estimation::fit::FitOptions;
use crate::material::estimation::report::FitReport;
use crate::material::points::damping_points::DampingPoints;
use crate::plot::{Axis, Line, beside, chart};
use std::f64::consts::TAU;

/// Number of points of a drawn curve.
const STEPS: usize = 160;
/// Maximum number of points that are drawn.
const MAX_DRAWN: usize = 4000;

/// Smallest and largest of values above 0, as the range of a logarithmic axis.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let finite = values.filter(|x| x.is_finite() && *x > 0.0);
    let (low, high) = finite.fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
    if low < high { [0.9 * low, 1.1 * high] } else { [1.0, 10.0] }
}

fn geometric([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    (0..=STEPS).map(move |k| low * (high / low).powf(k as f64 / STEPS as f64))
}

impl FitReport {
    /// Draws the points with the fitted damping over frequency.
    fn curve_chart(&self) -> String {
        let every = self.points.len() / MAX_DRAWN + 1;
        let drawn = || self.points.iter().zip(&self.per_point).step_by(every);
        let place = |lambda: f64| lambda.sqrt() / TAU;
        let dots = |spurious: bool| -> Vec<[f64; 2]> {
            drawn()
                .filter(|(_, r)| (r.responsibility < 0.5) == spurious)
                .map(|(p, _)| [place(p[0]), p[1]])
                .collect()
        };
        let x = range(self.points.iter().map(|p| place(p[0])));
        let curve = |support: f64| -> Vec<[f64; 2]> {
            geometric(x).map(|f| [f, self.model.c((TAU * f).powi(2)) + support]).collect()
        };
        let mut lines = vec![Line::dots("modes", dots(false)), Line::new("material", curve(0.0))];
        if let Some(eta) = self.eta {
            lines.push(Line::new("with support", curve(1.0 / eta)));
        }
        let spurious = dots(true);
        if !spurious.is_empty() {
            lines.push(Line::dots("spurious", spurious));
        }
        let y = range(lines.iter().flat_map(|l| l.points.iter().map(|p| p[1])));
        let axis = |label: &str, range| Axis { label: label.into(), range, log: true };
        let (x, y) = (axis("natural frequency, Hz", x), axis("damping c, 1/s", y));
        chart(
            &format!("{}: {} modes of {} recordings", self.estimator, self.n, self.n_recordings),
            &x,
            &y,
            &lines,
        )
    }

    /// Draws the density of the damping above the curve: the histogram of the modes, the fitted density, and its two parts.
    fn density_chart(&self) -> Option<String> {
        let (sigma, eta) = (self.sigma, self.eta?);
        let used = self.points.iter().zip(&self.per_point).filter(|(_, r)| r.responsibility >= 0.5);
        let excess: Vec<f64> = used.map(|(p, r)| p[1] - r.c_hat).collect();
        let mean = 1.0 / eta;
        let (low, high) = (-4.0 * sigma - 0.2 * mean, 5.0 * mean + 4.0 * sigma);
        let bins = 40;
        let width = (high - low) / bins as f64;
        let mut count = vec![0.0; bins];
        for e in &excess {
            if let Some(count) = count.get_mut(((e - low) / width).max(0.0) as usize).filter(|_| *e >= low) {
                *count += 1.0;
            }
        }
        let scale = 1.0 / (width * excess.len().max(1) as f64);
        let stairs = count.iter().enumerate().flat_map(|(k, n)| {
            let left = low + width * k as f64;
            [[left, n * scale], [left + width, n * scale]]
        });
        let at = |k: usize| low + (high - low) * k as f64 / (4 * STEPS) as f64;
        let curve = |f: &dyn Fn(f64) -> f64| (0..=4 * STEPS).map(at).map(|e| [e, f(e)]).collect::<Vec<_>>();
        let emg = Emg { c: 0.0, sigma, eta };
        let density = curve(&|e| libm::exp(emg.log_density(e)));
        let support = curve(&|e| if e >= 0.0 { eta * libm::exp(-eta * e) } else { 0.0 });
        let mut lines = vec![
            Line::new("modes", stairs.collect()),
            Line::new("fit", density),
            Line::new("support", support),
        ];
        if sigma > 0.0 {
            let normal = Emg { eta: f64::INFINITY, ..emg };
            lines.push(Line::new("noise", curve(&|e| libm::exp(normal.log_density(e)))));
        }
        let peak = lines[..2].iter().flat_map(|l| l.points.iter().map(|p| p[1])).fold(eta, f64::max);
        let x =
            Axis { label: "damping above that of the material, 1/s".into(), range: [low, high], log: false };
        let y = Axis { label: "density, s".into(), range: [0.0, 1.1 * peak], log: false };
        Some(chart("Support and noise", &x, &y, &lines))
    }
}

impl Data for FitReport {
    const NAME: &'static str = "damping fit";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let points = DampingPoints::trial(rng);
        let settings = Settings {
            draws: 3,
            ks_draws: 0,
            compare: false,
            ..Settings::new(Estimator::LowerBound, FitOptions::new(Family::Rayleigh))
        };
        // Trial points always have enough frequencies.
        estimate(&points.points, &settings).expect("a trial can be fitted")
    }

    fn plot(&self) -> Option<String> {
        let panels: Vec<String> =
            [Some(self.curve_chart()), self.density_chart()].into_iter().flatten().collect();
        Some(beside(&panels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_has_the_points_the_curve_and_the_density() {
        let points = DampingPoints::trial(&mut Rng::new(2)).points;
        for estimator in [
            Estimator::Mixture,
            Estimator::Likelihood,
            Estimator::Hierarchical,
            Estimator::LeastSquares,
            Estimator::LowerBound,
        ] {
            let settings = Settings {
                draws: 3,
                ks_draws: 3,
                ..Settings::new(estimator, FitOptions::new(Family::Rayleigh))
            };
            let report = estimate(&points, &settings).unwrap();
            let svg = report.plot().unwrap();
            assert_eq!(svg.matches("<circle").count(), points.len(), "{estimator:?}");
            let curves = if estimator == Estimator::LeastSquares { 1 } else { 5 };
            assert!(svg.matches("<polyline").count() >= curves, "{estimator:?}");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{estimator:?}");
        }
    }
}
