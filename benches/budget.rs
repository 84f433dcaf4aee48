//! Cost of the whole chain of cloth in live use: `graphs/cloth/live.ron` with a sheet of 5041 vertices, at 96 kHz in
//! windows of 256, on a clock without a card.
//!
//! `cargo bench -p foley -- budget`, or `-- budget 600` for ten minutes instead of one. Budget: half a core for audio, one for the
//! analysis of the motion, and no window late.

use crate::common::{live_graph, play};
use foley::graph::{LoadOptions, Override};
use foley::live::LiveGraph;
use std::fmt::Write as _;
use std::path::Path;

/// Vertices along each side of the sheet that ships, and of the one that plays.
const SIDE: usize = 50;
const FINE: usize = 71;
const RATE: u32 = 96_000;
const QUANTUM: usize = 256;
/// Nodes that analyse motion; all other nodes make sound.
const MOTION: [&str; 10] =
    ["sheet", "floor", "wall1", "wall2", "contacts", "speed", "curvature", "buckles", "events", "match"];

type Frame = Vec<[f32; 3]>;

fn read_pc2(path: &Path) -> Vec<Frame> {
    let bytes = std::fs::read(path).expect("an animation that ships");
    let int = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let (vertices, frames) = (int(16) as usize, int(28) as usize);
    let float = |at: usize| f32::from_bits(int(at));
    let point = |k: usize| [0, 1, 2].map(|i| float(32 + 12 * k + 4 * i));
    (0..frames).map(|f| (0..vertices).map(|v| point(f * vertices + v)).collect()).collect()
}

/// Writes an animation that moves to and fro until it has `count` frames.
fn write_pc2(path: &Path, frames: &[Frame], count: usize) {
    let (n, last) = (frames[0].len(), frames.len() - 1);
    let mut bytes = b"POINTCACHE2\0".to_vec();
    for word in [1, n as u32, 0.0_f32.to_bits(), 1.0_f32.to_bits(), count as u32] {
        bytes.extend(word.to_le_bytes());
    }
    for k in 0..count {
        let back = k % (2 * last);
        let frame = &frames[back.min(2 * last - back)];
        bytes.extend(frame.iter().flatten().flat_map(|x| x.to_le_bytes()));
    }
    std::fs::write(path, bytes).expect("the folder can be written");
}

/// A sheet of [`FINE`] by [`FINE`] vertices through one of [`SIDE`] by [`SIDE`]: Catmull and Rom's splines along both sides.
fn refined(frame: &Frame) -> Frame {
    let at = |i: isize, j: isize| frame[clamped(i) * SIDE + clamped(j)];
    let mut out = Vec::with_capacity(FINE * FINE);
    for k in 0..FINE * FINE {
        let place = |k: usize| k as f32 * (SIDE - 1) as f32 / (FINE - 1) as f32;
        let [(i, a), (j, b)] =
            [k / FINE, k % FINE].map(|k| (place(k).floor() as isize, spline(place(k).fract())));
        let mut sum = [0.0; 3];
        for (di, a) in (-1..).zip(a) {
            for (dj, b) in (-1..).zip(b) {
                let point = at(i + di, j + dj);
                (0..3).for_each(|axis| sum[axis] += a * b * point[axis]);
            }
        }
        out.push(sum);
    }
    out
}

fn clamped(k: isize) -> usize {
    k.clamp(0, SIDE as isize - 1) as usize
}

fn spline(t: f32) -> [f32; 4] {
    [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ]
}

fn obj(rest: &Frame) -> String {
    let mut text = String::new();
    for [x, y, z] in rest {
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for k in (0..FINE * (FINE - 1)).filter(|k| k % FINE < FINE - 1) {
        let _ = writeln!(text, "f {} {} {} {}", k + 1, k + FINE + 1, k + FINE + 2, k + 2);
    }
    text
}

/// Writes the input files into a folder, and returns the overrides of the graph that they require.
fn inputs(folder: &Path, seconds: f64) -> Vec<Override> {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets/cloth");
    let name = "cotton_sheet_drag_drop_crumple";
    let count = (60.0 * (seconds + 2.0)) as usize;
    let sheet: Vec<Frame> = read_pc2(&assets.join(format!("{name}.pc2"))).iter().map(refined).collect();
    write_pc2(&folder.join("sheet.pc2"), &sheet, count);
    std::fs::write(folder.join("sheet.obj"), obj(&sheet[0])).expect("the folder can be written");
    for wall in ["wall1", "wall2"] {
        let frames = read_pc2(&assets.join(format!("{name}.body_{wall}.pc2")));
        write_pc2(&folder.join(format!("{wall}.pc2")), &frames, count);
        let base = assets.join(format!("{name}.body_{wall}.obj"));
        std::fs::copy(base, folder.join(format!("{wall}.obj"))).expect("the folder can be written");
    }
    // The same warp for features of another rate: their bands are in hertz, their units in seconds.
    let warp = std::fs::read_to_string(assets.join("cotton_live.warp.json")).expect("a warp that ships");
    let mut warp: serde_json::Value = serde_json::from_str(&warp).expect("it is JSON");
    // It is not the warp that its digest was made of any more.
    warp.as_object_mut().expect("an object").remove("content");
    let conventions = &mut warp["conventions"];
    conventions["rate"]["num"] = RATE.into();
    for length in ["unit", "frame"] {
        conventions[length] = (conventions[length].as_u64().expect("a length") * 2).into();
    }
    std::fs::write(folder.join("warp.json"), warp.to_string()).expect("the folder can be written");
    let files =
        ["sheet", "wall1", "wall2"].map(|id| (format!("{id}.path"), folder.join(format!("{id}.pc2"))));
    let paths = files.into_iter().chain([("warp".to_owned(), folder.join("warp.json"))]);
    let set =
        |(target, path): (String, std::path::PathBuf)| Override { target, value: path.display().to_string() };
    paths.map(set).chain([Override { target: "rate".into(), value: RATE.to_string() }]).collect()
}

fn material(folder: &Path, seconds: f64) -> LiveGraph {
    let sets = inputs(folder, seconds);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/cloth/live.ron");
    live_graph(&path, &LoadOptions::default().overrides(sets).allow_read(folder))
}

pub fn bench() {
    let seconds: f64 = std::env::args().skip(1).find_map(|arg| arg.parse().ok()).unwrap_or(60.0);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let played = play(material(folder.path(), seconds), QUANTUM, RATE, seconds);
    let nodes = played.node_times();
    let motion = |id: &str| MOTION.contains(&id);
    let sum = |of: bool| nodes.iter().filter(|(id, _)| motion(id) == of).map(|(_, time)| *time).sum();
    println!(
        "{} vertices, {RATE} Hz in windows of {QUANTUM}, {:.0} s on a clock without a card (the paper ran nothing live):",
        FINE * FINE,
        played.seconds
    );
    println!(
        "  audio    {:>6.1} % of a core   (at most 50), of which in the callback {:.1} %",
        played.share(sum(false)),
        played.callback_share()
    );
    println!("  analysis {:>6.1} % of a core   (at most 100)", played.share(sum(true)));
    played.print();
    for (id, time) in nodes.iter().take(12) {
        println!("  {id:<24} {:>6.2} % of a core", played.share(*time));
    }
}
