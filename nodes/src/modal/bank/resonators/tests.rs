use super::*;
use crate::core::random::Rng;
use std::f64::consts::TAU;

fn one(f: f64, d: f64) -> Modes {
    Modes::new("one", vec![f], vec![d], vec![1.0]).unwrap()
}

/// The sum that the modes are defined by, in double precision.
fn reference(modes: &Modes, point: usize, rate: f64, force: &[f32], samples: usize) -> Vec<f64> {
    let mut out = vec![0.0; samples];
    for (at, f) in force.iter().enumerate().filter(|(_, f)| **f != 0.0) {
        for (n, y) in out.iter_mut().enumerate().skip(at) {
            let t = (n - at) as f64 / rate;
            for (i, (freq, d)) in modes.frequencies.iter().zip(&modes.dampings).enumerate() {
                let gain = f64::from(modes.row(point)[i]) * f64::from(*f);
                let phase = f64::from(modes.phases.get(i).copied().unwrap_or(0.0));
                *y += gain * (-d * t).exp() * (TAU * freq * t + phase).sin();
            }
        }
    }
    out
}

fn impulse_response(modes: &Modes, rate: f64, samples: usize) -> Vec<f32> {
    let (mut force, mut out) = (vec![0.0; samples], vec![0.0; samples]);
    force[0] = 1.0;
    Bank::new(modes, rate, BankOutput::Displacement).unwrap().process(&force, &mut out);
    out
}

#[test]
fn the_impulse_response_of_a_mode_is_a_damped_sine_at_any_frequency() {
    // The two-pole form is off by 0.07 in single precision, this one by some millionths.
    // Near half the rate a step less 1 has no more digits than the step itself.
    let cases = [
        (20.0, 0.5, 5e-5),
        (50.0, 1.0, 5e-5),
        (440.0, 5.0, 5e-5),
        (5000.0, 20.0, 2e-4),
        (21_000.0, 1.0, 3e-3),
    ];
    for (f, d, bound) in cases {
        let modes = one(f, d);
        let out = impulse_response(&modes, 44_100.0, 44_100);
        let want = reference(&modes, 0, 44_100.0, &[1.0], 44_100);
        let worst = out.iter().zip(&want).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        println!("{f} Hz, {d}/s: off by {worst:.1e} over 1 s");
        assert!(worst < bound, "{f} Hz: {worst}");
    }
}

/// Response of three modes to a force by `scipy.signal.lfilter` in the two-pole form, every 40th sample: `tests/oracles/modal.py`.
const LFILTER: [f64; 50] = include!("../lfilter.in");

#[test]
fn a_force_rings_modes_as_the_filters_of_scipy_do() {
    let (f, d) = (vec![220.0, 1500.0, 9000.0], vec![3.0, 12.0, 40.0]);
    let modes = Modes::new("three", f, d, vec![1.0, 0.5, 0.25]).unwrap();
    let force: Vec<f32> = (0..2000_i32)
        .map(|n| if n < 700 { ((37 * n + 11 * n * n) % 33 - 16) as f32 / 16.0 } else { 0.0 })
        .collect();
    let mut out = vec![0.0; force.len()];
    Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap().process(&force, &mut out);
    for (k, (found, right)) in out.iter().step_by(40).zip(LFILTER).enumerate() {
        // Without a force modes go on as two poles.
        let bound = if 40 * k < 700 { 1e-4 } else { 3e-4 };
        assert!((f64::from(*found) - right).abs() < bound, "sample {}: {found} for {right}", 40 * k);
    }
    assert!(LFILTER.iter().any(|x| x.abs() > 3.0));
}

#[test]
fn neither_frequency_nor_damping_drifts_in_ten_seconds() {
    let modes = one(20.0, 0.5);
    let out = impulse_response(&modes, 44_100.0, 441_000);
    let want = reference(&modes, 0, 44_100.0, &[1.0], 441_000);
    for (n, (a, b)) in out.iter().zip(&want).enumerate() {
        let envelope = (-0.5 * n as f64 / 44_100.0).exp();
        assert!((f64::from(*a) - b).abs() < 1e-3 * envelope, "sample {n}: {a} for {b}");
    }
}

#[test]
fn the_decay_time_follows_from_the_damping() {
    // Schroeder's backward integral of the energy.
    let out = impulse_response(&one(800.0, 12.0), 44_100.0, 60_000);
    let mut energy: Vec<f64> = out.iter().map(|x| f64::from(*x).powi(2)).collect();
    for n in (0..energy.len() - 1).rev() {
        energy[n] += energy[n + 1];
    }
    let down = |db: f64| energy.iter().position(|e| 10.0 * (e / energy[0]).log10() < -db).unwrap() as f64;
    let t60 = (down(35.0) - down(5.0)) * 2.0 / 44_100.0;
    assert!((t60 * 12.0 / 6.907_755 - 1.0).abs() < 0.005, "{t60}");
}

#[test]
fn several_forces_at_several_points_add_up() {
    let modes = Modes {
        gains: vec![1.0, 0.5, -0.25, 0.75, 0.1, 0.9],
        phases: vec![0.3, -1.0],
        ..Modes::new("two", vec![300.0, 1234.5], vec![8.0, 30.0], vec![1.0, 1.0]).unwrap()
    };
    let mut rng = Rng::new(3);
    let forces: Vec<Vec<f32>> =
        (0..3).map(|_| (0..200).map(|_| rng.between(-1.0, 1.0) as f32).collect()).collect();
    let mut bank = Bank::new(&modes, 8000.0, BankOutput::Displacement).unwrap();
    let mut out = vec![0.0; 400];
    let mut at = 0;
    while at < 400 {
        let n = bank.until_grid().min(400 - at);
        for (p, force) in forces.iter().enumerate() {
            let part = &force[at.min(200)..(at + n).min(200)];
            bank.force(p)[..part.len()].copy_from_slice(part);
        }
        bank.advance(&mut out[at..at + n]);
        at += n;
    }
    let parts: Vec<Vec<f64>> = (0..3).map(|p| reference(&modes, p, 8000.0, &forces[p], 400)).collect();
    for (n, y) in out.iter().enumerate() {
        let want: f64 = parts.iter().map(|part| part[n]).sum();
        assert!((f64::from(*y) - want).abs() < 1e-4, "{n}: {y} for {want}");
    }
    assert!(bank.force(3).is_empty());
}

fn random_modes(n: usize) -> Modes {
    let mut rng = Rng::new(9);
    let f = (0..n).map(|_| rng.between(30.0, 20_000.0)).collect();
    let d = (0..n).map(|_| rng.between(1.0, 400.0)).collect();
    let g = (0..n).map(|_| rng.between(-0.1, 0.1) as f32).collect();
    Modes::new("many", f, d, g).unwrap()
}

#[test]
fn blocks_of_any_length_give_the_same_bits() {
    let modes = random_modes(150);
    let mut force = vec![0.0; 30_000];
    for (at, f) in [(0, 1.0), (77, -0.5), (78, 0.25), (9000, 1e-6), (20_001, 1.0)] {
        force[at] = f;
    }
    let run = |piece: usize| {
        let mut bank = Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap();
        bank.start(1.0, 1.0, 441);
        let mut out = vec![0.0; force.len()];
        let mut at = 0;
        for (force, out) in force.chunks(piece).zip(out.chunks_mut(piece)) {
            if at <= 2100 && at + piece > 2100 && (piece == 1 || piece == 2100) {
                bank.glide(3.0, 0.9);
            }
            bank.process(force, out);
            at += piece;
        }
        out.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    let whole = run(30_000);
    for piece in [1, 7, 64, 1000] {
        if piece > 1 {
            assert!(run(piece) == whole, "pieces of {piece}");
        }
    }
    assert!(run(1) == run(2100), "a glide that starts at the same sample");
}

#[test]
fn decayed_modes_are_skipped_and_ring_again_exactly() {
    let modes = random_modes(150);
    let mut bank = Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap();
    let (mut force, mut out) = (vec![0.0; 44_100], vec![0.0; 44_100]);
    bank.process(&force, &mut out);
    assert!(bank.sounding() == 0 && out.iter().all(|x| *x == 0.0));
    force[0] = 1.0;
    bank.process(&force, &mut out);
    assert!(bank.sounding() > 0);
    let first = out.clone();
    force[0] = 0.0;
    for _ in 0..30 {
        bank.process(&force, &mut out);
    }
    assert!(bank.sounding() == 0 && out.iter().all(|x| *x == 0.0));
    force[0] = 1.0;
    bank.process(&force, &mut out);
    // The grid has another phase, so modes may be set to zero a few samples earlier or later, and begin as two poles elsewhere.
    let worst = first.iter().zip(&out).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn energy_never_grows_without_force_at_any_damping() {
    let mut bank = Bank::new(&one(700.0, 1.0), 44_100.0, BankOutput::Displacement).unwrap();
    bank.set_floor(-400.0);
    bank.process(&[1.0], &mut [0.0]);
    let mut rng = Rng::new(5);
    let size = |bank: &Bank| bank.lanes[0].re[0].hypot(bank.lanes[0].im[0]);
    let mut before = size(&bank);
    for _ in 0..3000 {
        bank.damp(&[rng.between(0.0, 1.0).powi(4) as f32 * 30.0]);
        let n = bank.until_grid();
        bank.process(&[], &mut vec![0.0; n]);
        let after = size(&bank);
        assert!(after <= before * 1.000_004, "{before} to {after}");
        before = after;
    }
}

#[test]
fn damping_can_be_given_per_mode() {
    let modes = Modes::new("two", vec![500.0, 900.0], vec![10.0, 10.0], vec![1.0, 1.0]).unwrap();
    let mut bank = Bank::new(&modes, 8000.0, BankOutput::Displacement).unwrap();
    bank.damp(&[1.0, 8.0]);
    let mut out = vec![0.0; 800];
    bank.process(&[1.0], &mut out);
    let states = bank.states(0);
    let size = |k: usize| f64::from(states[k].0.hypot(states[k].1));
    // The impulse is at the first of 800 samples.
    assert!((size(0) - (-10.0 * 799.0 / 8000.0_f64).exp()).abs() < 1e-5);
    assert!((size(1) - (-80.0 * 799.0 / 8000.0_f64).exp()).abs() < 1e-5);
}

#[test]
fn modes_beyond_half_the_rate_are_left_out() {
    let modes = Modes::new("high", vec![100.0, 490.0, 489.0], vec![1.0; 3], vec![1.0; 3]).unwrap();
    let bank = Bank::new(&modes, 1000.0, BankOutput::Displacement).unwrap();
    assert_eq!((bank.dropped(), bank.points()), (1, 1));
    let mut all_gone = Bank::new(&one(600.0, 1.0), 1000.0, BankOutput::Displacement).unwrap();
    let mut out = [1.0; 100];
    all_gone.process(&[1.0; 100], &mut out);
    assert_eq!(out, [0.0; 100]);
}

#[test]
fn the_sum_of_gains_bounds_the_sound() {
    let modes = random_modes(40);
    let rate = 44_100.0;
    let mut rng = Rng::new(8);
    let force: Vec<f32> = (0..20_000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let mut out = vec![0.0; force.len()];
    Bank::new(&modes, rate, BankOutput::Displacement).unwrap().process(&force, &mut out);
    let each = modes.dampings.iter().zip(&modes.gains);
    let bound: f64 = each.map(|(d, g)| f64::from(g.abs()) / (1.0 - (-d / rate).exp())).sum();
    assert!(out.iter().all(|x| f64::from(x.abs()) <= bound));
}

#[test]
fn numbers_that_are_not_finite_do_not_stay() {
    let mut bank = Bank::new(&random_modes(20), 44_100.0, BankOutput::Displacement).unwrap();
    let mut out = vec![0.0; 1000];
    bank.process(&[f32::NAN, f32::INFINITY, 1.0], &mut out);
    assert!(out.iter().all(|x| x.is_finite()));
    bank.process(&[f32::MAX; 300], &mut out);
    bank.process(&[], &mut vec![0.0; 64]);
    bank.process(&[], &mut out);
    assert!(out.iter().all(|x| x.is_finite()) && bank.diverged() > 0);
}

#[test]
fn no_denormal_numbers_arise_in_a_minute_after_an_impulse() {
    let modes = random_modes(400);
    let mut bank = Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap();
    let mut out = vec![0.0; 44_100];
    bank.process(&[1.0], &mut out);
    let mut smallest = f32::MAX;
    for _ in 0..60 {
        bank.process(&[], &mut out);
        let parts = bank.lanes.iter().flat_map(|lanes| lanes.re.iter().zip(&lanes.im));
        let sizes = parts.map(|(re, im)| re.abs().max(im.abs())).filter(|x| *x > 0.0);
        smallest = sizes.fold(smallest, f32::min);
    }
    assert!(bank.sounding() == 0 && smallest > 1e-20, "{smallest}: denormal numbers are near");
}

/// Modes with gains in dB.
fn graded(levels: &[f64]) -> Modes {
    let n = levels.len();
    let frequencies = (0..n).map(|k| 300.0 + 137.0 * k as f64).collect();
    let gains = levels.iter().map(|db| db_to_linear(*db) as f32).collect();
    Modes::new("graded", frequencies, vec![6.0; n], gains).unwrap()
}

#[test]
fn leaving_out_modes_80_db_below_the_strongest_costs_little_accuracy() {
    let levels: Vec<f64> = (0..40).map(|k| -3.0 * f64::from(k)).collect();
    let modes = graded(&levels);
    let force: Vec<f32> = (0..40_000).map(|n| if n == 0 { 1.0 } else { 0.0 }).collect();
    let ring = |mut bank: Bank| {
        let mut out = vec![0.0; force.len()];
        bank.process(&force, &mut out);
        out
    };
    let all = ring(Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap());
    let rms = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    // The error is about as strong as the strongest mode that is left out.
    for (cull, kept) in [(-80.0, 27), (-40.0, 14), (0.0, 1)] {
        let bank = Bank::culled(&modes, 44_100.0, BankOutput::Displacement, cull).unwrap();
        assert_eq!((bank.faint(), bank.dropped()), (40 - kept, 0), "{cull}");
        let less = ring(bank);
        let missed: Vec<f32> = all.iter().zip(&less).map(|(a, b)| a - b).collect();
        let level = 20.0 * (rms(&missed) / rms(&all)).log10();
        let first = levels[kept];
        println!("cull {cull} dB: {} of 40 modes, {level:.1} dB missed", kept);
        assert!((first - 5.0..first + 3.1).contains(&level), "{cull}: {level}");
    }
    assert_eq!(Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap().faint(), 0);
    // A mode that is strong anywhere is kept.
    let two = Modes { gains: vec![1.0, 1e-5, 1e-5, 1.0], ..graded(&[0.0, 0.0]) };
    assert_eq!(Bank::culled(&two, 44_100.0, BankOutput::Displacement, -80.0).unwrap().faint(), 0);
}

#[test]
fn a_bank_with_another_cull_takes_over_the_modes_in_both() {
    let levels: Vec<f64> = (0..40).map(|k| -2.0 * f64::from((k * 7) % 40)).collect();
    let modes = graded(&levels);
    let (mut force, mut out) = ([0.0; 640], [0.0; 640]);
    force[0] = 1.0;
    let mut full = Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap();
    full.process(&force, &mut out);
    let mut less = Bank::culled(&modes, 44_100.0, BankOutput::Displacement, -40.0).unwrap();
    less.take_state(&full);
    let mut alone = Bank::culled(&modes, 44_100.0, BankOutput::Displacement, -40.0).unwrap();
    alone.process(&force, &mut out);
    let (mut a, mut b) = ([0.0; 640], [0.0; 640]);
    less.process(&[], &mut a);
    alone.process(&[], &mut b);
    // One goes on by rotation until its coefficients are steady, the other by two poles.
    let largest = b.iter().fold(0.0_f32, |max, x| max.max(x.abs()));
    let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-4 * largest && largest > 0.1, "{worst} of {largest}");
}

/// Gain of a bank at a frequency, from a long sine after the modes have settled.
fn gain_at(bank: &mut Bank, frequency: f64, rate: f64) -> f64 {
    let samples = 2 * rate as usize;
    let sine = |n: usize| (TAU * frequency * n as f64 / rate).sin();
    let force: Vec<f32> = (0..samples).map(|n| sine(n) as f32).collect();
    let mut out = vec![0.0; samples];
    bank.process(&force, &mut out);
    // A whole number of periods at the end.
    let periods = (frequency / 2.0).max(1.0).floor();
    let from = samples - (periods * rate / frequency).round() as usize;
    let [mut re, mut im] = [0.0, 0.0];
    for (n, y) in out.iter().enumerate().skip(from) {
        re += f64::from(*y) * (TAU * frequency * n as f64 / rate).cos();
        im += f64::from(*y) * sine(n);
    }
    2.0 * re.hypot(im) / (samples - from) as f64
}

/// Gain of `a w / ((s + d)^2 + w^2)` times `s^2 / (d^2 + w^2)` in samples of force, `s = 2 pi i f`.
fn radiated(f: f64, mode: f64, d: f64, rate: f64) -> f64 {
    let (s, w) = (TAU * f, TAU * mode);
    let power = d * d + w * w;
    w * rate * s * s / power / (power - s * s).hypot(2.0 * d * s)
}

#[test]
fn acceleration_has_the_gain_of_a_mode_at_its_frequency_and_the_square_law_below() {
    let rate = 44_100.0;
    for (mode, d) in [(60.0, 6.0), (400.0, 8.0), (2000.0, 30.0), (500.0, 400.0)] {
        let bank = |motion| Bank::new(&one(mode, d), rate, motion).unwrap();
        let [moved, fast] = [BankOutput::Displacement, BankOutput::Acceleration]
            .map(|motion| gain_at(&mut bank(motion), (mode * mode + (d / TAU).powi(2)).sqrt(), rate));
        assert!(d > 100.0 || (fast / moved - 1.0).abs() < 0.005, "{mode} Hz: {fast} for {moved}");
        for f in [0.05 * mode, 0.25 * mode, 0.8 * mode, mode, 2.0 * mode, 4.0 * mode] {
            let (found, right) =
                (gain_at(&mut bank(BankOutput::Acceleration), f, rate), radiated(f, mode, d, rate));
            let db = 20.0 * (found / right).log10();
            println!("{mode} Hz, {d}/s at {f} Hz: {db:+.3} dB");
            assert!(db.abs() < 0.5, "{mode} Hz at {f} Hz: {found} for {right}");
        }
    }
}

#[test]
fn a_constant_force_is_not_heard_as_acceleration_whatever_pitch_and_damping() {
    let modes = Modes {
        phases: vec![0.0, 0.7, -1.2, 0.0],
        ..Modes::new("four", vec![80.0, 700.0, 3100.0, 30_000.0], vec![20.0, 60.0, 3000.0, 9.0], vec![1.0; 4])
            .unwrap()
    };
    let mut bank = Bank::new(&modes, 44_100.0, BankOutput::Acceleration).unwrap();
    bank.start(1.0, 1.0, 441);
    let force = vec![1.0; 88_200];
    for (damping, pitch) in [(1.0, 1.0), (3.0, 0.5), (0.8, 1.9)] {
        bank.glide(damping, pitch);
        let mut out = vec![0.0; force.len()];
        bank.process(&force, &mut out);
        let end = out[80_000..].iter().fold(0.0_f32, |max, y| max.max(y.abs()));
        let moved = Bank::new(&modes, 44_100.0, BankOutput::Displacement).map(|mut bank| {
            bank.start(damping, pitch, 0);
            let mut out = vec![0.0; force.len()];
            bank.process(&force, &mut out);
            out[88_199].abs()
        });
        assert!(end < 1e-5 * moved.unwrap(), "{damping} {pitch}: {end}");
    }
}

/// The output of modes in double precision, with the steps that a bank has in single precision.
fn rotated(bank: &Bank, gains: &[f32], force: &[f32], samples: usize) -> Vec<f64> {
    let mut out = vec![0.0; samples];
    for (k, gain) in gains.iter().enumerate() {
        let lanes = &bank.lanes[k / LANES];
        let (re, im) = (1.0 + f64::from(lanes.less_one[k % LANES]), f64::from(lanes.sin[k % LANES]));
        let (mut x, mut y) = (0.0, 0.0);
        for (n, out) in out.iter_mut().enumerate() {
            (x, y) = (re * x - im * y, im * x + re * y);
            x += f64::from(gain * force.get(n).copied().unwrap_or(0.0));
            *out += y;
        }
    }
    out
}

#[test]
fn two_poles_equal_the_rotation() {
    // From frequencies that stay in rotation to those near half the rate, and forces at and within grid points.
    for f in [20.0, 55.0, 57.0, 60.0, 100.0, 441.0, 1000.0, 5000.0, 11_025.0, 15_000.0, 21_500.0] {
        let mut force = vec![0.0; 44_100];
        for at in [0, 6400, 12_837, 12_838, 20_000, 20_063] {
            force[at] = 1.0;
        }
        let mut bank = Bank::new(&one(f, 2.0), 44_100.0, BankOutput::Displacement).unwrap();
        let want = rotated(&bank, &[1.0], &force, 44_100);
        let mut out = vec![0.0; 44_100];
        bank.process(&force, &mut out);
        let worst = out.iter().zip(&want).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        let largest = want.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
        println!("{f} Hz: {:.1e}", worst / largest);
        let bound = if f < 200.0 { 1e-4 } else { 3e-5 };
        assert!(worst < bound * largest, "{f} Hz: {worst} of {largest}");
    }
}

#[test]
fn two_poles_are_taken_while_coefficients_are_steady_and_nothing_forces() {
    let is_free = |bank: &mut Bank, force: f32| {
        bank.process(&[force], &mut [0.0; 1]);
        let free = bank.is_free;
        bank.process(&[], &mut [0.0; GRID - 1]);
        free
    };
    // Frequencies above and below the limit, in one vector and in others.
    let f = (0..40).map(|k| 40.0 + 2.0 * f64::from(k)).collect();
    let modes = Modes::new("many", f, vec![1.0; 40], vec![0.1; 40]).unwrap();
    let mut bank = Bank::new(&modes, 44_100.0, BankOutput::Displacement).unwrap();
    assert!(!is_free(&mut bank, 0.0), "nothing sounds");
    let first: Vec<bool> = (0..6).map(|k| is_free(&mut bank, if k == 0 { 1.0 } else { 0.0 })).collect();
    assert_eq!(first, [false, false, false, true, true, true]);
    assert_eq!(bank.two_poles.iter().map(|x| x.fits).collect::<Vec<_>>(), [false, true, true]);
    assert!(!is_free(&mut bank, 1.0) && is_free(&mut bank, 0.0));
    bank.damp(&[2.0]);
    let moved: Vec<bool> = (0..6).map(|_| is_free(&mut bank, 0.0)).collect();
    assert_eq!(moved, [false, false, false, false, true, true]);
}
