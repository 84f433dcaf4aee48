//! Cost of the engine itself: nanoseconds per call of a node in chains of gains, planned memory against memory in use,
//! and one thread against two.
//!
//! `cargo bench -p foley -- engine`, or one part of it: `cargo bench -p foley -- engine chain`, `memory` or `threads`.

use foley::graph::{Graph, LoadOptions, load_text};
use foley::plan::PlanOptions;
use foley::run::Report;
use foley_nodes::core::time::Rate;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn chain(nodes: usize) -> Graph {
    let mut text = String::from(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {\n\"g0\": Noise(colour: Uniform, rate: 48000),\n",
    );
    for k in 1..=nodes {
        let _ = writeln!(text, "\"g{k}\": Gain(audio: \"g{}\", gain: 0.9999),", k - 1);
    }
    let _ = writeln!(text, "\"out\": WavOut(audio: \"g{nodes}\", path: \"unused.wav\"),\n}})");
    let loaded = load_text("chain.ron", &text, Path::new("chain.ron"), &LoadOptions::default());
    loaded.graph.expect("the chain is a valid graph")
}

/// Nanoseconds per call of a gain: a chain of them less a chain without any, the best of many runs each.
fn per_node(nodes: usize, block: i64) -> f64 {
    (per_step(nodes, block) - per_step(0, block)) / nodes as f64
}

/// Nanoseconds per window.
fn per_step(nodes: usize, block: i64) -> f64 {
    crate::common::with_windows(&chain(nodes), block, |step, calls| {
        // Many short runs: the best of them is one that nothing else on the machine came between.
        let steps = (20_000 / ((calls as i64 + 20) * block.max(256) / 256)).max(3);
        let mut best = f64::INFINITY;
        for _ in 0..400 {
            let start = Instant::now();
            (0..steps).for_each(|_| step());
            best = best.min(start.elapsed().as_nanos() as f64 / steps as f64);
        }
        best
    })
}

/// A run of an example graph, a minute of it at most.
fn played(path: &Path, threads: usize) -> Report {
    let out = tempfile::tempdir().expect("a folder for the bench");
    let options = PlanOptions { threads, until: Some(Rate::hz(1).tick(60)), ..PlanOptions::default() };
    crate::common::run_by(path, &[], out.path(), None, &options).1
}

/// Seconds to run an example graph on one and on two threads, in turn: a machine that is slower for a while is so for both.
fn seconds(path: &Path) -> [f64; 2] {
    let mut best = [f64::INFINITY; 2];
    for _ in 0..5 {
        for (threads, best) in (1..).zip(&mut best) {
            *best = best.min(played(path, threads).wall.as_secs_f64());
        }
    }
    best
}

/// Bytes of a run: planned for buffers, used by buffers, and of the whole process with all values, files and code.
///
/// The most that a process has taken never falls: every graph has a process of its own.
fn memory_in_child(path: &Path) -> Option<String> {
    let bench = std::env::current_exe().ok()?;
    let child = std::process::Command::new(bench).args(["engine", ONE]).arg(path).output().ok()?;
    let text = String::from_utf8(child.stdout).ok()?;
    (!text.is_empty()).then_some(text)
}

/// Argument that selects the memory of one graph.
const ONE: &str = "memory-of";

fn memory(path: &Path) {
    let report = played(path, 2);
    let megabytes = |bytes: usize| bytes as f64 / 1e6;
    let [planned, there] = [report.planned_bytes, report.buffer_bytes].map(megabytes);
    let process = report.peak_process_bytes.map_or(f64::NAN, megabytes);
    print!("{planned:>10.2} {there:>10.2} {process:>10.1}");
}

/// The example graphs, except those that only play.
fn examples(root: &Path) -> Vec<PathBuf> {
    let folders = std::fs::read_dir(root).into_iter().flatten().flatten().map(|e| e.path());
    let mut graphs: Vec<_> = folders
        .filter(|f| !f.ends_with("assets") && !f.ends_with("lib"))
        .flat_map(|f| std::fs::read_dir(f).into_iter().flatten().flatten().map(|e| e.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "ron") && !p.to_string_lossy().ends_with(".test.ron"))
        .collect();
    graphs.sort();
    graphs
}

fn chains() {
    println!("nanoseconds per node and block, mono, one core (a gain multiplies each sample)");
    println!("{:>8} {:>10} {:>10} {:>10}", "nodes", "block 64", "256", "1024");
    for nodes in [10, 100, 1000] {
        let figures: Vec<String> =
            [64, 256, 1024].iter().map(|b| format!("{:>10.1}", per_node(nodes, *b))).collect();
        println!("{nodes:>8} {}", figures.join(" "));
    }
}

pub fn bench() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let Some(at) = args.iter().position(|arg| arg == ONE) {
        return args.get(at + 1).map_or((), |path| memory(Path::new(path)));
    }
    let only = ["chain", "memory", "threads"].into_iter().find(|part| args.iter().any(|arg| arg == part));
    let wanted = |part| only.is_none_or(|only| only == part);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    let name = |path: &Path| path.strip_prefix(&root).unwrap_or(path).display().to_string();
    if wanted("chain") {
        chains();
    }
    if wanted("memory") {
        println!(
            "\nmegabytes per example graph, 2 threads: planned for buffers, there in buffers, the whole process"
        );
        for path in examples(&root) {
            if let Some(figures) = memory_in_child(&path) {
                println!("{:<32} {figures}", name(&path));
            }
        }
    }
    if wanted("threads") {
        println!("\nseconds per example graph, best of five: 1 thread, 2 threads");
        for path in examples(&root) {
            let [one, two] = seconds(&path);
            println!("{:<32} {one:>8.3} {two:>8.3}  ({:.2} times)", name(&path), one / two);
        }
    }
}
