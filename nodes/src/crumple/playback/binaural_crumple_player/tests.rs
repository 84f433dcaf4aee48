use super::super::onset_timing::Jitter;
use super::*;
use crate::core::item::Event;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, Tick};
use crate::crumple::bank::{Cut, Extraction, Origin, Recorded};
use crate::crumple::playback::crumple_player::{CrumplePlayer, CrumplePlayerParams, CrumplePlayerPorts};
use crate::spatial::hrtf::structural_hrtf::{StructuralHrtf, StructuralHrtfParams, StructuralHrtfPorts};
use crate::spatial::propagation::distance_gain::{DistanceGain, DistanceGainParams, DistanceGainPorts};
use crate::spatial::{Ear, Pinna};

type Port = BinauralCrumplePlayerPorts;
type Parameters = BinauralCrumplePlayerParams;

fn params() -> Parameters {
    let p = Parameters::read(&|_| None).unwrap();
    Parameters {
        onset: JitterParams { jitter: Jitter::Off, ..p.onset },
        head: HeadParams { pinna: Pinna::Off, ..p.head },
        playback: PlaybackParams { tail: 0.05, ..p.playback },
        ..p
    }
}

/// A bank of one click, one burst of noise, and one wave that has nothing above 2.5 kHz.
fn bank() -> CrumpleBank {
    let wave = |n: f32| (0.31 * n).sin() * (n / 400.0 * std::f32::consts::PI).sin().powi(2);
    let noise = (0..400).map(|n| ((n * n) as f32 * 0.61).sin() * 0.3).collect();
    let low = (0..400).map(|n| wave(n as f32)).collect();
    let cuts = [vec![1.0], noise, low].map(|samples| Cut { samples, origin: Origin::default() });
    CrumpleBank::new("", 48_000.0, cuts.into(), vec![Recorded::default()], Extraction::default())
}

fn event(id: u32, sample: u32, position: [f32; 3]) -> MatchedCrumple {
    let event = MatchedCrumple::trial(&mut Rng::new(1));
    MatchedCrumple { id, sample, bank: bank().id(), interval: Rate::hz(60).tick(1), position, ..event }
}

fn standalone(p: Parameters, events: &[(Tick, MatchedCrumple)]) -> Standalone {
    Standalone::new::<BinauralCrumplePlayer>(p)
        .events(Port::matched, events.to_vec(), ticks(0.5))
        .value(Port::bank, bank())
}

fn ears(standalone: Standalone) -> [Vec<f32>; 2] {
    let out = standalone.run().unwrap().stream(Port::audio);
    [0, 1].map(|ear| out.iter().skip(ear).step_by(2).copied().collect())
}

/// Degrees to the right of a listener who looks along x.
fn at_azimuth(degrees: f32, distance: f32) -> [f32; 3] {
    let a = degrees.to_radians();
    [distance * a.cos(), -distance * a.sin(), 0.0]
}

fn power(x: &[f32]) -> f64 {
    x.iter().map(|x| f64::from(*x).powi(2)).sum()
}

#[test]
fn mirrored_events_swap_the_ears_bit_for_bit_and_events_in_front_are_equal_in_both() {
    for pinna in [Pinna::Off, Pinna::Set0] {
        let render = |degrees| {
            let p = Parameters {
                head: HeadParams { pinna, ..params().head },
                onset: JitterParams { jitter: Jitter::WholeFrames, ..params().onset },
                ..params()
            };
            let events = [
                (ticks(0.1), event(3, 1, at_azimuth(degrees, 2.0))),
                (ticks(0.1), event(9, 0, at_azimuth(degrees, 1.0))),
            ];
            ears(standalone(p, &events))
        };
        let ([left, right], [other_left, other_right]) = (render(50.0), render(-50.0));
        assert!(left == other_right && right == other_left && left != right);
        assert!(power(&right) > 2.0 * power(&left));
        let [left, right] = render(0.0);
        assert!(left == right && power(&left) > 0.0);
    }
}

#[test]
fn the_ears_differ_in_time_as_in_the_model() {
    let head = Head::default();
    for degrees in [30.0, 60.0, 90.0, -45.0] {
        let [left, right] =
            ears(standalone(params(), &[(ticks(0.1), event(0, 1, at_azimuth(degrees, 2.0)))]));
        let middle = 4000..left.len() - 1000;
        let correlation =
            |lag: i64| middle.clone().map(|n| left[(n as i64 + lag) as usize] * right[n]).sum::<f32>();
        let found = (-60..=60).max_by(|a, b| correlation(*a).total_cmp(&correlation(*b))).unwrap();
        let d = at_azimuth(degrees, 1.0).map(f64::from);
        let [l, r] = [Ear::Left, Ear::Right].map(|ear| head.delay(head.incidence(ear, d)));
        let expected = (l - r) * 48_000.0;
        assert!((found as f64 - expected).abs() <= 1.0, "{degrees}: {found} {expected}");
    }
}

/// The same sound from other nodes: one channel, then head and distance.
fn by_other_nodes(position: [f32; 3], tick: Tick, listener: Pose) -> Vec<f32> {
    let Parameters { onset, playback, .. } = params();
    let p = CrumplePlayerParams { onset, playback };
    let mono = Standalone::new::<CrumplePlayer>(p)
        .events(CrumplePlayerPorts::matched, vec![(tick, event(0, 2, position))], ticks(0.5))
        .value(CrumplePlayerPorts::bank, bank());
    let mono = mono.run().unwrap().stream(CrumplePlayerPorts::audio);
    let position = position.map(f64::from);
    let p = StructuralHrtfParams { position, ..StructuralHrtfParams::read(&|_| None).unwrap() };
    let stereo = Standalone::new::<StructuralHrtf>(p)
        .input(StructuralHrtfPorts::audio, Rate::hz(48_000), Channels(1), mono)
        .optional(StructuralHrtfPorts::listener, Rate::hz(60), (), vec![listener; 60]);
    let stereo = stereo.run().unwrap().stream(StructuralHrtfPorts::out);
    let p = DistanceGainParams {
        position,
        listener: listener.position.map(f64::from),
        ..DistanceGainParams::read(&|_| None).unwrap()
    };
    let out = Standalone::new::<DistanceGain>(p).input(
        DistanceGainPorts::audio,
        Rate::hz(48_000),
        Channels(2),
        stereo,
    );
    out.run().unwrap().stream(DistanceGainPorts::out)
}

#[test]
fn one_event_equals_the_mono_player_through_head_and_distance_nodes_while_the_listener_moves() {
    let frame = |k: usize| {
        let a = 0.1 * k as f64;
        Pose::looking([0.02 * k as f64, 0.5, 0.1], [a.cos(), a.sin(), 0.0], [0.0, 0.0, 1.0]).unwrap()
    };
    let poses: Vec<Pose> = (0..40).map(frame).collect();
    for (k, position) in [(6, [1.0, 2.0, 0.5]), (13, [-2.0, 0.2, 0.0])] {
        // The sample begins at a frame of the listener, so its pose is that of the frame.
        let tick = Rate::hz(60).tick(k);
        let p = Parameters { head: HeadParams { pinna: Pinna::Set0, ..params().head }, ..params() };
        let standalone = standalone(p, &[(tick, event(0, 2, position))]).optional(
            Port::listener,
            Rate::hz(60),
            (),
            poses.clone(),
        );
        let found = standalone.run().unwrap().stream(Port::audio);
        let expected = by_other_nodes(position, tick, frame(k as usize));
        let worst = found.iter().zip(&expected).fold(0.0_f32, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(power(&expected) > 1.0 && worst < 2e-3, "{worst} {}", power(&expected));
    }
}

#[test]
fn windows_of_any_length_give_the_same_bits_while_the_listener_moves_and_voices_are_stolen() {
    let poses: Vec<Pose> = (0..30).map(|k| Pose::at([0.0, 0.1 * k as f32 - 1.5, 0.0])).collect();
    let events: Vec<_> = (0..60)
        .map(|k| {
            (ticks(0.007 * f64::from(k)), event(k, k % 2, at_azimuth(17.0 * k as f32, 0.3 + 0.02 * k as f32)))
        })
        .collect();
    for (jitter, max_voices) in [(Jitter::WholeFrames, 100), (Jitter::Centred, 3), (Jitter::Off, 2)] {
        let run = |window| {
            let p = Parameters {
                onset: JitterParams { jitter, ..params().onset },
                playback: PlaybackParams { max_voices, ..params().playback },
                head: HeadParams { pinna: Pinna::Set1, ..params().head },
                ..params()
            };
            let standalone = standalone(p, &events).optional(Port::listener, Rate::hz(60), (), poses.clone());
            let mut standalone = standalone.window(window);
            standalone.poison = true;
            let run = standalone.run().unwrap();
            (run.stream(Port::audio), run.summary)
        };
        let whole = run(ticks(2.0));
        assert!(whole.0.iter().all(|x| x.is_finite()) && whole.0.iter().any(|x| *x != 0.0));
        for window in [ticks(0.0101), ticks(0.001), Rate::hz(48_000).span(64)] {
            assert!(run(window) == whole, "{jitter:?}");
        }
    }
}

#[test]
fn the_level_falls_with_distance_unless_there_is_no_reference() {
    let render = |distance, reference| {
        let p = Parameters { reference, ..params() };
        let [left, _] = ears(standalone(p, &[(ticks(0.1), event(0, 1, [distance, 0.0, 0.0]))]));
        power(&left).sqrt()
    };
    let near = render(1.0, Some(1.0));
    assert!((near / render(4.0, Some(1.0)) - 4.0).abs() < 1e-3 && near == render(4.0, None));
}

#[test]
fn an_undefined_direction_of_the_head_is_refused() {
    let reject =
        standalone(Parameters { head: HeadParams { up: [2.0, 0.0, 0.0], ..params().head }, ..params() }, &[])
            .shape()
            .unwrap_err();
    assert!(reject.code == "F067" && reject.message.contains("listener"), "{reject}");
}
