//! One motion logged at several rates, and the friction work of real logs.

use super::*;
use crate::core::random::Rng;
use crate::core::time::Rate;
use crate::scrape::testing::db;
use std::fs::read_to_string;
use std::path::Path;

/// Frames of the dense motion per second.
const DENSE: u32 = 1200;
const SECONDS: u32 = 3;

/// A slide at 0.7 m/s whose solver has another force in each of 1200 frames a second, as a log of `rate` frames a second has it: the mean
/// over each frame.
fn slide(rate: u32, forces: &[f64]) -> Vec<(Tick, ContactState)> {
    let part = (DENSE / rate) as usize;
    let frame = |(k, forces): (usize, &[f64])| {
        let t = (k + 1) as f64 / f64::from(rate);
        let mut state = contact([0.7 * t, 0.1 * t], [0.7, 0.1]);
        state.frame.force = (forces.iter().sum::<f64>() / part as f64) as f32;
        state.frame.interval = ticks(1.0 / f64::from(rate));
        (ticks(t), state)
    };
    forces.chunks_exact(part).enumerate().map(frame).collect()
}

/// Levels of what an uneven surface radiates (the second difference of the force) in dB, and of what is above 500 Hz of it.
fn level(p: ContactPathParams, contacts: Vec<(Tick, ContactState)>) -> f64 {
    let pieces = follow(p, contacts);
    // Up to 200 cycles per metre, as an image of 400 pixels per metre has.
    let mut rng = Rng::new(11);
    let waves: Vec<[f64; 2]> = (0..60).map(|k| [5.0 + 3.3 * f64::from(k), rng.between(0.0, TAU)]).collect();
    let rate = Rate::hz(16_000);
    let force = |n: i64| {
        let tick = rate.tick(n);
        let k = pieces.partition_point(|(from, _)| *from <= tick).checked_sub(1)?;
        let (from, piece) = pieces[k];
        let s = (tick - from) as f64 / piece.duration as f64;
        let [x, _] = piece.position_at(s);
        let slope: f64 = waves.iter().map(|[k, phase]| (TAU * k * x + phase).sin()).sum();
        Some(piece.force_at(s) * piece.gain_at(s) * slope)
    };
    let samples: Vec<f64> = (8000..40_000).map(|n| force(n).expect("a piece")).collect();
    let radiated = samples.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).powi(2)).sum::<f64>();
    10.0 * (radiated / samples.len() as f64).log10()
}

#[test]
fn the_rate_of_a_log_does_not_change_the_level() {
    let mut rng = Rng::new(7);
    // Half of the frames without any force, as solvers have it.
    let frames = (DENSE * SECONDS) as usize;
    let forces: Vec<f64> =
        (0..frames).map(|_| if rng.below(2) == 0 { 0.0 } else { rng.between(0.0, 40.0) }).collect();
    for mode in [PathMode::Hermite, PathMode::Extrapolate] {
        let levels = [30, 60, 240, 1200].map(|rate| {
            let frame = (1.0 / f64::from(rate)).max(FRAME);
            let p = ContactPathParams { mode, frame, ..params() };
            let raw = ContactPathParams { force_smooth: 0.0, force_median: 0.0, ..p.clone() };
            let [level, raw] = [p, raw].map(|p| level(p, slide(rate, &forces)));
            println!("{mode:?} {rate} Hz: {level:.1} dB, without the mean {raw:.1} dB");
            level
        });
        let ends = levels.iter().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        assert!(ends.1 - ends.0 < 2.0, "{mode:?}: {levels:?}");
    }
}

/// Pieces and shares of friction work of a log beside the repository; `None` if it is not there.
fn logged(scene: &str, rate: u32, p: ContactPathParams) -> Option<(Pieces, [f64; 2])> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/contacts");
    let read = |name: String| read_to_string(folder.join(name)).ok();
    let texts = read(format!("{scene}.contacts_{rate}hz.csv")).zip(read(format!("{scene}.poses.csv")));
    let Some((contacts, poses)) = texts else {
        println!("no log {scene} at {rate} Hz in {folder:?}: skipped");
        return None;
    };
    let read = read_contacts(contacts.as_bytes(), Some(poses.as_bytes()), &LogOptions::default()).unwrap();
    let mut classifier = Classifier::new(Rules::default(), 64);
    let states: Vec<_> =
        read.frames.iter().filter_map(|(tick, f)| Some((*tick, classifier.take(*tick, f)?))).collect();
    let run = standalone(p, states).run().unwrap();
    let share = |name: &str| {
        let text = format!("{:?}", run.summary);
        let (_, rest) = text.split_once(&format!("(\"{name}\", Number("))?;
        rest.split_once(')')?.0.parse().ok()
    };
    let shares = ["friction_work_heard", "friction_work_of_impacts"].map(|name| share(name).unwrap());
    Some((run.events(ContactPathPorts::paths), shares))
}

/// Largest sum of the forces of all contacts at once, N.
fn most(pieces: &Pieces) -> f64 {
    let end = pieces.iter().map(|(from, p)| from + p.duration).max().unwrap_or(0);
    let step = ticks(0.001);
    let mut sums = vec![0.0_f64; usize::try_from(end / step).unwrap() + 1];
    for (from, piece) in pieces {
        for k in (from + step - 1) / step..(from + piece.duration + step - 1) / step {
            let s = (k * step - from) as f64 / piece.duration as f64;
            sums[usize::try_from(k).unwrap()] += piece.force_at(s) * piece.gain_at(s);
        }
    }
    sums.into_iter().fold(0.0, f64::max)
}

#[test]
fn the_friction_work_of_unsteady_contacts_is_heard() {
    for (scene, rate) in [
        ("bullet_boxes_tumble", 240),
        ("dominoes", 60),
        ("dominoes", 240),
        ("plates_pile_fall", 60),
        ("plates_pile_fall", 240),
    ] {
        let heard = |p| logged(scene, rate, ContactPathParams { join: true, ..p });
        let Some((pieces, [share, impacts])) = heard(params()) else { continue };
        let (steadily, [steady, _]) = heard(ContactPathParams { unsteady: 0.0, ..params() }).unwrap();
        println!(
            "{scene} {rate} Hz: {share:.3} heard, {steady:.3} of steady contacts, {impacts:.3} of impacts"
        );
        assert!(share > 0.9 && steady < 0.8 && !pieces.is_empty(), "{scene}: {share} {steady}");
        let peak =
            |pieces: &Pieces| pieces.iter().map(|(_, p)| p.force[0] * p.gain[0]).fold(0.0_f32, f32::max);
        let free = ContactPathParams { force_smooth: 0.0, force_median: 0.0, ..params() };
        let all = peak(&heard(free).unwrap().0);
        println!(
            "  peak of the force {} N, {all} N with impacts; steady {} N",
            peak(&pieces),
            peak(&steadily)
        );
        let [sum, steady] = [&pieces, &steadily].map(most);
        println!("  of all contacts at once: {sum:.2} N, of steady ones {steady:.2} N");
        assert!(sum < 2.0 * steady && peak(&pieces) < 2.5 * peak(&steadily), "{scene} {rate}");
        assert!(peak(&pieces) < 0.6 * all, "{scene} {rate}");
    }
}

#[test]
fn the_box_slides_along_one_line_at_both_rates() {
    let slid = |rate: u32| {
        let p = ContactPathParams { a: Some(1), b: Some(2), u: [0.927, 0.0, -0.375], join: true, ..params() };
        logged("box_slide_slope", rate, p)
    };
    let (Some((slow, _)), Some((fast, _))) = (slid(60), slid(240)) else { return };
    for k in 0..18 {
        let t = 0.5 + 0.1 * f64::from(k);
        let [a, b] = [&slow, &fast].map(|pieces| {
            let (piece, s) = at(pieces, t).expect("a piece");
            piece.position_at(s)
        });
        println!("{t:.1} s: {a:.3?} and {b:.3?} m");
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 0.02, "{t}: {a:?} {b:?}");
    }
    let mean = |pieces: &Pieces| {
        let forces = (0..1500).filter_map(|k| at(pieces, 0.5 + 0.001 * f64::from(k)));
        forces.map(|(p, s)| p.force_at(s)).sum::<f64>() / 1500.0
    };
    assert!(db(mean(&slow) / mean(&fast)).abs() < 0.5, "{} and {} N", mean(&slow), mean(&fast));
}
