use super::*;
use crate::core::time::Rate;
use crate::scrape::force::voices::Voices;
use crate::scrape::path::piece::PathPiece;
use crate::scrape::testing::{amplitude, db, piece, rms};
use crate::texture::{Grid, Surface};
use std::f64::consts::TAU;

const FS: f64 = 44_100.0;
const RADIUS: f64 = 0.02;

fn grating(cycles: usize, density: f64, depth: f64) -> Relief {
    let wave = |x: usize, _: usize| (0.5 * depth * (1.0 + (TAU * (cycles * x) as f64 / 2048.0).cos())) as f32;
    let surface = Surface { density: [density; 2], ..Surface::default() };
    Relief::new(&Grid::from_fn(2048, 8, wave), &surface)
}

fn sounds(a: &Relief, b: &Relief, piece: PathPiece, samples: usize) -> Vec<f32> {
    let mut pair = PairForce::new(Law::new([1.0, 1.0, 0.0], FS), 33, RADIUS, a.range() + b.range());
    let mut voices = Voices::new(1, Rate::hz(44_100), Heading::default());
    let mut out = vec![0.0; samples];
    voices.play(
        &[(0, piece)],
        None,
        0,
        &mut out,
        |_| Heading::default(),
        |heading, segment, out| {
            pair.add([a, b], heading, segment, out);
        },
    );
    out
}

fn passing(va: [f64; 2], vb: [f64; 2], time: f64) -> PathPiece {
    let one = piece([0.013, 0.002], va, time);
    PathPiece { other: Some(piece([0.4, 0.001], vb, time).position), ..one }
}

/// Distance of the surfaces, from the definition with `taps` points.
fn apart(a: &Relief, b: &Relief, piece: &PathPiece, time: f64, taps: i32) -> f64 {
    let s = time / crate::core::time::seconds(piece.duration);
    let other = PathPiece { position: piece.other.unwrap(), ..*piece };
    let (ua, ub) = (piece.position_at(s), other.position_at(s));
    let v = piece.velocity_at(s);
    let t = v.map(|x| x / v[0].hypot(v[1]));
    let half = (2.0 * RADIUS * (a.range() + b.range())).sqrt();
    let each = (-taps..=taps).map(|j| {
        let xi = half * f64::from(j) / f64::from(taps);
        f64::from(a.height(along(ua, t, xi))) + f64::from(b.height(along(ub, t, -xi)))
            - xi * xi / (2.0 * RADIUS)
    });
    each.fold(f64::MIN, f64::max)
}

#[test]
fn the_force_is_the_change_of_the_gap() {
    let (a, b) = (grating(37, 2000.0, 5e-5), grating(61, 2000.0, 8e-5));
    let p = passing([0.31, 0.02], [-0.17, 0.0], 0.4);
    let out = sounds(&a, &b, p, 8000);
    let (mut error, mut right) = (0.0, 0.0);
    for n in (100..7900).step_by(7) {
        let t = n as f64 / FS;
        let [before, after] = [-0.4, 0.4].map(|d| apart(&a, &b, &p, t + d / FS, 3000));
        let want = (after - before) / (0.8 / FS);
        error += (f64::from(out[n]) - want).powi(2);
        right += want.powi(2);
    }
    let level = 10.0 * f64::log10(error / right);
    assert!(right > 0.0 && level < -25.0, "{level} dB");
}

#[test]
fn the_gap_is_never_less_than_the_heights_under_the_contact() {
    let (a, b) = (grating(37, 2000.0, 5e-5), grating(61, 2000.0, 8e-5));
    let p = passing([0.31, 0.02], [-0.17, 0.0], 0.4);
    for k in 0..300 {
        let t = f64::from(k) * 0.001;
        let other = PathPiece { position: p.other.unwrap(), ..p };
        let plain =
            f64::from(a.height(p.position_at(t / 0.4))) + f64::from(b.height(other.position_at(t / 0.4)));
        assert!(apart(&a, &b, &p, t, 16) >= plain - 1e-10);
    }
}

#[test]
fn the_gap_that_is_played_is_that_of_the_definition_and_never_too_small() {
    let (a, b) = (grating(37, 2000.0, 5e-5), grating(61, 2000.0, 8e-5));
    let p = passing([0.31, 0.02], [-0.17, 0.0], 0.4);
    let out = sounds(&a, &b, p, 16_000);
    let other = PathPiece { position: p.other.unwrap(), ..p };
    // The force is the speed at which the surfaces part: its sum is how far they are apart.
    let first = 100;
    let mut z = apart(&a, &b, &p, first as f64 / FS, 1000);
    let range = a.range() + b.range();
    for n in first..16_000 {
        let t = n as f64 / FS;
        if n % 50 == 0 {
            let right = apart(&a, &b, &p, t, 1000);
            assert!((z - right).abs() < 0.01 * range, "{n}: {z} m for {right} m");
            let s = t / crate::core::time::seconds(p.duration);
            let plain = f64::from(a.height(p.position_at(s))) + f64::from(b.height(other.position_at(s)));
            assert!(z > plain - 0.01 * range, "{n}: {z} m under {plain} m");
        }
        let next = out.get(n + 1).copied().unwrap_or_default();
        z += 0.5 * f64::from(out[n] + next) / FS;
    }
}

#[test]
fn both_surfaces_count_alike() {
    let (a, b) = (grating(37, 2000.0, 5e-5), grating(61, 2000.0, 8e-5));
    let p = passing([0.31, 0.0], [0.17, 0.0], 0.2);
    let turned = PathPiece { position: p.other.unwrap(), other: Some(p.position), ..p };
    let (one, two) = (sounds(&a, &b, p, 8000), sounds(&b, &a, turned, 8000));
    let difference: Vec<f32> = one.iter().zip(&two).map(|(a, b)| a - b).collect();
    assert!(db(rms(&difference) / rms(&one)) < -40.0, "{}", db(rms(&difference) / rms(&one)));
}

#[test]
fn features_of_both_meet_as_no_sum_of_two_forces_could() {
    // 400 and 530 a metre, passed at 1 and 0.6 m/s: 400 and 318 Hz, and their sum.
    let (a, b) = (grating(200, 4096.0, 1.45e-4), grating(265, 4096.0, 1.45e-4));
    let p = passing([1.0, 0.0], [0.6, 0.0], 1.0);
    // Amplitudes of the gap in m, from the force, which is the change of the gap.
    let line = |x: &[f32]| amplitude(&x[2000..42_000], 718.0, FS) / (TAU * 718.0);
    let both = sounds(&a, &b, p, 44_100);
    let flat = grating(0, 4096.0, 0.0);
    let [one, two] = [sounds(&a, &flat, p, 44_100), sounds(&flat, &b, p, 44_100)];
    let sum: Vec<f32> = one.iter().zip(&two).map(|(a, b)| a + b).collect();
    println!("at the sum frequency: {:.1} dB re 1 m, added {:.1} dB", db(line(&both)), db(line(&sum)));
    // The splines of the maps take 0.5 dB of the waves.
    assert!((db(line(&both)) + 87.0).abs() < 1.0, "{} dB re 1 m", db(line(&both)));
    assert!(db(line(&sum)) < -150.0, "{} dB re 1 m", db(line(&sum)));
}

#[test]
fn fast_contacts_are_read_point_by_point_with_the_same_result() {
    let (a, b) = (grating(37, 2000.0, 5e-7), grating(61, 2000.0, 8e-7));
    // So fast that a group of samples does not fit: compared with the definition.
    let p = passing([9.0, 0.0], [2.0, 0.0], 0.05);
    let out = sounds(&a, &b, p, 1500);
    let (mut error, mut right) = (0.0, 0.0);
    for (n, out) in out.iter().enumerate().take(1200).skip(200) {
        let t = n as f64 / FS;
        let [before, after] = [-0.1, 0.1].map(|d| apart(&a, &b, &p, t + d / FS, 300));
        let want = (after - before) / (0.2 / FS);
        error += (f64::from(*out) - want).powi(2);
        right += want.powi(2);
    }
    assert!(10.0 * f64::log10(error / right) < -25.0);
}
