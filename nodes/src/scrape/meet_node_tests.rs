use super::*;
use crate::core::solo::Solo;
use crate::core::time::Tick;
use crate::scrape::testing::{piece, rms};
use crate::scrape::{PULSE, Pulses};
use crate::texture::{Drawing, Grid, Levels, Luma, LumaKind, Surface, Wrap, isophotes};

const RATE: f64 = 48_000.0;
const DENSITY: f64 = 512.0;
/// Where the lines of both surfaces lie, px.
const LINES: [&[f32]; 2] =
    [&[11.0, 24.0, 33.0, 51.0, 64.0, 90.0, 101.0], &[17.0, 21.0, 40.0, 58.0, 77.0, 84.0]];

fn params() -> FeatureCrossingsParams {
    FeatureCrossingsParams::read(&|_| None).unwrap()
}

/// Upright lines at places in px, of a slope.
fn lines(places: &[f32], slope: f32) -> Isophotes {
    let surface = Surface { wrap: Wrap::Clamp, ..Surface::default() };
    let grid = Grid::from_fn(120, 30, |x, _| slope * x as f32);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    let levels = Levels::These(places.iter().map(|x| slope * x).collect());
    isophotes(&luma, &Drawing { levels, pre_blur: 0.0, simplify: 0.0, ..Drawing::default() }).unwrap()
}

fn solo(p: FeatureCrossingsParams, paths: Vec<(Tick, PathPiece)>, slopes: [f32; 2]) -> Solo {
    Solo::new::<FeatureCrossings>(p)
        .events(FeatureCrossingsPorts::paths, paths, ticks(0.5))
        .value(FeatureCrossingsPorts::first, lines(LINES[0], slopes[0]))
        .value(FeatureCrossingsPorts::second, lines(LINES[1], slopes[1]))
}

fn count(solo: &Solo) -> (u64, Vec<f32>) {
    let run = solo.run().unwrap();
    let told = run.summary.iter().find(|(key, _)| *key == "meetings").unwrap();
    (told.1.as_u64().unwrap(), run.stream(FeatureCrossingsPorts::force))
}

/// Along the first surface at one speed, along the second at another, m/s.
fn passing(first: f64, second: f64) -> PathPiece {
    let start = |v: f64| if v < 0.0 { 0.22 } else { 0.004 };
    let other = piece([start(second), 0.03], [second, 0.0], 0.3).place;
    PathPiece { other: Some(other), ..piece([start(first), 0.03], [first, 0.0], 0.3) }
}

#[test]
fn lines_meet_when_both_ways_add_up_to_their_places_and_within_reach() {
    for (first, second, reach) in
        [(0.5, 0.3, 0.012), (0.4, 0.0, 0.03), (0.6, -0.2, 0.02), (-0.3, -0.35, 0.015)]
    {
        let p = FeatureCrossingsParams { reach, kappa: 3.0, ..params() };
        let path = passing(first, second);
        let (meetings, out) = count(&solo(p, vec![(0, path)], [2.0, 0.5]));
        // The definition, pair by pair.
        let mut right = Pulses::new(1000, RATE);
        let mut expected = 0;
        let (a, b) = (path.place_at(0.0)[0], path.other.unwrap()[0][0]);
        // Along the way: a surface passed backwards has its lines mirrored.
        let sign = f64::signum(first);
        for (x, y) in LINES[0].iter().flat_map(|x| LINES[1].iter().map(move |y| (*x, *y))) {
            let [x, y] = [x, y].map(|x| f64::from(x) / DENSITY);
            let time = (x + y - a - b) / (first + second);
            let off = sign * (x - a - first * time);
            if time > 0.0 && time < 0.3 && off.abs() <= reach {
                expected += 1;
                let width = 1.0 / (DENSITY * (first + second).abs());
                right.add(0, time * RATE, width, PULSE * 3.0 * 2.0 * 0.5, (1, 0));
            }
        }
        assert!(meetings == expected && expected >= 2, "{first} {second}: {meetings} for {expected}");
        let mut wanted = vec![0.0; out.len()];
        right.read(0, &mut wanted);
        let miss: Vec<f32> = out.iter().zip(&wanted).map(|(a, b)| a - b).collect();
        assert!(rms(&miss) < 1e-3 * rms(&wanted), "{first} {second}: {} {}", rms(&miss), rms(&wanted));
    }
}

#[test]
fn even_lines_meet_as_often_as_their_densities_say() {
    // Both repeat: pairs of lines per square metre, times the area that the line of contact sweeps.
    let even = |step: usize| {
        let grid = Grid::from_fn(120, 40, |x, _| (x % step) as f32);
        let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
        let levels = Levels::These(vec![1.25]);
        isophotes(&luma, &Drawing { levels, pre_blur: 0.0, simplify: 0.0, ..Drawing::default() }).unwrap()
    };
    let (time, reach) = (0.4, 0.02);
    let path = PathPiece {
        other: Some(piece([0.1, 0.0], [0.35, 0.0], time).place),
        ..piece([0.0, 0.003], [0.5, 0.0], time)
    };
    let solo = Solo::new::<FeatureCrossings>(FeatureCrossingsParams { reach, ..params() })
        .events(FeatureCrossingsPorts::paths, vec![(0, path)], ticks(0.5))
        .value(FeatureCrossingsPorts::first, even(20))
        .value(FeatureCrossingsPorts::second, even(15));
    // Each step has a rising line and a falling one.
    let dense = |step: f64| 2.0 * DENSITY / step;
    let right = dense(20.0) * dense(15.0) * 2.0 * reach * 0.85 * time;
    let (found, _) = count(&solo);
    assert!((found as f64 / right - 1.0).abs() < 0.08, "{found} {right}");
}

#[test]
fn windows_change_no_bit_and_surfaces_count_alike() {
    let bent =
        PathPiece { place: [[0.01, 0.02], [0.1, 0.01], [0.03, 0.005], [-0.01, 0.0]], ..passing(0.5, 0.3) };
    let two = PathPiece { contact: 9, ..passing(0.3, 0.2) };
    let paths = vec![(ticks(0.0111), bent), (ticks(0.05), two)];
    let p = FeatureCrossingsParams { reach: 0.02, ..params() };
    let (meetings, whole) = count(&solo(p.clone(), paths.clone(), [1.0; 2]).window(ticks(1.0)));
    assert!(meetings > 10 && rms(&whole) > 0.0);
    for n in [1, 32, 100, 1024, 4096] {
        assert!(count(&solo(p.clone(), paths.clone(), [1.0; 2]).window(p.rate.span(n))).1 == whole, "{n}");
    }
    let turned = |one: PathPiece| PathPiece { place: one.other.unwrap(), other: Some(one.place), ..one };
    let back = Solo::new::<FeatureCrossings>(p)
        .events(FeatureCrossingsPorts::paths, vec![(ticks(0.05), turned(two))], ticks(0.5))
        .value(FeatureCrossingsPorts::first, lines(LINES[1], 1.0))
        .value(FeatureCrossingsPorts::second, lines(LINES[0], 1.0));
    let p = FeatureCrossingsParams { reach: 0.02, ..params() };
    assert_eq!(count(&back), count(&solo(p, vec![(ticks(0.05), two)], [1.0; 2])));
}

#[test]
fn rest_and_no_force_are_silent_and_knobs_make_no_steps() {
    let rest = passing(0.0, 0.0);
    assert!(count(&solo(params(), vec![(0, rest)], [1.0; 2])).1.iter().all(|x| *x == 0.0));
    let lifted = PathPiece { force: [0.0; 2], ..passing(0.5, 0.3) };
    assert!(count(&solo(params(), vec![(0, lifted)], [1.0; 2])).1.iter().all(|x| *x == 0.0));
    let p = FeatureCrossingsParams { reach: 0.03, ..params() };
    let plain = count(&solo(p.clone(), vec![(0, passing(0.5, 0.3))], [1.0; 2])).1;
    let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    for edit in [
        FeatureCrossingsParams { kappa: 0.0, ..p.clone() },
        FeatureCrossingsParams { scale: 1.3, ..p.clone() },
        FeatureCrossingsParams { b: 0.5, ..p.clone() },
    ] {
        let solo = solo(p.clone(), vec![(0, passing(0.5, 0.3))], [1.0; 2]).window(ticks(0.005));
        let mut run = solo.start().unwrap();
        for k in 0.. {
            if k == 20 {
                assert_eq!(run.node().retune(&edit), Retune::Done);
                let other = FeatureCrossingsParams { contacts: 3, ..edit.clone() };
                assert_eq!(run.node().retune(&other), Retune::Rebuild);
            }
            if !run.step().unwrap() {
                break;
            }
        }
        let out = run.stream(FeatureCrossingsPorts::force);
        assert!(step(&out) <= 2.0 * step(&plain), "{edit:?}: {} {}", step(&out), step(&plain));
    }
}
