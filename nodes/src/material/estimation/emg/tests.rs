use super::*;

fn close(found: f64, exact: f64, digits: f64) -> bool {
    (found - exact).abs() <= digits * exact.abs().max(1e-300)
}

/// `y, c, sigma, eta`, log density and its gradient, from 50-digit arithmetic.
const GOLDEN: [([f64; 4], f64, [f64; 3]); 8] = [
    ([5.0, 3.0, 0.5, 0.4], -1.696_363_082_535_33, [0.399_416_063_902, 0.038_773_734_193_7, 0.239_941_606_39]),
    ([3.0, 3.0, 0.5, 0.4], -1.762_030_254_555_75, [-1.458_831_696_17, -0.145_883_169_617, 0.854_116_830_383]),
    ([1.0, 3.0, 0.5, 0.4], -11.320_603_381_475_2, [-8.433_234_865_47, 16.823_146_244_4, 0.956_676_513_453]),
    (
        [3.0, 3.0, 1e-4, 0.4],
        -1.609_469_827_525_83,
        [-7_978.700_257_68, -3.191_480_103_07e-5, 0.999_968_085_199],
    ),
    ([40.0, 3.0, 0.5, 0.4], -15.696_290_731_874_2, [0.4, 0.04, -13.76]),
    ([3.2, 3.0, 0.1, 1e4], -0.614_352_441_549_466, [19.989_979_98, 2.995_994_000_03, -0.002_001_995_977_97]),
    ([-100.0, 3.0, 0.5, 0.4], -21_225.164_099_354_5, [-412.009_698_865, 42_436.998_013_2, 0.999_030_113_514]),
    ([1e6, 3.0, 0.5, 0.4], -399_999.696_290_732, [0.4, 0.04, -399_997.76]),
];

#[test]
fn densities_and_gradients_have_all_digits_of_the_golden_table() {
    for ([y, c, sigma, eta], log_density, gradient) in GOLDEN {
        let emg = Emg { c, sigma, eta };
        let found = emg.log_density(y);
        assert!(close(found, log_density, 3e-15), "{y}: {found:.15}, not {log_density:.15}");
        for (found, exact) in emg.gradient(y).into_iter().zip(gradient) {
            // The table has twelve digits.
            assert!(close(found, exact, 5e-12), "{y}: {found:.12e}, not {exact:.12e}");
        }
    }
}

#[test]
fn the_hazard_keeps_its_digits_where_a_difference_loses_them() {
    for (v, m, q, dq) in [
        (-1.0, 0.287_599_970_939_178, -1.287_599_970_939_18, 0.629_686_285_776_605),
        (0.0, 0.797_884_560_802_865, -0.797_884_560_802_865, 0.363_380_227_632_419),
        (5.0, 5.186_503_967_125_84, -0.186_503_967_125_842, 0.032_696_434_617_112_2),
        (20.0, 20.049_753_068_527_9, -0.049_753_068_527_850_5, 0.002_463_261_615_052_16),
        (1000.0, 1_000.000_999_998, -0.000_999_998_000_01, 9.999_940_000_499_99e-7),
    ] {
        let h = hazard(v);
        assert!(close(h.m, m, 5e-15) && close(h.q, q, 5e-15) && close(h.dq, dq, 5e-15), "{v}: {h:?}");
    }
    // Both forms agree where one takes over from the other.
    for v in [3.999_999_f64, 5.999, 7.999, 11.999, 19.999, 39.999, 0.999e8] {
        let (a, b) = (hazard(v), hazard(v * 1.000_001));
        assert!(close(a.q, b.q, 3e-6) && close(a.dq, b.dq, 3e-6), "{v}: {a:?} {b:?}");
    }
    assert_eq!(hazard(-50.0), Hazard { m: 0.0, q: -50.0, dq: 1.0 });
}

#[test]
fn derivatives_agree_with_differences() {
    for u in [-6.0, -2.0, -0.3, 0.4, 3.0, 20.0] {
        for k in [1e-3, 0.1, 1.0, 5.0, 30.0] {
            for (name, f) in
                [("density", terms as fn(f64, f64) -> Terms), ("survivor", negative_log_survivor)]
            {
                let (t, du, dk) = (f(u, k), 1e-5, 1e-5 * k);
                let (up, down) = (f(u + du, k), f(u - du, k));
                let (kp, kd) = (f(u, k + dk), f(u, k - dk));
                for (what, found, exact) in [
                    ("u", (up.value - down.value) / (2.0 * du), t.u),
                    ("k", (kp.value - kd.value) / (2.0 * dk), t.k),
                    ("uu", (up.u - down.u) / (2.0 * du), t.uu),
                    ("uk", (up.k - down.k) / (2.0 * du), t.uk),
                    ("ku", (kp.u - kd.u) / (2.0 * dk), t.uk),
                    ("kk", (kp.k - kd.k) / (2.0 * dk), t.kk),
                ] {
                    let scale = exact.abs().max(1e-3 * (1.0 + t.value.abs()) / k.min(1.0));
                    assert!(
                        (found - exact).abs() < 1e-5 * scale,
                        "{name} at u = {u}, k = {k}: d/d{what} is {exact}, differences give {found}"
                    );
                }
            }
        }
    }
    assert_eq!(terms(0.3, 0.2).value, log_shape(0.3, 0.2));
}

#[test]
fn probabilities_and_posterior_parts_are_those_of_the_convolution() {
    let emg = Emg { c: 3.0, sigma: 0.5, eta: 0.4 };
    let (mut total, mut mean, step) = (0.0, 0.0, 0.002);
    let mut y = -2.0;
    while y < 60.0 {
        let p = libm::exp(emg.log_density(y)) * step;
        let (e, variance) = emg.excess(y);
        total += p;
        mean += p * e;
        assert!(e > 0.0 && variance > 0.0 && variance < 0.25 + 1e-12);
        assert!((emg.cdf(y) + emg.survivor(y) - 1.0).abs() < 1e-14);
        y += step;
    }
    // The mean of all posterior means is the mean of the excess.
    assert!((total - 1.0).abs() < 1e-9 && (mean - 2.5).abs() < 1e-6, "{total} {mean}");
    assert!((emg.cdf(5.0) - 0.541_595_482_231_184_8).abs() < 1e-15);
}

#[test]
fn both_limits_are_legal() {
    let bare = Emg { c: 3.0, sigma: 0.0, eta: 0.4 };
    assert_eq!(bare.log_density(2.9), f64::NEG_INFINITY);
    assert!((bare.log_density(5.0) - (0.4_f64.ln() - 0.8)).abs() < 1e-15);
    assert_eq!((bare.gradient(5.0)[0], bare.cdf(3.0), bare.excess(4.0)), (0.4, 0.0, (1.0, 0.0)));
    let near = Emg { sigma: 1e-7, ..bare };
    assert!((near.log_density(5.0) - bare.log_density(5.0)).abs() < 1e-7);
    let normal = Emg { c: 3.0, sigma: 0.5, eta: f64::INFINITY };
    let steep = Emg { eta: 1e7, ..normal };
    assert!((normal.log_density(3.4) - steep.log_density(3.4)).abs() < 1e-5);
    assert!((normal.cdf(3.4) - steep.cdf(3.4)).abs() < 1e-6);
    for y in [-1e300, -1e10, 1e10, 1e300] {
        let near = Emg { c: 3.0, sigma: 1e-3, eta: 0.4 };
        assert!(!near.log_density(y).is_nan() && !near.survivor(y).is_nan() && !near.cdf(y).is_nan(), "{y}");
    }
}
