//! The node `ContactDetector`: rates, ends, windows.

use super::*;
use crate::contact::Contact;
use crate::core::params::Params;
use crate::core::standalone::Standalone;
use crate::core::time::{TICKS_PER_SECOND, ticks};
use crate::mesh::Topology;
use crate::mesh::generate::{FlatSheet, SlidingPlanes, Synthetic};

fn params() -> ContactDetectorParams {
    ContactDetectorParams::read(&|_| None).expect("every parameter has a default")
}

fn frames(scene: &impl Synthetic, rate: Rate, count: i64) -> (Topology, Vec<[f32; 3]>) {
    let topology = scene.topology();
    let mut all = vec![[0.0; 3]; topology.vertex_count() * count as usize];
    for (k, frame) in all.chunks_exact_mut(topology.vertex_count()).enumerate() {
        scene.positions(k as f64 / rate.as_f64(), frame);
    }
    (topology, all)
}

/// A sheet that slides over a floor of another mesh.
fn over_floor(floor_rate: Rate, is_static: bool) -> Standalone {
    let rate = Rate::hz(60);
    let sheet = FlatSheet { vertices: [5, 5], size: [0.2, 0.2], velocity: [0.3, 0.0, 0.0] };
    let (cloth, moving) = frames(&sheet, rate, 30);
    let floor = FlatSheet { vertices: [2, 2], size: [4.0, 4.0], velocity: [0.0; 3] };
    let (mut ground, _) = frames(&floor, floor_rate, 1);
    ground.rest.iter_mut().for_each(|p| p[2] = -0.01);
    let rest = ground.rest.clone();
    let format = MeshFormat { is_static, ..MeshFormat::moving(ground) };
    Standalone::new::<ContactDetector>(ContactDetectorParams { radius: 0.02, ..params() })
        .input(ContactDetectorPorts::mesh, rate, MeshFormat::moving(cloth), moving)
        .also(ContactDetectorPorts::others, floor_rate, format, rest.repeat(4))
}

#[test]
fn a_sheet_slides_over_a_floor_by_its_speed_until_its_last_frame() {
    let run = over_floor(Rate::hz(60), false).run().unwrap();
    let contacts = run.stream(ContactDetectorPorts::contacts);
    assert_eq!(contacts.len(), 30 * 25);
    assert!(contacts.iter().all(|c| c.surface == 1 && (c.distance - 0.01).abs() < 1e-6));
    assert!(contacts[..29 * 25].iter().all(|c| (c.slide * 60.0 - 0.3).abs() < 1e-4));
    assert!(contacts[29 * 25..].iter().all(|c| c.slide == 0.0));
    let figure = |name| run.summary.iter().find(|(n, _)| *n == name).map(|(_, v)| v.clone());
    assert_eq!(figure("contacts_per_frame"), Some(25.0.into()));
}

#[test]
fn a_static_floor_can_have_any_rate_and_a_moving_one_cannot() {
    let contacts = |standalone: Standalone| standalone.run().unwrap().stream(ContactDetectorPorts::contacts);
    assert_eq!(contacts(over_floor(Rate::hz(7), true)), contacts(over_floor(Rate::hz(60), false)));
    let reject = over_floor(Rate::hz(30), false).shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F072", Some("others[0]")));
    assert!(reject.help.unwrap().contains("`fps: 60`"));
}

#[test]
fn windows_of_any_length_give_the_same_contacts() {
    let contacts = |window| {
        let run = over_floor(Rate::hz(60), false).window(window).run().unwrap();
        run.stream(ContactDetectorPorts::contacts)
    };
    let reference = contacts(TICKS_PER_SECOND);
    for window in [ticks(0.001), ticks(0.0123), Rate::hz(60).tick(7)] {
        assert_eq!(contacts(window), reference);
    }
}

#[test]
fn a_position_that_is_not_finite_is_a_fault_with_its_time() {
    let scene =
        SlidingPlanes { vertices: [3, 3], size: [0.2, 0.2], gap: 0.01, speed: 0.1, acceleration: 0.0 };
    let (topology, mut all) = frames(&scene, Rate::hz(60), 10);
    all[18 * 4 + 2][1] = f32::NAN;
    let standalone = Standalone::new::<ContactDetector>(params()).input(
        ContactDetectorPorts::mesh,
        Rate::hz(60),
        MeshFormat::moving(topology),
        all,
    );
    let fault = standalone.run().err().unwrap();
    assert_eq!((fault.code, fault.field.as_deref()), ("F073", Some("mesh")));
    assert_eq!(fault.time, Some(Rate::hz(60).tick(3)));
}

#[test]
fn a_cloth_alone_touches_itself() {
    let scene =
        SlidingPlanes { vertices: [4, 4], size: [0.2, 0.2], gap: 0.01, speed: 0.1, acceleration: 0.0 };
    let (topology, all) = frames(&scene, Rate::hz(60), 3);
    let touching = |self_contact| {
        let p = ContactDetectorParams { radius: 0.02, self_contact, ..params() };
        let format = MeshFormat::moving(topology.clone());
        let standalone = Standalone::new::<ContactDetector>(p).input(
            ContactDetectorPorts::mesh,
            Rate::hz(60),
            format,
            all.clone(),
        );
        let contacts = standalone.run().unwrap().stream(ContactDetectorPorts::contacts);
        contacts.iter().filter(|c: &&Contact| c.is_some()).count()
    };
    assert_eq!((touching(true), touching(false)), (3 * 32, 0));
}

#[test]
fn a_rotation_of_the_pair_is_sliding_by_the_naive_measure_and_not_by_the_exact_one() {
    // Two sheets 10 mm apart that turn together about y, by 0.1 rad a frame.
    let scene =
        SlidingPlanes { vertices: [4, 4], size: [0.2, 0.2], gap: 0.01, speed: 0.0, acceleration: 0.0 };
    let (topology, positions) = frames(&scene, Rate::hz(60), 1);
    let turned = |angle: f32| {
        let (sin, cos) = angle.sin_cos();
        positions.iter().map(move |&[x, y, z]| [cos * x + sin * z, y, cos * z - sin * x])
    };
    let all: Vec<[f32; 3]> = (0..3).flat_map(|k| turned(0.1 * k as f32)).collect();
    let slides = |slip| {
        let p = ContactDetectorParams { radius: 0.02, slip, ..params() };
        let port = ContactDetectorPorts::mesh;
        let format = MeshFormat::moving(topology.clone());
        let run = Standalone::new::<ContactDetector>(p).input(port, Rate::hz(60), format, all.clone()).run();
        let contacts = run.unwrap().stream(ContactDetectorPorts::contacts);
        contacts[..2 * 32].iter().map(|c| c.slide).fold((f32::MAX, 0.0_f32), |(a, b), s| (a.min(s), b.max(s)))
    };
    let (min, max) = slides(SlipMode::Naive);
    assert!(min > 0.9e-3 && max < 1.1e-3, "0.1 rad times 10 mm: {min} to {max}");
    assert!(slides(SlipMode::Exact).1 < 1e-6);
}

#[test]
fn a_mesh_of_separate_faces_gives_a_note() {
    let scene =
        SlidingPlanes { vertices: [4, 4], size: [0.2, 0.2], gap: 0.01, speed: 0.1, acceleration: 0.0 };
    let (topology, _) = frames(&scene, Rate::hz(60), 1);
    let notes = |topology: Topology| {
        let (format, rest) = (MeshFormat::moving(topology.clone()), topology.rest);
        let standalone = Standalone::new::<ContactDetector>(params()).input(
            ContactDetectorPorts::mesh,
            Rate::hz(60),
            format,
            rest,
        );
        standalone.shape().unwrap().notes
    };
    assert!(notes(topology.clone()).is_empty());
    let rest: Vec<_> = topology.triangles.iter().flatten().map(|v| topology.rest[*v as usize]).collect();
    let triangles = (0..rest.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let found = notes(Topology { rest, triangles });
    assert!(found.len() == 1 && found[0].contains("merge vertices"), "{found:?}");
}
