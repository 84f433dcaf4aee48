//! Silence, level, rates and windows of the node.

use super::*;
use crate::core::random::Random;
use crate::core::standalone::Standalone;
use crate::core::time::{TICKS_PER_SECOND, ticks};
use crate::friction::synthesis::noise_params::ClipParams;
use crate::friction::synthesis::noise_params::VertexLevelParams;
use crate::friction::synthesis::{MotionAt, Window};
use crate::friction::testing::bump_model;

const VERTICES: usize = 4;

fn params() -> IftNoiseNodeParams {
    IftNoiseNodeParams::read(&|_| None).expect("every parameter has a default")
}

fn model() -> FrictionModel {
    bump_model(&[(0.1, 1000.0), (0.4, 4000.0), (1.0, 8000.0)], 300.0, 48_000.0, 2400)
}

fn standalone(p: IftNoiseNodeParams, rate: Rate, speeds: Vec<f32>) -> Standalone {
    let areas: std::sync::Arc<[f32]> = vec![1e-4; VERTICES].into();
    Standalone::new::<IftNoiseNode>(p)
        .input(IftNoisePorts::speeds, rate, areas, speeds)
        .value(IftNoisePorts::model, model())
}

fn power(x: &[f32]) -> f64 {
    x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64
}

#[test]
fn cloth_at_rest_is_exactly_silent_and_audio_lasts_as_long_as_the_speeds() {
    let mut speeds = vec![0.0; 40 * VERTICES];
    speeds[20 * VERTICES] = 0.4;
    let audio = standalone(params(), Rate::hz(40), speeds).run().unwrap().stream(IftNoisePorts::audio);
    assert_eq!(audio.len(), 48_000);
    // The one clip that sounds is centred at 0.5 s and 50 ms long.
    let sounds = 24_000 - 1200..24_000 + 1200;
    assert!(audio[..sounds.start].iter().all(|x| *x == 0.0));
    assert!(audio[sounds.clone()].iter().any(|x| *x != 0.0));
    assert!(audio[sounds.end..].iter().all(|x| *x == 0.0));
}

#[test]
fn pressure_is_a_factor_on_power_and_without_any_nothing_sounds() {
    let areas: std::sync::Arc<[f32]> = vec![1e-4; VERTICES].into();
    let with = |pressures: Vec<f32>| {
        let node = standalone(params(), Rate::hz(40), vec![0.4; 40 * VERTICES]);
        node.optional(IftNoisePorts::pressure, Rate::hz(40), areas.clone(), pressures)
    };
    let of = |pressure: f32| with(vec![pressure; 40 * VERTICES]).run().unwrap().stream(IftNoisePorts::audio);
    let plain = standalone(params(), Rate::hz(40), vec![0.4; 40 * VERTICES]);
    assert_eq!(plain.run().unwrap().stream(IftNoisePorts::audio), of(1.0));
    let (light, firm) = (of(1.0), of(4.0));
    assert!((power(&firm) / power(&light) - 4.0).abs() < 1e-3);
    assert!(of(0.0).iter().all(|x| *x == 0.0));
    let fault = with(vec![-1.0; 40 * VERTICES]).run().err().unwrap();
    assert!(fault.code == "F076" && fault.message.contains("pressure of vertex 0 is -1"), "{fault}");
    let slow = standalone(params(), Rate::hz(40), vec![0.4; 40 * VERTICES]);
    let slow = slow.optional(IftNoisePorts::pressure, Rate::hz(20), areas.clone(), vec![1.0; 20 * VERTICES]);
    assert_eq!(slow.shape().unwrap_err().field.as_deref(), Some("pressure"));
    let fewer: std::sync::Arc<[f32]> = vec![1e-4; 2].into();
    let fewer = standalone(params(), Rate::hz(40), vec![0.4; 40 * VERTICES]).optional(
        IftNoisePorts::pressure,
        Rate::hz(40),
        fewer,
        vec![1.0; 80],
    );
    assert_eq!(fewer.shape().unwrap_err().code, "F067");
}

#[test]
fn motion_at_the_start_of_a_clip_sounds_from_that_time() {
    let mut speeds = vec![0.0; 40 * VERTICES];
    speeds[20 * VERTICES] = 0.4;
    let p = IftNoiseNodeParams {
        vertices: VertexLevelParams { motion_at: MotionAt::Start, ..params().vertices },
        ..params()
    };
    let run = |window| {
        let standalone = standalone(p.clone(), Rate::hz(40), speeds.clone()).window(window);
        assert_eq!(standalone.shape().unwrap().lookaround[0].ahead, 0, "no look-ahead");
        standalone.run().unwrap().stream(IftNoisePorts::audio)
    };
    let audio = run(TICKS_PER_SECOND);
    let sounds = 24_000..24_000 + 2400;
    assert!(audio[..sounds.start].iter().all(|x| *x == 0.0));
    assert!(audio[sounds.start..sounds.start + 100].iter().any(|x| *x != 0.0));
    assert!(audio[sounds.end..].iter().all(|x| *x == 0.0));
    for window in [ticks(0.0011), ticks(0.0173), ticks(0.025)] {
        assert!(run(window) == audio);
    }
}

#[test]
fn the_level_is_that_of_the_model_at_the_speed_and_follows_it() {
    let level = |speed: f32| {
        let audio = standalone(params(), Rate::hz(40), vec![speed; 200 * VERTICES])
            .run()
            .unwrap()
            .stream(IftNoisePorts::audio);
        power(&audio[2400..audio.len() - 2400])
    };
    for speed in [0.05, 0.1, 0.25, 0.7, 3.0] {
        let (found, expected) = (level(speed), VERTICES as f64 * model().power(f64::from(speed)));
        assert!((found / expected - 1.0).abs() < 0.03, "{speed}: {found} {expected}");
    }
    let louder =
        IftNoiseNodeParams { vertices: VertexLevelParams { level: 2.0, ..params().vertices }, ..params() };
    let audio = standalone(louder, Rate::hz(40), vec![0.4; 200 * VERTICES])
        .run()
        .unwrap()
        .stream(IftNoisePorts::audio);
    assert!((power(&audio[2400..]) / level(0.4) / 4.0 - 1.0).abs() < 0.05);
}

#[test]
fn a_rate_that_does_not_fit_is_refused_with_one_that_fits() {
    let at = |audio: u32, speeds: Rate| {
        standalone(IftNoiseNodeParams { rate: Rate::hz(audio), ..params() }, speeds, vec![0.0; VERTICES])
            .shape()
    };
    let reject = at(44_100, Rate::hz(40)).unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F074", Some("speeds")));
    assert!(reject.help.unwrap().contains("`rate: \"44100/1103\"`"));
    assert!(at(44_100, Rate::new(44_100, 1103).unwrap()).is_ok());
    assert!(at(96_000, Rate::hz(40)).is_ok() && at(48_000, Rate::hz(60)).is_ok());
}

#[test]
fn windows_of_any_length_give_the_same_bits() {
    let speeds: Vec<f32> =
        (0..40 * VERTICES).map(|k| if k % 7 < 3 { 0.0 } else { k as f32 * 0.01 }).collect();
    for emitters in [EmitterKind::Clustered, EmitterKind::PerVertex] {
        for rate in [Rate::hz(40), Rate::hz(60)] {
            let run = |window| {
                let p = IftNoiseNodeParams { clips: ClipParams { emitters, ..params().clips }, ..params() };
                let mut standalone = standalone(p, rate, speeds.clone()).window(window);
                standalone.poison = true;
                let run = standalone.run().unwrap();
                (run.stream(IftNoisePorts::audio), run.summary)
            };
            let whole = run(2 * TICKS_PER_SECOND);
            assert!(whole.0.iter().all(|x| x.is_finite()));
            for window in [1, 7, 64, 1000].map(|samples| Rate::hz(48_000).tick(samples * 5)) {
                assert_eq!(run(window), whole, "{emitters:?} {rate}");
            }
            assert_eq!(run(ticks(0.0371)), whole);
        }
    }
}

#[test]
fn another_level_is_reached_without_a_rebuild_and_anything_else_needs_one() {
    let p =
        IftNoiseNodeParams { vertices: VertexLevelParams { level: 0.5, ..params().vertices }, ..params() };
    let areas = [1e-4; VERTICES];
    let noise = IftNoise::new(&model(), 48_000.0, IftNoiseParams::default(), &areas, Random::new(1, "n"));
    let level = dsp::Gain::new(0.5, 480, 1);
    let clips = ClipStream::new(noise.unwrap());
    let mut node = IftNoiseNode { clips, level, peak: 0.0, params: p.clone() };
    let louder = IftNoiseNodeParams { vertices: VertexLevelParams { level: 1.0, ..p.vertices }, ..p };
    assert_eq!(node.retune(&louder), Retune::Done);
    let mut ones = [1.0; 481];
    node.level.process(&mut ones);
    assert!(ones.is_sorted() && ones[0] == 0.5 && ones[480] == 1.0);
    let other =
        IftNoiseNodeParams { clips: ClipParams { window: Window::Sine, ..louder.clips }, ..louder.clone() };
    assert_eq!(node.retune(&other), Retune::Rebuild);
    assert_eq!(node.retune(&louder), Retune::Done);
}
