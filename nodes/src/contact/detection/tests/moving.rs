use std::f32::consts::PI;

use super::grid;
use crate::contact::detection::reference::{Surfaces, contacts_of, excluded, key};
use crate::contact::vector::widen;
use crate::contact::{Contact, Detector, DetectorParams};
use crate::core::pool::with_threads;
use crate::mesh::Topology;

const SIDE: usize = 19;
const EDGE: f32 = 0.1;

/// The sheet rolled up further with each frame, and in some frames displaced or crumpled.
fn pose(sheet: &Topology, frame: usize) -> Vec<[f32; 3]> {
    let (time, jump) = (frame as f32, if frame % 7 == 5 { 12.5 } else { 0.0 });
    let radius = 0.3 - 0.006 * time;
    let rolled = |(v, &[x, y, _]): (usize, &[f32; 3])| {
        let turn = x / radius + 0.05 * time;
        // Loosely rolled: layers are 0.08 apart.
        let r = radius - 0.08 * turn / (2.0 * PI);
        let wobble = if frame % 9 == 4 { 0.4 * (v as f32 * 78.233 + time).sin() } else { 0.0 };
        [r * turn.cos() + jump + wobble, y + 0.02 * time, r * turn.sin() - wobble]
    };
    sheet.rest.iter().enumerate().map(rolled).collect()
}

fn floor_at(floor: &Topology, frame: usize) -> Vec<[f32; 3]> {
    let up = if frame % 11 == 10 { 3.0 } else { 0.006 * frame as f32 };
    floor.rest.iter().map(|&[x, y, _]| [x - 1.0, y, up - 0.27]).collect()
}

#[test]
fn every_frame_of_a_moving_scene_equals_brute_force_for_any_previous_frames() {
    moving_scene();
    with_threads(moving_scene);
}

fn moving_scene() {
    let (sheet, floor) = (grid(SIDE, EDGE, 0.0), grid(9, 0.25, 0.0));
    let params = DetectorParams { radius: 0.06, max_contacts: 2, ..DetectorParams::default() };
    let vertices = sheet.vertex_count();
    let own: Vec<_> = (0..vertices).map(|v| excluded(&sheet, v, params.radius, params.exclude)).collect();
    let fresh = Detector::new(&sheet, &[&floor], params).unwrap();
    let mut continued = fresh.clone();
    let mut out = vec![Contact::default(); vertices * params.max_contacts];
    let mut fresh_out = out.clone();
    let (mut with_cloth, mut with_floor, mut sorted) = (0, 0, 0);
    for frame in 0..24 {
        let (now, under) = (pose(&sheet, frame), floor_at(&floor, frame));
        sorted += continued.detect(&now, &[&under], &mut out).unwrap().rebuilt;
        fresh.clone().detect(&now, &[&under], &mut fresh_out).unwrap();
        assert_eq!(out, fresh_out, "frame {frame}, with and without previous frames");
        let wide = |ps: &[[f32; 3]]| ps.iter().map(|&p| widen(p)).collect::<Vec<_>>();
        let positions: Surfaces = vec![wide(&now), wide(&under)];
        for (v, found) in out.chunks(params.max_contacts).enumerate() {
            let mut expected = contacts_of(v, &[&sheet, &floor], &positions, &own[v], &params);
            expected.truncate(params.max_contacts);
            let expected: Vec<_> = expected.iter().map(|e| (e.0.sqrt() as f32, e.1, e.2)).collect();
            let found: Vec<_> = found.iter().filter_map(|c| key(c).map(|k| (c.distance, k.0, k.1))).collect();
            assert_eq!(found, expected, "frame {frame}, vertex {v}");
            with_cloth += found.iter().filter(|c| c.1 == 0).count();
            with_floor += found.iter().filter(|c| c.1 == 1).count();
        }
    }
    assert!(with_cloth > 500 && with_floor > 200 && sorted > 2, "{with_cloth} {with_floor} {sorted}");
}
