use super::*;

fn toward(azimuth: f64, elevation: f64) -> Vec3 {
    // Azimuth to the right, as in the tables.
    let (a, e) = (azimuth.to_radians(), elevation.to_radians());
    [a.cos() * e.cos(), -a.sin() * e.cos(), e.sin()]
}

#[test]
fn the_shadow_has_the_gains_and_coefficients_of_the_table() {
    let head = Head::default();
    let rows = [
        (0.0, 2.0, 6.02, Some([1.960_769, -1.882_306])),
        (90.0, 0.7564, -2.42, Some([0.765_989, -0.687_527])),
        (150.0, 0.1, -20.0, Some([0.135_308, -0.056_845])),
        (180.0, 0.2814, -11.01, None),
    ];
    for (degrees, alpha, db, coefficients) in rows {
        let theta = f64::to_radians(degrees);
        let gain = head.high_gain(theta);
        assert!((gain - alpha).abs() < 5e-5, "{degrees}: {gain}");
        assert!((20.0 * gain.log10() - db).abs() < 0.01, "{degrees}: {gain}");
        let [b0, b1, a1] = head.shadow(theta, 96_000.0);
        assert!((a1 + 0.921_537).abs() < 1e-6);
        assert!(((b0 + b1) / (1.0 + a1) - 1.0).abs() < 1e-12, "low frequencies pass");
        assert!(((b0 - b1) / (1.0 - a1) - gain).abs() < 1e-12);
        if let Some([c0, c1]) = coefficients {
            assert!((b0 - c0).abs() < 1e-6 && (b1 - c1).abs() < 1e-6, "{degrees}: {b0} {b1}");
        }
    }
}

#[test]
fn the_ears_differ_in_time_and_level_as_in_the_table() {
    let head = Head::default();
    let rows = [(30.0, 265.3, 388.7, 16.0), (60.0, 507.1, 706.7, 22.9), (90.0, 607.4, 836.6, 20.7)];
    for (azimuth, geometric, low, level) in rows {
        let [near, far] = [Ear::Right, Ear::Left].map(|ear| head.incidence(ear, toward(azimuth, 0.0)));
        let itd = 1e6 * (head.delay(far) - head.delay(near));
        assert!((itd - geometric).abs() < 0.1, "{azimuth}: {itd}");
        let group = |theta: f64| 1e6 * (1.0 - head.high_gain(theta)) * head.centre_delay() / 2.0;
        let itd = itd + group(far) - group(near);
        assert!((itd - low).abs() < 0.1, "{azimuth}: {itd}");
        let found = 20.0 * (head.high_gain(near) / head.high_gain(far)).log10();
        assert!((found - level).abs() < 0.06, "{azimuth}: {found}");
    }
    let side = Head { ear_azimuth: FRAC_PI_2, ..head };
    let [near, far] = [Ear::Right, Ear::Left].map(|ear| side.incidence(ear, toward(90.0, 0.0)));
    assert!((1e6 * (side.delay(far) - side.delay(near)) - 655.8).abs() < 0.1);
    assert!((1e6 * head.max_delay() - 655.8).abs() < 0.1);
}

#[test]
fn interaural_level_differences_follow_the_head_shadow_to_a_hundredth_of_a_decibel() {
    // The formula in degrees, with the angle between two unit vectors from its cosine.
    let alpha = |azimuth: f64, elevation: f64, ear: f64| {
        let cosine = elevation.to_radians().cos() * (azimuth - ear).to_radians().cos();
        let theta = cosine.acos().to_degrees();
        1.05 + 0.95 * (1.2 * theta).to_radians().cos()
    };
    let decibels = |near: f64, far: f64| 20.0 * (near / far).log10();
    let mut max_difference = 0.0_f64;
    for azimuth in (-180..180).step_by(5).map(f64::from) {
        for elevation in [-40.0, 0.0, 25.0, 70.0] {
            let expected = decibels(alpha(azimuth, elevation, 100.0), alpha(azimuth, elevation, -100.0));
            let [right, left] = [Ear::Right, Ear::Left]
                .map(|ear| Head::default().ear(ear, toward(azimuth, elevation), 96_000.0));
            // Gain of the filters at half the rate.
            let high = |f: EarFilter| (f.shadow[0] - f.shadow[1]) / (1.0 - f.shadow[2]);
            let found = decibels(high(right), high(left));
            assert!((found - expected).abs() < 0.01, "{azimuth}, {elevation}: {found} for {expected}");
            max_difference = max_difference.max(found);
        }
    }
    assert!(max_difference > 20.0, "{max_difference}");
    for (azimuth, level) in [(30.0, 16.0), (60.0, 22.9), (90.0, 20.7)] {
        let found = decibels(alpha(azimuth, 0.0, 100.0), alpha(azimuth, 0.0, -100.0));
        assert!((found - level).abs() < 0.05, "{azimuth}: {found}");
    }
}

#[test]
fn mirrored_directions_give_the_other_ear_bit_for_bit_and_the_front_gives_both_the_same() {
    let head = Head { pinna: Some(PinnaSet::Set0), shoulder: 0.2, ..Head::default() };
    for k in 0..400 {
        let d = toward(f64::from(k) * 7.3, f64::from(k % 37) * 5.0 - 90.0);
        let mirrored = [d[0], -d[1], d[2]];
        let (left, right) = (head.ear(Ear::Left, d, 48_000.0), head.ear(Ear::Right, mirrored, 48_000.0));
        assert_eq!(left, right);
        assert!(left.delay >= 0.0 && left.delay <= head.max_delay() + 1e-15);
        assert!(left.pinna.iter().all(|t| *t >= 2.0 / PINNA_RATE - 1e-12 && *t <= PINNA_MAX_DELAY + 1e-12));
        assert!((0.0..=SHOULDER_MAX_DELAY).contains(&left.shoulder));
    }
    for d in [[1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]] {
        assert_eq!(head.ear(Ear::Left, d, 48_000.0), head.ear(Ear::Right, d, 48_000.0));
    }
}

#[test]
fn a_source_inside_the_head_has_the_filter_of_its_surface() {
    let head = Head { pinna: Some(PinnaSet::Set0), shoulder: 0.2, ..Head::default() };
    let distance = crate::spatial::Distance::default();
    let at = |azimuth: f64, d: f64| toward(azimuth, 15.0).map(|x| x * d);
    for azimuth in [0.0, 40.0, -110.0, 180.0] {
        for ear in [Ear::Left, Ear::Right] {
            let surface = head.ear(ear, at(azimuth, head.radius), 48_000.0);
            for d in [1e-9, 0.01, 0.04, 0.087] {
                let inside = head.ear(ear, at(azimuth, d), 48_000.0);
                let numbers = |f: &EarFilter| [&f.shadow[..], &[f.delay, f.shoulder], &f.pinna].concat();
                let differences =
                    numbers(&inside).into_iter().zip(numbers(&surface)).map(|(a, b)| (a - b).abs());
                assert!(differences.fold(0.0, f64::max) < 1e-12, "{azimuth} {d}: {inside:?} {surface:?}");
                // The gain is that at 0.1 m.
                assert_eq!(distance.gain_at(at(azimuth, d)), 10.0);
            }
            assert!(distance.gain_at(at(azimuth, 0.101)) < 10.0);
        }
    }
    // The centre has no direction: it is treated as in front.
    let middle = head.ear(Ear::Left, [0.0; 3], 48_000.0);
    assert_eq!(middle, head.ear(Ear::Left, [head.radius, 0.0, 0.0], 48_000.0));
}

#[test]
fn the_pinna_delays_are_samples_at_44100() {
    let head = Head { pinna: Some(PinnaSet::Set0), ..Head::default() };
    // Straight ahead: cos 0 = 1, sin 90 = 1 for the first and sin 45 for the others.
    let expected = [1.0 + 2.0, 5.0 * 0.5_f64.sqrt() + 4.0, 5.0 * 0.5_f64.sqrt() + 7.0];
    for (found, samples) in head.pinna_delays([1.0, 0.0, 0.0]).iter().zip(expected) {
        assert!((found * 44_100.0 - samples).abs() < 1e-9, "{found}");
    }
    assert!((head.pinna_delays([0.0, 0.0, 1.0])[4] * 44_100.0 - 13.0).abs() < 1e-9);
    let other = Head { pinna: Some(PinnaSet::Set1), ..head };
    let angle = 0.35 * FRAC_PI_2;
    assert!((other.pinna_delays([1.0, 0.0, 0.0])[1] * 44_100.0 - 5.0 * angle.sin() - 4.0).abs() < 1e-9);
    assert!(PINNA_LEVELS.iter().sum::<f64>().abs() < 1e-15, "low frequencies pass");
}

#[test]
fn the_response_is_one_at_low_and_the_shadow_at_high_frequencies() {
    let head = Head::default();
    let filter = head.ear(Ear::Left, toward(-60.0, 0.0), 48_000.0);
    let [re, im] = head.response(&filter, 0.0, 48_000.0);
    assert!((re - 1.0).abs() < 1e-12 && im.abs() < 1e-12);
    let [re, im] = head.response(&filter, 24_000.0, 48_000.0);
    let gain = head.high_gain(head.incidence(Ear::Left, toward(-60.0, 0.0)));
    assert!((re.hypot(im) - gain).abs() < 1e-9);
}
