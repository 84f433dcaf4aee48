use super::*;
use crate::contact::Contact;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, TICKS_PER_SECOND, ticks};
use crate::mesh::{MeshFormat, Topology};
use crate::spatial;

type Port = AnalyticColliderPorts;

fn params() -> AnalyticColliderParams {
    AnalyticColliderParams::read(&|_| None).unwrap()
}

/// Three vertices at heights 0.01, 0.03 and 0.2 m over the origin that move along x at 0.3 m/s, touching nothing else.
fn standalone(p: AnalyticColliderParams) -> Standalone {
    let heights = [0.01_f32, 0.03, 0.2];
    let frames = (0..30).flat_map(|k| heights.map(|z| [0.005 * k as f32, 0.0, z])).collect();
    let topology = Topology { rest: heights.map(|z| [0.0, 0.0, z]).to_vec(), triangles: vec![] };
    Standalone::new::<AnalyticCollider>(p)
        .input(
            Port::contacts,
            Rate::hz(60),
            ContactsFormat::plain(vec![1e-4; 3].into(), 1),
            vec![Contact::default(); 90],
        )
        .input(Port::mesh, Rate::hz(60), MeshFormat::moving(topology), frames)
}

fn merged(standalone: &Standalone) -> Vec<Contact> {
    standalone.run().unwrap().stream(Port::merged)
}

#[test]
fn cloth_near_a_static_floor_slides_at_its_own_speed() {
    let found = merged(&standalone(params()));
    for frame in found.chunks(3).take(29) {
        assert_eq!([0, 1, 2].map(|v| frame[v].surface), [1, 1, Contact::NONE]);
        assert!(frame[..2].iter().all(|c| (c.slide * 60.0 - 0.3).abs() < 1e-4 && c.approach == 0.0));
        assert!((frame[1].distance - 0.03).abs() < 1e-6);
    }
}

#[test]
fn cloth_does_not_slide_over_a_body_that_moves_with_it() {
    let poses = |rate: f64, seconds: f64| {
        let count = (rate * seconds) as usize;
        let pose = |k: usize| spatial::Pose::at([(0.3 * k as f64 / rate) as f32, 0.0, 0.0]);
        (0..count).map(pose).collect::<Vec<_>>()
    };
    for rate in [60, 100, 24] {
        let moving = standalone(params()).optional(Port::pose, Rate::hz(rate), (), poses(rate.into(), 1.0));
        let found = merged(&moving);
        // The cubic between the first two poses has no pose before it.
        let steady = &found[3 * 6..3 * 29];
        assert!(steady.iter().all(|c| c.slide * 60.0 < 1e-3), "{rate}: {steady:?}");
    }
}

#[test]
fn a_rotating_sphere_slides_under_cloth_at_rest_and_a_capsule_extends_along_its_axis() {
    let sphere = AnalyticColliderParams {
        form: ColliderForm::Sphere,
        position: [0.0, 0.0, -0.1],
        radius: 0.02,
        ..params()
    };
    assert_eq!(merged(&standalone(sphere.clone()))[..3].iter().filter(|c| c.is_some()).count(), 1);
    // Half a turn a second about x under a vertex 0.11 m from the axis.
    let turn = |k: i32| {
        let angle = 0.5 * std::f32::consts::PI * k as f32 / 60.0;
        spatial::Pose { position: [0.0, 0.0, -0.1], rotation: [angle.cos(), angle.sin(), 0.0, 0.0] }
    };
    let turning = standalone(sphere).optional(Port::pose, Rate::hz(60), (), (0..30).map(turn).collect());
    let speed = 60.0 * merged(&turning)[0].slide;
    let expected = 0.3_f32.hypot(std::f32::consts::PI * 0.11);
    assert!((speed - expected).abs() < 0.01 * expected, "{speed} {expected}");
    let capsule = AnalyticColliderParams {
        form: ColliderForm::Capsule,
        size: 0.05,
        length: 0.4,
        position: [0.25, 0.0, 0.0],
        axis: [-1.0, 0.0, 0.0],
        ..params()
    };
    let near = merged(&standalone(capsule))[0];
    let gap = 0.05_f32.hypot(0.01) - 0.05;
    assert!((near.distance - gap).abs() < 1e-6, "the round end is nearest: {near:?}");
}

#[test]
fn windows_of_any_length_give_the_same_contacts() {
    let turn = |k: i32| spatial::Pose::at([0.01 * k as f32, 0.0, 0.001 * (k % 5) as f32]);
    let run = |window| {
        let moving = standalone(params()).optional(Port::pose, Rate::hz(37), (), (0..18).map(turn).collect());
        merged(&moving.window(window))
    };
    let reference = run(TICKS_PER_SECOND);
    for window in [ticks(0.001), ticks(0.0123), Rate::hz(60).tick(7)] {
        assert_eq!(run(window), reference);
    }
}

#[test]
fn an_axis_without_direction_and_another_mesh_are_rejected() {
    let reject = standalone(AnalyticColliderParams { axis: [0.0; 3], ..params() }).shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F067", Some("axis")));
    let other = Standalone::new::<AnalyticCollider>(params())
        .input(
            Port::contacts,
            Rate::hz(60),
            ContactsFormat::plain(vec![1e-4; 2].into(), 1),
            vec![Contact::default(); 4],
        )
        .input(
            Port::mesh,
            Rate::hz(60),
            MeshFormat::moving(Topology { rest: vec![[0.0; 3]], triangles: vec![] }),
            vec![[0.0; 3]; 2],
        );
    assert_eq!(other.shape().unwrap_err().code, "F067");
}
