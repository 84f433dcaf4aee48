use crate::core::item::AnyValue;
use crate::core::node::Retune;
use crate::core::params::Params;
use crate::core::standalone::{Feed, Standalone, StandaloneRun};
use crate::core::time::{Rate, Tick, ticks};
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::path::PathPiece;
use crate::scrape::relief::joint_force::JointParams;
use crate::scrape::relief::two_textures::{TwoTextures, TwoTexturesParams, TwoTexturesPorts};
use crate::scrape::testing::{db, piece, rms};
use crate::texture::{Grid, Luma, LumaKind, Surface};

const FS: f64 = 44_100.0;
const DENSITY: f64 = 1000.0;

fn params(kappa: f64) -> TwoTexturesParams {
    let p = TwoTexturesParams::read(&|_| None).unwrap();
    let contact = ContactForceParams { rate: Rate::hz(44_100), ..p.contact };
    let joints = JointParams { pair_impacts: 1.0, ..p.joints };
    TwoTexturesParams { kappa, contact, joints, ..p }
}

/// Tiles of 0.1 m with joints of `gap` pixels, and tops that are uneven by 10 um.
fn tiles(gap: usize) -> Luma {
    let top = |x: usize| 98.0 + (x as f32 * 0.3).sin() + 0.5 * (x as f32 * 0.71).cos();
    Luma {
        grid: Grid::from_fn(400, 6, |x, _| if x % 100 < gap { 0.0 } else { top(x) }),
        holes: Vec::new(),
        kind: LumaKind::Lstar,
        surface: Surface { density: [DENSITY; 2], depth: 1e-3, ..Surface::default() },
    }
}

fn standalone(p: TwoTexturesParams, a: Luma, paths: Vec<(Tick, PathPiece)>, end: f64) -> Standalone {
    let standalone = Standalone::new::<TwoTextures>(p).events(TwoTexturesPorts::paths, paths, ticks(end));
    standalone.value(TwoTexturesPorts::a, a)
}

/// The same on another relief.
fn on(b: Luma, p: TwoTexturesParams, a: Luma, paths: Vec<(Tick, PathPiece)>, end: f64) -> Standalone {
    standalone(p, a, paths, end).feed(TwoTexturesPorts::b.index(), Feed::value(AnyValue::new(b)))
}

fn area(out: &[f32]) -> f64 {
    out.iter().map(|f| f64::from(*f)).sum::<f64>() / FS
}

fn force(p: TwoTexturesParams, a: Luma, paths: Vec<(Tick, PathPiece)>, end: f64) -> Vec<f32> {
    standalone(p, a, paths, end).run().unwrap().stream(TwoTexturesPorts::force)
}

/// Content above 500 Hz: four high-passes of first order.
fn above_500(x: &[f32]) -> Vec<f32> {
    let feedback = (-std::f64::consts::TAU * 500.0 / FS).exp();
    let mut out: Vec<f64> = x.iter().map(|x| f64::from(*x)).collect();
    for _ in 0..4 {
        let (mut before, mut y) = (0.0, 0.0);
        for x in &mut out {
            y = feedback * (y + *x - before);
            before = *x;
            *x = y;
        }
    }
    out.into_iter().map(|x| x as f32).collect()
}

/// Times at which a ball at `v` m/s from 0.05 m on meets the middles of joints, s.
fn joints(gap: usize, v: f64, end: f64) -> Vec<f64> {
    let middle = |k: usize| (100.0 * k as f64 - 0.5 + 0.5 * gap as f64) / DENSITY;
    (1..).map(|k| (middle(k) - 0.05) / v).take_while(|t| *t < end - 0.05).collect()
}

#[test]
fn each_joint_has_the_impulse_of_its_width_and_the_speed() {
    for gap in [2, 4, 8] {
        for v in [0.25, 0.5, 1.0, 2.0] {
            let end = 0.45 / v;
            let out = force(params(0.0), tiles(gap), vec![(0, piece([0.05, 0.0], [v, 0.0], end))], end);
            // From the last pixel of one tile to the first of the next, whose heights differ by a little.
            let width = (gap + 1) as f64 / DENSITY;
            let right = 0.1 * 1.5 * v * width / 0.02;
            for t in joints(gap, v, end) {
                let [from, to] = [t - 0.002 / v, t + 0.02].map(|t| (t * FS) as usize);
                let area = out[from..to.min(out.len())].iter().map(|f| f64::from(*f)).sum::<f64>() / FS;
                assert!(
                    (area / right - 1.0).abs() < 0.01,
                    "{gap} px at {v} m/s, {t} s: {area} for {right} N s"
                );
            }
        }
    }
}

#[test]
fn each_joint_is_heard_over_the_rolling_between_them() {
    for (gap, v) in [(4, 0.5), (4, 1.0), (4, 0.25), (2, 0.5), (8, 0.5)] {
        let end = 1.05 / v;
        let out = force(params(1.0), tiles(gap), vec![(0, piece([0.05, 0.0], [v, 0.0], end))], end);
        let out = above_500(&out);
        let window = (0.02 * FS) as usize;
        let mut peaks = Vec::new();
        for t in joints(gap, v, end) {
            let start = ((t - 0.002) * FS) as usize;
            let between = ((t + 0.05 / v - 0.01) * FS) as usize;
            let level = db(rms(&out[start..start + window]) / rms(&out[between..between + window]));
            println!("{gap} mm at {v} m/s, {t:.3} s: {level:.1} dB over the rolling");
            assert!(level > 6.0, "{gap} mm at {v} m/s, {t} s: {level} dB");
            let loudest =
                (start..start + window).max_by(|a, b| out[*a].abs().total_cmp(&out[*b].abs())).unwrap();
            peaks.push(loudest as f64 / FS);
        }
        assert!(peaks.len() >= 9, "{}", peaks.len());
        assert!(peaks.windows(2).all(|w| (w[1] - w[0] - 0.1 / v).abs() < 0.002), "{peaks:?}");
    }
}

#[test]
fn windows_change_no_bit_of_overlapping_impacts() {
    let rough =
        Luma { grid: Grid::from_fn(256, 6, |x, y| ((x * 3 * x + 7 * y * x) % 101) as f32), ..tiles(1) };
    let contact = |contact: u64, v: [f64; 2]| PathPiece { contact, ..piece([0.01, 0.002], v, 0.15) };
    let paths = vec![
        (ticks(0.0111), contact(1, [0.4, 0.1])),
        (ticks(0.02), contact(2, [-0.8, 0.3])),
        (ticks(0.0203), contact(3, [1.7, 0.0])),
    ];
    let run = |n: usize| {
        let standalone = standalone(params(1.0), rough.clone(), paths.clone(), 0.2);
        let run = standalone.window(Rate::hz(44_100).span(n)).run().unwrap();
        (run.stream(TwoTexturesPorts::force), format!("{:?}", run.summary))
    };
    let whole = run(10_000);
    println!("{}", whole.1);
    for n in [1, 32, 100, 1024, 4096] {
        assert!(run(n) == whole, "{n}");
    }
}

#[test]
fn the_mass_of_a_contact_counts_and_both_directions_are_equal() {
    let path = |from: f64, v: f64, mass| vec![(0, PathPiece { mass, ..piece([from, 0.0], [v, 0.0], 0.5) })];
    let area = |paths| {
        let out = force(params(0.0), tiles(4), paths, 0.6);
        out.iter().map(|f| f64::from(*f)).sum::<f64>() / FS
    };
    let one = area(path(0.05, 0.5, None));
    assert!((area(path(0.05, 0.5, Some(0.3))) / one - 3.0).abs() < 1e-6);
    assert!((area(path(0.3, -0.5, None)) / one - 1.0).abs() < 1e-6, "{one}");
    // Nothing lands without force, at rest, or with a strength of 0.
    assert_eq!(area(vec![(0, PathPiece { force: [0.0; 2], ..piece([0.05, 0.0], [0.5, 0.0], 0.5) })]), 0.0);
    assert_eq!(area(path(0.1015, 0.0, None)), 0.0);
    let mut p = params(0.0);
    p.joints.impacts = 0.0;
    assert!(force(p, tiles(4), path(0.05, 0.5, None), 0.6).iter().all(|f| *f == 0.0));
}

/// Tiles with joints of `gap` pixels and even tops.
fn even_tiles(gap: usize) -> Luma {
    Luma { grid: Grid::from_fn(400, 6, |x, _| if x % 100 < gap { 0.0 } else { 100.0 }), ..tiles(1) }
}

#[test]
fn a_tip_strikes_joints_alike_whether_it_is_smooth_or_an_even_relief() {
    let flat = || Luma { grid: Grid::from_fn(16, 6, |_, _| 0.0), ..tiles(1) };
    for (gap, v) in [(4, 0.5), (8, 0.5), (8, -0.5), (8, 1.3)] {
        let from = if v > 0.0 { 0.05 } else { 0.35 };
        let path = vec![(0, piece([from, 0.001], [v, 0.0], 0.25 / v.abs()))];
        let end = 0.25 / v.abs() + 0.02;
        let alone = standalone(params(0.0), even_tiles(gap), path.clone(), end).run().unwrap();
        let smooth = alone.stream(TwoTexturesPorts::force);
        let run = on(flat(), params(0.0), even_tiles(gap), path, end).run().unwrap();
        let even = run.stream(TwoTexturesPorts::force);
        let impacts =
            |run: &StandaloneRun| run.summary.iter().find(|(k, _)| *k == "impacts").unwrap().1.clone();
        let summary = impacts(&run);
        println!("{gap} px at {v} m/s: {:.6} and {:.6} N s, {summary}", area(&smooth), area(&even));
        // A relief is smooth between its pixels, so its edges are closer together by up to a pixel.
        assert!((area(&even) / area(&smooth) - 1.0).abs() < 0.2, "{gap} {v}");
        assert_eq!(summary, impacts(&alone), "{gap} {v}");
        let first = |x: &[f32]| x.iter().position(|f| *f > 1e-6).unwrap() as f64;
        let apart = (first(&smooth) - first(&even)) / FS * v.abs();
        assert!(apart.abs() < 1e-3, "{gap} {v}: {apart} m apart");
    }
}

#[test]
fn joints_of_either_surface_strike_and_windows_change_no_bit() {
    // A joint of the other surface passes under the contact at 0.4 m/s.
    let flat = Luma { grid: Grid::from_fn(16, 6, |_, _| 0.0), ..tiles(1) };
    let moves = piece([0.05, 0.001], [0.4, 0.0], 0.5);
    let rests = PathPiece { other: Some(moves.position), ..piece([0.0; 2], [0.0; 2], 0.5) };
    let alone = on(flat.clone(), params(0.0), even_tiles(8), vec![(0, moves)], 0.6).run().unwrap();
    let turned = on(even_tiles(8), params(0.0), flat, vec![(0, rests)], 0.6).run().unwrap();
    let [one, other] = [&alone, &turned].map(|run| area(&run.stream(TwoTexturesPorts::force)));
    assert!((one / other - 1.0).abs() < 0.02, "{one} and {other} N s");

    let rough = |k: usize| Luma {
        grid: Grid::from_fn(256, 6, |x, y| ((x * k * x + 7 * y * x) % 101) as f32),
        ..tiles(1)
    };
    let contact = |contact: u64, v: [f64; 2]| PathPiece {
        contact,
        other: Some(piece([0.1, 0.0], [-0.3, 0.02], 0.15).position),
        ..piece([0.01, 0.002], v, 0.15)
    };
    let paths = vec![(ticks(0.0111), contact(1, [0.4, 0.1])), (ticks(0.0203), contact(2, [-0.8, 0.3]))];
    let run = |n: usize| {
        let run = on(rough(5), params(1.0), rough(3), paths.clone(), 0.2);
        let run = run.window(Rate::hz(44_100).span(n)).run().unwrap();
        (run.stream(TwoTexturesPorts::force), format!("{:?}", run.summary))
    };
    let whole = run(10_000);
    println!("{}", whole.1);
    assert!(!whole.1.contains("(\"impacts\", Number(0))"));
    for n in [1, 32, 100, 1024] {
        assert!(run(n) == whole, "{n}");
    }
}

#[test]
fn joints_strike_while_the_size_changes() {
    // 4 of 10 mm are deep: 28 joints in 0.28 s at 1 m/s.
    let comb =
        || Luma { grid: Grid::from_fn(400, 6, |x, _| if x % 10 < 4 { 0.0 } else { 100.0 }), ..tiles(1) };
    let flat = || Luma { grid: Grid::from_fn(16, 6, |_, _| 0.0), ..tiles(1) };
    let path = vec![(0, piece([0.055, 0.001], [1.0, 0.0], 0.28))];
    for b in [None, Some(flat())] {
        let struck = |changes: bool| {
            let run = match &b {
                None => standalone(params(0.0), comb(), path.clone(), 0.3),
                Some(b) => on(b.clone(), params(0.0), comb(), path.clone(), 0.3),
            };
            // A ramp lasts two windows.
            let mut run = run.window(Rate::hz(44_100).span(441)).start().unwrap();
            let mut windows = 0;
            while run.step().unwrap() {
                windows += 1;
                if changes && windows % 2 == 0 {
                    let mut p = params(0.0);
                    p.contact.scale = if windows % 4 == 0 { 1.0 } else { 1.01 };
                    assert_eq!(run.node().retune(&p), Retune::Done);
                }
            }
            run.finish().unwrap();
            let summary = format!("{:?}", run.summary);
            let (_, rest) = summary.split_once("(\"impacts\", Number(").unwrap();
            rest.split_once(')').unwrap().0.parse::<f64>().unwrap()
        };
        let [constant, changing] = [false, true].map(struck);
        println!("{constant} impacts at one size, {changing} while it changes");
        assert_eq!(constant, 28.0);
        assert!((changing - constant).abs() <= 3.0, "{changing}");
    }
}
