use std::f32::consts::PI;

use super::*;
use crate::core::params::Params;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, TICKS_PER_SECOND, ticks};

const FS: u32 = 48_000;

fn params() -> StructuralHrtfParams {
    StructuralHrtfParams::read(&|_| None).unwrap()
}

fn standalone(p: StructuralHrtfParams, audio: Vec<f32>) -> Standalone {
    Standalone::new::<StructuralHrtf>(p).input(StructuralHrtfPorts::audio, Rate::hz(FS), Channels(1), audio)
}

fn click(at: usize) -> Vec<f32> {
    let mut audio = vec![0.0; FS as usize / 10];
    audio[at] = 1.0;
    audio
}

fn circle(radius: f32) -> Vec<Pose> {
    let at = |k: u8| 2.0 * PI * f32::from(k) / 60.0;
    (0..60).map(|k| Pose::at([radius * at(k).cos(), radius * at(k).sin(), 0.0])).collect()
}

#[test]
fn a_click_in_front_stays_near_its_time_and_is_the_same_in_both_ears() {
    let p = StructuralHrtfParams { pinna: Pinna::Off, ..params() };
    let out = standalone(p, click(1000)).run().unwrap().stream(StructuralHrtfPorts::out);
    let left: Vec<f32> = out.iter().step_by(2).copied().collect();
    let right: Vec<f32> = out.iter().skip(1).step_by(2).copied().collect();
    assert_eq!(left, right);
    let peak = (0..left.len()).max_by(|a, b| left[*a].total_cmp(&left[*b])).unwrap();
    // The path to ears at 100 degrees is 10 degrees of arc longer than to the centre.
    let expected = 1000.0 + 0.0875 / 343.0 * 10_f64.to_radians() * 48_000.0;
    assert!((peak as f64 - expected).abs() <= 1.0, "{peak} {expected}");
    assert!(left[..900].iter().all(|x| *x == 0.0));
}

#[test]
fn a_source_to_the_left_is_louder_and_earlier_at_the_left_ear() {
    let turned = StructuralHrtfParams { look: [0.0, -1.0, 0.0], ..params() };
    let moved = StructuralHrtfParams { listener: [0.0, 5.0, 0.0], position: [0.0, 9.0, 0.0], ..params() };
    let left = StructuralHrtfParams { position: [0.0, 2.0, 0.0], ..params() };
    let out = [turned, moved, left]
        .map(|p| standalone(p, click(1000)).run().unwrap().stream(StructuralHrtfPorts::out));
    for out in &out {
        let power = |ear: usize| out.iter().skip(ear).step_by(2).map(|x| x * x).sum::<f32>();
        assert!(power(0) > 3.0 * power(1), "{} {}", power(0), power(1));
        let first = |ear: usize| out.iter().skip(ear).step_by(2).position(|x| x.abs() > 0.01).unwrap();
        assert!(first(0) + 20 < first(1), "{} {}", first(0), first(1));
    }
    assert!(out[1] == out[2]);
}

#[test]
fn a_link_moves_the_source_or_the_head_with_the_same_bits_in_any_windows() {
    let noise: Vec<f32> = (0..FS).map(|n| ((n * n) as f32 * 0.61).sin()).collect();
    let run = |moves_listener: bool, window| {
        let port = if moves_listener { StructuralHrtfPorts::listener } else { StructuralHrtfPorts::position };
        let standalone = standalone(params(), noise.clone()).optional(port, Rate::hz(60), (), circle(2.0));
        standalone.window(window).run().unwrap().stream(StructuralHrtfPorts::out)
    };
    for moves_listener in [false, true] {
        let expected = run(moves_listener, 2 * TICKS_PER_SECOND);
        assert!(
            run(moves_listener, ticks(0.0123)) == expected
                && run(moves_listener, Rate::hz(FS).span(17)) == expected
        );
    }
    let out = run(false, TICKS_PER_SECOND);
    let power = |from: usize, ear: usize| {
        out[2 * from..2 * from + 4800].iter().skip(ear).step_by(2).map(|x| x * x).sum::<f32>()
    };
    // After a quarter turn the source is on the left, after three quarters on the right.
    assert!(power(12_000, 0) > 2.0 * power(12_000, 1));
    assert!(power(36_000, 1) > 2.0 * power(36_000, 0));
}

#[test]
fn a_new_position_needs_no_rebuild_and_a_new_head_does() {
    let cx = standalone(params(), click(0));
    assert!(cx.shape().is_ok());
    let mut node = StructuralHrtf {
        binaural: Binaural::new(head(&params()), 0.0, 48_000.0),
        started: false,
        source: [1.0, 0.0, 0.0],
        listener: Pose::default(),
        params: params(),
    };
    let moved = StructuralHrtfParams { position: [0.0, 1.0, 0.0], look: [0.0, 1.0, 0.0], ..params() };
    assert_eq!(node.retune(&moved), Retune::Done);
    assert_eq!(node.source, [0.0, 1.0, 0.0]);
    assert_eq!(node.retune(&StructuralHrtfParams { radius: 0.1, ..moved }), Retune::Rebuild);
}

#[test]
fn stereo_and_an_undefined_orientation_are_refused() {
    let stereo = Standalone::new::<StructuralHrtf>(params());
    let stereo = stereo.input(StructuralHrtfPorts::audio, Rate::hz(FS), Channels(2), vec![0.0; 4]);
    assert!(stereo.shape().unwrap_err().help.unwrap().contains("Mono"));
    let p = StructuralHrtfParams { up: [2.0, 0.0, 0.0], ..params() };
    assert_eq!(standalone(p, vec![0.0; 4]).shape().unwrap_err().code, "F067");
}
