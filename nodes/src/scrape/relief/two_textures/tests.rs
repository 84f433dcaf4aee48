use super::*;
use crate::core::item::AnyValue;
use crate::core::standalone::{Feed, Standalone};
use crate::core::time::Rate;
use crate::core::time::{Tick, ticks};
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::relief::joint_force::JointParams;
use crate::scrape::testing::{db, piece, rates_apart, rms};
use crate::texture::{Grid, LumaKind, Surface};

const FS: f64 = 44_100.0;

/// Parameters without impacts at joints, whose tests stand beside them.
fn params() -> TwoTexturesParams {
    let joints = JointParams { impacts: 0.0, ..TwoTexturesParams::read(&|_| None).unwrap().joints };
    TwoTexturesParams {
        joints,
        contact: ContactForceParams {
            rate: Rate::hz(44_100),
            ..TwoTexturesParams::read(&|_| None).unwrap().contact
        },
        ..TwoTexturesParams::read(&|_| None).unwrap()
    }
}

fn luma(density: f64, depth: f64, width: usize, at: impl Fn(usize) -> f32) -> Luma {
    Luma {
        grid: Grid::from_fn(width, 6, |x, _| at(x)),
        holes: Vec::new(),
        kind: LumaKind::Lstar,
        surface: Surface { density: [density; 2], depth, ..Surface::default() },
    }
}

fn standalone(a: Luma, b: Option<Luma>, paths: Vec<(Tick, PathPiece)>, end: f64) -> Standalone {
    standalone_of(params(), a, b, paths, end)
}

fn standalone_of(
    p: TwoTexturesParams,
    a: Luma,
    b: Option<Luma>,
    paths: Vec<(Tick, PathPiece)>,
    end: f64,
) -> Standalone {
    let standalone = Standalone::new::<TwoTextures>(p).events(TwoTexturesPorts::paths, paths, ticks(end));
    let standalone = standalone.value(TwoTexturesPorts::a, a);
    match b {
        Some(b) => standalone.feed(TwoTexturesPorts::b.index(), Feed::value(AnyValue::new(b))),
        None => standalone,
    }
}

fn force(a: Luma, b: Option<Luma>, paths: Vec<(Tick, PathPiece)>, end: f64) -> Vec<f32> {
    standalone(a, b, paths, end).run().unwrap().stream(TwoTexturesPorts::force)
}

#[test]
fn a_flat_partner_is_the_same_as_none() {
    let rough =
        || luma(2000.0, 1e-4, 512, |x| 50.0 + 50.0 * (x as f32 * std::f32::consts::TAU * 24.0 / 512.0).cos());
    let flat = luma(2000.0, 1e-4, 512, |_| 0.0);
    let path = vec![(0, piece([0.01, 0.0], [0.3, 0.0], 0.3))];
    let one = force(rough(), None, path.clone(), 0.3);
    let two = force(rough(), Some(flat), path, 0.3);
    let difference: Vec<f32> = one.iter().zip(&two).skip(200).map(|(a, b)| a - b).collect();
    let level = db(rms(&difference) / rms(&two));
    println!("a flat partner and none: {level:.1} dB apart");
    // A ball is worked out in each pixel, 0.5 mm wide, and the line of contact, 4 mm long, is read at 33 points.
    assert!(level < -42.0, "{level} dB");
}

/// Times between knocks: the first peak of the autocorrelation of the envelope, s.
fn period(x: &[f32], around: [f64; 2]) -> f64 {
    let hop = 44;
    let envelope: Vec<f64> = x.chunks(hop).map(|c| c.iter().map(|x| f64::from(x.abs())).sum()).collect();
    let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
    let at = |lag: usize| {
        let pairs = envelope.iter().zip(&envelope[lag..]);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>()
    };
    let lags = around.map(|t| (t * FS / hop as f64) as usize);
    let best = (lags[0]..lags[1]).max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap();
    best as f64 * hop as f64 / FS
}

/// Number of rises above half of the maximum after 30 ms of silence.
fn knocks(x: &[f32]) -> usize {
    let loud = x.iter().fold(0.0_f32, |m, x| m.max(x.abs())) * 0.5;
    let (mut count, mut last) = (0, -FS);
    for (n, _) in x.iter().enumerate().filter(|(_, x)| x.abs() > loud) {
        count += usize::from(n as f64 - last > 0.03 * FS);
        last = n as f64;
    }
    count
}

#[test]
fn a_ball_over_tiles_knocks_at_each_joint() {
    // Tiles of 0.1 m with joints of 4 mm, at 1000 pixels a metre.
    let tiles = || luma(1000.0, 1e-3, 400, |x| if x % 100 < 4 { 0.0 } else { 100.0 });
    for (v, time) in [(0.5, 0.2), (1.0, 0.1)] {
        let x = force(tiles(), None, vec![(0, piece([0.05, 0.0], [v, 0.0], 2.0))], 2.0);
        let found = period(&x, [0.5 * time, 1.6 * time]);
        assert!((found - time).abs() < 0.002, "{v} m/s: {found} s");
        assert_eq!(knocks(&x), (2.0 / time) as usize, "{v} m/s");
    }
}

/// A capsule of 60 mm between its ends that rolls at a speed along x, its axis turned by an angle from straight across: as physics
/// engines report it, one contact under each end, with half of the load.
fn capsule(v: f64, turn: f64) -> Vec<(Tick, PathPiece)> {
    let end = |contact: u64, side: f64| {
        let from = [0.05 + side * 0.03 * f64::sin(turn), 0.05 + side * 0.03 * f64::cos(turn)];
        (0, PathPiece { contact, force: [0.5; 2], ..piece(from, [v, 0.0], 2.0) })
    };
    vec![end(1, -1.0), end(2, 1.0)]
}

#[test]
fn a_capsule_over_tiles_knocks_at_each_joint() {
    // Tiles of 0.1 m with joints of 4 mm on all sides.
    let joint = |x: usize| x % 100 < 4;
    let tiles = || Luma {
        grid: Grid::from_fn(200, 200, |x, y| if joint(x) || joint(y) { 0.0 } else { 100.0 }),
        ..luma(1000.0, 1e-3, 1, |_| 0.0)
    };
    for (v, time) in [(0.5, 0.2), (1.0, 0.1)] {
        let straight = force(tiles(), None, capsule(v, 0.0), 2.0);
        let found = period(&straight, [0.5 * time, 1.6 * time]);
        assert!((found - time).abs() < 0.002, "{v} m/s: {found} s");
        assert_eq!(knocks(&straight), (2.0 / time) as usize, "{v} m/s");
        // Both ends knock at once, as a ball with the whole load does.
        let ball = force(tiles(), None, vec![(0, piece([0.05; 2], [v, 0.0], 2.0))], 2.0);
        let miss: Vec<f32> = straight.iter().zip(&ball).map(|(a, b)| a - b).collect();
        assert!(db(rms(&miss) / rms(&ball)) < -60.0, "{}", db(rms(&miss) / rms(&ball)));
        // Askew they knock one after the other, 30 mm apart, as often each.
        let askew = force(tiles(), None, capsule(v, std::f64::consts::FRAC_PI_6), 2.0);
        let found = period(&askew, [0.6 * time, 1.6 * time]);
        assert!((found - time).abs() < 0.002, "{v} m/s: {found} s");
        let half = |x: &[f32]| x.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        assert!((half(&askew) / half(&straight) - 0.5).abs() < 0.01);
    }
}

#[test]
fn windows_change_no_bit() {
    let rough = |k: usize| luma(2000.0, 1e-4, 256, move |x| ((x * k * x) % 101) as f32);
    let one = PathPiece {
        other: Some([[0.1, 0.0], [0.02, 0.01], [0.0; 2], [0.01, 0.0]]),
        ..piece([0.0; 2], [0.4, 0.1], 0.1)
    };
    let two = PathPiece { contact: 9, ..piece([0.0; 2], [-0.8, 0.1], 0.12) };
    let paths = vec![(ticks(0.0111), one), (ticks(0.05), two)];
    for b in [None, Some(rough(5))] {
        let run = |n: usize| {
            let standalone =
                standalone(rough(3), b.clone(), paths.clone(), 0.2).window(Rate::hz(44_100).span(n));
            standalone.run().unwrap().stream(TwoTexturesPorts::force)
        };
        let whole = run(10_000);
        assert!(rms(&whole) > 0.0);
        for n in [32, 100, 1024, 4096] {
            assert!(run(n) == whole, "{n}");
        }
    }
}

#[test]
fn a_relief_of_any_density_is_the_same_relief() {
    let tiles = |density: [f64; 2]| {
        let at = |x: usize, y: usize| {
            let (x, y) = (x as f64 / density[0], y as f64 / density[1]);
            if (x * 20.0).fract() < 0.1 || (y * 16.0).fract() < 0.1 { 0.0 } else { 100.0 }
        };
        let size = density.map(|d| (0.5 * d) as usize);
        let surface = Surface { density, depth: 1e-3, ..Surface::default() };
        Luma { grid: Grid::from_fn(size[0], size[1], at), surface, ..luma(1.0, 1e-3, 1, |_| 0.0) }
    };
    let path = vec![(0, piece([0.01, 0.01], [0.3, 0.2], 0.3))];
    let even = force(tiles([4000.0; 2]), None, path.clone(), 0.3);
    let uneven = force(tiles([4000.0, 2000.0]), None, path, 0.3);
    let ratio = rms(&uneven) / rms(&even);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

#[test]
fn a_linked_strength_takes_the_place_of_the_number() {
    let rough = || luma(2000.0, 1e-4, 256, |x| ((x * 7) % 101) as f32);
    let path = vec![(0, piece([0.01, 0.0], [0.3, 0.0], 0.1))];
    for b in [None, Some(rough())] {
        let linked = |kappa: f64| {
            let standalone = standalone(rough(), b.clone(), path.clone(), 0.1);
            standalone
                .feed(TwoTexturesPorts::kappa.index(), Feed::value(AnyValue::new(Strength::constant(kappa))))
        };
        let plain = force(rough(), b.clone(), path.clone(), 0.1);
        let strong = linked(4.0).run().unwrap().stream(TwoTexturesPorts::force);
        assert!(rms(&plain) > 0.0 && plain.iter().zip(&strong).all(|(a, b)| 4.0 * a == *b));
        let error = linked(f64::NAN).run().map(|_| ()).unwrap_err();
        assert!(error.code == "F128" && error.to_string().contains("`kappa`"), "{error}");
    }
}

#[test]
fn a_relief_of_no_numbers_is_an_error() {
    let broken = luma(1000.0, 1e-4, 16, |_| f32::NAN);
    let error = standalone(broken, None, vec![], 0.1).run().map(|_| ()).unwrap_err();
    assert!(error.code == "F128" && error.to_string().contains("none at all"), "{error}");
}

fn ripple(density: f64, depth: f64, cycles: f32) -> Luma {
    luma(density, depth, 512, move |x| {
        50.0 + 50.0 * (x as f32 * std::f32::consts::TAU * cycles / 512.0).cos()
    })
}

#[test]
fn a_scale_is_that_of_places_heights_and_the_radius() {
    let both = [None, Some(40.0)];
    for cycles in both {
        let at = |density: f64, depth: f64, p: TwoTexturesParams| {
            let other = cycles.map(|cycles| ripple(density, depth, cycles));
            let path = PathPiece {
                other: Some(piece([0.2, 0.0], [-0.1, 0.0], 0.3).position),
                ..piece([0.01, 0.0], [0.3, 0.0], 0.3)
            };
            let standalone = standalone_of(p, ripple(density, depth, 24.0), other, vec![(0, path)], 0.3);
            standalone.run().unwrap().stream(TwoTexturesPorts::force)
        };
        let one = at(
            2000.0,
            1e-4,
            TwoTexturesParams { contact: ContactForceParams { scale: 2.5, ..params().contact }, ..params() },
        );
        let two = at(800.0, 2.5e-4, TwoTexturesParams { radius: 2.5 * params().radius, ..params() });
        let difference: Vec<f32> = one.iter().zip(&two).map(|(a, b)| a - b).collect();
        assert!(rms(&two) > 1e-3 && db(rms(&difference) / rms(&two)) < -50.0, "{cycles:?}: {}", rms(&two));
    }
}

#[test]
fn edits_while_it_sounds_do_not_click() {
    let path = PathPiece {
        other: Some(piece([0.2, 0.0], [-0.1, 0.0], 1.0).position),
        ..piece([0.5, 0.0], [0.3, 0.0], 1.0)
    };
    let edits = [
        TwoTexturesParams { kappa: 3.0, ..params() },
        TwoTexturesParams { contact: ContactForceParams { gain: 0.0, ..params().contact }, ..params() },
        TwoTexturesParams { a_exponent: 0.3, ..params() },
        TwoTexturesParams { contact: ContactForceParams { scale: 1.02, ..params().contact }, ..params() },
        TwoTexturesParams { contact: ContactForceParams { scale: 1.7, ..params().contact }, ..params() },
    ];
    for (edit, b) in edits.iter().flat_map(|edit| [(edit, None), (edit, Some(ripple(2000.0, 1e-4, 7.0)))]) {
        // Far from the corner a gliding size would sweep a ball over many ripples: that is a sound of its own, not a
        // click.
        if b.is_none() && edit.contact.scale > 1.5 {
            continue;
        }
        let standalone = standalone(ripple(2000.0, 1e-4, 8.0), b.clone(), vec![(0, path)], 1.0);
        let mut run = standalone.window(Rate::hz(44_100).span(256)).start().unwrap();
        let mut count = 0;
        while run.step().unwrap() {
            count += 1;
            if count == 60 {
                assert_eq!(run.node().retune(edit), Retune::Done);
            }
        }
        let out = run.stream(TwoTexturesPorts::force);
        let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        let (before, during) = (step(&out[2000..15_000]), step(&out[15_000..17_000]));
        let after = step(&out[18_000..]).max(before);
        assert!(during < 4.0 * after, "{edit:?} {}: {during} against {before} and {after}", b.is_some());
    }
}

/// A relief of unrelated waves, and the path of two of them over each other.
fn rough_pair() -> ([Luma; 2], PathPiece) {
    let rough = |density: f64, seeds: [u64; 8]| {
        luma(density, 2e-4, 1024, move |x| {
            let wave = |k: &u64| (x as f32 * std::f32::consts::TAU * *k as f32 / 1024.0).sin();
            50.0 + 8.0 * seeds.iter().map(wave).sum::<f32>()
        })
    };
    let path = PathPiece {
        other: Some(piece([0.2, 0.0], [0.31, 0.0], 1.0).position),
        ..piece([0.01, 0.0], [0.8, 0.0], 1.0)
    };
    let pair = [
        rough(2000.0, [17, 29, 53, 71, 97, 131, 173, 211]),
        rough(3000.0, [13, 31, 47, 79, 103, 127, 167, 223]),
    ];
    (pair, path)
}

#[test]
fn the_sample_rate_changes_nothing_that_is_heard() {
    let ([a, b], path) = rough_pair();
    for other in [None, Some(b)] {
        let alone = other.is_none();
        let at = |rate: u32| {
            let p = TwoTexturesParams {
                contact: ContactForceParams { rate: Rate::hz(rate), ..params().contact },
                ..params()
            };
            let standalone = standalone_of(p, a.clone(), other.clone(), vec![(0, path)], 1.0);
            standalone.run().unwrap().stream(TwoTexturesPorts::force)
        };
        let miss = rates_apart(&at(44_100), &at(88_200));
        assert!(miss < 0.5, "alone: {alone}: {miss} dB");
    }
}

#[test]
fn rest_and_no_force_are_silent() {
    let ([a, b], go) = rough_pair();
    let go = go.part(0.0, 0.2, ticks(0.2));
    let still = |at: [f64; 2]| piece(at, [0.0; 2], 0.3).position;
    let end = go.position_at(1.0);
    let other = go.other.map(|c| [0, 1].map(|k| c.iter().map(|c| c[k]).sum::<f64>()));
    let rest = PathPiece { other: other.map(still), ..piece(end, [0.0; 2], 0.3) };
    for b in [None, Some(b)] {
        let p = TwoTexturesParams { a_exponent: 0.0, ..params() };
        let play = |paths: Vec<(Tick, PathPiece)>| {
            let standalone = standalone_of(p.clone(), a.clone(), b.clone(), paths, 0.5);
            standalone.run().unwrap().stream(TwoTexturesPorts::force)
        };
        let out = play(vec![(0, go), (ticks(0.2), rest)]);
        assert!(rms(&out[..8820]) > 0.0);
        assert!(out[8820 + 225..].iter().all(|x| *x == 0.0), "it goes on at rest");
        assert!(play(vec![(0, PathPiece { duration: ticks(0.5), ..rest })]).iter().all(|x| *x == 0.0));
        assert!(play(vec![(0, PathPiece { force: [0.0; 2], ..go })]).iter().all(|x| *x == 0.0));
        // A contact that rests on one side and slips on the other sounds, if there are two sides.
        let slips = PathPiece { other: go.other, ..piece(go.position_at(0.0), [0.0; 2], 0.2) };
        assert_eq!(rms(&play(vec![(0, slips)])) > 0.0, b.is_some());
    }
}
