//! Standard errors, intervals and diagnostics.

use super::golden::{golden, spurious};
use super::simulated;
use crate::core::random::Rng;
use crate::material::damping::Family;
use crate::material::estimation::estimate::{Estimator, Settings, estimate};
use crate::material::estimation::fit::{FitOptions, fit};
use crate::material::estimation::report::FitWarning;
use crate::material::estimation::uncertainty::{IntervalMethod, covariance, information, profile};

fn settings(estimator: Estimator) -> Settings {
    Settings {
        draws: 20,
        ks_draws: 19,
        compare: false,
        ..Settings::new(estimator, FitOptions::paper(Family::Rayleigh))
    }
}

#[test]
fn standard_errors_have_all_digits() {
    let fit = fit(&golden(), &FitOptions::paper(Family::Rayleigh)).unwrap();
    let cov = covariance(&fit, &information(&fit)).unwrap();
    assert!((cov[0].sqrt() / 0.198_685 - 1.0).abs() < 3e-6, "{}", cov[0].sqrt());
    assert!((cov[5].sqrt() / 5.110_378e-11 - 1.0).abs() < 3e-7, "{:e}", cov[5].sqrt());
    let ends = profile(&fit, 0).unwrap();
    assert!(ends[0] < 3.761 - 0.3 && ends[1] > 3.761 + 0.2 && ends[1] - ends[0] < 1.0, "{ends:?}");
}

#[test]
fn each_estimator_reports_what_it_found() {
    let points = spurious();
    for estimator in [
        Estimator::Mixture,
        Estimator::Likelihood,
        Estimator::Hierarchical,
        Estimator::LeastSquares,
        Estimator::LowerBound,
    ] {
        let report = estimate(&points, &settings(estimator)).unwrap();
        assert_eq!((report.n, report.per_point.len(), report.at.len()), (200, 200, 5));
        assert!(report.ci.iter().all(|i| i.low <= i.high && i.low.is_finite()), "{:?}", report.ci);
        for (p, r) in points.iter().zip(&report.per_point) {
            assert!((r.c_hat + r.support_part + r.noise_part - p.c).abs() < 1e-9, "{estimator:?}");
        }
        assert!(report.warnings.contains(&FitWarning::FewRecordings(1)), "{:?}", report.warnings);
        let low = report.per_point.iter().filter(|r| r.responsibility < 0.5).count();
        assert_eq!(low, if estimator == Estimator::Mixture { 6 } else { 0 }, "{estimator:?}");
        let twice = estimate(&points, &settings(estimator)).unwrap();
        assert_eq!(report, twice, "the same seed gives the same bits");
    }
}

#[test]
fn a_good_model_passes_its_tests_and_a_wrong_one_is_reported() {
    let mut rng = Rng::new(12);
    let points = simulated(&mut rng, 400, [3.9, 1e-8, 0.4, 0.125]);
    let report = estimate(&points, &Settings { compare: true, ..settings(Estimator::Likelihood) }).unwrap();
    assert!(report.diagnostics.ks_p >= 0.05, "{:?}", report.diagnostics);
    let comparisons = &report.diagnostics.comparisons;
    assert!(comparisons.len() == 4 && comparisons[0].aic <= comparisons[3].aic, "{comparisons:?}");
    assert!(report.diagnostics.straight_p.unwrap() > 0.01, "an exponent of 1 is right: {comparisons:?}");
    assert!(report.diagnostics.correlation[0].abs() < 0.1);
    assert!(
        !report.warnings.iter().any(|w| matches!(w, FitWarning::PoorFit(_) | FitWarning::Heteroscedastic(_)))
    );
    // Support damping from a frictionless contact: gamma of shape 1/2, the square of a normal variable.
    let squares: Vec<_> = points
        .iter()
        .map(|p| {
            let normal = crate::statistics::normal::normal_quantile(rng.between(1e-9, 1.0));
            crate::material::estimation::point::DampingPoint {
                c: 3.9 + 1e-8 * p.lambda + 8.0 * normal * normal,
                ..*p
            }
        })
        .collect();
    let report = estimate(&squares, &settings(Estimator::Likelihood)).unwrap();
    assert!(
        report.warnings.iter().any(|w| matches!(w, FitWarning::ExcessShape(s) if *s < 0.7)),
        "{:?}",
        report.warnings
    );
}

#[test]
fn clean_data_have_reflected_intervals_and_no_standard_errors() {
    let mut rng = Rng::new(2);
    let points = simulated(&mut rng, 300, [3.9, 1e-8, 0.0, 0.125]);
    let report = estimate(&points, &settings(Estimator::Likelihood)).unwrap();
    assert!(report.sigma_at_floor && report.cov.is_none(), "{report:?}");
    assert!(report.ci.iter().all(|i| i.method == IntervalMethod::ParametricBootstrap));
    assert!(report.warnings.iter().any(|w| matches!(w, FitWarning::NonRegular(_))));
}

#[test]
fn confounded_and_undetermined_parameters_are_reported() {
    let mut rng = Rng::new(4);
    let noisy = simulated(&mut rng, 700, [30.0, 1e-8, 6.0, 0.25]);
    let report = estimate(&noisy, &settings(Estimator::Likelihood)).unwrap();
    assert!(
        report.warnings.iter().any(|w| matches!(w, FitWarning::SupportConfounded { .. })),
        "{:?}",
        report.warnings
    );
    let narrow: Vec<_> = simulated(&mut rng, 200, [3.9, 0.0, 0.3, 0.125])
        .into_iter()
        .map(|p| crate::material::estimation::point::DampingPoint { lambda: 1e7 + 1e-4 * p.lambda, ..p })
        .collect();
    let report = estimate(&narrow, &settings(Estimator::Likelihood)).unwrap();
    assert!(
        report.warnings.iter().any(|w| matches!(w, FitWarning::NoLeverage { .. })),
        "{:?}",
        report.warnings
    );
}

#[test]
fn a_recording_that_moves_the_fit_is_named() {
    let mut rng = Rng::new(9);
    let mut points = simulated(&mut rng, 400, [3.9, 1e-8, 0.4, 0.125]);
    for (i, p) in points.iter_mut().enumerate() {
        p.recording = (i / 40) as u32;
        if p.recording == 7 {
            p.c *= 0.3;
        }
    }
    let report = estimate(&points, &settings(Estimator::Likelihood)).unwrap();
    let named = |w: &FitWarning| matches!(w, FitWarning::RecordingEffect { recording: 7, .. });
    assert!(report.warnings.iter().any(named), "{:?}", report.warnings);
}
