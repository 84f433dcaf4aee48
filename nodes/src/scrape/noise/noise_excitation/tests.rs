use super::*;
use crate::core::standalone::Standalone;
use crate::core::time::Rate;
use crate::core::time::{Tick, ticks};
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::testing::{piece, rates_apart, rms};

fn params() -> NoiseExcitationParams {
    NoiseExcitationParams {
        contact: ContactForceParams {
            rate: Rate::hz(44_100),
            ..NoiseExcitationParams::read(&|_| None).unwrap().contact
        },
        value: crate::texture::NoiseValue::Height,
        reference: crate::dsp::Reference::Absolute,
        ..NoiseExcitationParams::read(&|_| None).unwrap()
    }
}

fn white(n: usize) -> NoiseProfile {
    let mut rng = Rng::new(4);
    NoiseProfile {
        samples: (0..n).map(|_| rng.between(-1.0, 1.0) as f32).collect(),
        spacing: 1.0 / 4096.0,
        ..NoiseProfile::default()
    }
}

fn standalone(p: NoiseExcitationParams, paths: Vec<(Tick, PathPiece)>, end: f64) -> Standalone {
    let standalone =
        Standalone::new::<NoiseExcitation>(p).events(NoiseExcitationPorts::paths, paths, ticks(end));
    standalone.value(NoiseExcitationPorts::noise, white(8192))
}

fn force(paths: Vec<(Tick, PathPiece)>, end: f64) -> Vec<f32> {
    standalone(params(), paths, end).run().unwrap().stream(NoiseExcitationPorts::force)
}

/// Mean frequency by power.
fn centroid(x: &[f32]) -> f64 {
    use rustfft::num_complex::Complex;
    let mut z: Vec<_> = x.iter().map(|x| Complex::new(f64::from(*x), 0.0)).collect();
    foley_fft::FftPlanner::new().plan_fft_forward(z.len()).process(&mut z);
    let half = &z[..z.len() / 2];
    let sum = half.iter().enumerate().map(|(k, z)| k as f64 * z.norm_sqr()).sum::<f64>();
    sum / half.iter().map(|z| z.norm_sqr()).sum::<f64>() * 44_100.0 / z.len() as f64
}

#[test]
fn twice_as_fast_is_an_octave_higher() {
    let at = |v: f64| force(vec![(0, piece([0.0; 2], [v, 0.0], 1.0))], 1.0);
    let (slow, fast) = (at(0.5), at(1.0));
    let ratio = centroid(&fast) / centroid(&slow);
    assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
    // Amplitude with the square root of the speed.
    let level = rms(&fast) / rms(&slow);
    assert!((level - 2_f64.sqrt()).abs() < 0.03, "{level}");
}

#[test]
fn a_reversal_reads_the_loop_backwards() {
    let there = piece([0.0; 2], [0.5, 0.0], 0.2);
    let back = piece([0.1, 0.0], [-0.5, 0.0], 0.2);
    let out = force(vec![(0, there), (ticks(0.2), back)], 0.4);
    for k in (20..8000).step_by(37) {
        let (a, b) = (out[8820 - k], out[8820 + k]);
        assert!((a - b).abs() < 1e-3, "{k}: {a} {b}");
    }
    assert!(rms(&out) > 0.1);
}

#[test]
fn contacts_begin_at_places_of_their_own_that_the_seed_decides() {
    let path = |contact| vec![(0, PathPiece { contact, ..piece([0.0; 2], [0.3, 0.0], 0.1) })];
    let (one, two) = (force(path(1), 0.1), force(path(2), 0.1));
    assert_ne!(one, two);
    assert_eq!(one, force(path(1), 0.1));
    let mut other = standalone(params(), path(1), 0.1);
    other.seed += 1;
    assert_ne!(one, other.run().unwrap().stream(NoiseExcitationPorts::force));
}

#[test]
fn windows_change_no_bit() {
    let there = piece([0.0; 2], [0.5, 0.0], 0.11);
    let back = piece([0.05, 0.0], [-40.5, 0.1], 0.09);
    let paths =
        vec![(ticks(0.0123), there), (ticks(0.05), PathPiece { contact: 5, ..back }), (ticks(0.1223), back)];
    let run = |n: usize| {
        let window = Rate::hz(44_100).span(n);
        standalone(params(), paths.clone(), 0.3)
            .window(window)
            .run()
            .unwrap()
            .stream(NoiseExcitationPorts::force)
    };
    let whole = run(20_000);
    for n in [32, 100, 1024, 4096] {
        assert!(run(n) == whole, "{n}");
    }
}

#[test]
fn edits_while_it_sounds_do_not_click() {
    let path = vec![(0, piece([0.0; 2], [0.1, 0.0], 1.0))];
    let edits = [
        NoiseExcitationParams { kappa: 5.0, ..params() },
        NoiseExcitationParams { contact: ContactForceParams { gain: 0.0, ..params().contact }, ..params() },
        NoiseExcitationParams { a: 1.5, b: 0.0, ..params() },
        NoiseExcitationParams { contact: ContactForceParams { scale: 0.5, ..params().contact }, ..params() },
        NoiseExcitationParams { contact: ContactForceParams { scale: 9.0, ..params().contact }, ..params() },
    ];
    for edit in edits {
        let standalone = standalone(params(), path.clone(), 1.0).window(Rate::hz(44_100).span(256));
        let mut run = standalone.start().unwrap();
        let mut count = 0;
        while run.step().unwrap() {
            count += 1;
            if count == 60 {
                assert_eq!(run.node().retune(&edit), Retune::Done);
            }
        }
        let out = run.stream(NoiseExcitationPorts::force);
        let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        let before = step(&out[2000..15_000]).max(step(&out[18_000..]));
        let during = step(&out[15_000..17_000]);
        assert!(before > 0.0 && during < 4.0 * before, "{edit:?}: {during} against {before}");
    }
}

#[test]
fn the_sample_rate_changes_nothing_that_is_heard() {
    // Read as it is, and where it is passed so fast at one rate that less of it is left.
    for speed in [1.1, 7.0] {
        let at = |rate: u32| {
            let p = NoiseExcitationParams {
                contact: ContactForceParams { rate: Rate::hz(rate), ..params().contact },
                ..params()
            };
            let path = vec![(0, piece([0.0; 2], [speed, 0.0], 1.0))];
            standalone(p, path, 1.0).run().unwrap().stream(NoiseExcitationPorts::force)
        };
        let (low, high) = (at(44_100), at(88_200));
        let heard = rates_apart(&low, &high);
        assert!(heard < 0.5, "{speed} m/s: {heard} dB");
    }
}

#[test]
fn rest_and_no_force_are_silent() {
    let p = NoiseExcitationParams { a: 0.0, b: 0.0, ..params() };
    let play = |paths| standalone(p.clone(), paths, 0.4).run().unwrap().stream(NoiseExcitationPorts::force);
    let go = piece([0.0; 2], [0.5, 0.0], 0.2);
    let rest = piece([0.1, 0.0], [0.0; 2], 0.2);
    let out = play(vec![(0, go), (ticks(0.2), rest)]);
    assert!(rms(&out[..8820]) > 0.1);
    assert!(out[8820 + 225..].iter().all(|x| *x == 0.0), "it goes on at rest");
    assert!(play(vec![(0, rest)]).iter().all(|x| *x == 0.0));
    assert!(play(vec![(0, PathPiece { force: [0.0; 2], ..go })]).iter().all(|x| *x == 0.0));
}

#[test]
fn a_loop_without_samples_is_an_error() {
    let empty = NoiseProfile { samples: Vec::new(), spacing: 1.0, ..NoiseProfile::default() };
    let standalone = Standalone::new::<NoiseExcitation>(params()).events::<PathPiece>(
        NoiseExcitationPorts::paths,
        vec![],
        1,
    );
    let error = standalone.value(NoiseExcitationPorts::noise, empty).run().map(|_| ()).unwrap_err();
    assert!(error.code == "F128" && error.to_string().contains("0 samples"), "{error}");
}
