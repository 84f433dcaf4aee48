use super::*;
use crate::core::random::Rng as Dice;
use crate::core::standalone::Standalone;
use crate::core::time::Rate;
use crate::core::time::{Tick, seconds};
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::force::contact_force_params::ForceLawParams;
use crate::scrape::testing::{db, piece, rates_apart, rms};
use crate::texture::{Drawing, Grid, Levels, Luma, LumaKind, Surface, Wrap, isophotes};

const RATE: f64 = 48_000.0;

fn params() -> IsophoteExcitationParams {
    IsophoteExcitationParams {
        reference: crate::dsp::Reference::Absolute,
        ..IsophoteExcitationParams::read(&|_| None).unwrap()
    }
}

/// Isophotes of a function, with all points.
fn curves(size: [usize; 2], wrap: Wrap, levels: Vec<f32>, f: impl FnMut(usize, usize) -> f32) -> Isophotes {
    let surface = Surface { wrap, ..Surface::default() };
    let grid = Grid::from_fn(size[0], size[1], f);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    let levels = Levels::These(levels);
    isophotes(&luma, &Drawing { levels, pre_blur: 0.0, simplify: 0.0, ..Drawing::default() }).unwrap()
}

fn noise(seed: u64, n: usize) -> Vec<f32> {
    let mut dice = Dice::new(seed);
    let grid = Grid::from_fn(n, n, |_, _| dice.between(0.0, 100.0) as f32);
    crate::texture::smooth(&grid, &crate::texture::Kernel::gaussian(1.5, 4.0), Wrap::Repeat).samples
}

fn play(p: IsophoteExcitationParams, all: &Isophotes, pieces: &[(Tick, PathPiece)], end: f64) -> Vec<f32> {
    play_in(p, all, pieces, end, ticks(0.05))
}

fn play_in(
    p: IsophoteExcitationParams,
    all: &Isophotes,
    pieces: &[(Tick, PathPiece)],
    end: f64,
    window: Tick,
) -> Vec<f32> {
    let standalone = Standalone::new::<IsophoteExcitation>(p)
        .events(IsophoteExcitationPorts::paths, pieces.to_vec(), ticks(end))
        .value(IsophoteExcitationPorts::isophotes, all.clone());
    standalone.window(window).run().unwrap().stream(IsophoteExcitationPorts::force)
}

/// Path from a position in px at a velocity in m/s.
fn straight(px: [f64; 2], velocity: [f64; 2], duration: f64) -> PathPiece {
    piece(px.map(|x| x / 512.0), velocity, duration)
}

/// A wandering path over a surface, px.
fn wander(from: [f64; 2], reach: f64, count: usize) -> Vec<(Tick, PathPiece)> {
    let mut dice = Dice::new(11);
    let frame = ticks(1.0 / 60.0);
    let (mut at, mut v) = (from.map(|x| x / 512.0), [0.3, -0.2]);
    let steer = |at: f64, home: f64, dice: &mut Dice| {
        let off = (at - home) * 512.0 / reach;
        0.6 * dice.between(-1.0, 1.0) - 0.4 * off
    };
    (0..count)
        .map(|k| {
            let w = [0, 1].map(|i| 0.7 * v[i] + steer(at[i], from[i] / 512.0, &mut dice));
            let t = seconds(frame);
            let position = [at, v.map(|v| v * t), [0, 1].map(|i| 0.5 * (w[i] - v[i]) * t), [0.0; 2]];
            let one = PathPiece { position, duration: frame, ..straight(from, [0.0; 2], 1.0) };
            (at, v) = (one.position_at(1.0), w);
            (frame * k as Tick, one)
        })
        .collect()
}

/// Areas and centres of single pulses, in N s and samples.
fn pulses(x: &[f32]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    let (mut area, mut moment) = (0.0, 0.0);
    for (n, x) in x.iter().enumerate() {
        if x.abs() > 0.0 {
            area += f64::from(*x);
            moment += n as f64 * f64::from(*x);
        } else if area != 0.0 {
            found.push((area / RATE, moment / area));
            (area, moment) = (0.0, 0.0);
        }
    }
    found
}

/// The radii of the rings of a bowl, px.
const RINGS: [f64; 5] = [8.5, 15.5, 22.5, 40.5, 47.5];

/// A bowl of height r^2, whose slope at r is 2 r; rings exactly where the path crosses them.
fn bowl() -> Isophotes {
    let levels = RINGS.map(|r| ((r - 0.5).powi(2) + (r + 0.5).powi(2)) as f32 / 2.0);
    curves([129, 129], Wrap::Clamp, levels.to_vec(), |x, y| {
        (x as f32 - 64.0).powi(2) + (y as f32 - 64.0).powi(2)
    })
}

#[test]
fn rings_are_met_at_their_radius_over_the_speed() {
    for v in [0.5, 1.0] {
        // Along a row of pixels, where all points of curves lie on the path.
        let out = play(params(), &bowl(), &[(0, straight([64.0, 64.0], [v, 0.0], 0.2))], 0.25);
        let found = pulses(&out);
        let count = RINGS.iter().filter(|r| **r < 0.2 * v * 512.0).count();
        assert_eq!(found.len(), count, "{found:?}");
        let mut before = 0.0;
        for ((area, centre), r) in found.iter().zip(RINGS) {
            let time = (centre - 0.5 * RATE / (512.0 * v)) / RATE;
            assert!((time - r / (512.0 * v)).abs() * RATE < 0.01, "{r}: {time}");
            assert!((area * 1e3 - (2.0 * r - before)).abs() < 2e-3, "{r}: {area}");
            before = 2.0 * r;
        }
    }
}

#[test]
fn a_path_back_reverses_the_first_pulse_and_meets_the_same_changes() {
    let out = play(params(), &bowl(), &[(0, straight([64.0, 64.0], [1.0, 0.0], 0.12))], 0.2);
    let back = play(params(), &bowl(), &[(0, straight([125.44, 64.0], [-1.0, 0.0], 0.12))], 0.2);
    let (out, back) = (pulses(&out), pulses(&back));
    assert_eq!((out.len(), back.len()), (5, 5));
    assert!(out[0].0 > 0.0 && back[0].0 < 0.0 && (back[0].0 * 1e3 + 95.0).abs() < 3e-3, "{back:?}");
    for k in 1..5 {
        assert!((out[k].0 - back[5 - k].0).abs() < 3e-6, "between two rings the slope changes as much");
    }
}

#[test]
fn even_ground_sounds_once_and_a_path_along_a_curve_never() {
    let slope = |x: usize, y: usize| 3.0 * x as f32 + y as f32;
    let padded = curves([100, 100], Wrap::Clamp, (1..20).map(|k| 17.3 * k as f32).collect(), slope);
    let over = play(params(), &padded, &[(0, straight([10.0, 20.0], [0.5, 0.2], 0.3))], 0.35);
    let found = pulses(&over);
    let first = 1e-3 * (3.0 * 0.5 + 0.2) / 0.29_f64.sqrt();
    assert!((found[0].0 - first).abs() < 1e-8, "{found:?}");
    assert!(found[1..].iter().all(|(area, _)| area.abs() < 1e-8), "{found:?}");
    // Between two curves, and on one.
    for x in [50.0, (17.3 * 10.0 - 20.0) / 3.0] {
        let along = play(params(), &padded, &[(0, straight([x, 20.0], [-0.2, 0.6], 0.2))], 0.25);
        assert!(along.iter().all(|f| f.abs() < 1e-4), "{x}");
        let near = IsophoteExcitationParams { reading: Reading::Proximity, ..params() };
        let along = play(near, &padded, &[(0, straight([x, 20.0], [-0.2, 0.6], 0.2))], 0.25);
        assert!(along.iter().all(|f| f.abs() < 1e-4), "{x}");
    }
}

#[test]
fn nearness_has_its_form_and_change_is_taken_over_a_pixel() {
    // One straight curve on ground whose slope grows by 0.2 per pixel: L = 0.1 x^2.
    let all =
        curves([100, 40], Wrap::Clamp, vec![0.1 * 50.5 * 50.5 + 0.025], |x, _| 0.1 * (x as f32).powi(2));
    let p = IsophoteExcitationParams { reading: Reading::Proximity, ..params() };
    // It is met at 50.5 px, at a slope of 10.1, and nowhere else is another slope.
    let out = play(p, &all, &[(0, straight([40.0, 20.0], [1.0, 0.0], 0.04))], 0.05);
    let at = |px: f64| f64::from(out[((px - 40.0) / 512.0 * RATE).round() as usize]);
    let near = |d: f64| (1.0 - (d / 2.0_f64).powi(2)).powi(2);
    for (px, wanted) in
        [(48.0, 0.0), (48.8, 10.1 * near(1.7)), (49.3, 10.1 * near(1.2)), (50.5, 0.0), (53.0, 0.0)]
    {
        assert!((at(px) - wanted).abs() < 0.25, "{px}: {} for {wanted}", at(px));
    }
}

fn tiled(samples: &[f32], n: usize, map: impl Fn(usize) -> usize) -> impl FnMut(usize, usize) -> f32 {
    let samples = samples.to_vec();
    move |x, y| samples[map(y) * n + map(x)]
}

#[test]
fn seams_mirrors_and_borders_are_those_of_the_larger_image() {
    let n = 40;
    let samples = noise(3, n);
    let levels = || vec![44.0, 48.0, 52.0, 56.0];
    let image = |wrap| curves([n, n], wrap, levels(), tiled(&samples, n, |x| x));
    let twice = |map: fn(usize) -> usize| curves([80, 80], Wrap::Repeat, levels(), tiled(&samples, n, map));
    let mirrored = |x: usize| if x % 80 < 40 { x % 80 } else { 79 - x % 80 };
    let path = wander([30.0, 35.0], 60.0, 90);
    for reading in [Reading::Crossing, Reading::Proximity] {
        let p = IsophoteExcitationParams { reading, ..params() };
        for (small, large) in [(Wrap::Repeat, twice(|x| x % 40)), (Wrap::Mirror, twice(mirrored))] {
            let a = play(p.clone(), &image(small), &path, 1.6);
            let b = play(p.clone(), &large, &path, 1.6);
            let miss: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            assert!(rms(&a) > 0.3, "{reading:?} {small:?} is silent");
            assert!(db(rms(&miss) / rms(&a)) < -60.0, "{reading:?} {small:?}: {}", rms(&miss) / rms(&a));
        }
    }
    // Beyond the border the image continues as its border.
    let wide =
        curves([120, 120], Wrap::Clamp, levels(), tiled(&samples, n, |x| x.saturating_sub(40).min(39)));
    let moved: Vec<_> = path
        .iter()
        .map(|(t, one)| {
            let mut one = *one;
            one.position[0] = one.position[0].map(|x| x + 40.0 / 512.0);
            (*t, one)
        })
        .collect();
    let (a, b) = (play(params(), &image(Wrap::Clamp), &path, 1.6), play(params(), &wide, &moved, 1.6));
    let miss: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
    assert!(db(rms(&miss) / rms(&a)) < -20.0, "{}", rms(&miss) / rms(&a));
}

#[test]
fn the_sample_rate_changes_nothing_that_is_heard() {
    let n = 96;
    let samples = noise(7, n);
    let all = curves([n, n], Wrap::Repeat, vec![42.0, 46.0, 50.0, 54.0, 58.0], tiled(&samples, n, |x| x));
    let path = [(0, straight([3.3, 5.1], [1.2, 0.45], 1.0))];
    for reading in [Reading::Crossing, Reading::Proximity] {
        let at = |rate: u32| {
            let p = IsophoteExcitationParams {
                reading,
                contact: ContactForceParams { rate: Rate::hz(rate), ..params().contact },
                ..params()
            };
            play(p, &all, &path, 1.0)
        };
        let (low, high) = (at(44_100), at(88_200));
        let miss = rates_apart(&low, &high);
        assert!(miss < 0.5, "{reading:?}: {miss} dB");
    }
}

#[test]
fn rest_and_no_force_are_silent() {
    let n = 40;
    let samples = noise(3, n);
    let all = curves([n, n], Wrap::Repeat, vec![45.0, 50.0, 55.0], tiled(&samples, n, |x| x));
    let go = straight([1.0, 2.0], [0.8, 0.5], 0.2);
    let rest = PathPiece { position: [go.position_at(1.0), [0.0; 2], [0.0; 2], [0.0; 2]], ..go };
    for reading in [Reading::Crossing, Reading::Proximity] {
        let p =
            IsophoteExcitationParams { reading, law: ForceLawParams { a: 0.0, ..params().law }, ..params() };
        let out = play(p.clone(), &all, &[(0, go), (ticks(0.2), rest)], 0.4);
        assert!(rms(&out[..9600]) > 0.1);
        assert!(out[9600 + 245..].iter().all(|x| *x == 0.0), "{reading:?} goes on at rest");
        let lifted = PathPiece { force: [0.0; 2], ..go };
        assert!(play(p.clone(), &all, &[(0, lifted)], 0.3).iter().all(|x| *x == 0.0), "{reading:?}");
        let still = PathPiece { duration: ticks(0.3), ..rest };
        assert!(play(p, &all, &[(0, still)], 0.3).iter().all(|x| *x == 0.0), "{reading:?}");
    }
}

#[test]
fn blocks_of_any_length_give_the_same_bits() {
    let n = 40;
    let samples = noise(5, n);
    let all = curves([n, n], Wrap::Mirror, vec![45.0, 50.0, 55.0], tiled(&samples, n, |x| x));
    let mut path = wander([0.0, 20.0], 50.0, 20);
    // A second contact, one that jumps, and one that is cut short.
    let other = PathPiece { contact: 2, ..straight([5.0, 5.0], [1.0, 1.0], 0.1) };
    path.extend([(ticks(0.0503), other), (ticks(0.0911), PathPiece { jump: 1, ..other })]);
    path.push((ticks(0.12), straight([9.0, 5.0], [-1.0, 1.0], 0.1)));
    path.sort_by_key(|(tick, _)| *tick);
    for reading in [Reading::Crossing, Reading::Proximity] {
        let p = IsophoteExcitationParams { reading, ..params() };
        let whole = play_in(p.clone(), &all, &path, 0.35, ticks(1.0));
        assert!(rms(&whole) > 0.01);
        for block in [1, 32, 64, 100, 256, 1024, 4096] {
            let window = p.contact.rate.span(block);
            assert!(
                play_in(p.clone(), &all, &path, 0.35, window) == whole,
                "{reading:?} in blocks of {block}"
            );
        }
    }
}

#[test]
fn law_gain_and_scale_do_what_they_say() {
    let one =
        |p: IsophoteExcitationParams, piece: PathPiece| pulses(&play(p, &bowl(), &[(0, piece)], 0.3))[0];
    let go = straight([64.0, 64.0], [0.25, 0.0], 0.1);
    let (plain, _) = one(params(), go);
    let heavy = PathPiece { force: [4.0; 2], gain: [0.5; 2], ..go };
    let (area, _) = one(
        IsophoteExcitationParams {
            law: ForceLawParams { a: 0.5, b: 0.5, kappa: 3.0 },
            contact: ContactForceParams { gain: 2.0, ..params().contact },
            ..params()
        },
        heavy,
    );
    assert!((area / plain - 3.0 * 2.0 * 2.0 * 0.5 * 0.5).abs() < 1e-3, "{}", area / plain);
    // Twice the size is half the pixels at the same speed: from the corner that stays where it is.
    let far = straight([128.0, 128.0], [0.5, 0.0], 0.1);
    let (big, centre) = one(
        IsophoteExcitationParams {
            contact: ContactForceParams { scale: 2.0, ..params().contact },
            ..params()
        },
        far,
    );
    let (small, at) = one(params(), go);
    assert!((big - small).abs() < 1e-9 && (centre - at).abs() < 0.01, "{centre} {at}");
}

#[test]
fn turning_knobs_makes_no_steps_and_going_on_loses_nothing() {
    let n = 40;
    let samples = noise(5, n);
    let all = curves([n, n], Wrap::Repeat, vec![45.0, 50.0, 55.0], tiled(&samples, n, |x| x));
    let path = [(0, straight([1.0, 2.0], [0.3, 0.2], 0.4))];
    let p = IsophoteExcitationParams { reading: Reading::Proximity, ..params() };
    let quiet =
        IsophoteExcitationParams { radius: 1.0, law: ForceLawParams { kappa: 0.0, ..p.law }, ..p.clone() };
    let standalone = Standalone::new::<IsophoteExcitation>(p.clone())
        .events(IsophoteExcitationPorts::paths, path.to_vec(), ticks(0.4))
        .value(IsophoteExcitationPorts::isophotes, all.clone())
        .window(ticks(0.01));
    let mut run = standalone.start().unwrap();
    for k in 0.. {
        if k == 20 {
            assert_eq!(run.node().retune(&quiet), Retune::Done);
            let other = IsophoteExcitationParams {
                contact: ContactForceParams { contacts: 3, ..quiet.contact },
                ..quiet.clone()
            };
            assert_eq!(run.node().retune(&other), Retune::Rebuild);
        }
        if !run.step().unwrap() {
            break;
        }
    }
    let out = run.stream(IsophoteExcitationPorts::force);
    let plain = play(p, &all, &path, 0.4);
    assert_eq!(out[..9600], plain[..9600]);
    let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(step(&out[9500..]) <= 1.1 * step(&plain) && out[10_700..].iter().all(|x| *x == 0.0));
}

#[test]
fn too_many_crossings_and_too_much_speed_are_counted() {
    let n = 40;
    let samples = noise(5, n);
    let all = curves([n, n], Wrap::Repeat, (35..65).map(|k| k as f32).collect(), tiled(&samples, n, |x| x));
    for v in [150.0, 5000.0] {
        let path = vec![(0, straight([1.0, 2.0], [v, 0.3 * v], 0.1))];
        let standalone = Standalone::new::<IsophoteExcitation>(params())
            .events(IsophoteExcitationPorts::paths, path, ticks(0.1))
            .value(IsophoteExcitationPorts::isophotes, all.clone());
        let run = standalone.run().unwrap();
        let reported = run.summary.iter().find(|(name, _)| *name == "crossings_left_out");
        assert!(reported.is_some_and(|(_, count)| count.as_u64() > Some(100)), "{v}: {:?}", run.summary);
        assert!(run.stream(IsophoteExcitationPorts::force).iter().all(|x| x.is_finite()));
    }
}

#[test]
fn isophotes_that_cannot_be_read_are_refused() {
    let mut all = bowl();
    all.surface.density = [1e12, 512.0];
    let standalone = Standalone::new::<IsophoteExcitation>(params())
        .events(IsophoteExcitationPorts::paths, vec![], ticks(0.1))
        .value(IsophoteExcitationPorts::isophotes, all);
    let fault = standalone.run().err().unwrap();
    assert!(fault.code == "F127" && fault.message.contains("1000000000000"), "{fault}");
}
