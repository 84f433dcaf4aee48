use super::cull::{Culling, cull};
use super::modal_model::ModalModel;
use super::model_modes::voices;
use super::radiance::{Listener, Radiance, radiation_damping};
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::material::DampingModel;
use crate::modal::surface::contact::{ContactError, contacts};
use crate::solid::fem::eigen::Request;
use crate::solid::fem::elements::{Isotropic, Order};
use crate::solid::mesh::shapes::{ball, block, round_ball};
use crate::solid::mesh::tet_mesh::TetMesh;
use std::f64::consts::{PI, TAU};

const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };
const DAMPING: DampingModel = DampingModel::Rayleigh { a1: 3.0, a2: 1e-8 };

fn model(mesh: &TetMesh, material: &Isotropic, highest: f64) -> ModalModel {
    let request = Request { highest, ..Request::default() };
    ModalModel::analyse(mesh, material, Order::Quadratic, &request, &|_| false).unwrap()
}

fn bar() -> ModalModel {
    model(&block([0.2, 0.03, 0.02], [12, 1, 1]), &STEEL, 6000.0)
}

#[test]
fn figures_of_a_bar_are_those_of_its_shape() {
    let bar = bar();
    bar.validate().unwrap();
    let mass = 7850.0 * 0.2 * 0.03 * 0.02;
    assert!((bar.mass / mass - 1.0).abs() < 1e-12);
    assert!((bar.area - 2.0 * (0.2 * 0.03 + 0.2 * 0.02 + 0.03 * 0.02)).abs() < 1e-12);
    let centre = [0.1, 0.015, 0.01];
    (0..3).for_each(|k| assert!((bar.centre[k] - centre[k]).abs() < 1e-12));
    let expected = mass / 12.0 * (0.2 * 0.2 + 0.03 * 0.03);
    assert!((bar.inertia[2] / expected - 1.0).abs() < 1e-12);
    assert!(bar.inertia[3..].iter().all(|x| x.abs() < 1e-12 * mass));
}

#[test]
fn figures_of_a_ball_are_those_within_its_curved_edges() {
    let errors = [ball(0.05, 4), round_ball(0.05, 4)].map(|mesh| {
        let ball = model(&mesh, &STEEL, 29_000.0);
        let mass = 7850.0 * 4.0 / 3.0 * PI * 0.05_f64.powi(3);
        let inertia = 0.4 * mass * 0.05 * 0.05;
        assert!(ball.centre.iter().all(|x| x.abs() < 1e-12));
        [ball.mass / mass - 1.0, ball.inertia[0] / inertia - 1.0]
    });
    assert!(errors[0].iter().all(|e| *e < -0.05), "{errors:?}");
    assert!(errors[1].iter().all(|e| e.abs() < 0.005), "{errors:?}");
}

#[test]
fn a_bar_is_excited_at_its_ends_and_silent_at_its_nodes() {
    let bar = bar();
    // Free-free bending: the first mode has nodes at 0.224 of the length, and 2 / sqrt(mass) at the ends of a slender bar.
    let f = bar.frequencies();
    let z_bending = f.iter().position(|f| (f / 2530.0 - 1.0).abs() < 0.03).unwrap();
    let points = [0.0005, 0.2242 * 0.2, 0.1, 0.1995].map(|x| [x, 0.015, 0.02]);
    let at: Vec<f64> = contacts(bar.surface(), &points, &[], &[], 0.01)
        .unwrap()
        .iter()
        .map(|c| c.impulses(bar.surface())[z_bending])
        .collect();
    assert!((at[0].abs() * bar.mass.sqrt() - 2.0).abs() < 0.1, "{at:?}");
    assert!(at[1].abs() < 0.03 * at[0].abs(), "{at:?}");
    assert!(at[2] * at[0] < 0.0 && (at[2] / at[0] + 0.608).abs() < 0.03, "{at:?}");
    assert!((at[3] / at[0] - 1.0).abs() < 1e-3);
    let along = contacts(bar.surface(), &points[..1], &[], &[[1.0, 0.0, 0.0]], 0.01).unwrap();
    assert!(along[0].impulses(bar.surface())[z_bending].abs() < 0.3 * at[0].abs());
}

#[test]
fn contact_points_that_do_not_fit_are_errors() {
    let bar = bar();
    let far = contacts(bar.surface(), &[[0.1, 0.015, 0.1]], &[], &[], 0.05).unwrap_err();
    let ContactError::Far { distance, nearest, .. } = far else { panic!("{far}") };
    assert!((distance - 0.08).abs() < 1e-9 && (nearest[2] - 0.02).abs() < 1e-9);
    assert_eq!(contacts(bar.surface(), &[], &[], &[], 0.05).unwrap_err(), ContactError::None);
    let count = bar.vertices.len();
    let missing = contacts(bar.surface(), &[], &[count as u32], &[], 0.05).unwrap_err();
    assert_eq!(missing, ContactError::Vertex { found: count as u32, count });
    let zero = contacts(bar.surface(), &[], &[0], &[[0.0; 3]], 0.05).unwrap_err();
    assert_eq!(zero, ContactError::Direction { index: 0 });
    let two = contacts(bar.surface(), &[], &[0], &[[1.0, 0.0, 0.0]; 2], 0.05).unwrap_err();
    assert_eq!(two, ContactError::Directions { found: 2, points: 1 });
}

#[test]
fn only_the_breathing_mode_of_a_ball_displaces_volume() {
    // Poisson's ratio sets the frequency of the breathing mode apart from those of others.
    let material = Isotropic { poisson: 0.25, ..STEEL };
    let ball = model(&ball(0.05, 6), &material, 48e3);
    let unit = (material.lame()[1] / material.density).sqrt() / (0.05 * TAU);
    let f = ball.frequencies();
    let share = |mode: usize| ball.net_flow[mode].abs() / ball.absolute_flow[mode];
    let found: Vec<usize> = (0..ball.len()).filter(|mode| share(*mode) > 0.05).collect();
    let &[breathing] = found.as_slice() else { panic!("{found:?}") };
    assert!(share(breathing) > 0.99 && (f[breathing] / (4.44000 * unit) - 1.0).abs() < 0.02);
    // It moves the whole surface alike: p = rho0 c0 S v / (4 pi r) times ka / sqrt(1 + (ka)^2) / a.
    let sphere = Radiance::Sphere.per_velocity(&ball, breathing, &Listener::new(&ball, None, 1.0));
    let point =
        Radiance::VolumeVelocity.per_velocity(&ball, breathing, &Listener::new(&ball, None, 1.0)).abs();
    let ka = ball.lambda[breathing].sqrt() / 343.0 * (ball.area / (4.0 * PI)).sqrt();
    assert!((sphere / point * (1.0 + ka * ka).sqrt() - 1.0).abs() < 0.02, "{sphere} {point} {ka}");
}

#[test]
fn gains_are_the_response_to_an_impulse() {
    let bar = bar();
    let impulses = vec![
        contacts(bar.surface(), &[[0.0, 0.015, 0.02]], &[], &[], 0.01).unwrap()[0].impulses(bar.surface()),
    ];
    let listener = Listener::new(&bar, None, 1.0);
    let pressures = |radiance: Radiance| radiance.pressures(&bar, &listener);
    let all = voices(&bar, &DAMPING, &impulses, &pressures(Radiance::Unit), false);
    for (mode, voice) in all.iter().enumerate() {
        assert!((voice.c - DAMPING.c(bar.lambda[mode])).abs() < 1e-12);
        let omega_d = TAU * voice.frequency();
        let expected = impulses[0][mode] * bar.lambda[mode].sqrt() / omega_d;
        assert!((voice.gains[0] / expected - 1.0).abs() < 1e-9);
        assert!(voice.reach >= 0.9 * voice.gains[0].abs());
    }
    let radiating = voices(&bar, &DAMPING, &impulses, &pressures(Radiance::Sphere), true);
    for (mode, (a, b)) in radiating.iter().zip(&all).enumerate() {
        let expected = radiation_damping(&bar, mode);
        assert!(expected > 0.0 && (a.c - b.c - expected).abs() < 1e-12);
    }
    let culling =
        Culling { lowest: 20.0, highest: 20e3, floor: -80.0, jnd_scale: 0.0, keep_beats: true, top: None };
    assert_eq!(cull(all.clone(), &culling).0, all);
}

#[test]
fn files_are_read_back_bit_by_bit_and_damage_is_found() {
    let bar = bar();
    let bytes = bar.to_bytes().unwrap();
    assert_eq!(ModalModel::from_bytes(&bytes).as_ref(), Ok(&bar));
    let mut damaged = bytes.clone();
    damaged[200] ^= 1;
    assert!(ModalModel::from_bytes(&damaged).unwrap_err().contains("another hash"));
    assert!(ModalModel::from_bytes(&bytes[..40]).unwrap_err().contains("too short"));
    assert!(ModalModel::from_bytes(b"RIFF").unwrap_err().contains("not a modal model"));
    for seed in 0..8 {
        ModalModel::trial(&mut Rng::new(seed)).validate().unwrap();
    }
}

#[test]
fn point_sources_over_a_pulsating_ball_interfere_as_their_integral() {
    // Slow waves, so that the ball is about as large as the wavelength in air.
    let soft = Isotropic { young: 2e7, poisson: 0.25, density: 1000.0 };
    let ball = model(&ball(0.05, 6), &soft, 2.2e3);
    let share = |mode: usize| ball.net_flow[mode].abs() / ball.absolute_flow[mode];
    let found: Vec<usize> = (0..ball.len()).filter(|mode| share(*mode) > 0.99).collect();
    let &[breathing] = found.as_slice() else { panic!("{found:?}") };
    let ka = ball.lambda[breathing].sqrt() / 343.0 * (ball.area / (4.0 * PI)).sqrt();
    assert!((0.5..2.5).contains(&ka), "{ka}");
    for position in [[0.0, 0.0, 1.0], [0.3, 0.4, 0.0], [0.0, -2.0, 0.0]] {
        let listener = Listener::new(&ball, Some(position), 1.0);
        let sum = Radiance::FaceSum.per_velocity(&ball, breathing, &listener);
        let point = Radiance::VolumeVelocity.per_velocity(&ball, breathing, &listener).abs();
        // The integral of exp(-i k r) / r over a sphere is 4 pi a^2 sin(k a) / (k a) exp(-i k R) / R.
        assert!((sum / point / (ka.sin() / ka) - 1.0).abs() < 0.03, "{sum} {point} {ka}");
    }
    // Along z from the centre of mass by default.
    let along = Listener::new(&ball, None, 1.0);
    assert!((along.position[2] - ball.centre[2] - 1.0).abs() < 1e-12 && along.distance == 1.0);
}
