//! Paths between frames: exact where they must be, smooth elsewhere; jumps, losses and stalls.

use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::testing::{amplitude, db};
use crate::scrape::map::map_excitation::{MapExcitation, MapExcitationParams, MapExcitationPorts};
use crate::scrape::path::piece::PathPiece;
use crate::scrape::path::queue::Queue;
use crate::scrape::path::sample::{PathRules, ContactSample};
use crate::scrape::path::tracker::{JUMP_FADE, END_FADE, Tracker};
use crate::core::item::AnyValue;
use crate::core::params::Params;
use crate::core::standalone::{Feed, Standalone};
use crate::core::time::{Rate, Tick, seconds, ticks};
use crate::texture::{DiscontinuityMap, Grid, Surface};
use std::f64::consts::TAU;

type Pieces = Vec<(Tick, PathPiece)>;

fn rules(frame: f64) -> PathRules {
    PathRules {
        frame: ticks(frame),
        look_ahead: true,
        differences: false,
        guard: true,
        teleport: 8.0 / 512.0,
        object: 3,
        smooth: 0.0,
    }
}

fn sample(time: f64, position: [f64; 2], velocity: [f64; 2]) -> ContactSample {
    ContactSample {
        contact: 1,
        tick: ticks(time),
        position,
        velocity: Some(velocity),
        other: None,
        force: 2.0,
        gain: 1.0,
        mass: None,
        begins: false,
        ends: false,
    }
}

/// The pieces that frames make, in windows of a length, until a time.
fn follow(rules: PathRules, frames: &[ContactSample], window: f64, until: f64) -> (Pieces, Tracker) {
    let (mut tracker, mut queue, mut pieces) = (Tracker::new(rules, 64), Queue::new(512), Vec::new());
    let (mut next, mut to) = (0, 0);
    while to < ticks(until) {
        to += ticks(window);
        let known = to + rules.latency();
        let mut keep = |tick, piece| pieces.push((tick, piece));
        while let Some(frame) = frames.get(next).filter(|f| f.tick < known) {
            queue.give(frame.tick - rules.latency(), &mut keep);
            tracker.due(frame.tick, &mut queue);
            tracker.frame(frame, &mut queue);
            next += 1;
        }
        tracker.due(known, &mut queue);
        queue.give(to, |tick, piece| {
            assert!(tick >= to - ticks(window), "a piece comes after its time");
            keep(tick, piece);
        });
    }
    (pieces, tracker)
}

/// The piece of the newest path at a time and the position in it.
fn at(pieces: &Pieces, time: f64) -> Option<(PathPiece, f64)> {
    let tick = ticks(time);
    let under_way = |(start, p): &&(Tick, PathPiece)| (*start..start + p.duration).contains(&tick);
    let (start, piece) = pieces.iter().rev().find(under_way)?;
    Some((*piece, (tick - start) as f64 / piece.duration as f64))
}

#[test]
fn even_motion_is_exact_at_any_even_or_uneven_frames() {
    let path = |t: f64| [0.3 + 0.7 * t, -0.2 * t];
    for (frame, uneven) in [(1.0 / 60.0, 0.0), (1.0 / 30.0, 0.0), (1.0 / 240.0, 0.0), (1.0 / 60.0, 0.009)] {
        for differences in [false, true] {
            let times = (0..40).map(|k| frame * f64::from(k) + uneven * f64::from((k * 7) % 5) / 5.0);
            let frames: Vec<_> = times.map(|t| sample(t, path(t), [0.7, -0.2])).collect();
            let rules = PathRules { differences, ..rules(frame) };
            let (pieces, tracker) = follow(rules, &frames, 0.003, 20.0 * frame);
            assert_eq!((tracker.stalls, tracker.jumps), (0, 0));
            for k in 0..500 {
                let t = 0.02 + f64::from(k) * frame * 19.0 / 500.0;
                let Some((piece, s)) = at(&pieces, t) else { continue };
                let [x, y] = piece.position_at(s);
                let right = path(t);
                assert!((x - right[0]).abs() < 1e-9 && (y - right[1]).abs() < 1e-9, "{frame} {t}: {x} {y}");
            }
        }
    }
}

fn turning(frame: f64, turn: f64, radius: f64, until: f64) -> Vec<ContactSample> {
    let w = TAU / turn;
    let count = (until / frame).ceil() as i32;
    (0..count)
        .map(|k| {
            let t = f64::from(k) * frame;
            let (sin, cos) = (w * t).sin_cos();
            sample(t, [radius * cos, radius * sin], [-radius * w * sin, radius * w * cos])
        })
        .collect()
}

#[test]
fn a_circle_of_twelve_frames_is_round_within_half_a_percent() {
    let frame = 1.0 / 60.0;
    for differences in [false, true] {
        let frames = turning(frame, 12.0 * frame, 0.05, 1.0);
        let (pieces, _) = follow(PathRules { differences, ..rules(frame) }, &frames, 0.01, 0.8);
        for k in 0..700 {
            let (piece, s) = at(&pieces, 0.05 + f64::from(k) * 0.001).expect("a piece");
            let [x, y] = piece.position_at(s);
            assert!((x.hypot(y) / 0.05 - 1.0).abs() < 0.005, "{differences}: {}", x.hypot(y));
        }
    }
}

#[test]
fn the_frames_cannot_be_heard_on_an_even_slope() {
    // Direction along x of a contact that circles at 2 Hz over frames at 60 Hz.
    let (frame, fs) = (1.0 / 60.0, 4000.0);
    for look_ahead in [true, false] {
        let frames = turning(frame, 0.5, 0.1, 3.0);
        let (pieces, _) = follow(PathRules { look_ahead, ..rules(frame) }, &frames, 0.01, 2.9);
        let slope = |k: u32| {
            let (piece, s) = at(&pieces, 0.5 + f64::from(k) / fs).expect("a piece");
            let [x, y] = piece.velocity_at(s);
            (x / x.hypot(y)) as f32
        };
        let signal: Vec<f32> = (0..8000).map(slope).collect();
        let whole = amplitude(&signal, 2.0, fs);
        for line in [56.0, 58.0, 60.0, 62.0, 64.0, 120.0, 122.0] {
            let level = db(amplitude(&signal, line, fs) / whole);
            assert!(level < -60.0, "{look_ahead}: {line} Hz at {level} dB");
        }
    }
}

#[test]
fn an_even_slope_gives_a_force_without_the_frames_which_straight_lines_do_not() {
    let (frame, fs) = (1.0 / 60.0, 44_100.0);
    let map = || DiscontinuityMap {
        gx: Grid::from_fn(8, 8, |_, _| 1.0),
        gy: Grid::from_fn(8, 8, |_, _| 0.0),
        surface: Surface::default(),
    };
    let lines = |pieces: Pieces| {
        let p =
            MapExcitationParams { reference: crate::dsp::Reference::Absolute, contact: ContactForceParams { rate: Rate::hz(44_100), ..MapExcitationParams::read(&|_| None).unwrap().contact }, ..MapExcitationParams::read(&|_| None).unwrap() };
        let standalone =
            Standalone::new::<MapExcitation>(p).events(MapExcitationPorts::paths, pieces, ticks(2.5));
        let standalone = standalone.feed(MapExcitationPorts::map.index(), Feed::value(AnyValue::new(map())));
        let force = standalone.run().unwrap().stream(MapExcitationPorts::force);
        let signal = &force[22_050..22_050 + 88_200];
        let whole = amplitude(signal, 2.0, fs);
        [58.0, 60.0, 62.0, 120.0, 122.0]
            .map(|f| db(amplitude(signal, f, fs) / whole))
            .into_iter()
            .fold(f64::MIN, f64::max)
    };
    let frames = turning(frame, 0.5, 0.1, 3.0);
    for look_ahead in [true, false] {
        let (pieces, _) = follow(PathRules { look_ahead, ..rules(frame) }, &frames, 0.01, 2.9);
        let level = lines(pieces);
        assert!(level < -60.0, "{look_ahead}: {level} dB");
    }
    let straight = |ends: &[ContactSample]| {
        let path = [0, 1].map(|k| ends[1].position[k] - ends[0].position[k]);
        let duration = ends[1].tick - ends[0].tick;
        let piece = super::testing::piece(ends[0].position, path, 1.0);
        (ends[0].tick, PathPiece { duration, ..piece })
    };
    let level = lines(frames.windows(2).map(straight).collect());
    assert!(level > -40.0, "straight lines between the frames are heard: {level} dB");
}

#[test]
fn the_path_is_known_one_frame_later_two_without_velocities_and_at_once_where_it_is_predicted() {
    let frame = 1.0 / 60.0;
    for (look_ahead, differences, frames) in
        [(true, false, 1), (true, true, 2), (false, false, 0), (false, true, 0)]
    {
        let rules = PathRules { look_ahead, differences, ..rules(frame) };
        // And a hundredth for frames that come late.
        assert_eq!(
            rules.latency(),
            frames * (ticks(frame) + ticks(frame) / 100),
            "{look_ahead} {differences}"
        );
    }
}

#[test]
fn what_was_predicted_goes_over_to_what_was_true_without_a_step_or_a_kink() {
    let frame = 1.0 / 60.0;
    // Uneven acceleration, so that every prediction is wrong.
    let path = |t: f64| [0.3 * t + 0.05 * (9.0 * t).sin(), 0.04 * (7.0 * t).cos()];
    let velocity = |t: f64| [0.3 + 0.45 * (9.0 * t).cos(), -0.28 * (7.0 * t).sin()];
    let frames: Vec<_> = (0..40).map(|k| f64::from(k) * frame).map(|t| sample(t, path(t), velocity(t))).collect();
    let (pieces, tracker) = follow(PathRules { look_ahead: false, ..rules(frame) }, &frames, 0.004, 0.6);
    assert_eq!((tracker.stalls, tracker.jumps), (0, 0));
    let (mut before, mut worst): (Option<([f64; 2], [f64; 2])>, _) = (None, 0.0_f64);
    for k in 0..5500 {
        let t = 0.02 + f64::from(k) * 1e-4;
        let (piece, s) = at(&pieces, t).expect("no gap");
        let now = (piece.position_at(s), piece.velocity_at(s));
        if let Some((p, v)) = before {
            assert!((0..2).all(|i| (now.0[i] - p[i] - 1e-4 * v[i]).abs() < 2e-6), "{t}: no step");
            assert!((0..2).all(|i| (now.1[i] - v[i]).abs() < 0.02), "{t}: no kink: {v:?} to {:?}", now.1);
        }
        let right = path(t);
        worst = worst.max((now.0[0] - right[0]).hypot(now.0[1] - right[1]));
        before = Some(now);
    }
    assert!(worst > 1e-6 && worst < 1.5e-3, "{worst} m");
}

#[test]
fn forces_go_straight_from_frame_to_frame_and_are_never_below_0() {
    let frame = 1.0 / 60.0;
    let forces = [1.0, 3.0, 2.0, -4.0, 6.0, 6.0];
    let frames: Vec<_> = (0..)
        .zip(forces)
        .map(|(k, force)| {
            let t = f64::from(k) * frame;
            ContactSample { force, ..sample(t, [0.1 * t, 0.0], [0.1, 0.0]) }
        })
        .collect();
    let (pieces, _) = follow(rules(frame), &frames, 0.004, 0.08);
    for (time, right) in [(0.25, 1.5), (0.5, 2.0), (1.5, 2.5), (2.5, 1.0), (3.5, 3.0), (4.5, 6.0)] {
        let (piece, s) = at(&pieces, time * frame).expect("a piece");
        let force = f64::from(piece.force[0]) * (1.0 - s) + f64::from(piece.force[1]) * s;
        assert!((force - right).abs() < 1e-3, "{time}: {force}");
        assert!(piece.force.iter().all(|f| *f >= 0.0));
    }
}

#[test]
fn a_fast_contact_may_be_further_off_than_a_slow_one_before_it_has_jumped() {
    // 8 pixels at 512 a metre are 15.6 mm; at 1.2 m/s twice the distance of a frame is 40 mm more.
    let frame = 1.0 / 60.0;
    for (speed, off, jumps) in [(0.0, 0.0150, 0), (0.0, 0.0162, 1), (1.2, 0.0550, 0), (1.2, 0.0562, 1)] {
        let frames: Vec<_> = (0..20)
            .map(|k| {
                let t = f64::from(k) * frame;
                sample(t, [speed * t, if k >= 10 { off } else { 0.0 }], [speed, 0.0])
            })
            .collect();
        let (_, tracker) = follow(rules(frame), &frames, 0.005, 0.3);
        assert_eq!(tracker.jumps, jumps, "{off} m aside at {speed} m/s");
    }
}

#[test]
fn a_jump_is_a_new_path_and_crossfades() {
    let frame = 1.0 / 60.0;
    let frames: Vec<_> = (0..20)
        .map(|k| {
            let t = f64::from(k) * frame;
            sample(t, [0.1 * t + if k >= 10 { 0.08 } else { 0.0 }, 0.0], [0.1, 0.0])
        })
        .collect();
    let (pieces, tracker) = follow(rules(frame), &frames, 0.005, 0.3);
    assert_eq!(tracker.jumps, 1);
    let out: Vec<_> = pieces.iter().filter(|(_, p)| p.gain == [1.0, 0.0]).collect();
    assert_eq!((out.len(), out[0].0, out[0].1.duration), (1, frames[10].tick, ticks(JUMP_FADE)));
    let into: Vec<_> = pieces.iter().filter(|(_, p)| p.gain == [0.0, 1.0]).collect();
    assert_eq!((into.len(), into[1].0, into[1].1.jump), (2, frames[10].tick, 1));
    assert!(pieces.iter().all(|(_, p)| p.object == 3 && p.contact == 1));
}

#[test]
fn a_number_that_begins_again_is_a_new_path() {
    let frame = 1.0 / 60.0;
    let frames: Vec<_> = (0..20)
        .map(|k| {
            let t = f64::from(k) * frame;
            ContactSample { begins: k == 0 || k == 10, ends: k == 6, ..sample(t, [0.1 * t, 0.0], [0.1, 0.0]) }
        })
        .filter(|s| !(ticks(6.5 * frame)..ticks(9.5 * frame)).contains(&s.tick))
        .collect();
    let (pieces, tracker) = follow(rules(frame), &frames, 0.005, 0.3);
    let jumps: Vec<u32> = pieces.iter().map(|(_, p)| p.jump).collect();
    assert!(jumps.contains(&0) && jumps.contains(&1) && tracker.stalls == 0);
    // It ended under force: 5 ms more.
    let (tick, last) = pieces.iter().rfind(|(_, p)| p.jump == 0).unwrap();
    assert_eq!((*tick, last.duration, last.gain), (frames[6].tick, ticks(END_FADE), [1.0, 0.0]));
    assert!(at(&pieces, 7.5 * frame).is_none());
}

#[test]
fn a_physics_that_stalls_fades_out_after_two_frames() {
    let frame = 1.0 / 60.0;
    for look_ahead in [true, false] {
        let mut frames: Vec<_> =
            (0..6).map(|k| sample(f64::from(k) * frame, [0.0, f64::from(k) * 0.01], [0.0, 0.6])).collect();
        frames.push(sample(20.0 * frame, [0.0, 0.2], [0.0, 0.6]));
        frames.push(sample(21.0 * frame, [0.0, 0.21], [0.0, 0.6]));
        let (pieces, tracker) = follow(PathRules { look_ahead, ..rules(frame) }, &frames, 0.004, 0.36);
        assert!(tracker.stalls >= 1);
        let (piece, s) = at(&pieces, 6.9 * frame).expect("it goes on");
        assert!((piece.position_at(s)[1] - 0.069).abs() < 1e-6 && piece.gain_at(s) == 1.0);
        let (piece, s) = at(&pieces, 7.0 * frame + 0.0025).expect("it fades");
        assert!((piece.gain_at(s) - 0.5).abs() < 0.01);
        assert!(at(&pieces, 7.0 * frame + 0.0055).is_none(), "and is gone");
        let (piece, _) = at(&pieces, 20.5 * frame).expect("it is back");
        assert_eq!(piece.jump, 1);
    }
}

#[test]
fn a_late_frame_is_reached_smoothly() {
    let frame = 1.0 / 60.0;
    let times = [0.0, 1.0, 2.0, 3.0, 4.6, 5.0, 6.0, 7.0, 8.0].map(|k| k * frame);
    let position = |t: f64| [0.3 * t + 2.0 * t * t, 0.0];
    let frames: Vec<_> = times.iter().map(|t| sample(*t, position(*t), [0.3 + 4.0 * t, 0.0])).collect();
    let (pieces, tracker) = follow(rules(frame), &frames, 0.002, 0.12);
    assert_eq!((tracker.late, tracker.stalls, tracker.jumps), (1, 0, 0));
    let mut before: Option<([f64; 2], [f64; 2])> = None;
    for k in 0..1100 {
        let (piece, s) = at(&pieces, 0.005 + f64::from(k) * 1e-4).expect("no gap");
        let now = (piece.position_at(s), piece.velocity_at(s));
        if let Some((p, v)) = before {
            assert!((now.0[0] - p[0] - 1e-4 * v[0]).abs() < 2e-6, "{k}: no step");
            assert!((now.1[0] - v[0]).abs() < 0.02, "{k}: no kink");
        }
        before = Some(now);
    }
}

#[test]
fn dozens_of_contacts_keep_apart_and_windows_change_nothing() {
    let frame = 1.0 / 60.0;
    let mut frames: Vec<ContactSample> = (0..30)
        .flat_map(|k| {
            (0..48).map(move |c| {
                let t = f64::from(k) * frame + f64::from((k * 5) % 3) * 0.002;
                ContactSample { contact: c, ..sample(t, [c as f64 + 0.1 * t, 0.0], [0.1, 0.0]) }
            })
        })
        .collect();
    frames.sort_by_key(|f| f.tick);
    let (pieces, tracker) = follow(rules(frame), &frames, 0.4, 0.4);
    assert_eq!(tracker.left_out, 0);
    for (_, p) in &pieces {
        assert!((p.position[0][0] - p.contact as f64).abs() < 0.1);
    }
    for window in [0.001, 0.0213] {
        let (mut same, _) = follow(rules(frame), &frames, window, 0.4);
        same.retain(|(tick, _)| *tick < ticks(0.4));
        let key = |(tick, p): &(Tick, PathPiece)| (*tick, p.contact, p.jump);
        let mut whole = pieces.clone();
        same.sort_by_key(key);
        whole.sort_by_key(key);
        assert!(same == whole, "{window}");
    }
}

#[test]
fn a_low_pass_calms_points_that_hop_about() {
    let frame = 1.0 / 60.0;
    let hop = |k: u32| if k.is_multiple_of(2) { 0.002 } else { -0.002 };
    let frames: Vec<_> = (0..60)
        .map(|k| {
            let t = f64::from(k) * frame;
            sample(t, [0.2 * t, hop(k)], [0.2, 0.0])
        })
        .collect();
    let spread = |smooth: f64| {
        let (pieces, _) = follow(PathRules { smooth, ..rules(frame) }, &frames, 0.01, 0.9);
        let late = pieces.iter().filter(|(tick, _)| seconds(*tick) > 0.4);
        late.map(|(_, p)| p.position[0][1].abs()).fold(0.0, f64::max)
    };
    assert!((spread(0.0) - 0.002).abs() < 1e-9 && spread(0.02) < 0.0009, "{}", spread(0.02));
}
