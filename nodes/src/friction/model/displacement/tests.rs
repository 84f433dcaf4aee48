use super::*;
use proptest::prelude::*;

const NO_LIFT: f64 = 0.0;

fn gaussian(mean: f64, sd: f64, df: f64, bins: usize) -> Vec<f64> {
    (0..bins).map(|k| (-0.5 * ((k as f64 * df - mean) / sd).powi(2)).exp() / sd).collect()
}

fn moments(a: &[f64], df: f64) -> (f64, f64) {
    let mass: f64 = a.iter().sum();
    let at = |k: usize| k as f64 * df;
    let mean = a.iter().enumerate().map(|(k, v)| at(k) * v).sum::<f64>() / mass;
    let variance = a.iter().enumerate().map(|(k, v)| (at(k) - mean).powi(2) * v).sum::<f64>() / mass;
    (mean, variance.sqrt())
}

fn peak(a: &[f64]) -> usize {
    (0..a.len()).max_by(|&i, &j| a[i].total_cmp(&a[j])).unwrap()
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= tolerance, "bin {k}: {f} instead of {e}");
    }
}

#[test]
fn a_mirrored_pair_of_four_bins_has_the_known_middle() {
    let mut out = [0.0; 4];
    displace_with(&[3.0, 1.0, 0.5, 0.5], &[0.5, 0.5, 1.0, 3.0], 0.5, Gain::Mass, NO_LIFT, &mut out);
    close(&out, &[0.857_142_857_1, 1.642_857_142_9, 1.642_857_142_9, 0.857_142_857_1], 1e-10);
}

#[test]
fn unequal_masses_at_a_quarter_result_in_the_known_spectrum() {
    let mut out = [0.0; 4];
    displace_with(&[3.0, 1.0, 0.5, 0.5], &[1.0, 1.0, 2.0, 6.0], 0.25, Gain::Mass, NO_LIFT, &mut out);
    close(&out, &[1.875, 2.5, 1.085_526_315_8, 0.789_473_684_2], 1e-10);
}

#[test]
fn both_gains_equal_numpy_interpolation_on_the_knots() {
    // tests/oracles/friction.py, "displaced"
    let a: Vec<f64> = (0..12).map(|k| 1.0 + f64::from(k * 5 % 7)).collect();
    let b: Vec<f64> = (0..12).map(|k| 0.5 + f64::from(k * k % 11)).collect();
    let mass = [
        0.891743119266055,
        4.276540462823497,
        5.206637303986397,
        3.379039509963654,
        6.683106578556238,
        4.481157324469582,
        3.30488275054293,
        2.346434435107798,
        5.950949021612958,
        4.000385782330676,
        4.892238465438572,
        3.186885245901637,
    ];
    let rms = [
        0.9702112601758537,
        4.652850828884388,
        5.664790712528173,
        3.6763750796800014,
        7.271180584838414,
        4.875472768882387,
        3.5956929623149083,
        2.552906841691862,
        6.474597476292691,
        4.352396163436656,
        5.322726628426951,
        3.467312372431737,
    ];
    let mut out = [0.0; 12];
    displace_with(&a, &b, 0.3, Gain::Mass, NO_LIFT, &mut out);
    close(&out, &mass, 1e-12);
    displace_with(&a, &b, 0.3, Gain::Rms, NO_LIFT, &mut out);
    close(&out, &rms, 1e-12);
}

#[test]
fn two_gaussians_move_and_widen_linearly() {
    let (df, bins) = (20.0, 1201);
    let (a, b) = (gaussian(4000.0, 200.0, df, bins), gaussian(10000.0, 800.0, df, bins));
    let mut out = vec![0.0; bins];
    displace_with(&a, &b, 0.5, Gain::Mass, NO_LIFT, &mut out);
    let (mean, sd) = moments(&out, df);
    assert!((mean - 7000.0).abs() < 1.0, "{mean}");
    assert!((sd - 500.0).abs() < 0.5, "{sd}");
}

#[test]
fn a_bump_travels_while_a_plain_blend_would_leave_two() {
    let (df, bins) = (20.0, 1201);
    let (a, b) = (gaussian(2000.0, 200.0, df, bins), gaussian(8000.0, 200.0, df, bins));
    let mut out = vec![0.0; bins];
    for (alpha, hz) in [(0.25, 3500.0), (0.5, 5000.0), (0.75, 6500.0)] {
        displace(&a, &b, alpha, Gain::Rms, &mut out);
        assert!((peak(&out) as f64 * df - hz).abs() <= df, "{}", peak(&out));
        assert!(out[100] < 1e-6 * out[peak(&out)] && out[400] < 1e-6 * out[peak(&out)]);
    }
}

fn power(a: &[f64]) -> f64 {
    a.iter().map(|v| v * v).sum()
}

#[test]
fn mass_gain_loses_1_94_decibels_half_way_between_equal_masses_of_unequal_width_and_rms_none() {
    let (df, bins) = (20.0, 1201);
    // Each is divided by its width: both have the same mass.
    let (a, b) = (gaussian(4000.0, 200.0, df, bins), gaussian(10000.0, 800.0, df, bins));
    let mut out = vec![0.0; bins];
    let mut loss = |alpha: f64, gain| {
        displace(&a, &b, alpha, gain, &mut out);
        10.0 * (power(&out) / ((1.0 - alpha) * power(&a) + alpha * power(&b))).log10()
    };
    let half = loss(0.5, Gain::Mass);
    assert!((half + 1.939).abs() < 0.002, "{half}");
    for alpha in (1..20).map(|i| f64::from(i) / 20.0) {
        let (mass, rms) = (loss(alpha, Gain::Mass), loss(alpha, Gain::Rms));
        assert!((half..0.0).contains(&mass) && rms.abs() < 1e-12, "{alpha}: {mass} {rms}");
    }
}

#[test]
fn a_floor_40_decibels_down_holds_39_percent_of_the_mass_and_draws_the_moved_peak_down() {
    // 96 kHz: bins up to 48 kHz, each at its middle, with peaks 300 Hz wide.
    let (df, bins, floor) = (5.0, 9600, 0.01);
    let peak_at = |hz: f64, level: f64, floor: f64| -> Vec<f64> {
        let at = |k: usize| (k as f64 + 0.5) * df - hz;
        (0..bins).map(|k| level * (-0.5 * (at(k) / 300.0).powi(2)).exp() + floor).collect()
    };
    let share = floor * bins as f64 / peak_at(5000.0, 1.0, floor).iter().sum::<f64>();
    assert!((share - 0.39).abs() < 0.005, "{share}");

    let mut out = vec![0.0; bins];
    let mut half_way = |floor| {
        displace(&peak_at(2000.0, 0.1, floor), &peak_at(8000.0, 1.0, floor), 0.5, Gain::Mass, &mut out);
        (out[peak(&out)], (peak(&out) as f64 + 0.5) * df - 5000.0)
    };
    let (level, shift) = half_way(floor);
    assert!((level - 0.22).abs() < 0.005, "{level}");
    assert!((shift + 140.0).abs() < 10.0, "{shift}");
    // Without the floor the level is the mean of both and the peak lies in their middle: the builder therefore
    // subtracts floors.
    let (level, shift) = half_way(0.0);
    assert!((level - 0.55).abs() < 1e-3 && shift.abs() <= df, "{level} {shift}");
}

#[test]
fn ends_and_identical_spectra_are_reproduced() {
    let a = gaussian(3000.0, 700.0, 20.0, 1201);
    let b = gaussian(9000.0, 300.0, 20.0, 1201);
    let largest = a[peak(&a)].max(b[peak(&b)]);
    let mut out = vec![0.0; 1201];
    for gain in [Gain::Mass, Gain::Rms] {
        displace_with(&a, &b, 0.0, gain, NO_LIFT, &mut out);
        close(&out, &a, 4e-13 * largest);
        displace_with(&a, &b, 1.0, gain, NO_LIFT, &mut out);
        close(&out, &b, 4e-13 * largest);
        displace_with(&a, &a, 0.37, gain, NO_LIFT, &mut out);
        close(&out, &a, 4e-13 * largest);
    }
    // As used, the lift of 1e-9 of the largest value stays in the result.
    displace(&a, &b, 0.0, Gain::Rms, &mut out);
    close(&out, &a, 2e-9 * largest);
    displace(&a, &b, 1.0, Gain::Rms, &mut out);
    close(&out, &b, 2e-9 * largest);
}

#[test]
fn two_silent_spectra_give_silence_and_one_fades_in() {
    let mut out = [1.0; 3];
    displace(&[0.0; 3], &[0.0; 3], 0.5, Gain::Rms, &mut out);
    assert_eq!(out, [0.0; 3]);
    displace(&[0.0; 3], &[0.0, 2.0, 0.0], 0.25, Gain::Rms, &mut out);
    close(&out, &[0.0, 1.0, 0.0], 1e-8);
}

fn spectra(bins: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    let one = move || prop::collection::vec(prop_oneof![Just(0.0), 1e-6..1.0_f64], bins);
    (one(), one())
}

fn knots(a: &[f64], epsilon: f64) -> Vec<f64> {
    let mut c = vec![0.0; a.len() + 1];
    distribution(a, epsilon, &mut c);
    c
}

/// Frequencies in bins below which the fractions `p` of the amplitude lie.
fn quantiles(a: &[f64], epsilon: f64, p: &[f64]) -> Vec<f64> {
    let c = knots(a, epsilon);
    p.iter()
        .map(|&p| {
            let k = c[1..].partition_point(|&c| c < p).min(a.len() - 1);
            k as f64 + (p - c[k]) / (c[k + 1] - c[k])
        })
        .collect()
}

#[test]
fn every_percentile_of_smooth_spectra_moves_linearly_to_a_twentieth_of_a_bin() {
    let (a, b) = (gaussian(4000.0, 200.0, 20.0, 1201), gaussian(10000.0, 800.0, 20.0, 1201));
    let p: Vec<f64> = (1..100).map(|k| f64::from(k) / 100.0).collect();
    let (qa, qb) = (quantiles(&a, EPSILON, &p), quantiles(&b, EPSILON, &p));
    let mut x = vec![0.0; 1201];
    for alpha in [0.1, 0.25, 0.5, 0.8] {
        displace(&a, &b, alpha, Gain::Rms, &mut x);
        for (k, q) in quantiles(&x, NO_LIFT, &p).into_iter().enumerate() {
            let expected = (1.0 - alpha) * qa[k] + alpha * qb[k];
            assert!((q - expected).abs() < 0.05, "{alpha}, {} %: {q} for {expected}", k + 1);
        }
    }
}

proptest! {
    #[test]
    fn interpolation_is_symmetric_keeps_mass_and_is_never_negative(
        (a, b) in spectra(24),
        alpha in 0.0..=1.0_f64,
    ) {
        let (mut x, mut y) = (vec![0.0; 24], vec![0.0; 24]);
        displace(&a, &b, alpha, Gain::Mass, &mut x);
        displace(&b, &a, 1.0 - alpha, Gain::Mass, &mut y);
        let mass = (1.0 - alpha) * a.iter().sum::<f64>() + alpha * b.iter().sum::<f64>();
        prop_assert!((x.iter().sum::<f64>() - mass).abs() < 1e-12 * (1.0 + mass));
        for (x, y) in x.iter().zip(&y) {
            prop_assert!(*x >= 0.0 && (x - y).abs() < 1e-6, "{} {}", x, y);
        }
    }

    #[test]
    fn every_quantile_moves_linearly(
        a in prop::collection::vec(0.1..1.0_f64, 64), b in prop::collection::vec(0.1..1.0_f64, 64), alpha in 0.0..=1.0_f64,
    ) {
        let mut x = vec![0.0; 64];
        displace(&a, &b, alpha, Gain::Mass, &mut x);
        // Inside its bins a result on the grid is constant: its quantiles are those of the blend at its edges, and
        // there exactly.
        let p = &knots(&x, NO_LIFT)[1..64];
        for (edge, (qa, qb)) in (1..).zip(quantiles(&a, EPSILON, p).into_iter().zip(quantiles(&b, EPSILON, p))) {
            let found = (1.0 - alpha) * qa + alpha * qb;
            prop_assert!((found - f64::from(edge)).abs() < 1e-10, "{} at edge {}", found, edge);
        }
    }

    #[test]
    fn a_wider_frequency_axis_widens_the_result_and_nothing_else(
        (a, b) in spectra(24), alpha in 0.0..=1.0_f64, wider in 2_usize..6,
    ) {
        let widen = |a: &[f64]| -> Vec<f64> { a.iter().flat_map(|v| vec![*v; wider]).collect() };
        let (mut x, mut y) = (vec![0.0; 24], vec![0.0; 24 * wider]);
        displace(&a, &b, alpha, Gain::Mass, &mut x);
        displace(&widen(&a), &widen(&b), alpha, Gain::Mass, &mut y);
        for (x, y) in x.iter().zip(y.chunks(wider)) {
            // Where both spectra are silent a quantile crosses many bins within the lift of 1e-9, which costs digits.
            prop_assert!((x - y.iter().sum::<f64>() / wider as f64).abs() < 1e-6, "{} {:?}", x, y);
        }
    }

    #[test]
    fn any_numbers_are_accepted(
        a in prop::collection::vec(prop::num::f64::ANY, 0..9),
        b in prop::collection::vec(prop::num::f64::ANY, 0..9),
        alpha in prop::num::f64::ANY,
    ) {
        let mut out = [0.0; 8];
        displace(&a, &b, alpha, Gain::Rms, &mut out);
        prop_assert_eq!(out.len(), 8);
    }
}
