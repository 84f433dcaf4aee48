//! Speeds of known slides, gates, windows and the chain from meshes.

use super::*;
use crate::contact::detection::contact_detector::{
    ContactDetector, ContactDetectorParams, ContactDetectorPorts,
};
use crate::contact::sliding::speed_map::{SpeedMapNode, SpeedMapParams};
use crate::contact::{Contact, ContactsFormat};
use crate::core::item::Item;
use crate::core::params::Params;
use crate::core::random::Rng;
use crate::core::standalone::Standalone;
use crate::core::time::{TICKS_PER_SECOND, Tick, ticks};
use crate::mesh::MeshFormat;
use crate::mesh::generate::{SlidingPlanes, Synthetic};

fn params() -> SlidingSpeedParams {
    SlidingSpeedParams::read(&|_| None).expect("every parameter has a default")
}

fn sliding(slides: &[f32]) -> Vec<Contact> {
    let contact = |&slide| Contact { surface: 1, slide, ..Contact::default() };
    slides.iter().map(contact).collect()
}

fn one_vertex() -> ContactsFormat {
    ContactsFormat::plain(vec![1e-4].into(), 1)
}

fn speeds(p: SlidingSpeedParams, rate: Rate, contacts: Vec<Contact>) -> Vec<f32> {
    let standalone =
        Standalone::new::<SlidingSpeed>(p).input(SlidingSpeedPorts::contacts, rate, one_vertex(), contacts);
    standalone.run().unwrap().stream(SlidingSpeedPorts::speeds)
}

#[test]
fn two_planes_slide_at_their_speed_computed_from_meshes() {
    let rate = Rate::hz(60);
    let scene =
        SlidingPlanes { vertices: [4, 4], size: [0.4, 0.4], gap: 0.01, speed: 0.25, acceleration: 0.0 };
    let topology = scene.topology();
    let mut frames = vec![[0.0; 3]; 32 * 60];
    for (k, frame) in frames.chunks_exact_mut(32).enumerate() {
        scene.positions(k as f64 / 60.0, frame);
    }
    let detect = ContactDetectorParams { radius: 0.02, ..Params::read(&|_| None).unwrap() };
    let detector = Standalone::new::<ContactDetector>(detect).input(
        ContactDetectorPorts::mesh,
        rate,
        MeshFormat::moving(topology),
        frames,
    );
    let format = detector.shape().unwrap().outputs[0].as_ref().unwrap().format::<Contacts>().unwrap().clone();
    let total: f32 = format.areas.iter().sum();
    assert!((total - 2.0 * 0.16).abs() < 1e-6, "{total}");
    let contacts = detector.run().unwrap().stream(ContactDetectorPorts::contacts);
    let standalone =
        Standalone::new::<SlidingSpeed>(params()).input(SlidingSpeedPorts::contacts, rate, format, contacts);
    let run = standalone.run().unwrap();
    let found = run.stream(SlidingSpeedPorts::speeds);
    assert_eq!(found.len(), 40 * 32);
    // 1/120 s passes before the first sample, and 1.5 frames are left after the last.
    assert!(found[..32].iter().all(|s| *s == 0.0));
    // The outer rows leave the other plane; the inner ones are over it for the first half second.
    for (item, speeds) in found.chunks_exact(32).enumerate().take(20).skip(1) {
        let inner = speeds.iter().enumerate().filter(|(v, _)| (1..3).contains(&(v % 4)));
        assert!(inner.clone().count() == 16 && inner.clone().all(|(_, s)| (s - 0.25).abs() < 1e-4), "{item}");
    }
    let figure = |name| run.summary.iter().find(|(n, _)| *n == name).unwrap().1.as_f64().unwrap();
    assert!((figure("fastest") - 0.25).abs() < 1e-4 && figure("gated_share") == 0.0);
}

#[test]
fn midpoints_of_known_samples_have_the_known_values() {
    // The samples 0, 0, 2, 3, 3, 0 at twice their rate and half a frame late.
    let slides = [0.0, 0.0, 2.0, 3.0, 3.0, 0.0, 0.0].map(|s| s / 10.0);
    let p = SlidingSpeedParams { rate: Rate::hz(20), stamp: Stamp::Start, ..params() };
    let found = speeds(p, Rate::hz(10), sliding(&slides));
    let expected = [0.0, 0.0, 0.0, 5.0 / 6.0, 2.0, 8.0 / 3.0, 3.0, 3.0, 3.0, 2.0625, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(found.len(), expected.len());
    assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-6), "{found:?}");
    let late = SlidingSpeedParams { rate: Rate::hz(20), between: Between::Linear, ..params() };
    let found = speeds(late, Rate::hz(10), sliding(&slides));
    let expected = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.5, 3.0, 3.0, 3.0, 1.5, 0.0, 0.0, 0.0];
    assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-6), "{found:?}");
    // Held from the first frame of each difference to the second, without a frame ahead.
    let held = SlidingSpeedParams { rate: Rate::hz(20), between: Between::Hold, ..params() };
    assert_eq!(sampler_params(&held, Rate::hz(10), false).look_ahead(), 5, "only the gate looks ahead");
    let live = SlidingSpeedParams { gate: SpeedGate::Causal, ..held.clone() };
    assert_eq!(sampler_params(&live, Rate::hz(10), false).look_ahead(), 0);
    let found = speeds(held, Rate::hz(10), sliding(&slides));
    let expected = [0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0, 0.0, 0.0, 0.0, 0.0];
    assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-6), "{found:?}");
}

#[test]
fn gates_silence_slow_runs() {
    let slow = 0.01 / 40.0;
    let mut slides = vec![slow; 40];
    slides[35] = 0.1 / 40.0;
    let at = |p: SlidingSpeedParams| {
        let p = SlidingSpeedParams { stamp: Stamp::Start, ..p };
        speeds(p, Rate::hz(40), sliding(&slides)).iter().position(|s| *s > 0.0)
    };
    assert_eq!(at(SlidingSpeedParams { gate: SpeedGate::Interval, max_hold: 0.25, ..params() }), Some(25));
    assert_eq!(at(SlidingSpeedParams { gate: SpeedGate::Ever, ..params() }), Some(0));
    assert_eq!(at(SlidingSpeedParams { gate: SpeedGate::Causal, ..params() }), Some(35));
    assert_eq!(at(SlidingSpeedParams { threshold: 0.5, ..params() }), None);
}

#[test]
fn the_gate_ever_is_rejected_for_an_endless_stream() {
    let links = [vec![crate::core::shape::LinkShape::Stream(
        crate::core::item::StreamShape::new::<Contacts>(Rate::hz(60), one_vertex(), None),
    )]];
    let files = crate::core::files::MemoryFiles::default();
    let mut raw = crate::core::shape::RawShape::new(&links, 1, &files);
    let p = SlidingSpeedParams { gate: SpeedGate::Ever, ..params() };
    assert_eq!(SlidingSpeed::shape(&p, &mut Shape::new(&mut raw)).unwrap_err().code, "F075");
    assert!(SlidingSpeed::shape(&params(), &mut Shape::new(&mut raw)).is_ok());
}

#[test]
fn windows_of_any_length_give_the_same_speeds_for_every_gate_and_rate() {
    let mut rng = Rng::new(5);
    let format = ContactsFormat::plain(vec![1e-4; 3].into(), 2);
    let contacts: Vec<Contact> = (0..70 * 6).map(|k| Contacts::trial(&format, k % 6, &mut rng)).collect();
    for gate in [SpeedGate::Interval, SpeedGate::Ever, SpeedGate::Causal] {
        for (rate, between) in
            [(40, Between::Pchip), (7, Between::Pchip), (1000, Between::Linear), (90, Between::Hold)]
        {
            let p = SlidingSpeedParams {
                gate,
                between,
                rate: Rate::hz(rate),
                threshold: 0.5,
                max_hold: 0.1,
                ..params()
            };
            let run = |window: Tick| {
                let standalone = Standalone::new::<SlidingSpeed>(p.clone()).input(
                    SlidingSpeedPorts::contacts,
                    Rate::hz(60),
                    format.clone(),
                    contacts.clone(),
                );
                let mut standalone = standalone.window(window);
                standalone.poison = true;
                standalone.run().unwrap().stream(SlidingSpeedPorts::speeds)
            };
            let reference = run(2 * TICKS_PER_SECOND);
            assert!(reference.iter().all(|s| s.is_finite()) && reference.iter().any(|s| *s > 0.0));
            for window in [0.001, 0.0177, 0.1] {
                assert_eq!(run(ticks(window)), reference, "{gate:?} {rate} {window}");
            }
        }
    }
}

#[test]
fn the_node_speed_map_equals_the_map_of_sliding_speed() {
    let slides = [0.0, 0.1, 0.2, 0.4, 0.1, 0.0];
    let inside = SlidingSpeedParams { factor: 0.25, power: 1.5, ..params() };
    let mapped = speeds(inside, Rate::hz(60), sliding(&slides));
    let plain = speeds(params(), Rate::hz(60), sliding(&slides));
    let standalone = Standalone::new::<crate::core::node::PerItem<SpeedMapNode>>(SpeedMapParams {
        factor: 0.25,
        power: 1.5,
    })
    .input::<Speeds>(crate::core::ports::Port::new(0), Rate::hz(40), vec![1e-4].into(), plain);
    assert_eq!(standalone.run().unwrap().stream::<Speeds>(crate::core::ports::Port::new(0)), mapped);
}

/// Speeds at 60 Hz of slides between items whose frames have these ages.
fn speeds_with_ages(p: SlidingSpeedParams, slides: &[f32], ages: Vec<f32>) -> Vec<f32> {
    let p = SlidingSpeedParams { rate: Rate::hz(60), threshold: 0.0, ..p };
    let run = |window: f64| {
        let standalone = Standalone::new::<SlidingSpeed>(p.clone())
            .input(SlidingSpeedPorts::contacts, Rate::hz(60), one_vertex(), sliding(slides))
            .optional(SlidingSpeedPorts::age, Rate::hz(60), Channels(1), ages.clone())
            .window(ticks(window));
        standalone.run().unwrap().stream(SlidingSpeedPorts::speeds)
    };
    let reference = run(10.0);
    for window in [0.001, 0.0177, 0.1] {
        assert_eq!(run(window), reference, "{window}");
    }
    reference
}

#[test]
fn late_frames_hold_the_last_speed_then_ramp_it_to_zero_and_the_next_frame_causes_no_jump() {
    // 0.3 m/s all the time; no new frame arrives between item 10 and item 34.
    let shown = |item: usize| if (10..34).contains(&item) { 10 } else { item };
    let ages = (0..60).map(|k| ((k - shown(k)) as f64 / 60.0) as f32).collect::<Vec<_>>();
    let slides: Vec<f32> = (0..60).map(|k| (0.3 * (shown(k + 1) - shown(k)) as f64 / 60.0) as f32).collect();
    for (gate, between, stamp) in [
        (SpeedGate::Causal, Between::Hold, Stamp::Midpoint),
        (SpeedGate::Ever, Between::Pchip, Stamp::Start),
        (SpeedGate::Interval, Between::Linear, Stamp::Start),
    ] {
        let p = SlidingSpeedParams { gate, between, stamp, ..params() };
        let found = speeds_with_ages(p.clone(), &slides, ages.clone());
        for (k, speed) in found.iter().enumerate().take(59) {
            // Item 10 is the first whose frame is repeated.
            let share = if (10..33).contains(&k) { 1.0 - ((k - 10) as f64 / 60.0 - 0.1) / 0.1 } else { 1.0 };
            let expected = 0.3 * share.clamp(0.0, 1.0);
            assert!((f64::from(*speed) - expected).abs() < 1e-6, "{between:?} {k}: {speed} {expected}");
        }
        // Without ages: immediate silence, and a spike of 24 times the speed.
        let standalone =
            Standalone::new::<SlidingSpeed>(SlidingSpeedParams { rate: Rate::hz(60), threshold: 0.0, ..p });
        let standalone =
            standalone.input(SlidingSpeedPorts::contacts, Rate::hz(60), one_vertex(), sliding(&slides));
        let plain = standalone.run().unwrap().stream(SlidingSpeedPorts::speeds);
        assert!(plain[12] == 0.0 && (plain[33] - 7.2).abs() < 1e-4, "{between:?}: {plain:?}");
    }
}

#[test]
fn frames_at_irregular_times_have_a_constant_speed() {
    let mut rng = Rng::new(3);
    let stamps: Vec<f64> = (0..200).map(|k| (f64::from(k) + rng.between(0.0, 0.4)) / 60.0).collect();
    let shown =
        |item: usize| stamps.iter().rev().find(|at| **at <= item as f64 / 60.0).copied().unwrap_or(stamps[0]);
    let ages = (0..150).map(|k| (k as f64 / 60.0 - shown(k)) as f32).collect();
    let slides: Vec<f32> = (0..150).map(|k| (0.37 * (shown(k + 1) - shown(k))) as f32).collect();
    assert!(
        slides.iter().any(|s| *s < 0.005) && slides.iter().any(|s| *s > 0.0075),
        "the frames are irregular"
    );
    let p = SlidingSpeedParams { gate: SpeedGate::Causal, between: Between::Hold, ..params() };
    for (k, speed) in speeds_with_ages(p, &slides, ages).iter().enumerate().take(149).skip(5) {
        assert!((f64::from(*speed) / 0.37 - 1.0).abs() < 1e-6, "{k}: {speed}");
    }
}

#[test]
fn a_vertex_that_loses_contact_has_no_held_speed() {
    let ages = (0..30).map(|k| if k < 10 { 0.0 } else { (k - 10) as f32 / 60.0 }).collect();
    let mut contacts = sliding(&[0.005; 30]);
    contacts[12..].iter_mut().for_each(|c| *c = Contact::default());
    let p = SlidingSpeedParams {
        gate: SpeedGate::Causal,
        between: Between::Hold,
        hold: 0.0,
        rate: Rate::hz(60),
        ..params()
    };
    let standalone = Standalone::new::<SlidingSpeed>(p)
        .input(SlidingSpeedPorts::contacts, Rate::hz(60), one_vertex(), contacts)
        .optional(SlidingSpeedPorts::age, Rate::hz(60), Channels(1), ages);
    let found = standalone.run().unwrap().stream(SlidingSpeedPorts::speeds);
    assert!(
        found[..12].iter().all(|s| (s - 0.3).abs() < 1e-6) && found[12..].iter().all(|s| *s == 0.0),
        "{found:?}"
    );
}

#[test]
fn an_age_of_another_rate_or_of_two_channels_is_rejected() {
    let rejected = |rate, channels: u16| {
        let standalone = Standalone::new::<SlidingSpeed>(params())
            .input(SlidingSpeedPorts::contacts, Rate::hz(60), one_vertex(), sliding(&[0.0; 4]))
            .optional(SlidingSpeedPorts::age, rate, Channels(channels), vec![0.0; 4 * usize::from(channels)]);
        standalone.shape().unwrap_err()
    };
    let (rate, channels) = (rejected(Rate::hz(50), 1), rejected(Rate::hz(60), 2));
    assert_eq!((rate.code, channels.code), ("F045", "F046"));
}

#[test]
fn threshold_factor_and_power_change_without_a_rebuild_and_nothing_else_does() {
    let p = params();
    let made = |p: &SlidingSpeedParams| SlidingSpeed {
        sampler: SpeedSampler::new(sampler_params(p, Rate::hz(60), false), 1, 1, None),
        started: false,
        look_ahead: sampler_params(p, Rate::hz(60), false).look_ahead() as i64,
        needs_first_pass: false,
        map: SpeedMap { factor: p.factor, power: p.power },
        params: p.clone(),
    };
    let mut node = made(&p);
    // At 0.3 m/s nothing passes a threshold of 1 m/s, and everything one of 0.1 m/s.
    for (threshold, factor, expected) in [(1.0, 1.0, 0.0), (0.1, 1.0, 0.3), (0.1, 2.0, 0.6), (1.0, 2.0, 0.6)]
    {
        let new = SlidingSpeedParams { threshold, factor, ..p.clone() };
        assert_eq!(node.retune(&new), Retune::Done);
        for _ in 0..100 {
            node.sampler.push(&sliding(&[0.005]), None);
        }
        let mut out = [0.0];
        let item = node.sampler.next_frame() * 40 / 60 - 22;
        assert!(node.sampler.sample(item, &mut out));
        let found = node.map.map(out[0]);
        // The last of these runs has passed already, and a run that has passed stays open to its end.
        assert!((found - expected).abs() < 1e-6, "{threshold} {factor}: {found}");
    }
    for other in [
        SlidingSpeedParams { rate: Rate::hz(50), ..p.clone() },
        SlidingSpeedParams { max_hold: 0.1, ..p.clone() },
        SlidingSpeedParams { between: Between::Linear, ..p.clone() },
        SlidingSpeedParams { gate: SpeedGate::Causal, ..p.clone() },
    ] {
        assert_eq!(made(&p).retune(&other), Retune::Rebuild);
    }
}
