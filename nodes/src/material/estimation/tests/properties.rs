//! Derivatives, limits and invariances of the likelihood and its optimum.

use super::golden::golden;
use crate::core::random::Rng;
use crate::material::damping::Family;
use crate::material::estimation::fit::{FitOptions, fit};
use crate::material::estimation::least_squares::{LeastSquares, Space};
use crate::material::estimation::likelihood::{Excess, Likelihood};
use crate::material::estimation::lower_bound::lower_bound;
use crate::material::estimation::newton::Objective;
use crate::material::estimation::point::{DampingPoint, EstimationError, Sample};
use crate::material::estimation::scan::at_shape;

const FAMILIES: [Family; 6] = [
    Family::Rayleigh,
    Family::Power,
    Family::Hybrid,
    Family::Caughey(3),
    Family::Caughey(1),
    Family::Spline(5),
];

fn with_accuracies() -> Vec<DampingPoint> {
    let mut rng = Rng::new(5);
    golden()
        .into_iter()
        .map(|p| DampingPoint { sd_c: rng.between(0.0, 0.2) * p.c, weight: rng.between(0.2, 2.0), ..p })
        .collect()
}

#[test]
fn gradients_and_hessians_agree_with_differences() {
    let points = with_accuracies();
    for family in FAMILIES {
        let sample = Sample::new(&points, family).unwrap();
        for (per_feature, below, excess) in [
            (false, None, Excess::Exponential),
            (true, None, Excess::Exponential),
            (true, Some(0.3), Excess::Exponential),
            (true, None, Excess::Gamma(0.6)),
        ] {
            let mut f = Likelihood::new(&sample, per_feature, below, excess);
            let n = f.parameters();
            let mut z = vec![0.13; n];
            if family.has_exponent() {
                z[n - 3] = 0.9;
            }
            (z[n - 2], z[n - 1]) = (-2.0, 0.4);
            let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
            let value = f.derivatives(&z, &mut g, &mut h);
            assert!(
                (value - f.value(&z)).abs() < 1e-12
                    && (value - f.gradient(&z, &mut vec![0.0; n])).abs() < 1e-12
            );
            for a in 0..n {
                let step = 1e-5;
                let (mut up, mut down) = (z.clone(), z.clone());
                up[a] += step;
                down[a] -= step;
                let slope = (f.value(&up) - f.value(&down)) / (2.0 * step);
                let scale = g.iter().fold(1.0, |m: f64, g| m.max(g.abs()));
                assert!(
                    (slope - g[a]).abs() < 1e-6 * scale,
                    "{family:?} {per_feature} {below:?} {excess:?} {a}: {slope} {}",
                    g[a]
                );
                let (mut gu, mut gd) = (vec![0.0; n], vec![0.0; n]);
                f.gradient(&up, &mut gu);
                f.gradient(&down, &mut gd);
                let scale = h.iter().fold(1.0, |m: f64, h| m.max(h.abs()));
                for b in 0..n {
                    let bend = (gu[b] - gd[b]) / (2.0 * step);
                    let found = h[a * n + b];
                    assert!(
                        (bend - found).abs() < 1e-6 * scale,
                        "{family:?} {per_feature} {below:?} {excess:?} {a} {b}: {bend} {found}"
                    );
                }
            }
        }
    }
}

#[test]
fn without_noise_the_likelihood_is_the_lower_bound() {
    let sample = Sample::new(&golden(), Family::Rayleigh).unwrap();
    let likelihood = Likelihood::new(&sample, false, None, Excess::Exponential);
    let (bound, _) = lower_bound(&sample);
    let mut last = f64::INFINITY;
    for k in [1e-3, 1e-4, 1e-5] {
        let z = at_shape(&likelihood, k);
        let difference = (z[0] / bound[0] - 1.0).abs();
        assert!(difference < 0.3 * last, "{k}: {difference}");
        last = difference;
        let curve = sample.curve(&z[..2]);
        let excess = sample.y.iter().zip(&curve).map(|(y, c)| y - c).sum::<f64>() / 200.0;
        if k == 1e-5 {
            // SciPy's simplex search at the same shape: 8.13357e-5.
            assert!((difference / 8.133_57e-5 - 1.0).abs() < 1e-4, "{difference}");
            // The points that touch the curve leave a difference of order k.
            assert!((z[3].exp() * excess - 1.0).abs() < 4e-5, "{}", z[3].exp() * excess);
        }
    }
}

#[test]
fn with_normal_noise_alone_the_likelihood_is_least_squares() {
    let sample = Sample::new(&golden(), Family::Rayleigh).unwrap();
    let likelihood = Likelihood::new(&sample, false, None, Excess::Exponential);
    let z = at_shape(&likelihood, 1000.0);
    let least = LeastSquares::default().fit(&sample);
    assert!(((z[0] + (-z[3]).exp()) / least[0] - 1.0).abs() < 3e-8, "{z:?} {least:?}");
    assert!((z[1] / least[1] - 1.0).abs() < 3e-8, "{z:?} {least:?}");
}

#[test]
fn at_a_fixed_shape_the_likelihood_is_concave() {
    use crate::material::estimation::emg::terms;
    let mut rng = Rng::new(8);
    for _ in 0..2000 {
        let (u, k) = (rng.between(-20.0, 40.0), rng.between(-8.0, 4.0).exp());
        let t = terms(u, k);
        assert!(t.uu <= 0.0 && (0.0..=1.0).contains(&t.kk), "{u} {k}: {t:?}");
    }
}

#[test]
fn parameters_transform_with_the_units_and_ignore_order_and_duplicates() {
    let points = golden();
    for family in [Family::Rayleigh, Family::Hybrid, Family::Caughey(3), Family::Spline(4)] {
        let options = FitOptions::paper(family);
        let base = fit(&points, &options).unwrap();
        let (s, t) = (37.0, 0.11);
        let scaled: Vec<_> =
            points.iter().map(|p| DampingPoint { lambda: s * p.lambda, c: t * p.c, ..*p }).collect();
        let scaled = fit(&scaled, &options).unwrap();
        let p = family.linear_parameters();
        let exponent = base.theta().get(p).copied().unwrap_or(1.0);
        let factors = family.factors(s, t, exponent);
        let size = base.physical();
        for (j, factor) in factors.iter().enumerate() {
            let (a, b) = (size[j] * factor, scaled.physical()[j]);
            let most = if family == Family::Hybrid { 1e-7 } else { 1e-9 };
            assert!((a - b).abs() <= most * a.abs() + 1e-11 * t, "{family:?} {j}: {a} {b}");
        }
        assert!((scaled.sigma() / base.sigma() / t - 1.0).abs() < 1e-8);
        let reversed: Vec<_> = points.iter().rev().copied().collect();
        let half =
            points.iter().chain(&points).map(|p| DampingPoint { weight: 0.5, ..*p }).collect::<Vec<_>>();
        for other in [reversed, half] {
            let other = fit(&other, &options).unwrap();
            assert!((other.log_likelihood - base.log_likelihood).abs() < 1e-9, "{family:?}");
            assert!((other.eta() / base.eta() - 1.0).abs() < 1e-7, "{family:?}");
        }
    }
}

#[test]
fn fits_are_at_least_as_likely_as_the_truth() {
    let mut rng = Rng::new(21);
    for trial in 0..30 {
        let [a1, a2, sigma, support] =
            [rng.between(1.0, 40.0), rng.between(1e-9, 1e-7), rng.between(0.05, 2.0), rng.between(2.0, 20.0)];
        let truth = super::simulated(&mut rng, 150, [a1, a2, sigma, 1.0 / support]);
        let fit = fit(&truth, &FitOptions::paper(Family::Rayleigh)).unwrap();
        let sample = &fit.sample;
        let noise = [(sigma / sample.ys).ln(), (sample.ys / support).ln()];
        let z = [a1 / sample.ys, a2 * sample.ls / sample.ys, noise[0], noise[1]];
        let mut likelihood = Likelihood::new(sample, false, None, Excess::Exponential);
        let at_truth = likelihood.total_weight() * likelihood.value(&z);
        assert!(fit.log_likelihood >= at_truth - 1e-9, "{trial}: {} {at_truth}", fit.log_likelihood);
    }
}

#[test]
fn lower_bounds_touch_but_never_cross_a_point() {
    let mut rng = Rng::new(2);
    for family in FAMILIES {
        for _ in 0..20 {
            let points = super::simulated(&mut rng, 60, [3.9, 1e-8, 0.4, 0.125]);
            let sample = Sample::new(&points, family).unwrap();
            let (theta, excess) = lower_bound(&sample);
            let gaps: Vec<f64> = sample.curve(&theta).iter().zip(&sample.y).map(|(c, y)| y - c).collect();
            let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(least > -1e-10 && least < 1e-8 && excess > 0.0, "{family:?}: {least}");
        }
    }
    // The hull and the linear program are two methods for one problem.
    let points = golden();
    let hull = lower_bound(&Sample::new(&points, Family::Rayleigh).unwrap()).0;
    let program = lower_bound(&Sample::new(&points, Family::Caughey(2)).unwrap()).0;
    assert!(hull.iter().zip(&program).all(|(a, b)| (a - b).abs() < 1e-10), "{hull:?} {program:?}");
}

#[test]
fn least_squares_of_power_laws_find_their_exponent() {
    let exact: Vec<_> =
        golden().iter().map(|p| DampingPoint::new(p.lambda, 2e-5 * p.lambda.powf(0.7))).collect();
    let sample = Sample::new(&exact, Family::Power).unwrap();
    for space in [Space::Linear, Space::Log] {
        let found = sample.physical(&LeastSquares { space, unconstrained: false }.fit(&sample));
        assert!(
            (found[1] - 0.7).abs() < 1e-6 && (found[0] / 2e-5 - 1.0).abs() < 2e-5,
            "{space:?}: {found:?}"
        );
    }
    let falling: Vec<_> =
        golden().iter().map(|p| DampingPoint::new(p.lambda, 500.0 - 1e-8 * p.lambda)).collect();
    let sample = Sample::new(&falling, Family::Rayleigh).unwrap();
    let free = sample.physical(&LeastSquares { unconstrained: true, ..LeastSquares::default() }.fit(&sample));
    assert!((free[1] / -1e-8 - 1.0).abs() < 1e-9, "{free:?}");
    assert_eq!(LeastSquares::default().fit(&sample)[1], 0.0);
}

#[test]
fn impossible_inputs_are_named() {
    let few = golden()[..3].to_vec();
    assert!(matches!(
        fit(&few, &FitOptions::new(Family::Rayleigh)),
        Err(EstimationError::TooFewPoints { found: 3, parameters: 2, needed: 4 })
    ));
    for points in [Vec::new(), golden()[..1].to_vec()] {
        assert!(fit(&points, &FitOptions::new(Family::Rayleigh)).is_err());
    }
    let flat: Vec<_> = golden().iter().map(|p| DampingPoint { lambda: 1e6, ..*p }).collect();
    let error = fit(&flat, &FitOptions::new(Family::Rayleigh)).unwrap_err();
    assert_eq!(error, EstimationError::RankDeficient { distinct: 1, needed: 2 });
    for (field, wrong) in [
        ("lambda", DampingPoint::new(0.0, 1.0)),
        ("lambda", DampingPoint::new(f64::NAN, 1.0)),
        ("c", DampingPoint::new(1e6, -1.0)),
        ("c", DampingPoint::new(1e6, f64::INFINITY)),
        ("sd_c", DampingPoint { sd_c: -1.0, ..DampingPoint::new(1e6, 1.0) }),
        ("weight", DampingPoint { weight: f64::NAN, ..DampingPoint::new(1e6, 1.0) }),
    ] {
        let mut points = golden();
        points[7] = wrong;
        let text = fit(&points, &FitOptions::new(Family::Rayleigh)).unwrap_err().to_string();
        assert!(text.contains(&format!("`{field}` of point 7")), "{text}");
    }
    let text =
        fit(&golden(), &FitOptions { truncated_below: Some(5.0), ..FitOptions::new(Family::Rayleigh) });
    assert!(text.unwrap_err().to_string().contains("dropped"));
}

#[test]
fn degenerate_points_end_at_a_bound_and_not_in_nan() {
    for family in FAMILIES {
        let on_a_curve: Vec<_> =
            golden().iter().map(|p| DampingPoint::new(p.lambda, 3.9 + 1e-8 * p.lambda)).collect();
        let flat: Vec<_> = golden().iter().map(|p| DampingPoint { c: 7.0, ..*p }).collect();
        let twice: Vec<_> = golden()
            .iter()
            .map(|p| DampingPoint { lambda: if p.c > 15.0 { 1e6 } else { 3e9 }, ..*p })
            .collect();
        for (name, points) in [("curve", on_a_curve), ("flat", flat), ("two frequencies", twice)] {
            let fit = match fit(&points, &FitOptions::new(family)) {
                Ok(fit) => fit,
                Err(e) => {
                    let few = matches!(e, EstimationError::RankDeficient { distinct: 2, .. });
                    assert!(few && name == "two frequencies", "{family:?} {name}: {e}");
                    continue;
                }
            };
            assert!(
                fit.z.iter().all(|z| z.is_finite()) && fit.log_likelihood.is_finite(),
                "{family:?} {name}: {:?}",
                fit.z
            );
            if name != "two frequencies" && !family.has_exponent() {
                assert!(
                    fit.sigma_at_floor() || family == Family::Spline(5) || family == Family::Caughey(1),
                    "{family:?} {name}: {}",
                    fit.sigma()
                );
            }
        }
    }
}

#[test]
fn a_spline_follows_a_curve_that_no_polynomial_has() {
    let mut rng = Rng::new(6);
    let step = |lambda: f64| 4.0 + 30.0 / (1.0 + (-(lambda.ln() - 17.0) * 2.0).exp());
    let points: Vec<_> = super::simulated(&mut rng, 600, [0.0, 0.0, 0.3, 0.2])
        .into_iter()
        .map(|p| DampingPoint { c: (p.c + step(p.lambda)).max(0.1), ..p })
        .collect();
    let spline = fit(&points, &FitOptions::new(Family::Spline(6))).unwrap();
    let line = fit(&points, &FitOptions::new(Family::Rayleigh)).unwrap();
    assert!(spline.log_likelihood > line.log_likelihood + 100.0);
    let model = Family::Spline(6).model(&spline.physical(), &spline.sample.physical_knots());
    for lambda in [1e7, 3e7, 1e8] {
        assert!(
            (model.c(lambda) / step(lambda) - 1.0).abs() < 0.1,
            "{lambda}: {} {}",
            model.c(lambda),
            step(lambda)
        );
    }
}
