use super::*;
use crate::core::standalone::Standalone;
use crate::core::time::{TICKS_PER_SECOND, ticks};
use crate::crumple::Buckle;
use crate::curvature::scenes::{Scene, grid};
use crate::mesh::Materials;

/// 6 by 2 vertices.
fn strip() -> Scene {
    grid(6, 2, false, |u, v| [u, v, 0.0])
}

fn buckle(vertices: &[usize], delta: f64) -> Vec<Buckle> {
    let mut labels = vec![Buckle::default(); 12];
    for &v in vertices {
        labels[v] = Buckle { label: delta.signum() as i8, delta, area: 0.5, ..Buckle::default() };
    }
    labels
}

fn standalone(p: CrumpleEventsParams, materials: Materials, frames: &[Vec<Buckle>]) -> Standalone {
    standalone_at(120, p, materials, frames)
}

fn standalone_at(
    fps: u32,
    p: CrumpleEventsParams,
    materials: Materials,
    frames: &[Vec<Buckle>],
) -> Standalone {
    let format = MeshFormat { materials: materials.into(), ..MeshFormat::moving(strip().topology()) };
    Standalone::new::<CrumpleEventsNode>(p).input(
        CrumpleEventsPorts::buckles,
        Rate::hz(fps),
        format,
        frames.concat(),
    )
}

fn params() -> CrumpleEventsParams {
    CrumpleEventsParams { weight: Weight::Area, e_min: 0.0, merge_window: 0.0, material: None }
}

#[test]
fn events_have_the_time_of_their_frame_for_any_window_and_merging_joins_frames() {
    let frames =
        [buckle(&[], 0.0), buckle(&[1], 1.0), buckle(&[2], 3.0), buckle(&[], 0.0), buckle(&[4], -2.0)];
    let run = |merge_window, window| {
        let p = CrumpleEventsParams { merge_window, ..params() };
        let run = standalone(p, Materials::default(), &frames).window(ticks(window)).run().unwrap();
        let found = run.events(CrumpleEventsPorts::events).into_iter();
        found.map(|(tick, e)| (Rate::hz(120).first_at(tick), e.energy, e.material)).collect::<Vec<_>>()
    };
    for window in [0.001, 0.02, 1.0] {
        assert_eq!(run(0.0, window), [(1, 0.25, 0), (2, 2.25, 0), (4, 1.0, 0)]);
        assert_eq!(run(0.033, window), [(2, 4.0, 0), (4, 1.0, 0)]);
    }
}

#[test]
fn events_have_the_method_and_the_dead_band_of_their_curvature() {
    use crate::curvature::{Curvature, Method};
    let mut frames = vec![vec![Buckle::default(); 12]; 3];
    let mut detector = crate::crumple::BuckleDetector::new(12, 60.0, 0.25);
    for (h, out) in [-1.0, 1.0, -1.0].into_iter().zip(&mut frames) {
        let bent = Curvature { h, valid: true, area: 1.0, method: Method::Dihedral, ..Curvature::default() };
        detector.detect(&[bent; 12], out);
        detector.set_dead_band(0.5);
    }
    for merge_window in [0.0, 0.033] {
        let p = CrumpleEventsParams { merge_window, ..params() };
        let run = standalone(p, Materials::default(), &frames).run().unwrap();
        let found = run.events(CrumpleEventsPorts::events);
        assert!(
            found.len() == 2 && found.iter().all(|(_, e)| e.method == Some(Method::Dihedral)),
            "{found:?}"
        );
        assert!(found.iter().all(|(_, e)| e.h_eps == 0.5), "{found:?}");
    }
}

#[test]
fn twice_the_frame_interval_changes_only_the_times_of_events() {
    let frames = [
        buckle(&[], 0.0),
        buckle(&[1, 2], 1.0),
        buckle(&[3], 3.0),
        buckle(&[], 0.0),
        buckle(&[4], -2.0),
        buckle(&[5], -1.0),
    ];
    let run = |fps: u32, merge_window| {
        let p = CrumpleEventsParams { merge_window, ..params() };
        let run = standalone_at(fps, p, Materials::default(), &frames).window(ticks(0.02)).run().unwrap();
        let found = run.events(CrumpleEventsPorts::events).into_iter();
        // Frames instead of times.
        found
            .map(|(tick, e)| (Rate::hz(fps).first_at(tick), Crumple { interval: 0, ..e }))
            .collect::<Vec<_>>()
    };
    for merge_window in [0.0, 0.02] {
        let fast = run(120, merge_window);
        assert_eq!(fast.len(), if merge_window == 0.0 { 4 } else { 2 });
        assert_eq!(fast, run(60, 2.0 * merge_window));
    }
}

/// One material for each half of the strip: columns 0 to 2, and 3 to 5 except for the border.
fn halves(left: &str, right: &str) -> Materials {
    let scene = strip();
    let mut materials = Materials::default();
    for t in &scene.triangles {
        let x: f64 = t.iter().map(|&v| scene.points[v as usize][0]).sum::<f64>() / 3.0;
        materials.push(if x < 0.5 { left } else { right });
    }
    materials
}

#[test]
fn buckling_across_two_materials_is_two_events_and_swapped_names_swap_them() {
    // All vertices buckle to one side, those of the right half with twice the change.
    let mut frame = buckle(&(0..12).collect::<Vec<_>>(), 1.0);
    (0..12).filter(|v| v % 6 >= 3).for_each(|v| frame[v].delta = 2.0);
    for merge_window in [0.0, 0.033] {
        let events = |materials: Materials, name: Option<&str>| {
            let material = name.map(Text::from);
            let p = CrumpleEventsParams { material, merge_window, ..params() };
            let run =
                standalone(p, materials.clone(), std::slice::from_ref(&frame)).window(TICKS_PER_SECOND).run();
            let found = run.unwrap().events(CrumpleEventsPorts::events).into_iter();
            found
                .map(|(_, e)| (e.id, materials.name(e.material).to_owned(), e.vertices, e.energy))
                .collect::<Vec<_>>()
        };
        let event = |id, name: &str, vertices, energy| (id, name.to_owned(), vertices, energy);
        let there = events(halves("cotton", "silk"), None);
        assert_eq!(there, [event(0, "cotton", 6, 9.0), event(3, "silk", 6, 36.0)]);
        assert_eq!(events(halves("cotton", "silk"), Some("cotton")), there[..1]);
        assert_eq!(events(halves("cotton", "silk"), Some("silk")), there[1..]);
        let swapped = events(halves("silk", "cotton"), None);
        assert_eq!(swapped, [event(0, "silk", 6, 9.0), event(3, "cotton", 6, 36.0)]);
        assert_eq!(events(halves("silk", "cotton"), Some("silk")), swapped[..1]);
        // One material is one event.
        assert_eq!(events(halves("silk", "silk"), Some("silk")), [event(0, "silk", 12, 81.0)]);
    }
}

#[test]
fn an_unknown_material_is_refused_with_the_known_ones() {
    let of = |materials| {
        let p = CrumpleEventsParams { material: Some("woll".into()), ..params() };
        standalone(p, materials, &[buckle(&[], 0.0)]).shape().unwrap_err()
    };
    let reject = of(halves("wool", ""));
    assert!(reject.code == "F107" && reject.message.contains("`woll`"), "{reject}");
    assert_eq!(reject.field.as_deref(), Some("material"));
    assert_eq!(reject.help.as_deref(), Some("its materials are wool, (unnamed)"));
    assert!(of(Materials::default()).help.unwrap().contains("MeshSequence"));
}
