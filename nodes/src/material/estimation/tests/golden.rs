//! A data set without random numbers, with its estimates to all digits.

use super::simulated;
use crate::core::random::Rng;
use crate::material::damping::Family;
use crate::material::estimation::fit::{FitOptions, Method, fit};
use crate::material::estimation::least_squares::LeastSquares;
use crate::material::estimation::lower_bound::lower_bound;
use crate::material::estimation::mixture::{MixtureFit, MixtureOptions, fit_mixture};
use crate::material::estimation::point::{DampingPoint, Sample};
use crate::statistics::normal::normal_quantile;
use std::f64::consts::TAU;

/// 200 points of `a1 = 3.9`, `a2 = 1e-8`, `sigma = 0.4` and a mean excess of 8.
pub(super) fn golden() -> Vec<DampingPoint> {
    (0..200)
        .map(|i| {
            let i = f64::from(i);
            let frequency = 300.0 * 50_f64.powf((i + 0.5) / 200.0);
            let lambda = (TAU * frequency).powi(2);
            let excess = -8.0 * (1.0 - (0.618_033_988_7 * i + 0.5).fract()).ln();
            let noise = 0.4 * normal_quantile((0.754_877_666_2 * i + 0.25).fract());
            DampingPoint::new(lambda, 3.9 + 1e-8 * lambda + excess + noise)
        })
        .collect()
}

/// The same with ten planted spurious points.
pub(super) fn spurious() -> Vec<DampingPoint> {
    let mut points = golden();
    for j in 0..10 {
        points[5 + 20 * j].c = 0.5 * 1000_f64.powf((j as f64 + 0.5) / 10.0);
    }
    points
}

fn digits(found: f64, exact: f64, relative: f64) {
    assert!((found - exact).abs() <= relative * exact.abs(), "{found:.12e}, not {exact:.12e}");
}

#[test]
fn estimates_have_all_digits() {
    let points = golden();
    digits(points.iter().map(|p| p.c).sum(), 4_639.885_752_779, 2e-13);
    let fit = fit(&points, &FitOptions::paper(Family::Rayleigh)).unwrap();
    digits(fit.sample.ls, 1.776_528_792_2e8, 1e-10);
    digits(fit.sample.ys, 15.628_446_749_3, 1e-11);
    let found = fit.physical();
    digits(found[0], 3.761_058_300, 2e-10);
    digits(found[1], 1.003_043_334e-8, 5e-10);
    digits(fit.sigma(), 0.301_503_783, 2e-9);
    digits(fit.eta(), 0.124_129_626, 2e-9);
    digits(fit.log_likelihood, -74.122_049_627, 1e-11);
    digits(fit.physical_log_likelihood(), -623.940_602_277, 1e-12);
    assert!(fit.certified && fit.gradient < 1e-9 && !fit.sigma_at_floor(), "{fit:?}");
    let sample = Sample::new(&points, Family::Rayleigh).unwrap();
    let least_squares = sample.physical(&LeastSquares::default().fit(&sample));
    digits(least_squares[0], 11.940_560_881, 1e-10);
    digits(least_squares[1], 9.921_682_139e-9, 1e-10);
    let bound = sample.physical(&lower_bound(&sample).0);
    digits(bound[0], 3.397_963_782, 2e-10);
    digits(bound[1], 1.007_881_352e-8, 1e-9);
}

#[test]
fn estimates_with_spurious_points_have_all_digits() {
    let points = spurious();
    let options = FitOptions::paper(Family::Rayleigh);
    let plain = fit(&points, &options).unwrap();
    digits(plain.sample.ys, 15.683_809_074_7, 1e-11);
    let found = plain.physical();
    digits(found[0], 3.388_802_767, 2e-10);
    digits(found[1], 1.011_051_298e-8, 1e-9);
    digits(plain.sigma(), 1.158_654_511, 1e-9);
    digits(plain.eta(), 0.092_335_697, 1e-8);
    digits(plain.physical_log_likelihood(), -695.806_916_090, 1e-12);
    let sample = Sample::new(&points, Family::Rayleigh).unwrap();
    let least_squares = sample.physical(&LeastSquares::default().fit(&sample));
    digits(least_squares[0], 12.477_039_175, 1e-10);
    digits(least_squares[1], 1.164_545_392e-8, 1e-9);
    let bound = sample.physical(&lower_bound(&sample).0);
    digits(bound[0], 0.660_242_036, 1e-9);
    digits(bound[1], 1.044_635_021e-8, 1e-9);
    let options = MixtureOptions { lo: 0.25, hi: Some(2000.0), prior: false, ..MixtureOptions::new(options) };
    let mixture = fit_mixture(&points, &options).unwrap();
    let found = mixture.fit.physical();
    digits(found[0], 3.815_922, 2e-7);
    digits(found[1], 1.002_207e-8, 5e-7);
    digits(mixture.fit.sigma(), 0.356_877, 2e-6);
    digits(mixture.fit.eta(), 0.123_199, 5e-6);
    digits(mixture.pi, 0.038_832, 2e-5);
    digits(mixture.fit.physical_log_likelihood(), -663.395_428, 1e-9);
    for (planted, responsibility) in [(0, 1.0), (1, 1.0), (2, 0.975), (7, 0.8), (8, 1.0), (9, 1.0)] {
        let found = 1.0 - mixture.responsibility[5 + 20 * planted];
        assert!((found - responsibility).abs() < 6e-3, "{planted}: {found}");
    }
    for pair in mixture.trace.windows(2) {
        assert!(pair[1] >= pair[0] - 1e-9, "the objective falls: {:?}", mixture.trace);
    }
}

#[test]
fn clusters_of_spurious_points_have_a_share_of_their_own() {
    let mut rng = Rng::new(3);
    let mut points = simulated(&mut rng, 300, [3.9, 1e-8, 0.4, 0.125]);
    let planted = 120;
    let centres = [200, 230, 260].map(|k: usize| points[k].lambda);
    for (k, p) in points.iter_mut().enumerate() {
        p.mode_cluster = k as u32;
        if k < planted {
            (p.lambda, p.c) = (centres[k % 3], 0.5 * 1000_f64.powf(rng.uniform()));
            p.mode_cluster = 1000 + k as u32 % 3;
        }
    }
    let options = MixtureOptions::new(FitOptions::new(Family::Rayleigh));
    let with = fit_mixture(&points, &options).unwrap();
    for (k, group) in with.groups.iter().enumerate() {
        let own = if k < planted { 1 + k as u32 % 3 } else { 0 };
        assert_eq!(*group, own, "{k}");
    }
    // Many log-uniform dampings are as likely those of a support, and the prior of a share is that of few spurious points.
    assert!(with.logits[0] < -3.0 && with.logits[1..].iter().all(|x| *x > 0.0), "{:?}", with.logits);
    points.iter_mut().for_each(|p| p.mode_cluster = 0);
    let without = fit_mixture(&points, &options).unwrap();
    assert!(without.groups.iter().all(|g| *g == 0));
    let accepted = |fit: &MixtureFit| fit.responsibility[..planted].iter().sum::<f64>();
    assert!(accepted(&with) < accepted(&without), "{} {}", accepted(&with), accepted(&without));
}

#[test]
fn every_method_climbs_to_the_same_optimum() {
    let points = golden();
    let paper = FitOptions::paper(Family::Rayleigh);
    let best = fit(&points, &paper).unwrap();
    let em = fit(&points, &FitOptions { method: Method::Em, ..paper }).unwrap();
    assert!((best.log_likelihood - em.log_likelihood).abs() < 1e-6, "{}", em.log_likelihood);
    let ascent = fit(&points, &FitOptions { method: Method::GradientAscent, ..paper }).unwrap();
    assert!(ascent.log_likelihood < best.log_likelihood, "{}", ascent.log_likelihood);
    for family in [Family::Caughey(2), Family::Hybrid, Family::Caughey(3)] {
        let other = fit(&points, &FitOptions::paper(family)).unwrap();
        assert!(other.log_likelihood >= best.log_likelihood - 1e-7, "{family:?}: {}", other.log_likelihood);
    }
}
