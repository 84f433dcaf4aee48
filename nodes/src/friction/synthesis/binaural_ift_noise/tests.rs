//! Sides, delays, movement and windows of the node.

use super::*;
use crate::core::standalone::Standalone;
use crate::core::time::{TICKS_PER_SECOND, ticks};
use crate::friction::synthesis::MotionAt;
use crate::friction::synthesis::noise_params::VertexLevelParams;
use crate::friction::testing::bump_model;
use crate::mesh::{MeshFormat, Topology};
use crate::spatial::{Ear, Head, Pinna};

type Port = BinauralIftNoisePorts;

fn params() -> BinauralIftNoiseParams {
    let p = BinauralIftNoiseParams::read(&|_| None).expect("every parameter has a default");
    BinauralIftNoiseParams { head: HeadParams { pinna: Pinna::Off, ..p.head }, ..p }
}

/// Broad noise, so that the ears can be compared in time.
fn model() -> FrictionModel {
    bump_model(&[(0.1, 6000.0), (1.0, 8000.0)], 4000.0, 48_000.0, 2400)
}

/// Two sliding vertices at a position per frame, 60 frames per second.
fn standalone(p: BinauralIftNoiseParams, seconds: usize, trajectory: impl Fn(f32) -> [f32; 3]) -> Standalone {
    let frames: Vec<[f32; 3]> = (0..60 * seconds)
        .flat_map(|k| {
            let at = trajectory(k as f32 / 60.0);
            [at, [at[0], at[1], at[2] + 0.001]]
        })
        .collect();
    let rest = frames[..2].to_vec();
    let areas: std::sync::Arc<[f32]> = vec![1e-4; 2].into();
    Standalone::new::<BinauralIftNoise>(p)
        .input(Port::speeds, Rate::hz(40), areas, vec![0.5; 2 * 40 * seconds])
        .value(Port::model, model())
        .input(Port::mesh, Rate::hz(60), MeshFormat::moving(Topology { rest, triangles: vec![] }), frames)
}

fn ears(out: &[f32]) -> [Vec<f64>; 2] {
    [0, 1].map(|ear| out.iter().skip(ear).step_by(2).map(|x| f64::from(*x)).collect())
}

fn at_azimuth(degrees: f32, distance: f32) -> [f32; 3] {
    let a = degrees.to_radians();
    [distance * a.cos(), -distance * a.sin(), 0.0]
}

/// Samples by which the left ear is later: the peak of the cross-correlation.
fn lag(left: &[f64], right: &[f64]) -> i64 {
    let middle = 200..left.len() - 200;
    let correlation =
        |lag: i64| middle.clone().map(|n| left[(n as i64 + lag) as usize] * right[n]).sum::<f64>();
    (-60..=60).max_by(|a, b| correlation(*a).total_cmp(&correlation(*b))).unwrap_or_default()
}

#[test]
fn the_interaural_cross_correlation_peaks_at_the_delay_of_the_model() {
    let head = Head::default();
    for degrees in [30.0, -60.0, 90.0] {
        let out = standalone(params(), 3, |_| at_azimuth(degrees, 3.0)).run().unwrap().stream(Port::audio);
        let [left, right] = ears(&out);
        let d = at_azimuth(degrees, 1.0).map(f64::from);
        let [l, r] = [Ear::Left, Ear::Right].map(|ear| head.delay(head.incidence(ear, d)));
        let expected = (l - r) * 48_000.0;
        assert!(
            (lag(&left, &right) as f64 - expected).abs() <= 1.0,
            "{degrees}: {} {expected}",
            lag(&left, &right)
        );
    }
}

#[test]
fn both_ears_receive_the_same_phases() {
    let out = standalone(params(), 2, |_| [2.0, 0.0, 0.0]).run().unwrap().stream(Port::audio);
    let [left, right] = ears(&out);
    assert!(left == right, "in front of the head both ears are equal");
    let out = standalone(params(), 2, |_| at_azimuth(20.0, 2.0)).run().unwrap().stream(Port::audio);
    let [left, right] = ears(&out);
    let shift = lag(&left, &right) as usize;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (l, r) = (&left[shift + 200..], &right[200..right.len() - shift]);
    assert!(dot(l, r) / (dot(l, l) * dot(r, r)).sqrt() > 0.7);
}

#[test]
fn mirrored_cloth_and_a_turned_head_swap_the_ears() {
    let run =
        |p, degrees| ears(&standalone(p, 1, |_| at_azimuth(degrees, 1.0)).run().unwrap().stream(Port::audio));
    let ([a, b], [c, d]) = (run(params(), 50.0), run(params(), -50.0));
    assert!(a == d && b == c);
    let power = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    assert!(power(&b) > 4.0 * power(&a), "right of the head");
    let turned =
        BinauralIftNoiseParams { head: HeadParams { look: [-1.0, 0.0, 0.0], ..params().head }, ..params() };
    let [a, b] = run(turned, 50.0);
    assert!(power(&a) > 2.0 * power(&b), "left of a head that looks back");
}

#[test]
fn the_level_in_front_is_that_of_the_model_at_the_distance() {
    let power = |distance: f32, p| {
        let out = standalone(p, 3, |_| [distance, 0.0, 0.0]).run().unwrap().stream(Port::audio);
        ears(&out)[0].iter().skip(2400).map(|x| x * x).sum::<f64>() / (out.len() / 2 - 2400) as f64
    };
    let near = power(1.0, params());
    let far = power(4.0, params());
    assert!((near / far / 16.0 - 1.0).abs() < 0.01, "{}", near / far);
    let without = power(4.0, BinauralIftNoiseParams { reference: None, ..params() });
    assert!((without / near - 1.0).abs() < 0.01);
    // Ears at 100 degrees receive the front with a gain between 1 and that of high frequencies.
    let head = Head::default();
    let gain = head.high_gain(100_f64.to_radians()).powi(2);
    let mono = 2.0 * model().power(0.5);
    assert!(near < mono && near > gain * mono, "{near} {mono}");
}

#[test]
fn windows_of_any_length_give_the_same_bits_while_cloth_and_head_move() {
    let trajectory = |t: f32| at_azimuth(360.0 * t, 1.0 + t);
    let poses: Vec<Pose> = (0..25).map(|k| Pose::at([0.0, 0.02 * k as f32, 0.0])).collect();
    let run = |window: Tick| {
        let p =
            BinauralIftNoiseParams { head: HeadParams { pinna: Pinna::Set1, ..params().head }, ..params() };
        let mut standalone = standalone(p, 1, trajectory)
            .optional(Port::listener, Rate::hz(25), (), poses.clone())
            .window(window);
        standalone.poison = true;
        let run = standalone.run().unwrap();
        (run.stream(Port::audio), run.summary)
    };
    let whole = run(2 * TICKS_PER_SECOND);
    assert!(whole.0.len() == 96_000 && whole.0.iter().all(|x| x.is_finite()));
    for window in [ticks(0.001), ticks(0.0371), Rate::hz(48_000).span(64), ticks(0.2)] {
        assert!(run(window) == whole, "{window}");
    }
    let [left, right] = ears(&whole.0);
    let power = |x: &[f64], from: usize| x[from..from + 4800].iter().map(|x| x * x).sum::<f64>();
    assert!(power(&right, 9_600) > 2.0 * power(&left, 9_600));
    assert!(power(&left, 33_600) > 2.0 * power(&right, 33_600));
}

#[test]
fn another_mesh_is_refused() {
    let rest = vec![[0.0; 3]; 3];
    let format = MeshFormat::moving(Topology { rest: rest.clone(), triangles: vec![] });
    let areas: std::sync::Arc<[f32]> = vec![1e-4; 2].into();
    let standalone = Standalone::new::<BinauralIftNoise>(params())
        .input(Port::speeds, Rate::hz(40), areas, vec![0.0; 2])
        .value(Port::model, model())
        .input(Port::mesh, Rate::hz(60), format, rest);
    let reject = standalone.shape().unwrap_err();
    assert!(reject.code == "F067" && reject.message.contains("2 vertices, `mesh` has 3"), "{reject}");
}

#[test]
fn one_cluster_has_one_direction_and_two_clusters_have_two() {
    // A vertex on either side of the head: together they are in the middle.
    let sides = |clusters| {
        let frames: Vec<[f32; 3]> = (0..60).flat_map(|_| [[2.0, 1.0, 0.0], [2.0, -1.0, 0.0]]).collect();
        let rest = frames[..2].to_vec();
        let areas: std::sync::Arc<[f32]> = vec![1e-4; 2].into();
        let p = BinauralIftNoiseParams { clusters, reference: None, ..params() };
        let out = Standalone::new::<BinauralIftNoise>(p)
            .input(Port::speeds, Rate::hz(40), areas, vec![0.5; 2 * 40])
            .value(Port::model, model())
            .input(Port::mesh, Rate::hz(60), MeshFormat::moving(Topology { rest, triangles: vec![] }), frames)
            .run()
            .unwrap()
            .stream(Port::audio);
        ears(&out)
    };
    let [left, right] = sides(1);
    assert!(left == right, "one direction, in front");
    let [left, right] = sides(2);
    assert!(left != right);
}

#[test]
fn motion_at_the_start_of_a_clip_sounds_as_at_its_middle_half_a_clip_later() {
    let trajectory = |t: f32| [2.0, 1.5 - 3.0 * t, 0.0];
    let run = |motion_at| {
        let p = BinauralIftNoiseParams {
            vertices: VertexLevelParams { motion_at, ..params().vertices },
            ..params()
        };
        let standalone = standalone(p, 1, trajectory);
        (standalone.shape().unwrap().lookaround[0].ahead, standalone.run().unwrap().stream(Port::audio))
    };
    let ((ahead, start), (_, centre)) = (run(MotionAt::Start), run(MotionAt::Centre));
    assert_eq!(ahead, 0);
    // Phases belong to clips and not to motion, so only levels can be compared.
    let level = |out: &[f32], from: usize, ear: usize| {
        let part = out[2 * from..2 * (from + 9600)].iter().skip(ear).step_by(2);
        part.map(|x| f64::from(*x).powi(2)).sum::<f64>()
    };
    for from in [0, 9600, 24_000] {
        for ear in [0, 1] {
            let (a, b) = (level(&start, from + 1200, ear), level(&centre, from, ear));
            let decibels = 10.0 * (a / b).log10();
            assert!(decibels.abs() < 0.6, "from {from}, ear {ear}: {decibels} dB");
        }
    }
}
