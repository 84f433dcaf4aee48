//! Time per frame of contact detection and slip: a cloth slides over a sphere; its hem has folds in self contact.
//!
//! Run with `cargo bench -p foley-nodes -- contact`. One core. "Cold" is the first frame; the others are faster, since
//! each search starts from the contact of the frame before. The reference is brute force on a few vertices of the same frame.

use crate::common::sheet;
use std::f32::consts::{PI, TAU};
use std::hint::black_box;
use std::time::Instant;

use foley_nodes::contact::triangle::closest_point;
use foley_nodes::contact::{Contact, Detector, DetectorParams};
use foley_nodes::mesh::Topology;

const SPHERE: f32 = 0.4;
const SIDE: f32 = 1.6;
const FRAMES: usize = 60;
/// Frames per minute.
const MINUTE: f64 = 3600.0;

fn sphere(rows: usize, columns: usize) -> Topology {
    let mut mesh = Topology::default();
    for row in 0..=rows {
        let (s, c) = (PI * row as f32 / rows as f32).sin_cos();
        for column in 0..columns {
            let (y, x) = (TAU * column as f32 / columns as f32).sin_cos();
            mesh.rest.push([SPHERE * s * x, SPHERE * s * y, SPHERE * c]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |r: usize, c: usize| (r * columns + c % columns) as u32;
            let (a, b, c, d) =
                (at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1));
            mesh.triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    mesh
}

/// Drapes the sheet over the sphere, rotated over time. Below the equator it hangs in folds that touch each other.
fn draped(sheet: &Topology, time: f32, out: &mut Vec<[f32; 3]>) {
    let quarter = 0.5 * PI * SPHERE;
    out.clear();
    for p in &sheet.rest {
        let (length, angle) = (p[0].hypot(p[1]), p[1].atan2(p[0]) + 0.4 * time);
        let gap = 0.003 + 0.002 * (9.0 * angle + 3.0 * time).sin();
        if length <= quarter {
            let (s, c) = (length / SPHERE).sin_cos();
            let r = SPHERE + gap;
            out.push([r * s * angle.cos(), r * s * angle.sin(), r * c]);
        } else {
            let down = length - quarter;
            let depth = (0.35 * down).min(0.06);
            let fold = 24.0 * angle;
            let lean = angle - 1.2 * down.min(0.1) * (2.0 * fold).sin();
            let r = SPHERE + gap + depth * (0.5 + 0.5 * (fold + 2.0 * time).cos());
            out.push([r * lean.cos(), r * lean.sin(), -down]);
        }
    }
}

fn turned(mesh: &Topology, time: f32, out: &mut Vec<[f32; 3]>) {
    let (s, c) = (-0.3 * time).sin_cos();
    out.clear();
    out.extend(mesh.rest.iter().map(|p| [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]]));
}

fn measure(n: usize, body: &Topology, params: DetectorParams) {
    let cloth = sheet(n, SIDE);
    let vertices = cloth.rest.len();
    let started = Instant::now();
    let mut detector = Detector::new(&cloth, &[body], params).expect("the bench's meshes are sound");
    let prepared = started.elapsed().as_secs_f64();
    let runs: usize = detector.exclusion().bytes();
    let excluded: usize = (0..vertices).map(|v| detector.exclusion().count(v)).sum();
    let mut out = vec![Contact::default(); vertices * params.max_contacts];
    let frames: Vec<_> = (0..=FRAMES)
        .map(|i| {
            let (mut a, mut b) = (Vec::new(), Vec::new());
            draped(&cloth, i as f32 / 60.0, &mut a);
            turned(body, i as f32 / 60.0, &mut b);
            (a, b)
        })
        .collect();
    let (mut times, mut contacts, mut own, mut rebuilt) = (Vec::new(), 0, 0, 0);
    for pair in frames.windows(2) {
        let started = Instant::now();
        let found = detector
            .detect_and_slide(&pair[0].0, &pair[1].0, &[&pair[0].1], &[&pair[1].1], &mut out)
            .expect("the bench's frames are sound");
        times.push(started.elapsed().as_secs_f64() * 1e3);
        contacts += found.contacts;
        rebuilt += found.rebuilt;
        own += out.iter().filter(|c| c.surface == 0).count();
    }
    let cold = times[0];
    let warm = &mut times[1..];
    warm.sort_by(f64::total_cmp);
    let mean = warm.iter().sum::<f64>() / warm.len() as f64;

    let (some, last) = (8, &frames[FRAMES - 1]);
    let started = Instant::now();
    for v in (0..vertices).step_by(vertices / some).take(some) {
        let x = last.0[v].map(f64::from);
        let at = |p: &[[f32; 3]], t: &[u32; 3]| t.map(|c| p[c as usize].map(f64::from));
        let own = cloth.triangles.iter().map(|t| at(&last.0, t));
        let near = own.chain(body.triangles.iter().map(|t| at(&last.1, t)));
        black_box(near.map(|t| closest_point(x, t).squared_distance).fold(f64::INFINITY, f64::min));
    }
    let brute = started.elapsed().as_secs_f64() * 1e3 * vertices as f64 / some as f64;

    println!(
        "{vertices} cloth vertices, {} + {} triangles, r = {} mm: {mean:.2} ms per frame (median {:.2}, worst {:.2}, cold {cold:.2}; budget \
         10 on eight cores), {:.0} s for a take of a minute (paper 37 to 766 s for takes of unknown size), brute force {brute:.0} ms a frame",
        cloth.triangles.len(),
        body.triangles.len(),
        params.radius * 1e3,
        warm[warm.len() / 2],
        warm[warm.len() - 1],
        mean * MINUTE / 1e3,
    );
    println!(
        "    {} contacts per frame, {} of them self contacts; {rebuilt} trees rebuilt; prepared in {prepared:.2} s; \
         exclusion {:.1} MB for {:.1} M pairs",
        contacts / FRAMES,
        own / FRAMES,
        runs as f64 / 1e6,
        excluded as f64 / 1e6,
    );
}

pub fn bench() {
    let body = sphere(122, 246);
    for (n, radius) in [(100, 0.01), (142, 0.01), (142, 0.02), (142, 0.05)] {
        measure(n, &body, DetectorParams { radius, ..DetectorParams::default() });
    }
    println!("without self contact:");
    measure(142, &body, DetectorParams { radius: 0.01, self_contact: false, ..DetectorParams::default() });
}
