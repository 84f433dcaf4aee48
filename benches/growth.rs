//! Time and memory of friction and crumples of a cloth, against its length and its number of vertices: each should be proportional to both, and
//! memory should not grow with the length.
//!
//! `cargo bench -p foley -- growth` prints the table and writes `growth.svg` into the working folder.

use foley_nodes::plot::{Chart, Line};
use std::path::Path;
use std::process::Command;

/// Argument that selects one size.
const ONE: &str = "growth-of";
/// Seconds of motion, with [`SIDE`] by [`SIDE`] vertices.
const SECONDS: [f64; 4] = [10.0, 40.0, 150.0, 600.0];
/// Vertices along each side of the two sheets, for [`SHORT`] seconds: 968 to 100,352 vertices.
const SIDES: [usize; 4] = [22, 50, 100, 224];
const SIDE: usize = 22;
const SHORT: f64 = 10.0;

/// Two sheets that slide on each other, with edges of 2 cm, through the whole chain of a synthetic sound.
fn text(side: usize, seconds: f64) -> String {
    let size = 0.02 * (side - 1) as f64;
    format!(
        r#"#![schema = "foley:graph/1"]
Graph(seed: 1, nodes: {{
    "cloth": MeshGenerator(kind: Planes, vertices: [{side}, {side}], size: [{size:?}, {size:?}], duration: {seconds:?}, speed: 0.3),
    "contacts": ContactDetector(mesh: "cloth", radius: 0.015),
    "speed": SlidingSpeed(contacts: "contacts", rate: 40),
    "model": FrictionModelFile(path: "cotton.friction.json"),
    "friction": IftNoise(speeds: "speed", model: "model", rate: 48000),
    "curvature": MeanCurvature(mesh: "cloth"),
    "buckles": BuckleDetector(curvature: "curvature", h_eps: 0.4),
    "events": CrumpleEvents(buckles: "buckles"),
    "bank": CrumpleBankFile(path: "clothing.crumple.json"),
    "match": HistogramMatcher(events: "events", bank: "bank", adapt: true),
    "crumples": CrumplePlayer(matched: "match", bank: "bank", rate: 48000),
    "both": Mix(inputs: ["friction", "crumples"]),
    "out": WavOut(audio: "both", path: "growth.wav"),
}})"#
    )
}

/// Seconds of wall and of processors, megabytes of buffers and of the process.
type Figures = [f64; 4];

fn measured(side: usize, seconds: f64) -> Figures {
    let folder = tempfile::tempdir().expect("a folder for the bench");
    for name in ["cotton.friction.json", "clothing.crumple.json"] {
        let asset = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets/cloth").join(name);
        std::fs::copy(asset, folder.path().join(name)).expect("the models ship");
    }
    let (wall, report) = crate::common::run_text(folder.path(), &text(side, seconds), None);
    let process = report.peak_process_bytes.map_or(f64::NAN, |bytes| bytes as f64 / 1e6);
    [wall, report.cpu.map_or(f64::NAN, |time| time.as_secs_f64()), report.buffer_bytes as f64 / 1e6, process]
}

/// The same in a process of its own, as the most that a process has taken never falls.
fn in_child(side: usize, seconds: f64) -> Figures {
    let bench = std::env::current_exe().expect("the bench is a file");
    let args = ["growth".to_owned(), ONE.to_owned(), side.to_string(), seconds.to_string()];
    let child = Command::new(bench).args(args).output().expect("the bench runs again");
    let text = String::from_utf8_lossy(&child.stdout);
    let mut figures = text.split_whitespace().map(|figure| figure.parse().unwrap_or(f64::NAN));
    [(); 4].map(|()| figures.next().unwrap_or(f64::NAN))
}

pub fn bench() {
    let args: Vec<String> = std::env::args().skip_while(|arg| arg != ONE).skip(1).collect();
    if let [side, seconds] = &args[..] {
        let figures = measured(side.parse().expect("a number"), seconds.parse().expect("a number"));
        return println!("{}", figures.map(|figure| figure.to_string()).join(" "));
    }
    println!("two threads, from reading the graph to the written files");
    println!(
        "{:>10} {:>10} {:>10} {:>10} {:>12} {:>12}",
        "vertices", "seconds", "wall, s", "cpu, s", "buffers, MB", "process, MB"
    );
    let run = |side: usize, seconds: f64| {
        let figures = in_child(side, seconds);
        let [wall, cpu, buffers, process] = figures;
        println!(
            "{:>10} {seconds:>10} {wall:>10.2} {cpu:>10.2} {buffers:>12.1} {process:>12.1}",
            2 * side * side
        );
        figures
    };
    let by_length = SECONDS.map(|seconds| (seconds, run(SIDE, seconds)));
    let by_size = SIDES.map(|side| ((2 * side * side) as f64, run(side, SHORT)));
    let chart = |of: &str, what: &str, points: [(f64, Figures); 4], figure: usize| {
        let points: Vec<[f64; 2]> = points.iter().map(|(x, figures)| [*x, figures[figure]]).collect();
        let [first, last] = [points[0], points[points.len() - 1]];
        let proportional = vec![first, [last[0], first[1] * last[0] / first[0]]];
        let lines = vec![Line::dots("measured", points), Line::new("proportional", proportional)];
        Chart::of("", (of, true), (what, true), lines).draw()
    };
    let size = format!("length, s ({} vertices)", 2 * SIDE * SIDE);
    let charts = [
        chart(&size, "time, s", by_length, 0),
        chart(&size, "memory of the process, MB", by_length, 3),
        chart("vertices (10 s)", "time, s", by_size, 0),
        chart("vertices (10 s)", "memory of the process, MB", by_size, 3),
    ];
    std::fs::write("growth.svg", foley_nodes::plot::grid(&charts, 2))
        .expect("the working folder can be written");
}
