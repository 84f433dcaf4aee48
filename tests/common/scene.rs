//! A moving cloth whose slips and snaps are known, written as an animation: a patch slides over a floor at three speeds, and a
//! bulge beside it snaps to its other side.

use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Frames per second.
pub const FPS: f64 = 60.0;
/// Frames of the scene: 5 s.
pub const FRAMES: usize = 300;
/// Times at which the patch slides, s, and its speeds, m/s.
pub const SLIDES: [([f64; 2], f64); 3] = [([0.5, 0.9], 0.1), ([0.9, 1.3], 0.2), ([1.3, 1.7], 0.4)];
/// Area of the patch, m^2.
pub const AREA: f64 = 0.04;
/// Vertices to a side of the patch, and of the bulge.
const SIDES: [usize; 2] = [11, 15];
const STEP: f64 = 0.02;

/// The frames at which the bulge is on its other side for the first time.
pub fn snaps() -> Vec<usize> {
    let gaps = [2, 3, 5, 2, 4, 3].into_iter().cycle();
    let frames = gaps.scan(156, |frame, gap| {
        *frame += gap;
        Some(*frame)
    });
    frames.take_while(|frame| *frame < 252).collect()
}

/// A square of vertices around the origin.
fn square(side: usize) -> impl Iterator<Item = [f64; 2]> {
    let at = move |k: usize| STEP * (k as f64 - 0.5 * (side - 1) as f64);
    (0..side * side).map(move |v| [at(v % side), at(v / side)])
}

/// Displacement of the patch at a time, m.
fn slid(time: f64) -> f64 {
    SLIDES.iter().map(|([from, to], speed)| speed * (time.clamp(*from, *to) - from)).sum()
}

/// Half of the curvature of the bulge, 1/m: another at each snap, and of the other sign.
fn bulge(frame: usize) -> f64 {
    let snapped = snaps().iter().filter(|snap| **snap <= frame).count();
    let size = 1.0 + 0.35 * (snapped * 5 % 7) as f64;
    if snapped % 2 == 0 { size } else { -size }
}

fn vertices(frame: usize) -> Vec<[f64; 3]> {
    let (gone, q) = (slid(frame as f64 / FPS), bulge(frame));
    let patch = square(SIDES[0]).map(|[x, y]| [x + gone, y, 0.005]);
    let cap = square(SIDES[1]).map(|[x, y]| [x, y + 2.0, 0.5 - q * (x * x + y * y)]);
    patch.chain(cap).collect()
}

fn obj(vertices: &[[f64; 3]], triangles: &[[usize; 3]]) -> String {
    let mut text = String::new();
    for [x, y, z] in vertices {
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for [a, b, c] in triangles.iter().map(|t| t.map(|v| v + 1)) {
        writeln!(text, "f {a} {b} {c}").unwrap();
    }
    text
}

/// Two triangles to each square, from vertex `first` on.
fn triangles(side: usize, first: usize) -> impl Iterator<Item = [usize; 3]> {
    let corners = (0..(side - 1) * (side - 1)).map(move |k| first + k / (side - 1) * side + k % (side - 1));
    corners.flat_map(move |v| [[v, v + 1, v + side + 1], [v, v + side + 1, v + side]])
}

/// Writes `cloth.pc2` over `cloth.obj`, and `floor.obj`.
pub fn write(folder: &Path) {
    let first = vertices(0);
    let cloth: Vec<_> = triangles(SIDES[0], 0).chain(triangles(SIDES[1], SIDES[0] * SIDES[0])).collect();
    fs::write(folder.join("cloth.obj"), obj(&first, &cloth)).unwrap();
    let floor = [[-3.0, -3.0, 0.0], [3.0, -3.0, 0.0], [3.0, 3.0, 0.0], [-3.0, 3.0, 0.0]];
    fs::write(folder.join("floor.obj"), obj(&floor, &[[0, 1, 2], [0, 2, 3]])).unwrap();

    let mut cache = b"POINTCACHE2\0".to_vec();
    cache.extend(1_i32.to_le_bytes());
    cache.extend((first.len() as i32).to_le_bytes());
    cache.extend([0.0_f32, 1.0].iter().flat_map(|x| x.to_le_bytes()));
    cache.extend((FRAMES as i32).to_le_bytes());
    let numbers = (0..FRAMES).flat_map(vertices).flatten().flat_map(|x| (x as f32).to_le_bytes());
    cache.extend(numbers);
    fs::write(folder.join("cloth.pc2"), cache).unwrap();
}
