use std::f64::consts::PI;

use super::super::head::PinnaSet;
use super::*;

fn impulse(head: Head, room: f64, fs: f64, direction: Vec3) -> ([Vec<f64>; 2], usize) {
    let mut binaural = Binaural::new(head, room, fs);
    let len = (0.04 * fs) as usize;
    let mut x = vec![0.0; len];
    x[0] = 1.0;
    let mut out = vec![0.0; 2 * len];
    binaural.process(0, &x, &mut out, |_| direction);
    let ear = |k: usize| out.iter().skip(k).step_by(2).map(|x| f64::from(*x)).collect();
    ([ear(0), ear(1)], binaural.lag())
}

fn side(azimuth: f64) -> Vec3 {
    let a = f64::to_radians(azimuth);
    [a.cos(), -a.sin(), 0.1]
}

/// Returns the group delay at DC in s: the first moment of the impulse response.
fn moment(h: &[f64], lag: usize, fs: f64) -> f64 {
    let sum: f64 = h.iter().sum();
    (h.iter().enumerate().map(|(n, x)| n as f64 * x).sum::<f64>() / sum - lag as f64) / fs
}

#[test]
fn delays_are_the_same_in_seconds_at_every_rate() {
    for pinna in [None, Some(PinnaSet::Set0)] {
        let head = Head { pinna, ..Head::default() };
        for azimuth in [0.0, 30.0, -75.0, 160.0] {
            let expected = [Ear::Left, Ear::Right].map(|ear| {
                let f = head.ear(ear, side(azimuth), 48_000.0);
                let gain = head.high_gain(head.incidence(ear, side(azimuth)));
                let echoes: f64 = PINNA_LEVELS.iter().zip(f.pinna).map(|(r, t)| r * t).sum();
                f.delay - head.centre_delay() + (1.0 - gain) * head.centre_delay() / 2.0 + echoes
            });
            for fs in [44_100.0, 48_000.0, 96_000.0] {
                let (ears, lag) = impulse(head, 0.0, fs, side(azimuth));
                for (h, expected) in ears.iter().zip(expected) {
                    let found = moment(h, lag, fs);
                    assert!((found - expected).abs() < 1e-6, "{azimuth} {fs}: {found} {expected}");
                }
            }
        }
    }
}

#[test]
fn mirrored_sources_swap_the_ears_bit_for_bit_and_the_front_is_the_same_in_both() {
    let head = Head { pinna: Some(PinnaSet::Set1), shoulder: 0.2, ..Head::default() };
    let mirrored = |d: Vec3| [d[0], -d[1], d[2]];
    for azimuth in [10.0, 47.0, 95.0, 170.0] {
        let ([left, right], _) = impulse(head, ROOM_LEVEL, 48_000.0, side(azimuth));
        let ([other_left, other_right], _) = impulse(head, ROOM_LEVEL, 48_000.0, mirrored(side(azimuth)));
        assert!(left == other_right && right == other_left);
        assert!(left != right);
    }
    let ([left, right], _) = impulse(head, ROOM_LEVEL, 48_000.0, [1.0, 0.0, 0.0]);
    assert_eq!(left, right);
}

#[test]
fn the_spectrum_is_that_of_the_model_within_the_error_of_interpolation() {
    let (fs, direction) = (48_000.0, side(40.0));
    let head = Head { pinna: Some(PinnaSet::Set0), shoulder: 0.2, ..Head::default() };
    let (ears, lag) = impulse(head, 0.0, fs, direction);
    for (h, ear) in ears.iter().zip([Ear::Left, Ear::Right]) {
        let filter = head.ear(ear, direction, fs);
        for f in [100.0, 1000.0, 3000.0, 6000.0] {
            let found = h.iter().enumerate().fold([0.0; 2], |sum, (n, x)| {
                let a = 2.0 * PI * f * (n as f64 - lag as f64) / fs;
                [sum[0] + x * a.cos(), sum[1] - x * a.sin()]
            });
            let [re, im] = head.response(&filter, f, fs);
            let error = (found[0] - re).hypot(found[1] - im) / re.hypot(im);
            assert!(error < 0.02, "{f}: {found:?} {re} {im}");
        }
    }
}

#[test]
fn the_room_echo_reaches_both_ears_after_15_ms() {
    let ([left, right], lag) = impulse(Head::default(), ROOM_LEVEL, 48_000.0, side(30.0));
    let index = lag + 720;
    for ear in [left, right] {
        assert!((ear[index] - ROOM_LEVEL).abs() < 1e-6);
    }
}

/// Circles the head once per second and measures the residual besides the tone: clicks are broadband.
#[test]
fn a_source_that_circles_the_head_in_one_second_makes_no_clicks() {
    let (fs, tone) = (48_000.0, 1000.0);
    let x: Vec<f32> = (0..96_000).map(|n| (2.0 * PI * tone * f64::from(n) / fs).sin() as f32).collect();
    for pinna in [None, Some(PinnaSet::Set0)] {
        let head = Head { pinna, ..Head::default() };
        let mut binaural = Binaural::new(head, 0.0, fs);
        let mut out = vec![0.0; 2 * x.len()];
        binaural.process(0, &x, &mut out, |n| {
            let a = 2.0 * PI * n as f64 / fs;
            [a.cos(), a.sin(), 0.0]
        });
        for ear in 0..2 {
            // A high-pass far above the tone: six differences.
            let mut y: Vec<f64> = out.iter().skip(ear).step_by(2).map(|x| f64::from(*x)).collect();
            for _ in 0..6 {
                y = y.windows(2).map(|w| w[1] - w[0]).collect();
            }
            // A step of size s appears as 10 s, the tone as its level times (2 sin(pi f / fs))^6 = 5e-6.
            let worst = y[2000..].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(worst / 10.0 < 1e-3, "{pinna:?}, ear {ear}: {worst}");
        }
    }
}

#[test]
fn windows_of_any_length_give_the_same_bits() {
    let head = Head { pinna: Some(PinnaSet::Set0), ..Head::default() };
    let x: Vec<f32> = (0..1000).map(|n| ((n * n) as f32 * 0.37).sin()).collect();
    let direction = |n: u64| side(n as f64 * 0.1);
    let run = |len: usize| {
        let mut binaural = Binaural::new(head, ROOM_LEVEL, 44_100.0);
        let mut out = vec![0.0; 2 * x.len()];
        let mut first = 0;
        for (x, out) in x.chunks(len).zip(out.chunks_mut(2 * len)) {
            binaural.process(first, x, out, direction);
            first += x.len() as u64;
        }
        out
    };
    let expected = run(1000);
    assert!([1, 7, 63, 64, 65].into_iter().all(|len| run(len) == expected));
}
