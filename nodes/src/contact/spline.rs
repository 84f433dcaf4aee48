//! A speed between the samples: the shape-preserving cubic that never swings below 0.
//!
//! Catmull-Rom tangents through 0, 0, 0, 1, 1, 1 reach -0.074 and 1.074. PCHIP stays between neighbouring samples.
//!
//! # Source
//! Fritsch and Butland 1984: slopes are weighted harmonic means of the neighbouring secants, as in SciPy and MATLAB. It is
//! not the algorithm of Fritsch and Carlson 1980.

/// The slopes of the cubic at its knots.
///
/// # Shapes
/// `times`, strictly increasing, `values` and `slopes` have the same length; the shortest counts. One knot has slope 0.
///
/// # Complexity
/// O(n). Never allocates.
pub fn slopes(times: &[f64], values: &[f64], slopes: &mut [f64]) {
    let n = times.len().min(values.len()).min(slopes.len());
    let step = |k: usize| times[k + 1] - times[k];
    let secant = |k: usize| (values[k + 1] - values[k]) / step(k);
    match n {
        0 => {}
        1 => slopes[0] = 0.0,
        2 => slopes[..2].fill(secant(0)),
        _ => {
            slopes[0] = end_slope(step(0), step(1), secant(0), secant(1));
            for (k, slope) in slopes.iter_mut().enumerate().take(n - 1).skip(1) {
                *slope = inner_slope(step(k - 1), step(k), secant(k - 1), secant(k));
            }
            slopes[n - 1] = end_slope(step(n - 2), step(n - 3), secant(n - 2), secant(n - 3));
        }
    }
}

/// The cubic's value at time `t`: 0 before the first knot and after the last, and never below 0.
///
/// # Complexity
/// O(log n).
#[must_use]
pub fn evaluate(times: &[f64], values: &[f64], slopes: &[f64], t: f64) -> f64 {
    let n = times.len().min(values.len()).min(slopes.len());
    let times = &times[..n];
    let after = times.partition_point(|&knot| knot <= t);
    if after == 0 {
        return 0.0;
    }
    let k = after - 1;
    if after == n {
        return if t == times[k] { values[k].max(0.0) } else { 0.0 };
    }
    let h = times[k + 1] - times[k];
    let u = (t - times[k]) / h;
    hermite(u, values[k], h * slopes[k], values[k + 1], h * slopes[k + 1]).max(0.0)
}

#[inline]
fn hermite(u: f64, s0: f64, m0: f64, s1: f64, m1: f64) -> f64 {
    let v = 1.0 - u;
    // The textbook's four weights, with those of s0 and s1 folded into a step: equal samples then give exactly themselves.
    s0 + u * u * (3.0 - 2.0 * u) * (s1 - s0) + u * v * (v * m0 - u * m1)
}

/// Slope between two pieces of lengths `h0`, `h1` with secants `d0`, `d1`.
#[inline]
fn inner_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
    (w0 + w1) / (w0 / d0 + w1 / d1)
}

/// Slope at an end, from the piece there and the piece next to it.
#[inline]
fn end_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    // Compared by sign with zero its own sign, as in SciPy; products would lose tiny speeds.
    let sign = |x: f64| i32::from(x > 0.0) - i32::from(x < 0.0);
    if sign(slope) != sign(d0) {
        0.0
    } else if sign(d0) != sign(d1) && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

/// Which of the two outer samples around a piece exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbours {
    /// Whether there is a sample before the piece; if not, it is the first of the series.
    pub before: bool,
    /// Whether there is a sample after the piece; if not, it is the last of the series.
    pub after: bool,
}

/// Evaluates one piece of many series at once, for samples at equal distances.
///
/// `samples` are those at k - 1, k, k + 1 and k + 2; `u` in 0 ..= 1 is the place between k and k + 1. An absent neighbour's
/// slice may be empty. Gives what [`slopes`] and [`evaluate`] give, with the distance as the unit of time.
///
/// # Shapes
/// One series per element of `out`; the samples that exist have at least that many elements.
///
/// # Complexity
/// O(V). Never allocates.
pub fn eval_uniform(samples: [&[f32]; 4], neighbours: Neighbours, u: f64, out: &mut [f32]) {
    let [before, start, end, after] = samples;
    let mut count = out.len().min(start.len()).min(end.len());
    if neighbours.before {
        count = count.min(before.len());
    }
    if neighbours.after {
        count = count.min(after.len());
    }
    for (v, out) in out.iter_mut().take(count).enumerate() {
        let (s0, s1) = (f64::from(start[v]), f64::from(end[v]));
        let d = s1 - s0;
        let d_before = if neighbours.before { s0 - f64::from(before[v]) } else { d };
        let d_after = if neighbours.after { f64::from(after[v]) - s1 } else { d };
        let m0 = match neighbours {
            Neighbours { before: true, .. } => inner_slope(1.0, 1.0, d_before, d),
            Neighbours { after: true, .. } => end_slope(1.0, 1.0, d, d_after),
            _ => d,
        };
        let m1 = match neighbours {
            Neighbours { after: true, .. } => inner_slope(1.0, 1.0, d, d_after),
            Neighbours { before: true, .. } => end_slope(1.0, 1.0, d, d_before),
            _ => d,
        };
        *out = hermite(u, s0, m0, s1, m1).max(0.0) as f32;
    }
}

/// The live variant: straight lines from one sample to the next, which needs no sample beyond them.
///
/// # Complexity
/// O(V). Never allocates.
pub fn eval_linear(start: &[f32], end: &[f32], u: f32, out: &mut [f32]) {
    for ((out, &s0), &s1) in out.iter_mut().zip(start).zip(end) {
        *out = ((1.0 - u) * s0 + u * s1).max(0.0);
    }
}

#[cfg(test)]
mod tests {
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

    // Made by tests/oracles/pchip.py with SciPy.
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

    /// The same spline in other terms: Brodlie's form of the slopes, and the four textbook weights.
    fn by_the_book(t: &[f64], s: &[f64], k: usize, u: f64) -> f64 {
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
            // With rests and plateaus, as speeds have them.
            let s: Vec<f64> = (0..n).map(|_| rng.between(-1.0, 3.0).clamp(0.0, 2.5)).collect();
            let largest = s.iter().copied().fold(1e-300, f64::max);
            let f = spline(&t, &s);
            for k in 0..n - 1 {
                for _ in 0..8 {
                    let at = t[k] + rng.uniform() * (t[k + 1] - t[k]);
                    let expected = by_the_book(&t, &s, k, (at - t[k]) / (t[k + 1] - t[k]));
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
        let (mut least, mut most) = (0.0_f64, 0.0_f64);
        for i in 0..500 {
            let value = s(f64::from(i) * 0.01);
            assert!((0.0..=1.0).contains(&value), "{value} at {i}");
            if (100..400).contains(&i) {
                let other = catmull_rom(i as usize / 100, f64::from(i % 100) * 0.01);
                (least, most) = (least.min(other), most.max(other));
            }
        }
        // Two thirds of the way to the step, and a third behind it.
        assert!((least + 0.074).abs() < 1e-4 && (most - 1.074).abs() < 1e-4, "{least} {most}");
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
    fn the_live_variant_is_the_straight_line() {
        let mut out = [0.0; 2];
        eval_linear(&[0.0, 2.0], &[1.0, 4.0], 0.25, &mut out);
        assert_eq!(out, [0.25, 2.5]);
    }

    proptest! {
        #[test]
        fn pieces_of_many_series_equal_the_whole_series(
            series in prop::collection::vec(prop::collection::vec(0.0..3.0f32, 5), 1..4), n in 2usize..6, u in 0.0..1.0f64,
        ) {
            let n = n.min(5);
            for k in 0..n - 1 {
                let row = |i: usize| series.iter().map(|s| s[i]).collect::<Vec<f32>>();
                let rows = [if k > 0 { row(k - 1) } else { vec![] }, row(k), row(k + 1), if k + 2 < n { row(k + 2) } else { vec![] }];
                let mut out = vec![0.0; series.len()];
                let neighbours = Neighbours { before: k > 0, after: k + 2 < n };
                eval_uniform([&rows[0], &rows[1], &rows[2], &rows[3]], neighbours, u, &mut out);
                for (s, &found) in series.iter().zip(&out) {
                    let times: Vec<f64> = (0..n).map(|i| i as f64).collect();
                    let values: Vec<f64> = s[..n].iter().map(|&x| f64::from(x)).collect();
                    let expected = spline(&times, &values)(k as f64 + u);
                    prop_assert!((f64::from(found) - expected).abs() < 1e-6, "{} against {}", found, expected);
                }
            }
        }

        #[test]
        fn every_piece_only_rises_or_only_falls(
            values in prop::collection::vec(prop_oneof![Just(0.0), 0.0..3.0f64], 7), steps in prop::collection::vec(0.01..2.0f64, 7),
        ) {
            let times: Vec<f64> = steps.iter().scan(0.0, |t, h| { *t += h; Some(*t) }).collect();
            let s = spline(&times, &values);
            for k in 0..6 {
                let way = (values[k + 1] - values[k]).signum();
                let mut last = values[k];
                for i in 1..=200 {
                    let value = if i == 200 { values[k + 1] } else { s(times[k] + f64::from(i) * 0.005 * (times[k + 1] - times[k])) };
                    // The last bits may go the other way, and where both ends are one value there is no way at all.
                    prop_assert!(way * (value - last) >= -2e-15, "{} after {} in piece {}", value, last, k);
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
}
