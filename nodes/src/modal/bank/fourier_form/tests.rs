use super::*;
use crate::core::random::Rng;
use crate::dsp::linear_to_db;
use crate::modal::bank::resonators::{Bank, BankOutput};
use crate::modal::mode::modes::Modes;

const FS: f64 = 44_100.0;
const HOP: usize = 512;

/// Modes from 21 Hz to 0.48 of the rate, with dampings between two bounds.
fn modes(n: usize, [low, high]: [f64; 2]) -> Modes {
    let mut rng = Rng::new(11);
    let frequencies = (0..n).map(|k| 21.0 + (0.48 * FS - 21.0) * k as f64 / n as f64).collect();
    let dampings = (0..n).map(|_| rng.between(low, high)).collect();
    let gains = (0..n).map(|_| rng.between(-0.1, 0.1) as f32).collect();
    Modes::new("many", frequencies, dampings, gains).unwrap()
}

fn bank(modes: &Modes, form: BankForm, bins: usize) -> Bank {
    let mut bank = Bank::new(modes, FS, BankOutput::Acceleration).unwrap();
    bank.start(1.0, 1.0, 441);
    bank.set_form(form, bins);
    bank
}

/// Impulses at samples that share no factor with the grid.
fn impulses(samples: usize) -> Vec<f32> {
    let mut force = vec![0.0; samples];
    for (at, f) in [(0, 1.0), (77, -0.5), (1023, 0.7), (9000, 0.3), (20_001, 1.0)] {
        if let Some(force) = force.get_mut(at) {
            *force = f;
        }
    }
    force
}

fn sound(mut bank: Bank, force: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; force.len()];
    bank.process(force, &mut out);
    out
}

fn power(x: impl IntoIterator<Item = f32>) -> f64 {
    x.into_iter().map(|x| f64::from(x).powi(2)).sum()
}

/// Power of the difference in dB relative to a sound.
fn error(found: &[f32], right: &[f32]) -> f64 {
    let difference = found.iter().zip(right).map(|(a, b)| a - b);
    0.5 * linear_to_db(power(difference) / power(right.iter().copied()))
}

#[test]
fn the_difference_from_the_time_form_is_that_of_the_fit() {
    let cases = [
        (5, [0.5, 50.0], -41.0),
        (7, [0.5, 50.0], -58.0),
        // The rest is single precision, of the time form above all.
        (9, [0.5, 50.0], -70.0),
        (5, [50.0, 200.0], -34.0),
        (7, [50.0, 200.0], -50.0),
    ];
    for (bins, dampings, stated) in cases {
        let modes = modes(400, dampings);
        let force = impulses(30_000);
        let right = sound(bank(&modes, BankForm::Time, bins), &force);
        let found = sound(bank(&modes, BankForm::Fourier, bins), &force);
        let error = error(&found, &right);
        println!("{bins} bins, d from {} to {} 1/s: {error:.1} dB", dampings[0], dampings[1]);
        assert!(error < stated && error > stated - 25.0, "{bins} {dampings:?}: {error} dB");
    }
}

#[test]
fn the_worst_single_mode_differs_by_no_more_than_the_stated_error() {
    for (f, d) in
        [(21.0, 1.0), (50.0, 40.0), (1000.0, 50.0), (9300.0, 0.5), (21_500.0, 10.0), (3010.0, 199.0)]
    {
        let one = Modes::new("one", vec![f], vec![d], vec![1.0]).unwrap();
        let force = impulses(30_000);
        let right = sound(bank(&one, BankForm::Time, 5), &force);
        let error = error(&sound(bank(&one, BankForm::Fourier, 5), &force), &right);
        println!("{f} Hz, {d} 1/s: {error:.1} dB");
        assert!(error < if d > 50.0 { -33.0 } else { -38.0 }, "{f} Hz, {d} 1/s: {error}");
    }
}

#[test]
fn blocks_of_any_length_give_the_same_bits_in_the_fourier_form() {
    let modes = modes(500, [0.5, 300.0]);
    let mut force = impulses(30_000);
    let mut rng = Rng::new(2);
    force[12_000..12_400].iter_mut().for_each(|f| *f = rng.between(-0.1, 0.1) as f32);
    for form in [BankForm::Fourier, BankForm::Auto] {
        let run = |piece: usize, aligned: bool| {
            let mut bank = bank(&modes, form, 5);
            let mut out = vec![0.0; force.len()];
            let mut at = 0;
            for (force, out) in force.chunks(piece).zip(out.chunks_mut(piece)) {
                if aligned {
                    bank.align(at as i64);
                }
                if at <= 21_000 && at + piece > 21_000 && (piece == 1 || piece == 21_000) {
                    bank.glide(3.0, 0.9);
                }
                bank.process(force, out);
                at += piece;
            }
            assert!(bank.hops() > 4, "{form:?}");
            out.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        let whole = run(30_000, false);
        for piece in [7, 64, 480, 1000] {
            assert!(run(piece, piece % 2 == 0) == whole, "{form:?}, pieces of {piece}");
        }
        assert!(run(1, true) == run(21_000, false), "{form:?}, a glide that starts at the same sample");
    }
}

#[test]
fn an_impact_is_not_blurred() {
    let modes = modes(300, [1.0, 40.0]);
    for at in [0, 1, 700, 1023, 1024, 1500] {
        let mut force = vec![0.0; 4096];
        force[at] = 1.0;
        let right = sound(bank(&modes, BankForm::Time, 5), &force);
        let found = sound(bank(&modes, BankForm::Fourier, 5), &force);
        assert!(found[..at].iter().all(|x| *x == 0.0), "before {at}");
        let boundary = at / HOP * HOP + HOP;
        assert!(found[at..boundary] == right[at..boundary], "from {at} to {boundary}");
        let after = error(&found[boundary..boundary + HOP], &right[boundary..boundary + HOP]);
        assert!(after < -34.0, "after {boundary}: {after} dB");
    }
}

#[test]
fn sounds_of_two_forces_add_up() {
    let modes = modes(200, [1.0, 40.0]);
    let (a, mut b) = (impulses(20_000), vec![0.0; 20_000]);
    (b[3000], b[3400]) = (0.4, -0.9);
    let both: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a + b).collect();
    let [a, b, both] = [a, b, both].map(|force| sound(bank(&modes, BankForm::Fourier, 5), &force));
    let peak = both.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    for ((a, b), both) in a.iter().zip(&b).zip(&both) {
        assert!((a + b - both).abs() < 1e-5 * peak, "{a} {b} {both}");
    }
}

#[test]
fn modes_that_decay_fast_stay_in_time() {
    let fast = modes(100, [220.0, 900.0]);
    let force = impulses(5000);
    let found = sound(bank(&fast, BankForm::Fourier, 5), &force);
    assert!(found == sound(bank(&fast, BankForm::Time, 5), &force));
}

#[test]
fn decayed_modes_are_skipped_and_ring_again() {
    let modes = modes(150, [20.0, 200.0]);
    let mut bank = bank(&modes, BankForm::Fourier, 5);
    let mut out = vec![0.0; 44_032];
    bank.process(&[1.0], &mut out[..2048]);
    assert_eq!(bank.sounding(), 160);
    bank.process(&[], &mut out[2048..]);
    let first = out.clone();
    bank.process(&[], &mut out);
    bank.process(&[], &mut out);
    assert!(bank.sounding() == 0 && out[20_000..].iter().all(|x| *x == 0.0));
    bank.process(&[1.0], &mut out);
    assert!(error(&out, &first) < -100.0);
}

#[test]
fn no_modes_are_silent() {
    let high = Modes::new("high", vec![30_000.0], vec![1.0], vec![1.0]).unwrap();
    for form in [BankForm::Fourier, BankForm::Auto] {
        let out = sound(bank(&high, form, 5), &[1.0; 3000]);
        assert!(out.iter().all(|x| *x == 0.0));
    }
}

#[test]
fn dampings_change_at_the_same_sample_as_in_time_and_without_a_step() {
    let modes = modes(300, [1.0, 30.0]);
    // Changes in the middle of a hop, at its start, and at its end.
    for at in [4096 + 192, 4096, 4096 + 448] {
        let run = |form| {
            let mut bank = bank(&modes, form, 5);
            let mut out = vec![0.0; 12_000];
            bank.process(&[1.0], &mut out[..at]);
            let before = bank.hops();
            bank.damp(&[6.0]);
            bank.process(&[], &mut out[at..at + 400]);
            let during = bank.hops();
            bank.process(&[], &mut out[at + 400..]);
            (out, [before, during, bank.hops()])
        };
        let (right, _) = run(BankForm::Time);
        let (found, [before, during, after]) = run(BankForm::Fourier);
        assert!(before >= 7 && during <= before + 1 && after > during + 5, "{before} {during} {after}");
        let (now, later) = (error(&found[at..at + 64], &right[at..at + 64]), at + 64..at + 300);
        assert!(now < -30.0, "{at}: {now} dB");
        // In time, but for rounding, for a hop at least.
        let later = error(&found[later.clone()], &right[later]);
        assert!(later < -70.0, "{at}: {later} dB");
        assert!(error(&found, &right) < -34.0);
        // The difference has no step at the change.
        let difference: Vec<f32> = found.iter().zip(&right).map(|(a, b)| a - b).collect();
        let step = |range: std::ops::Range<usize>| {
            difference[range].windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
        };
        assert!(step(at - 2..at + 64) <= step(2000..at - 2), "{at}");
    }
}

#[test]
fn another_bank_takes_over_the_states_in_the_middle_of_a_hop() {
    let modes = modes(300, [1.0, 30.0]);
    let right = sound(bank(&modes, BankForm::Time, 5), &impulses(9000));
    for (from, to) in [
        (BankForm::Time, BankForm::Fourier),
        (BankForm::Fourier, BankForm::Time),
        (BankForm::Fourier, BankForm::Fourier),
    ] {
        let force = impulses(9000);
        let (mut old, mut new) = (bank(&modes, from, 5), bank(&modes, to, 7));
        let mut out = vec![0.0; 9000];
        for at in [3333, 3072] {
            out.fill(0.0);
            old.process(&force[..at], &mut out[..at]);
            new.take_state(&old);
            new.align(at as i64);
            new.process(&force[at..], &mut out[at..]);
            let later = error(&out[at..], &right[at..]);
            assert!(
                later < if to == BankForm::Time { -70.0 } else { -50.0 },
                "{from:?} to {to:?}: {later} dB"
            );
            (old, new) = (bank(&modes, from, 5), bank(&modes, to, 7));
        }
    }
}

#[test]
fn a_jump_of_the_stream_in_the_middle_of_a_hop_keeps_the_states() {
    let modes = modes(100, [1.0, 30.0]);
    let run = |form| {
        let mut bank = bank(&modes, form, 7);
        let mut out = vec![0.0; 6000];
        bank.process(&[1.0], &mut out[..2000]);
        bank.align(777);
        bank.process(&[], &mut out[2000..]);
        out
    };
    assert!(error(&run(BankForm::Fourier), &run(BankForm::Time)) < -50.0);
}

#[test]
fn auto_takes_the_fourier_form_while_many_modes_ring_freely() {
    let mut rng = Rng::new(5);
    let scrape: Vec<f32> = (0..20 * HOP).map(|_| rng.between(-0.1, 0.1) as f32).collect();
    let many = modes(1000, [20.0, 40.0]);
    let mut auto = bank(&many, BankForm::Auto, 5);
    let mut out = vec![0.0; 20 * HOP];
    auto.process(&[1.0], &mut out);
    let free = auto.hops();
    assert!(free >= 17, "{free} hops");
    auto.process(&scrape, &mut out);
    let forced = auto.hops() - free;
    assert!(forced <= 2, "{forced} hops");
    auto.process(&[], &mut out);
    assert!(auto.hops() - free - forced >= 17);
    // Until all have decayed, in which time no hop is computed by transforms.
    let mut out = vec![0.0; 80_000];
    auto.process(&[], &mut out);
    let end = auto.hops();
    auto.process(&[], &mut out);
    assert!(auto.sounding() == 0 && auto.hops() == end);
    let mut few = bank(&modes(200, [5.0, 20.0]), BankForm::Auto, 5);
    few.process(&[1.0], &mut out);
    assert_eq!(few.hops(), 0);
}

#[test]
fn frames_are_about_23_ms_long() {
    let sizes = [8000.0, 22_050.0, 44_100.0, 48_000.0, 96_000.0, 192_000.0, 100.0].map(frame);
    assert_eq!(sizes, [256, 512, 1024, 1024, 2048, 4096, 128]);
}
