use super::grid;
use crate::contact::detection::reference::{Surfaces, excluded, key, sliding_speeds};
use crate::contact::vector::{add, cross, dot, norm, scale, widen};
use crate::contact::{Contact, ContactError, Detector, DetectorParams, Exclude};
use crate::mesh::Topology;
use proptest::prelude::*;

/// Lengths in these scenes are sums of few powers of two, so that they are exact in single precision.
const EDGE: f32 = 0.0625;

fn params(radius: f32) -> DetectorParams {
    DetectorParams { radius, ..DetectorParams::default() }
}

fn moved(positions: &[[f32; 3]], by: [f32; 3]) -> Vec<[f32; 3]> {
    positions.iter().map(|p| [p[0] + by[0], p[1] + by[1], p[2] + by[2]]).collect()
}

fn slots(cloth: &Topology, params: &DetectorParams) -> Vec<Contact> {
    vec![Contact::default(); cloth.vertex_count() * params.max_contacts]
}

#[test]
fn two_parallel_planes_slide_at_their_relative_speed_for_any_approach() {
    let sheet = grid(9, EDGE, 0.03125);
    let floor = grid(21, 0.125, 0.0);
    let params = params(0.05);
    let mut detector = Detector::new(&sheet, &[&floor], params).unwrap();
    let mut out = slots(&sheet, &params);
    let (step, floor_step) = ([3.0 / 512.0, 4.0 / 512.0, 0.0], [0.0, -8.0 / 512.0, 0.0]);
    let relative = (3.0f32 / 512.0).hypot(12.0 / 512.0);
    for fall in [0.0, 1.0 / 1024.0] {
        let mut now = moved(&sheet.rest, [0.5, 0.5, 0.0]);
        let mut under = floor.rest.clone();
        let (mut touched, mut changes) = (Vec::new(), 0);
        for _ in 0..8 {
            let next = moved(&now, [step[0], step[1], -fall]);
            let under_next = moved(&under, floor_step);
            let found = detector.detect_and_slide(&now, &next, &[&under], &[&under_next], &mut out).unwrap();
            assert_eq!((found.contacts, found.degenerate), (81, 0));
            for contact in &out {
                assert_eq!(contact.surface, 1);
                assert!(
                    (contact.slide - relative).abs() <= 1e-6 * relative,
                    "{} for {relative}",
                    contact.slide
                );
                assert!((contact.approach + fall).abs() < 1e-9);
            }
            let triangles: Vec<u32> = out.iter().map(|contact| contact.triangle).collect();
            changes += triangles.iter().zip(&touched).filter(|(a, b)| a != b).count();
            touched = triangles;
            (now, under) = (next, under_next);
        }
        // A change of triangle is no slide: positions are measured on the triangle of the first frame.
        assert!(changes > 81, "{changes}");
    }
}

const DT: f64 = 1.0 / 60.0;
const SPEED: f64 = 0.37;

/// A sheet that slides at [`SPEED`] over a floor while both rotate at 5 rad/s and move away.
fn moving_planes() -> (Topology, Topology, Vec<Surfaces>) {
    let (sheet, floor) = (grid(5, EDGE, 0.03), grid(9, EDGE, 0.0));
    let frames = (0..6)
        .map(|i| {
            let t = f64::from(i) * DT;
            let (s, c) = (1.0 + 5.0 * t).sin_cos();
            let transformed = |x: [f64; 3]| {
                let x = [x[0], c * x[1] - s * x[2], s * x[1] + c * x[2]];
                [0.6 * x[0] + 0.8 * x[1] + 2.0 * t, 0.6 * x[1] - 0.8 * x[0], x[2] - 9.0 * t]
            };
            let slid = |x: [f64; 3]| {
                transformed([x[0] + 0.11 + 0.6 * SPEED * t, x[1] + 0.07 + 0.8 * SPEED * t, x[2]])
            };
            vec![
                sheet.rest.iter().map(|&p| slid(widen(p))).collect(),
                floor.rest.iter().map(|&p| transformed(widen(p))).collect(),
            ]
        })
        .collect();
    (sheet, floor, frames)
}

fn narrow(points: &[[f64; 3]]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.map(|x| x as f32)).collect()
}

#[test]
fn a_common_rotation_and_translation_do_not_change_the_relative_speed_of_two_planes() {
    let (dt, speed, params) = (DT, SPEED, params(0.05));
    let (sheet, floor, frames) = moving_planes();
    let times: Vec<f64> = (0..6).map(|i| f64::from(i) * dt).collect();
    let speeds = sliding_speeds(&[&sheet, &floor], &frames, &times, &params).unwrap();
    assert_eq!(speeds.len(), 5);
    for (i, frame) in speeds.iter().enumerate() {
        assert!((frame.time - (i as f64 + 0.5) * dt).abs() < 1e-15);
        for (v, &s) in frame.tangential.iter().enumerate() {
            assert!((s - speed).abs() < 1e-9 * speed, "frame {i}, vertex {v}: {s}");
            assert!(frame.normal[v].abs() < 1e-9);
        }
    }
    let slow: Vec<f64> = times.iter().map(|t| 2.0 * t).collect();
    let halved = sliding_speeds(&[&sheet, &floor], &frames, &slow, &params).unwrap();
    for (fast, slow) in speeds.iter().zip(&halved) {
        assert_eq!(fast.contact, slow.contact);
        for (f, s) in fast.tangential.iter().zip(&slow.tangential) {
            assert!((f - 2.0 * s).abs() < 1e-12);
        }
    }
}

#[test]
fn in_single_precision_a_common_motion_has_only_the_error_of_rounded_positions() {
    let params = params(0.05);
    let (sheet, floor, frames) = moving_planes();
    let mut detector = Detector::new(&sheet, &[&floor], params).unwrap();
    let mut out = slots(&sheet, &params);
    // Coordinates below 1 m have an error of 2^-25 m each, a point of sqrt(3) times that. The vertex and the triangle's corners, in
    // two frames, are four points; a tilt of the triangle counts half as much, since the gap is half an edge.
    let point_error = 3.0_f64.sqrt() * 0.5 * 2.0_f64.powi(-24);
    let bound = (4.0 + 2.0 * 0.5) * point_error;
    for pair in frames.windows(2) {
        let [now, under, next, under_next] =
            [&pair[0][0], &pair[0][1], &pair[1][0], &pair[1][1]].map(|points| narrow(points));
        let largest = pair.iter().flatten().flatten().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(largest < 1.0, "{largest}");
        let found = detector.detect_and_slide(&now, &next, &[&under], &[&under_next], &mut out).unwrap();
        assert_eq!(found.contacts, 25);
        for contact in &out {
            let error = f64::from(contact.slide) - SPEED * DT;
            assert!(error.abs() < bound, "{error} of {}, allowed {bound}", contact.slide);
            assert!(f64::from(contact.approach).abs() < bound);
        }
    }
}

#[test]
fn quarter_turns_and_translations_of_both_planes_change_the_speed_by_less_than_a_millionth() {
    // Rotations and translations exact in single precision, different in each frame: the rest is the error of the detector.
    let turns: [fn([f32; 3]) -> [f32; 3]; 4] =
        [|p| p, |[x, y, z]| [-y, x, z], |[x, y, z]| [z, x, y], |[x, y, z]| [x, -z, y]];
    let (sheet, floor, params) = (grid(9, EDGE, 0.03125), grid(21, 0.125, 0.0), params(0.05));
    let mut detector = Detector::new(&sheet, &[&floor], params).unwrap();
    let mut out = slots(&sheet, &params);
    let step = (3.0f32 / 512.0).hypot(12.0 / 512.0);
    let at = |frame: usize, points: &[[f32; 3]], slid: f32| -> Vec<[f32; 3]> {
        let k = frame as f32;
        let offset = [0.25 * k, -0.125 * k, 0.5 * k];
        let slide = |[x, y, z]: [f32; 3]| [x + slid * 3.0 / 512.0, y + slid * 12.0 / 512.0, z];
        moved(&points.iter().map(|&p| turns[frame % 4](slide(p))).collect::<Vec<_>>(), offset)
    };
    let inner = moved(&sheet.rest, [0.5, 0.5, 0.0]);
    for frame in 0..8 {
        let k = frame as f32;
        let (now, next) = (at(frame, &inner, k), at(frame + 1, &inner, k + 1.0));
        let (under, under_next) = (at(frame, &floor.rest, 0.0), at(frame + 1, &floor.rest, 0.0));
        let found = detector.detect_and_slide(&now, &next, &[&under], &[&under_next], &mut out).unwrap();
        assert_eq!(found.contacts, 81);
        for contact in &out {
            assert!((contact.slide - step).abs() <= 1e-6 * step, "{frame}: {} for {step}", contact.slide);
            assert!(contact.approach.abs() < 1e-9);
        }
    }
}

/// A rotation about an axis, then a translation.
fn rigid(p: [f32; 3], axis: [f64; 3], angle: f64, shift: [f64; 3]) -> [f64; 3] {
    let (s, c) = angle.sin_cos();
    let x = widen(p);
    let turned = add(add(scale(x, c), scale(cross(axis, x), s)), scale(axis, dot(axis, x) * (1.0 - c)));
    add(turned, shift)
}

fn rough_scene() -> (Topology, Topology) {
    let mut sheet = grid(12, EDGE, 0.0);
    for (v, p) in sheet.rest.iter_mut().enumerate() {
        p[2] = 0.02 + 0.11 * (0.5 + 0.5 * (v as f32 * 12.9898).sin());
        p[0] += 0.01 * (v as f32 * 78.233).sin();
    }
    (sheet, grid(9, 0.1, 0.0))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn rigid_motion_of_the_scene_does_not_change_contacts_and_slides(
        axis in prop::array::uniform3(-1.0..1.0_f64), angle in -3.0..3.0_f64, shift in prop::array::uniform3(-1.0..1.0_f64),
        step in prop::array::uniform3(-0.02..0.02_f32),
    ) {
        prop_assume!(norm(axis) > 0.1);
        let axis = scale(axis, 1.0 / norm(axis));
        let (sheet, floor) = rough_scene();
        let params = DetectorParams { self_contact: false, ..params(0.09375) };
        let next = moved(&sheet.rest, step);
        let transform = |points: &[[f32; 3]]| points.iter().map(|&p| rigid(p, axis, angle, shift)).collect::<Vec<_>>();
        // In double precision by brute force: relative error below 1e-9.
        let wide = |points: &[[f32; 3]]| points.iter().map(|&p| widen(p)).collect::<Vec<_>>();
        let fixed = [vec![wide(&sheet.rest), wide(&floor.rest)], vec![wide(&next), wide(&floor.rest)]];
        let turned = [vec![transform(&sheet.rest), transform(&floor.rest)], vec![transform(&next), transform(&floor.rest)]];
        let run = |frames: &[Surfaces]| sliding_speeds(&[&sheet, &floor], frames, &[0.0, 1.0], &params).unwrap().remove(0);
        let (a, b) = (run(&fixed), run(&turned));
        prop_assert!(a.contact.iter().flatten().count() > 50);
        for v in 0..sheet.vertex_count() {
            prop_assert_eq!(a.contact[v].is_some(), b.contact[v].is_some());
            prop_assert!((a.tangential[v] - b.tangential[v]).abs() < 1e-9 * a.tangential[v] + 1e-13);
            prop_assert!((a.normal[v] - b.normal[v]).abs() < 1e-9 * a.normal[v].abs() + 1e-13);
        }
        // In single precision: error of the rounding of positions below 4 m; near the radius both results are right.
        let mut detector = Detector::new(&sheet, &[&floor], params).unwrap();
        let (mut plain, mut found) = (slots(&sheet, &params), slots(&sheet, &params));
        detector.detect_and_slide(&sheet.rest, &next, &[&floor.rest], &[&floor.rest], &mut plain).unwrap();
        let [cloth, cloth_next, under] = [transform(&sheet.rest), transform(&next), transform(&floor.rest)].map(|p| narrow(&p));
        detector.detect_and_slide(&cloth, &cloth_next, &[&under], &[&under], &mut found).unwrap();
        // The gap is nearly as long as an edge, so that a tilt of the triangle counts fully.
        let bound = (4.0 + 2.0) * 3.0_f32.sqrt() * 0.5 * 2.0_f32.powi(-22);
        for (a, b) in plain.iter().zip(&found) {
            let at_the_radius = a.distance.max(b.distance) > params.radius - bound;
            prop_assert!(a.is_some() == b.is_some() || at_the_radius, "{:?} {:?}", a, b);
            if a.is_some() && b.is_some() {
                prop_assert!((a.distance - b.distance).abs() < bound, "{:?} {:?}", a, b);
                prop_assert!((a.slide - b.slide).abs() < bound, "{:?} {:?}", a, b);
                prop_assert!((a.approach - b.approach).abs() < bound, "{:?} {:?}", a, b);
            }
        }
    }
}

#[test]
fn a_flat_sheet_with_short_edges_touches_itself_only_if_nothing_but_incident_triangles_are_excluded() {
    let radius = 5.0 * EDGE;
    let sheet = grid(25, EDGE, 0.0);
    for (exclude, expected) in [(Exclude::Auto, 0), (Exclude::IncidentOnly, 625)] {
        let params = DetectorParams { exclude, ..params(radius) };
        let mut detector = Detector::new(&sheet, &[], params).unwrap();
        let mut out = slots(&sheet, &params);
        assert_eq!(detector.detect(&sheet.rest, &[], &mut out).unwrap().contacts, expected, "{exclude:?}");
    }
}

#[test]
fn a_folded_sheet_touches_its_other_layer_and_nothing_else() {
    let n = 33;
    let sheet = grid(n, EDGE, 0.0);
    let gap = 0.5 * EDGE;
    // The right half is folded over the left, `gap` above it, around a square fold.
    let folded: Vec<[f32; 3]> = sheet
        .rest
        .iter()
        .map(|&[x, y, _]| if x <= 16.0 * EDGE { [x, y, 0.0] } else { [33.0 * EDGE - x, y, gap] })
        .collect();
    let params = params(0.75 * EDGE);
    let mut detector = Detector::new(&sheet, &[], params).unwrap();
    let mut out = slots(&sheet, &params);
    detector.detect(&folded, &[], &mut out).unwrap();
    let layer = |v: u32| (v as usize % n) > 16;
    let mut touching = 0;
    for (v, contact) in out.iter().enumerate() {
        let column = v % n;
        if (2..=12).contains(&column) || (21..=31).contains(&column) {
            assert!(contact.is_some(), "vertex {v} in column {column}");
            assert!((contact.distance - gap).abs() < 1e-7);
        }
        if contact.is_some() {
            let corners = sheet.triangles[contact.triangle as usize];
            assert!(corners.iter().any(|&c| layer(c) != layer(v as u32)), "vertex {v} touches its own layer");
            touching += 1;
        }
    }
    assert!(touching > 700, "{touching}");
}

#[test]
fn exclusion_equals_plain_relaxation_over_all_edges() {
    let mut sheet = grid(9, EDGE, 0.0);
    for (v, p) in sheet.rest.iter_mut().enumerate() {
        p[0] += 0.02 * (v as f32 * 1.7).sin();
        p[2] += 0.03 * (v as f32 * 0.9).cos();
    }
    sheet.rest.push([9.0; 3]);
    for exclude in [Exclude::Auto, Exclude::Distance(0.17), Exclude::Distance(0.0), Exclude::IncidentOnly] {
        let detector = Detector::new(&sheet, &[], DetectorParams { exclude, ..params(0.05) }).unwrap();
        for v in 0..sheet.vertex_count() {
            let expected = excluded(&sheet, v, 0.05, exclude);
            for (t, &expected) in expected.iter().enumerate() {
                assert_eq!(detector.exclusion().is_excluded(v, t), expected, "{exclude:?}, {v}, {t}");
            }
            assert_eq!(detector.exclusion().count(v), expected.iter().filter(|&&e| e).count());
        }
    }
}

#[test]
fn quarter_turns_shifts_and_scales_by_two_do_not_change_contacts() {
    let mut sheet = grid(12, EDGE, 0.0);
    for (v, p) in sheet.rest.iter_mut().enumerate() {
        p[2] = ((v * 7919 % 64) as f32) / 512.0;
    }
    let floor = grid(9, 0.125, 0.0);
    let next = moved(&sheet.rest, [1.0 / 256.0, 2.0 / 256.0, -1.0 / 512.0]);
    let run = |k: f32, turn: fn([f32; 3]) -> [f32; 3]| {
        let all = |ps: &[[f32; 3]]| ps.iter().map(|p| turn(p.map(|x| k * x))).collect::<Vec<_>>();
        let params = params(0.09375 * k);
        let scaled = |t: &Topology| Topology { rest: all(&t.rest), triangles: t.triangles.clone() };
        let (cloth, under) = (scaled(&sheet), scaled(&floor));
        let mut detector = Detector::new(&cloth, &[&under], params).unwrap();
        let mut out = slots(&cloth, &params);
        detector
            .detect_and_slide(&cloth.rest, &all(&next), &[&under.rest], &[&under.rest], &mut out)
            .unwrap();
        out
    };
    let plain = run(1.0, |p| p);
    assert!(plain.iter().filter(|c| c.is_some()).count() > 50);
    for (k, turn) in [
        (1.0, (|[x, y, z]| [-y, x, z]) as fn([f32; 3]) -> [f32; 3]),
        (1.0, |[x, y, z]| [z + 1.0, x - 0.5, y + 0.25]),
        (2.0, |p| p),
        (0.25, |[x, y, z]| [x, -z, y]),
    ] {
        for (a, b) in plain.iter().zip(run(k, turn)) {
            assert_eq!(key(a), key(&b));
            assert!((a.slide * k - b.slide).abs() <= 1e-5 * b.slide.abs() + 1e-8, "{a:?} {b:?}");
            assert!((a.distance * k - b.distance).abs() <= 1e-6 * k);
        }
    }
}

#[test]
fn of_equally_near_triangles_the_lower_surface_then_the_lower_triangle_is_touched() {
    let cloth = Topology { rest: vec![[0.125, 0.0625, 0.03125]], triangles: Vec::new() };
    let floor = grid(3, 0.125, 0.0);
    let params = DetectorParams { max_contacts: 4, ..params(0.05) };
    let mut detector = Detector::new(&cloth, &[&floor, &floor], params).unwrap();
    let mut out = slots(&cloth, &params);
    detector.detect(&cloth.rest, &[&floor.rest, &floor.rest], &mut out).unwrap();
    // The vertex is over the edge between triangles 0 and 3.
    let keys: Vec<_> = out.iter().filter_map(key).collect();
    assert_eq!(keys, [(1, 0), (1, 3), (2, 0), (2, 3)]);
}

#[test]
fn one_sided_surfaces_are_not_touched_from_behind() {
    let floor = grid(3, 0.125, 0.0);
    let cloth = Topology { rest: vec![[0.1, 0.1, 0.02], [0.1, 0.1, -0.02]], triangles: Vec::new() };
    for (two_sided, expected) in [(true, [true, true]), (false, [true, false])] {
        let params = DetectorParams { two_sided, ..params(0.05) };
        let mut detector = Detector::new(&cloth, &[&floor], params).unwrap();
        let mut out = slots(&cloth, &params);
        detector.detect(&cloth.rest, &[&floor.rest], &mut out).unwrap();
        assert_eq!([out[0].is_some(), out[1].is_some()], expected);
    }
}

#[test]
fn a_degenerate_triangle_is_touched_and_counted_but_has_no_slide() {
    let degenerate =
        Topology { rest: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], triangles: vec![[0, 1, 2]] };
    let cloth = Topology { rest: vec![[0.5, 0.01, 0.0]], triangles: Vec::new() };
    let mut detector = Detector::new(&cloth, &[&degenerate], params(0.05)).unwrap();
    let mut out = [Contact::default()];
    let next = moved(&cloth.rest, [0.01, 0.0, 0.0]);
    let found = detector
        .detect_and_slide(&cloth.rest, &next, &[&degenerate.rest], &[&degenerate.rest], &mut out)
        .unwrap();
    assert_eq!((found.contacts, found.degenerate), (1, 1));
    assert_eq!((out[0].slide, out[0].approach, out[0].beta), (0.0, 0.0, [0.0, 0.25]));
}

#[test]
fn wrong_input_is_an_error_with_its_position() {
    let floor = grid(3, 0.125, 0.0);
    let bad = |radius| Detector::new(&floor, &[], params(radius)).map(|_| ()).unwrap_err();
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(bad(radius), ContactError::Parameter { name: "radius", .. }));
    }
    let torn = Topology { rest: floor.rest.clone(), triangles: vec![[0, 1, 2], [0, 1, 9]] };
    let error = Detector::new(&floor, &[&torn], params(0.05)).map(|_| ()).unwrap_err();
    assert_eq!(error, ContactError::Corner { surface: 1, triangle: 1, found: 9, vertices: 9 });

    let mut detector = Detector::new(&floor, &[], params(0.05)).unwrap();
    let mut out = slots(&floor, &params(0.05));
    let mut broken = floor.rest.clone();
    broken[4][1] = f32::NAN;
    let not_finite = Err(ContactError::NotFinite { surface: 0, vertex: 4 });
    assert_eq!(detector.detect(&broken, &[], &mut out), not_finite);
    assert_eq!(detector.detect_and_slide(&floor.rest, &broken, &[], &[], &mut out), not_finite);
    assert!(matches!(detector.detect(&floor.rest[1..], &[], &mut out), Err(ContactError::Positions { .. })));
    assert!(matches!(detector.detect(&floor.rest, &[&broken], &mut out), Err(ContactError::Length { .. })));
    assert!(matches!(detector.detect(&floor.rest, &[], &mut out[1..]), Err(ContactError::Length { .. })));
}

#[test]
fn an_empty_scene_is_valid_and_silent() {
    let nothing = Topology::default();
    let mut detector = Detector::new(&nothing, &[&nothing], params(0.05)).unwrap();
    assert_eq!(detector.detect(&[], &[&[]], &mut []).unwrap().contacts, 0);
    assert_eq!(sliding_speeds(&[], &[], &[], &params(0.05)), Ok(Vec::new()));
}

#[test]
fn positions_whose_squares_are_not_finite_are_rejected() {
    let sheet = grid(12, EDGE, 0.0);
    let params = params(2.0 * EDGE);
    let mut detector = Detector::new(&sheet, &[], params).unwrap();
    let mut out = slots(&sheet, &params);
    for (coordinate, is_valid) in [(1e9, true), (1e15, true), (1e16, false), (1e37, false), (f32::NAN, false)]
    {
        let mut rest = sheet.rest.clone();
        rest[17][1] = coordinate;
        let found = detector.detect(&rest, &[], &mut out);
        assert_eq!(found.is_ok(), is_valid, "{coordinate}");
    }
}
