//! Time per frame of curvature, buckling and crumple events on a sheet of about 20,000 vertices with travelling waves.
//!
//! Run with `cargo bench -p foley-nodes -- curvature`. One core. The budget for curvature and events together is 4 ms.

use crate::common::sheet;
use std::hint::black_box;
use std::time::Instant;

use foley_nodes::core::item::Event;
use foley_nodes::core::random::Rng;
use foley_nodes::crumple::matching::{EnergyMap, Mapping, Rolling};
use foley_nodes::crumple::{Buckle, BuckleDetector, Crumple, CrumpleEvents, CrumpleParams};
use foley_nodes::curvature::{Curvature, MeanCurvature, Method};
use foley_nodes::mesh::Topology;

const N: usize = 142;
const FRAMES: usize = 60;
/// Frames per minute.
const MINUTE: f64 = 3600.0;

/// Moves the sheet by waves of several directions, so that some hundred vertices snap in each frame.
fn moved(sheet: &Topology, frame: usize) -> Vec<[f32; 3]> {
    let t = frame as f32 / 60.0;
    let high = |x: f32, y: f32| {
        0.02 * (9.0 * x + 5.0 * y - 4.0 * t).sin()
            + 0.01 * (23.0 * y - 11.0 * x + 3.0 * t).sin()
            + 0.004 * (61.0 * x * y + t).sin()
    };
    sheet.rest.iter().map(|p| [p[0], p[1], high(p[0] + 0.5, p[1] + 0.5)]).collect()
}

fn median(mut times: Vec<f64>) -> (f64, f64) {
    times.sort_unstable_by(f64::total_cmp);
    (times[times.len() / 2], times[times.len() - 1])
}

pub fn bench() {
    let topology = sheet(N, 1.0);
    let vertices = topology.rest.len();
    let frames: Vec<Vec<[f32; 3]>> = (0..FRAMES).map(|k| moved(&topology, k)).collect();
    println!(
        "{vertices} vertices, {} triangles, {FRAMES} frames, one core; median and worst",
        topology.triangles.len()
    );
    for (name, method, merge_frames) in [
        ("cotan", Method::Cotan, 0),
        ("cotan, merged over 3 frames", Method::Cotan, 2),
        ("dihedral", Method::Dihedral, 0),
    ] {
        let started = Instant::now();
        let mut measure = MeanCurvature::new(&topology, method).expect("a sheet can be oriented");
        let params = CrumpleParams { merge_frames, ..CrumpleParams::default() };
        let mut events = CrumpleEvents::new(&topology, &[], params).expect("a sheet can be oriented");
        let mut detector = BuckleDetector::new(vertices, 60.0, 0.01);
        let prepared = started.elapsed().as_secs_f64() * 1e3;
        let (mut bent, mut labels) =
            (vec![Curvature::default(); vertices], vec![Buckle::default(); vertices]);
        let (mut curvature, mut rest, mut found, mut snaps) = (Vec::new(), Vec::new(), 0, 0);
        for (k, frame) in (0..).zip(&frames) {
            let start = Instant::now();
            measure.measure(black_box(frame), &mut bent).expect("positions are finite");
            curvature.push(start.elapsed().as_secs_f64() * 1e3);
            let start = Instant::now();
            detector.detect(&bent, &mut labels);
            events.add_frame(k, &labels);
            while events.next_before(k + 1 - merge_frames as i64).is_some() {
                found += 1;
            }
            rest.push(start.elapsed().as_secs_f64() * 1e3);
            snaps += labels.iter().filter(|b| b.label != 0).count();
        }
        let whole = curvature.iter().zip(&rest).map(|(a, b)| a + b).collect();
        let ((c, _), (r, _), (all, worst)) = (median(curvature), median(rest), median(whole));
        println!(
            "{name:<28} curvature {c:.2} ms + buckles and events {r:.2} ms = {all:.2} ms a frame (worst {worst:.2}, budget 4), {:.1} s for a \
             take of a minute (paper 12 to 120 s for takes of unknown size); prepared in {prepared:.0} ms; {} vertices snap and {} events \
             a frame",
            all * MINUTE / 1e3,
            snaps / FRAMES,
            found / FRAMES
        );
    }
    matching();
}

fn matching() {
    let mut rng = Rng::new(1);
    let mut energies: Vec<f64> = (0..4096).map(|_| Crumple::trial(&mut rng).energy).collect();
    energies.sort_unstable_by(f64::total_cmp);
    let map = EnergyMap::new(&energies, &energies[..500], Mapping::Ecdf);
    let mut rolling = Rolling::new(60.0);
    let start = Instant::now();
    for e in &energies {
        black_box(map.wanted(map.rank(*e)));
    }
    let ranked = start.elapsed().as_secs_f64() * 1e9 / energies.len() as f64;
    let start = Instant::now();
    for (k, e) in energies.iter().enumerate() {
        black_box(rolling.add(0.001 * k as f64, *e));
    }
    let rolled = start.elapsed().as_secs_f64() * 1e9 / energies.len() as f64;
    println!(
        "matching: {ranked:.0} ns an event against 4096 energies; {rolled:.0} ns with the rolling estimate"
    );
}
