use super::*;
use crate::core::item::AnyValue;
use crate::core::standalone::{Feed, Standalone};
use crate::texture::{Grid, LumaKind, Surface};
use std::f64::consts::TAU;

use crate::rigid::testing::{shipped, thinned};
use crate::rigid::{Classifier, LogOptions, Rules, read_contacts};

const FRAME: f64 = 1.0 / 60.0;

type Pieces = Vec<(Tick, PathPiece)>;

fn params() -> ContactPathParams {
    ContactPathParams::read(&|_| None).unwrap()
}

fn contact(position: [f64; 2], velocity: [f64; 2]) -> ContactState {
    let point = [position[0], position[1], 0.0];
    let travel = [velocity[0] as f32, velocity[1] as f32, 0.0];
    ContactState {
        frame: ContactFrame {
            contact: 1,
            bodies: [0, 1],
            interval: ticks(FRAME),
            point,
            local: [point; 2],
            normal: [0.0, 0.0, 1.0],
            force: 2.0,
            friction: None,
            velocity: travel,
            travel: [Some(travel), None],
            approach: None,
            depth: None,
            mass: None,
            begins: false,
            ends: false,
        },
        state: State::Sliding,
        slip: 1.0,
        power: 1.0,
        gain: 1.0,
        sliding: 1.0,
        rolling: 0.0,
        variation: [0.0; 2],
        prominence: 0.0,
        median: 0.0,
    }
}

/// Contacts on a path, at 60 frames a second.
fn along(path: impl Fn(f64) -> [f64; 4], count: u32) -> Vec<(Tick, ContactState)> {
    let frame = |k: u32| {
        let t = f64::from(k) * FRAME;
        let [x, y, vx, vy] = path(t);
        (ticks(t), contact([x, y], [vx, vy]))
    };
    (0..count).map(frame).collect()
}

fn standalone(p: ContactPathParams, contacts: Vec<(Tick, ContactState)>) -> Standalone {
    let end = contacts.last().map_or(0, |(tick, _)| tick + 1);
    Standalone::new::<ContactPath>(p).events(ContactPathPorts::contacts, contacts, end).window(ticks(0.007))
}

fn follow(p: ContactPathParams, contacts: Vec<(Tick, ContactState)>) -> Pieces {
    standalone(p, contacts).run().unwrap().events(ContactPathPorts::paths)
}

fn at(pieces: &Pieces, time: f64) -> Option<(PathPiece, f64)> {
    let tick = ticks(time);
    let now = pieces.iter().rev().find(|(from, p)| (*from..from + p.duration).contains(&tick))?;
    Some((now.1, (tick - now.0) as f64 / now.1.duration as f64))
}

#[test]
fn even_motion_is_exact_to_a_nanometre() {
    // Velocities travel in single precision.
    let path = |t: f64| [0.3 + 0.75 * t, -0.1875 * t, 0.75, -0.1875];
    for (mode, velocities) in [
        (PathMode::Hermite, Velocities::Given),
        (PathMode::Hermite, Velocities::Differences),
        (PathMode::Extrapolate, Velocities::Given),
    ] {
        let pieces = follow(ContactPathParams { mode, velocities, ..params() }, along(path, 40));
        for k in 0..500 {
            let t = 0.06 + f64::from(k) * 1e-3;
            let (piece, s) = at(&pieces, t).expect("a piece");
            let ([x, y], right) = (piece.position_at(s), path(t));
            assert!((x - right[0]).abs() < 1e-9 && (y - right[1]).abs() < 1e-9, "{mode:?} {t}: {x} {y}");
        }
    }
}

#[test]
fn a_circle_of_twelve_frames_is_round_within_half_a_percent() {
    let (w, r) = (TAU / (12.0 * FRAME), 0.05);
    let path = |t: f64| {
        let (sin, cos) = (w * t).sin_cos();
        [r * cos, r * sin, -r * w * sin, r * w * cos]
    };
    for velocities in [Velocities::Given, Velocities::Differences] {
        let pieces = follow(ContactPathParams { velocities, ..params() }, along(path, 60));
        for k in 0..800 {
            let (piece, s) = at(&pieces, 0.06 + f64::from(k) * 1e-3).expect("a piece");
            let [x, y] = piece.position_at(s);
            assert!((x.hypot(y) / r - 1.0).abs() < 0.005, "{velocities:?}: {}", x.hypot(y));
        }
    }
}

#[test]
fn the_guard_goes_straight_where_velocities_do_not_fit_the_path() {
    // Four times as fast as the positions state, across: a cubic would swing far out.
    let path = |t: f64| [0.2 * t, 0.0, 0.0, 0.8];
    let swing = |guard: bool| {
        let p = ContactPathParams { guard, teleport: 1e6, ..params() };
        let pieces = follow(p, along(path, 30));
        let mut out = 0.0_f64;
        for k in 0..300 {
            let t = 0.05 + f64::from(k) * 1e-3;
            let (piece, s) = at(&pieces, t).expect("a piece");
            let [x, y] = piece.position_at(s);
            if guard {
                assert!((x - 0.2 * t).abs() < 1e-9, "{t}: even along the path");
            }
            out = out.max(y.abs());
        }
        out
    };
    assert!(swing(true) < 1e-12 && swing(false) > 1e-3, "{} {}", swing(true), swing(false));
    // Just below three times the distance nothing is cut off.
    let fits = |t: f64| [0.2 * t, 0.0, 0.0, 0.59];
    let pieces = follow(params(), along(fits, 30));
    assert!(pieces.iter().any(|(_, p)| p.position[2] != [0.0; 2]));
}

#[test]
fn the_latency_is_the_declared_one_and_prediction_has_none() {
    use PathMode::{Extrapolate, Hermite};
    for (mode, velocities, frames) in [
        (Hermite, Velocities::Given, 1),
        (Hermite, Velocities::Differences, 2),
        (Extrapolate, Velocities::Given, 0),
    ] {
        for frame in [1.0 / 60.0, 1.0 / 30.0] {
            let standalone =
                standalone(ContactPathParams { mode, velocities, frame, ..params() }, along(|_| [0.0; 4], 3));
            let ahead = standalone.shape().unwrap().lookaround[0].ahead as Tick;
            assert_eq!(ahead, frames * (ticks(frame) + ticks(frame) / 100), "{mode:?} {velocities:?}");
        }
    }
}

#[test]
fn without_slip_the_places_on_both_bodies_go_on_together() {
    // A ball that rolls along x at 0.75 m/s: its own surface passes as fast under the contact, in its own axes.
    let mut contacts = along(|t| [0.75 * t, 0.1, 0.75, 0.0], 40);
    for (tick, contact) in &mut contacts {
        contact.frame.local[1] = [0.2 + 0.75 * crate::core::time::seconds(*tick), -0.3, 0.0];
        contact.state = State::Rolling;
    }
    let pieces = follow(ContactPathParams { both: true, ..params() }, contacts);
    for k in 0..400 {
        let t = 0.06 + f64::from(k) * 1e-3;
        let (piece, s) = at(&pieces, t).expect("a piece");
        let other = PathPiece { position: piece.other.expect("the other position"), ..piece };
        let ([x, y], [u, v]) = (piece.position_at(s), other.position_at(s));
        assert!((x - 0.75 * t).abs() < 1e-9 && (u - 0.2 - 0.75 * t).abs() < 1e-6, "{t}: {x} {u}");
        assert!((y - 0.1).abs() < 1e-9 && (v + 0.3).abs() < 1e-9);
        let ([a, b], [c, d]) = (piece.velocity_at(s), other.velocity_at(s));
        assert!((a - c).abs() < 1e-5 && (b - d).abs() < 1e-5, "{t}: both as fast: {a} {c}");
    }
}

/// Weighted force of the box along its path, N, from 1.2 s to 2.2 s in steps of 1 ms.
fn slid(contacts: &str, poses: &str) -> Vec<f64> {
    let options = LogOptions { masses: vec![0.0, 0.0, 1.2], ..LogOptions::default() };
    let contact = read_contacts(contacts.as_bytes(), Some(poses.as_bytes()), &options).unwrap();
    let mut classifier = Classifier::new(Rules::default(), 16);
    let states: Vec<_> = contact
        .frames
        .iter()
        .filter_map(|(tick, frame)| Some((*tick, classifier.take(*tick, frame)?)))
        .collect();
    let down = ContactPathParams { a: Some(1), b: Some(2), u: [0.927, 0.0, -0.375], join: true, ..params() };
    let pieces = follow(down, states);
    let force = |time: f64| at(&pieces, time).map_or(0.0, |(piece, s)| piece.force_at(s) * piece.gain_at(s));
    (0..1000).map(|k| force(1.2 + 0.001 * f64::from(k))).collect()
}

#[test]
fn a_box_whose_log_continues_at_half_the_rate_presses_as_before() {
    let [contacts, poses] = shipped("box_slide_slope");
    let [whole, slower] = [contacts.clone(), thinned(&contacts, 1.0)].map(|text| slid(&text, &poses));
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let silent = |x: &[f64]| x.iter().filter(|f| **f < 1.0).count();
    println!("{} N and {} N; {} ms are silent", mean(&whole), mean(&slower), silent(&slower));
    assert!((mean(&slower) / mean(&whole) - 1.0).abs() < 0.1 && mean(&whole) > 8.0);
    assert!(silent(&slower) <= silent(&whole) + 20, "{} of {}", silent(&slower), silent(&whole));
}

#[test]
fn a_jump_is_measured_in_pixels_of_the_map() {
    // 20 mm aside after ten frames: more than 8 pixels at 512 px/m (15.6 mm), less at 256 px/m (31 mm).
    let path = |t: f64| [0.1 * t, if t > 9.5 * FRAME { 0.02 } else { 0.0 }, 0.1, 0.0];
    let image = |density: f64| Luma {
        grid: Grid::from_fn(4, 4, |_, _| 0.0),
        holes: Vec::new(),
        kind: LumaKind::Lstar,
        surface: Surface { density: [density; 2], ..Surface::default() },
    };
    let jumps = |p: ContactPathParams, linked: Option<f64>| {
        let mut standalone = standalone(p, along(path, 20));
        if let Some(density) = linked {
            let feed = Feed::value(AnyValue::new(image(density)));
            standalone = standalone.feed(ContactPathPorts::image.index(), feed);
        }
        let run = standalone.run().unwrap();
        run.events(ContactPathPorts::paths).iter().any(|(_, p)| p.jump > 0)
    };
    assert!(jumps(params(), None) && !jumps(ContactPathParams { density: 256.0, ..params() }, None));
    assert!(!jumps(ContactPathParams { teleport: 16.0, ..params() }, None));
    assert!(jumps(params(), Some(2000.0)) && !jumps(params(), Some(256.0)));
    let both = ContactPathParams { density: 2000.0, ..params() };
    assert!(!jumps(both, Some(256.0)), "the image decides");
}

#[test]
fn edits_while_it_sounds_do_not_move_the_path() {
    let path = |t: f64| {
        let (sin, cos) = (4.0 * t).sin_cos();
        [0.3 * cos, 0.3 * sin, -1.2 * sin, 1.2 * cos]
    };
    let edits = [
        ContactPathParams { smooth: 0.02, ..params() },
        ContactPathParams { guard: false, teleport: 30.0, ..params() },
        ContactPathParams { sliding: 0.2, ..params() },
        ContactPathParams { density: 100.0, ..params() },
    ];
    for edit in edits {
        let mut run = standalone(params(), along(path, 60)).start().unwrap();
        let mut count = 0;
        while run.step().unwrap() {
            count += 1;
            if count == 60 {
                assert_eq!(run.node().retune(&edit), Retune::Done);
            }
        }
        let pieces = run.events(ContactPathPorts::paths);
        assert!(pieces.iter().all(|(_, p)| p.jump == 0), "{edit:?}");
        let mut before: Option<([f64; 2], f64)> = None;
        for k in 0..8000 {
            let t = 0.05 + f64::from(k) * 1e-4;
            let (piece, s) = at(&pieces, t).expect("no gap");
            let now = (piece.position_at(s), piece.gain_at(s));
            if let Some((position, gain)) = before {
                let step = (now.0[0] - position[0]).hypot(now.0[1] - position[1]);
                assert!(step < 2.5 * 1.2e-4, "{edit:?} {t}: {step} m");
                assert!((now.1 - gain).abs() < 0.02, "{edit:?} {t}: {gain} to {}", now.1);
            }
            before = Some(now);
        }
    }
}

mod rates;

#[test]
fn contacts_that_are_not_heard_are_counted() {
    let silent = |p: ContactPathParams, states: Vec<State>| {
        let frame = |(k, state): (usize, State)| {
            let mut one = contact([0.01 * k as f64, 0.0], [0.6, 0.0]);
            (one.state, one.frame.bodies) = (state, [1, 2 + (k % 2) as u32]);
            (ticks(FRAME * k as f64), one)
        };
        let run = standalone(p, states.into_iter().enumerate().map(frame).collect()).run().unwrap();
        let text = run.summary.iter().find(|(k, _)| *k == "silent");
        text.map(|(_, text)| text.as_str().unwrap().to_owned())
    };
    let sliding = || vec![State::Sliding; 4];
    assert_eq!(silent(params(), sliding()), None);
    let p = ContactPathParams { a: Some(2), b: Some(99), ..params() };
    assert_eq!(silent(p, sliding()).unwrap(), "no contact between 2 and 99; there are 1-2, 1-3");
    let p = ContactPathParams { b: Some(9), ..params() };
    assert_eq!(silent(p, sliding()).unwrap(), "no contact of 9 as the second body; there are 1-2, 1-3");
    let p = ContactPathParams { unsteady: 0.0, ..params() };
    let kinds = vec![State::Static, State::Static, State::Unsteady];
    assert_eq!(
        silent(p, kinds).unwrap(),
        "none of 3 frames is audible: 2 static, 1 unsteady (`unsteady` is 0)"
    );
}
