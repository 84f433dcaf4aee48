use super::*;
use crate::core::standalone::Standalone;
use crate::core::time::Rate;
use crate::core::time::Tick;
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::force::contact_force_params::ForceLawParams;
use crate::scrape::testing::{piece, rates_apart, rms};
use crate::scrape::{PULSE, Pulses};
use crate::texture::{Drawing, Grid, Levels, Luma, LumaKind, Surface, Wrap, isophotes};

const RATE: f64 = 48_000.0;
const DENSITY: f64 = 512.0;
/// Positions of the lines of both surfaces, px.
const LINES: [&[f32]; 2] =
    [&[11.0, 24.0, 33.0, 51.0, 64.0, 90.0, 101.0], &[17.0, 21.0, 40.0, 58.0, 77.0, 84.0]];

fn params() -> FeatureCrossingsParams {
    FeatureCrossingsParams::read(&|_| None).unwrap()
}

/// Vertical lines at positions in px, all with one slope.
fn lines(positions: &[f32], slope: f32) -> Isophotes {
    let surface = Surface { wrap: Wrap::Clamp, ..Surface::default() };
    let grid = Grid::from_fn(120, 30, |x, _| slope * x as f32);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    let levels = Levels::These(positions.iter().map(|x| slope * x).collect());
    isophotes(&luma, &Drawing { levels, pre_blur: 0.0, simplify: 0.0, ..Drawing::default() }).unwrap()
}

fn standalone(p: FeatureCrossingsParams, paths: Vec<(Tick, PathPiece)>, slopes: [f32; 2]) -> Standalone {
    Standalone::new::<FeatureCrossings>(p)
        .events(FeatureCrossingsPorts::paths, paths, ticks(0.5))
        .value(FeatureCrossingsPorts::first, lines(LINES[0], slopes[0]))
        .value(FeatureCrossingsPorts::second, lines(LINES[1], slopes[1]))
}

fn count(standalone: &Standalone) -> (u64, Vec<f32>) {
    let run = standalone.run().unwrap();
    let reported = run.summary.iter().find(|(key, _)| *key == "meetings").unwrap();
    (reported.1.as_u64().unwrap(), run.stream(FeatureCrossingsPorts::force))
}

/// Along the first surface at one speed, along the second at another, m/s.
fn passing(first: f64, second: f64) -> PathPiece {
    let start = |v: f64| if v < 0.0 { 0.22 } else { 0.004 };
    let other = piece([start(second), 0.03], [second, 0.0], 0.3).position;
    PathPiece { other: Some(other), ..piece([start(first), 0.03], [first, 0.0], 0.3) }
}

#[test]
fn lines_cross_when_both_displacements_add_up_to_their_positions_and_within_reach() {
    for (first, second, reach) in
        [(0.5, 0.3, 0.012), (0.4, 0.0, 0.03), (0.6, -0.2, 0.02), (-0.3, -0.35, 0.015)]
    {
        let p =
            FeatureCrossingsParams { reach, law: ForceLawParams { kappa: 3.0, ..params().law }, ..params() };
        let path = passing(first, second);
        let (meetings, out) = count(&standalone(p, vec![(0, path)], [2.0, 0.5]));
        // The definition, pair by pair.
        let mut right = Pulses::new(1000, RATE);
        let mut expected = 0;
        let (a, b) = (path.position_at(0.0)[0], path.other.unwrap()[0][0]);
        // Along the path: a surface that is passed backwards has mirrored lines.
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
        other: Some(piece([0.1, 0.0], [0.35, 0.0], time).position),
        ..piece([0.0, 0.003], [0.5, 0.0], time)
    };
    let standalone = Standalone::new::<FeatureCrossings>(FeatureCrossingsParams { reach, ..params() })
        .events(FeatureCrossingsPorts::paths, vec![(0, path)], ticks(0.5))
        .value(FeatureCrossingsPorts::first, even(20))
        .value(FeatureCrossingsPorts::second, even(15));
    // Each step has a rising line and a falling one.
    let dense = |step: f64| 2.0 * DENSITY / step;
    let right = dense(20.0) * dense(15.0) * 2.0 * reach * 0.85 * time;
    let (found, _) = count(&standalone);
    assert!((found as f64 / right - 1.0).abs() < 0.08, "{found} {right}");
}

#[test]
fn windows_change_no_bit_and_surfaces_count_alike() {
    let bent =
        PathPiece { position: [[0.01, 0.02], [0.1, 0.01], [0.03, 0.005], [-0.01, 0.0]], ..passing(0.5, 0.3) };
    let two = PathPiece { contact: 9, ..passing(0.3, 0.2) };
    let paths = vec![(ticks(0.0111), bent), (ticks(0.05), two)];
    let p = FeatureCrossingsParams { reach: 0.02, ..params() };
    let (meetings, whole) = count(&standalone(p.clone(), paths.clone(), [1.0; 2]).window(ticks(1.0)));
    assert!(meetings > 10 && rms(&whole) > 0.0);
    for n in [1, 32, 100, 1024, 4096] {
        assert!(
            count(&standalone(p.clone(), paths.clone(), [1.0; 2]).window(p.contact.rate.span(n))).1 == whole,
            "{n}"
        );
    }
    let turned =
        |one: PathPiece| PathPiece { position: one.other.unwrap(), other: Some(one.position), ..one };
    let back = Standalone::new::<FeatureCrossings>(p)
        .events(FeatureCrossingsPorts::paths, vec![(ticks(0.05), turned(two))], ticks(0.5))
        .value(FeatureCrossingsPorts::first, lines(LINES[1], 1.0))
        .value(FeatureCrossingsPorts::second, lines(LINES[0], 1.0));
    let p = FeatureCrossingsParams { reach: 0.02, ..params() };
    assert_eq!(count(&back), count(&standalone(p, vec![(ticks(0.05), two)], [1.0; 2])));
}

#[test]
fn rest_and_no_force_are_silent_and_knobs_make_no_steps() {
    let rest = passing(0.0, 0.0);
    assert!(count(&standalone(params(), vec![(0, rest)], [1.0; 2])).1.iter().all(|x| *x == 0.0));
    let lifted = PathPiece { force: [0.0; 2], ..passing(0.5, 0.3) };
    assert!(count(&standalone(params(), vec![(0, lifted)], [1.0; 2])).1.iter().all(|x| *x == 0.0));
    let p = FeatureCrossingsParams { reach: 0.03, ..params() };
    let plain = count(&standalone(p.clone(), vec![(0, passing(0.5, 0.3))], [1.0; 2])).1;
    let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    for edit in [
        FeatureCrossingsParams { law: ForceLawParams { kappa: 0.0, ..p.law }, ..p.clone() },
        FeatureCrossingsParams { contact: ContactForceParams { scale: 1.3, ..p.contact }, ..p.clone() },
        FeatureCrossingsParams { law: ForceLawParams { b: 0.5, ..p.law }, ..p.clone() },
    ] {
        let standalone = standalone(p.clone(), vec![(0, passing(0.5, 0.3))], [1.0; 2]).window(ticks(0.005));
        let mut run = standalone.start().unwrap();
        for k in 0.. {
            if k == 20 {
                assert_eq!(run.node().retune(&edit), Retune::Done);
                let other = FeatureCrossingsParams {
                    contact: ContactForceParams { contacts: 3, ..edit.contact },
                    ..edit.clone()
                };
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

#[test]
fn the_sample_rate_changes_nothing_that_is_heard() {
    let uneven = |steps: [usize; 4]| {
        let round: usize = steps.iter().sum();
        let edge =
            |x: usize| steps.iter().scan(0, |at, s| Some(std::mem::replace(at, *at + s))).any(|at| at == x);
        let grid = Grid::from_fn(round, 40, |x, y| if edge((x + y / 7) % round) { 1.0 } else { 0.0 });
        let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface: Surface::default() };
        let levels = Levels::These(vec![0.4]);
        isophotes(&luma, &Drawing { levels, pre_blur: 0.0, simplify: 0.0, ..Drawing::default() }).unwrap()
    };
    let path = PathPiece {
        other: Some(piece([0.1, 0.003], [0.35, 0.01], 1.0).position),
        ..piece([0.0, 0.003], [0.8, 0.02], 1.0)
    };
    let at = |rate: u32| {
        let p = FeatureCrossingsParams {
            width: 0.2,
            reach: 0.01,
            contact: ContactForceParams { rate: Rate::hz(rate), ..params().contact },
            ..params()
        };
        let standalone = Standalone::new::<FeatureCrossings>(p)
            .events(FeatureCrossingsPorts::paths, vec![(0, path)], ticks(1.0))
            .value(FeatureCrossingsPorts::first, uneven([13, 21, 34, 18]))
            .value(FeatureCrossingsPorts::second, uneven([17, 29, 11, 40]));
        count(&standalone)
    };
    let ((met, low), (too, high)) = (at(44_100), at(88_200));
    let miss = rates_apart(&low, &high);
    assert!(met > 30 && met == too && miss < 0.5, "{met} and {too} meetings, {miss} dB");
}

#[test]
fn with_a_linked_strength_all_that_is_twice_as_large_and_passed_twice_as_fast_is_twice_as_loud() {
    use crate::core::item::AnyValue;
    use crate::core::standalone::Feed;
    use crate::scrape::SpeedCurve;
    let play = |scale: f64, speed: f64, kappa: Strength| {
        let p = FeatureCrossingsParams {
            reach: 0.02,
            contact: ContactForceParams { scale, ..params().contact },
            ..params()
        };
        let path = passing(0.5 * speed, 0.3 * speed);
        let big = |c: [[f64; 2]; 4]| [c[0].map(|x| x * scale), c[1], c[2], c[3]];
        let path = PathPiece { position: big(path.position), other: path.other.map(big), ..path };
        let kappa = Feed::value(AnyValue::new(kappa));
        let standalone =
            standalone(p, vec![(0, path)], [1.0; 2]).feed(FeatureCrossingsPorts::kappa.index(), kappa);
        count(&standalone)
    };
    let curve = Some(SpeedCurve::new(0.8, std::array::from_fn(|k| 1.0 + 0.2 * k as f64)).of_relief());
    let strength = Strength { kappa: 2.0, curve };
    let (met, once) = play(1.0, 1.0, strength);
    let (too, twice) = play(2.0, 2.0, strength);
    assert!(met > 5 && met == too, "{met} {too}");
    for (a, b) in once.iter().zip(&twice) {
        assert!((2.0 * a - b).abs() < 1e-3 * rms(&twice) as f32 + 2e-3 * b.abs(), "{a} {b}");
    }
    let (_, none) = play(1.0, 1.0, Strength::constant(0.0));
    assert!(none.iter().all(|x| *x == 0.0));
}
