use super::*;
use crate::core::item::{Data, Event};
use crate::core::standalone::Standalone;

fn params() -> ContactDampingParams {
    ContactDampingParams { body: Some(1), ..ContactDampingParams::read(&|_| None).unwrap() }
}

fn frame(contact: u64, force: f32) -> ContactFrame {
    ContactFrame {
        contact,
        bodies: [0, 1],
        local: [[9.0; 3], [0.03, 0.02, 0.0]],
        force,
        velocity: [0.01, 0.0, -2.0],
        normal: [0.0, 0.0, 1.0],
        begins: false,
        ends: false,
        ..ContactFrame::trial(&mut Rng::new(1))
    }
}

/// Frames of one contact at 100 Hz from one time to another, and its end.
fn contact(contact: u64, force: f32, from: f64, to: f64) -> Vec<(Tick, ContactFrame)> {
    let count = ((to - from) * 100.0).round() as usize;
    let mut all: Vec<_> =
        (0..count).map(|k| (ticks(from + 0.01 * k as f64), frame(contact, force))).collect();
    all.push((ticks(to), ContactFrame { ends: true, force: 0.0, ..frame(contact, 0.0) }));
    all
}

fn run(p: ContactDampingParams, contacts: Vec<(Tick, ContactFrame)>, window: f64) -> (Vec<f32>, ModeShapes) {
    let shapes = ModeShapes::trial(&mut Rng::new(5));
    let feed = crate::core::standalone::Feed::events(contacts, ticks(1.0));
    let standalone = Standalone::new::<ContactDamping>(p)
        .feed(ContactDampingPorts::contacts.index(), feed)
        .value(ContactDampingPorts::shapes, shapes.clone());
    (standalone.window(ticks(window)).run().unwrap().stream(ContactDampingPorts::damping), shapes)
}

#[test]
fn supports_damp_from_their_age_on_and_let_go_within_the_release() {
    let (damping, shapes) = run(params(), contact(3, 4.0, 0.1, 0.5), 0.1);
    let modes = shapes.len();
    let at = |t: f64| &damping[(t * 1000.0).round() as usize * modes..][..modes];
    let index = SurfaceIndex::new(shapes.surface());
    let (point, _) = index.nearest(shapes.surface(), [0.03, 0.02, 0.0]).unwrap();
    let (mut scratch, mut expected) = (vec![0.0; 2 * modes], vec![0.0; modes]);
    ContactLaw { kappa: 0.5, mu: 0.5 }.add(shapes.surface(), &point, 4.0, &mut scratch, &mut expected);
    assert!(at(0.149).iter().all(|x| *x == 0.0), "too young");
    for (found, expected) in at(0.3).iter().zip(&expected) {
        assert!((f64::from(*found) - expected).abs() < 1e-5 * expected, "{found} {expected}");
    }
    let part = f64::from(at(0.501)[0]) / expected[0];
    assert!((part - 0.6).abs() < 1e-3, "{part}: two of five items of the way");
    assert!(at(0.506).iter().all(|x| *x == 0.0));
}

#[test]
fn dampings_of_contacts_add_up_however_time_is_cut() {
    let mut both = contact(3, 4.0, 0.1, 0.5);
    both.extend(contact(4, 1.0, 0.2, 0.6));
    both.sort_by_key(|(tick, _)| *tick);
    let (all, shapes) = run(params(), both.clone(), 0.1);
    let modes = shapes.len();
    let (one, _) = run(params(), contact(3, 4.0, 0.1, 0.5), 0.1);
    let at = |x: &[f32], t: f64| x[(t * 1000.0).round() as usize * modes];
    assert!((at(&all, 0.4) / at(&one, 0.4) - 1.25).abs() < 1e-5);
    for window in [0.0007, 0.013, 1.0] {
        assert_eq!(run(params(), both.clone(), window).0, all, "{window}");
    }
}

#[test]
fn what_slides_or_lies_elsewhere_does_not_damp() {
    let silent = |change: fn(&mut ContactFrame), p: ContactDampingParams| {
        let mut frames = contact(3, 4.0, 0.1, 0.5);
        frames.iter_mut().for_each(|(_, frame)| change(frame));
        run(p, frames, 0.1).0.iter().all(|x| *x == 0.0)
    };
    assert!(!silent(|_| {}, params()));
    assert!(silent(|f| f.velocity = [0.1, 0.0, 0.0], params()));
    assert!(silent(|f| f.local[1] = [0.0, 0.0, 5.0], params()));
    assert!(silent(|f| f.local[1] = [f64::NAN, 0.0, 5.0], params()));
    assert!(silent(|f| f.force = f32::NAN, params()));
    assert!(silent(|_| {}, ContactDampingParams { body: Some(7), ..params() }));
}
