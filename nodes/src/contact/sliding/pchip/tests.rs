use super::*;
use proptest::prelude::*;

fn spline(times: &[f64], values: &[f64]) -> impl Fn(f64) -> f64 {
    let mut m = vec![0.0; times.len()];
    slopes(times, values, &mut m);
    let (times, values) = (times.to_vec(), values.to_vec());
    move |t| evaluate(&times, &values, &m, t)
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= tolerance * (1.0 + e.abs()), "{found:?} against {expected:?}");
    }
}

#[test]
fn a_rise_a_hold_and_a_fall_have_the_known_slopes_and_midpoints() {
    let (t, s) = ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 0.0, 2.0, 3.0, 3.0, 0.0]);
    let mut m = [9.0; 6];
    slopes(&t, &s, &mut m);
    assert_close(&m, &[0.0, 0.0, 4.0 / 3.0, 0.0, 0.0, -4.5], 1e-15);
    let mid = spline(&t, &s);
    let found: Vec<f64> = (0..5).map(|k| mid(f64::from(k) + 0.5)).collect();
    assert_close(&found, &[0.0, 0.833_333_333_333_333_3, 2.666_666_666_666_666_5, 3.0, 2.0625], 1e-15);
}

// Values from tests/oracles/pchip.py with SciPy.
#[test]
fn uneven_knots_give_the_slopes_and_values_that_scipy_gives() {
    let check = |t: &[f64], s: &[f64], expected_slopes: &[f64], at: &[f64], values: &[f64]| {
        let mut m = vec![9.0; t.len()];
        slopes(t, s, &mut m);
        assert_close(&m, expected_slopes, 1e-14);
        let f = spline(t, s);
        assert_close(&at.iter().map(|&t| f(t)).collect::<Vec<f64>>(), values, 1e-14);
    };
    check(
        &[0.0, 0.4, 0.5, 1.7, 2.0, 3.1],
        &[0.3, 0.9, 0.85, 0.2, 0.0, 1.4],
        &[3.100000000000001, 0.0, -0.5141987829614608, -0.6103286384976524, 0.0, 2.7965367965367958],
        &[0.12, 0.43000000000000005, 0.8600000000000001, 1.79, 2.33],
        &[
            0.6118800000000001,
            0.8924394523326572,
            0.6650361797560207,
            0.12988450704225346,
            0.10860000000000004,
        ],
    );
    check(
        &[0.0, 0.25, 1.5, 1.75],
        &[1.0, 0.9, 2.5, 0.1],
        &[-0.6799999999999998, 0.0, 0.0, -11.41333333333333],
        &[0.075, 0.625, 1.5750000000000002],
        &[0.9534100000000001, 1.2456, 2.1613599999999984],
    );
    check(
        &[0.0, 0.1, 0.35],
        &[0.0, 1.0, 0.9],
        &[12.971428571428572, 0.0, -1.2000000000000002],
        &[0.03, 0.175],
        &[0.40668, 0.9973],
    );
}

/// The same spline by Brodlie's form of the slopes and the four textbook weights.
fn textbook_value(t: &[f64], s: &[f64], k: usize, u: f64) -> f64 {
    let h: Vec<f64> = t.windows(2).map(|t| t[1] - t[0]).collect();
    let d: Vec<f64> = s.windows(2).zip(&h).map(|(s, h)| (s[1] - s[0]) / h).collect();
    let end = |k: usize, next: usize| {
        let m = d[k] + h[k] * (d[k] - d[next]) / (h[k] + h[next]);
        match () {
            () if m * d[k] <= 0.0 => 0.0,
            () if d[k] * d[next] <= 0.0 && m.abs() > 3.0 * d[k].abs() => 3.0 * d[k],
            () => m,
        }
    };
    let last = h.len();
    let slope = |k: usize| match k {
        0 => end(0, 1),
        k if k == last => end(last - 1, last - 2),
        k if d[k - 1] * d[k] <= 0.0 => 0.0,
        k => {
            let a = (h[k - 1] + 2.0 * h[k]) / (3.0 * (h[k - 1] + h[k]));
            d[k - 1] * d[k] / (a * d[k] + (1.0 - a) * d[k - 1])
        }
    };
    let v = 1.0 - u;
    let (m0, m1) = (h[k] * slope(k), h[k] * slope(k + 1));
    (1.0 + 2.0 * u) * v * v * s[k] + u * v * v * m0 + u * u * (3.0 - 2.0 * u) * s[k + 1] - u * u * v * m1
}

#[test]
fn two_hundred_uneven_series_equal_the_formula_to_2e_15() {
    let mut rng = crate::core::random::Rng::new(3);
    for _ in 0..200 {
        let n = 3 + rng.below(20);
        let t: Vec<f64> = (0..n)
            .scan(0.0, |t, _| {
                *t += rng.between(0.01, 2.0);
                Some(*t)
            })
            .collect();
        // With zeros and plateaus, as in speeds.
        let s: Vec<f64> = (0..n).map(|_| rng.between(-1.0, 3.0).clamp(0.0, 2.5)).collect();
        let largest = s.iter().copied().fold(1e-300, f64::max);
        let f = spline(&t, &s);
        for k in 0..n - 1 {
            for _ in 0..8 {
                let at = t[k] + rng.uniform() * (t[k + 1] - t[k]);
                let expected = textbook_value(&t, &s, k, (at - t[k]) / (t[k + 1] - t[k]));
                assert!(
                    (f(at) - expected).abs() <= 2e-15 * largest,
                    "{} for {expected} at {at}: {t:?} {s:?}",
                    f(at)
                );
            }
        }
    }
}

#[test]
fn a_step_does_not_overshoot_where_catmull_rom_does() {
    let steps = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    let s = spline(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &steps);
    let catmull_rom = |k: usize, u: f64| {
        let slope = |k: usize| 0.5 * (steps[k + 1] - steps[k - 1]);
        hermite(u, steps[k], slope(k), steps[k + 1], slope(k + 1))
    };
    let (mut min, mut max) = (0.0_f64, 0.0_f64);
    for i in 0..500 {
        let value = s(f64::from(i) * 0.01);
        assert!((0.0..=1.0).contains(&value), "{value} at {i}");
        if (100..400).contains(&i) {
            let other = catmull_rom(i as usize / 100, f64::from(i % 100) * 0.01);
            (min, max) = (min.min(other), max.max(other));
        }
    }
    // Extremes two thirds of a segment before the step, and a third after it.
    assert!((min + 0.074).abs() < 1e-4 && (max - 1.074).abs() < 1e-4, "{min} {max}");
    assert!((catmull_rom(1, 2.0 / 3.0) + 2.0 / 27.0).abs() < 1e-15);
    assert_eq!((s(2.0), s(2.5), s(3.0)), (0.0, 0.5, 1.0));
}

#[test]
fn outside_the_samples_the_speed_is_zero_and_two_samples_make_a_line() {
    let s = spline(&[1.0, 3.0], &[2.0, 4.0]);
    assert_eq!([s(0.999), s(1.0), s(1.5), s(3.0), s(3.001)], [0.0, 2.0, 2.5, 4.0, 0.0]);
    assert_eq!(spline(&[], &[])(0.0), 0.0);
    assert_eq!((spline(&[1.0], &[2.0])(1.0), spline(&[1.0], &[2.0])(1.1)), (2.0, 0.0));
}

#[test]
fn linear_interpolation_is_a_straight_line() {
    let mut out = [0.0; 2];
    eval_linear(&[0.0, 2.0], &[1.0, 4.0], 0.25, &mut out);
    assert_eq!(out, [0.25, 2.5]);
}

proptest! {
    #[test]
    fn segments_of_several_series_equal_the_complete_series(
        series in prop::collection::vec(prop::collection::vec(0.0..3.0f32, 5), 1..4), n in 2usize..6, u in 0.0..1.0f64,
    ) {
        let n = n.min(5);
        for k in 0..n - 1 {
            let row = |i: usize| series.iter().map(|s| s[i]).collect::<Vec<f32>>();
            let rows = [if k > 0 { row(k - 1) } else { vec![] }, row(k), row(k + 1), if k + 2 < n { row(k + 2) } else { vec![] }];
            let mut out = vec![0.0; series.len()];
            let outer = OuterSamples { before: k > 0, after: k + 2 < n };
            eval_uniform([&rows[0], &rows[1], &rows[2], &rows[3]], outer, u, &mut out);
            for (s, &found) in series.iter().zip(&out) {
                let times: Vec<f64> = (0..n).map(|i| i as f64).collect();
                let values: Vec<f64> = s[..n].iter().map(|&x| f64::from(x)).collect();
                let expected = spline(&times, &values)(k as f64 + u);
                prop_assert!((f64::from(found) - expected).abs() < 1e-6, "{} against {}", found, expected);
            }
        }
    }

    #[test]
    fn every_segment_is_monotonic(
        values in prop::collection::vec(prop_oneof![Just(0.0), 0.0..3.0f64], 7), steps in prop::collection::vec(0.01..2.0f64, 7),
    ) {
        let times: Vec<f64> = steps.iter().scan(0.0, |t, h| { *t += h; Some(*t) }).collect();
        let s = spline(&times, &values);
        for k in 0..6 {
            let sign = (values[k + 1] - values[k]).signum();
            let mut last = values[k];
            for i in 1..=200 {
                let value = if i == 200 { values[k + 1] } else { s(times[k] + f64::from(i) * 0.005 * (times[k + 1] - times[k])) };
                // The last bits may be of the other sign, and between equal ends the sign has no meaning.
                prop_assert!(sign * (value - last) >= -2e-15, "{} after {} in segment {}", value, last, k);
                prop_assert!(values[k] != values[k + 1] || value == values[k]);
                last = value;
            }
        }
    }

    #[test]
    fn values_stay_between_the_neighbouring_samples(
        values in prop::collection::vec(0.0..3.0f64, 2..8), steps in prop::collection::vec(0.01..2.0f64, 7), u in 0.0..1.0f64,
    ) {
        let times: Vec<f64> = steps.iter().scan(0.0, |t, h| { *t += h; Some(*t) }).take(values.len()).collect();
        let s = spline(&times[..values.len().min(7)], &values[..values.len().min(7)]);
        for k in 0..values.len().min(7) - 1 {
            let value = s(times[k] + u * (times[k + 1] - times[k]));
            let (lo, hi) = (values[k].min(values[k + 1]), values[k].max(values[k + 1]));
            prop_assert!((lo - 1e-12..=hi + 1e-12).contains(&value));
        }
    }
}
