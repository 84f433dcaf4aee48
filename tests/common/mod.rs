//! Functions shared by the tests of whole graphs.
#![allow(dead_code)]

pub mod counter;
pub mod figure;
pub mod grown;
pub mod project;
pub mod scene;

use foley::diag::{Diagnostic, render};
use foley::graph::{DirFiles, Graph, Limits, LoadOptions, load, load_text};
use foley::memo::{CachePolicy, Memo};
use foley::plan::{Plan, PlanOptions};
use foley::run::{DirOutputs, Job, Progress, Report, TapTarget, check_tap, run};
use foley_nodes::core::time::{Tick, ticks};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Caches values and no streams.
pub const VALUES: CachePolicy = CachePolicy {
    seconds_per_byte: 0.0,
    min_seconds: f64::INFINITY,
    read_seconds_per_byte: 0.0,
    max_nodes: 1000,
};

/// Caches every stream that can be cached.
pub const ALL: CachePolicy =
    CachePolicy { seconds_per_byte: 0.0, min_seconds: 0.0, read_seconds_per_byte: 0.0, max_nodes: 1000 };

/// The folder of the example graphs.
pub fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs")
}

/// All graphs in it, sub-graphs included.
pub fn all_graphs() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![graphs()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("assets") && !path.ends_with("materials") {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "ron")
                && !path.to_string_lossy().ends_with(".test.ron")
            {
                found.push(path);
            }
        }
    }
    found.sort();
    assert!(!found.is_empty());
    found
}

/// Sub-graphs under `lib` are run by the graphs that use them; tables of likeness run examples that run alone as well.
pub fn is_whole(path: &Path) -> bool {
    let tables = ["cloth/likeness.ron", "cloth/held_out_settings.ron"];
    !path.components().any(|c| c.as_os_str() == "lib") && !tables.iter().any(|table| path.ends_with(table))
}

/// Time at which a run of an example may be cut, to save time; a piece with marked moments runs whole.
pub fn cut(path: &Path, seconds: f64) -> Option<Tick> {
    let graph = load(path, &LoadOptions::default()).graph?;
    let marked = graph
        .nodes
        .iter()
        .any(|node| ["CorrespondenceSet", "MotionQuery", "GestureSpotter"].contains(&node.ty.name));
    (!marked).then(|| ticks(seconds))
}

/// A graph of a text, or all that is wrong with it.
pub fn graph(text: &str) -> Result<Graph, String> {
    let loaded = load_text("test.ron", text, Path::new("test.ron"), &LoadOptions::default());
    loaded.graph.ok_or_else(|| render(&loaded.diagnostics, &loaded.sources, false))
}

/// A run of a graph text with its files in a folder.
pub fn run_text(text: &str, options: &PlanOptions, out: &Path) -> Result<Report, String> {
    let graph = graph(text)?;
    let files = DirFiles::new(foley::graph::Root::of(Path::new("test.ron")), Limits::default());
    run_graph(&graph, &files, options, out)
}

/// A run of a graph with its files in a folder.
pub fn run_graph(
    graph: &Graph,
    files: &DirFiles,
    options: &PlanOptions,
    out: &Path,
) -> Result<Report, String> {
    run_tapped(graph, files, options, &[], out)
}

/// The same with a cache.
pub fn run_graph_cached(
    graph: &Graph,
    files: &DirFiles,
    options: &PlanOptions,
    memo: Option<&Memo>,
    out: &Path,
) -> Result<Report, String> {
    run_cached(graph, files, options, &[], memo, out).map(within_plan)
}

/// The same with taps, `NODE.PORT=FILE` each, whose files land in the same folder.
pub fn run_tapped(
    graph: &Graph,
    files: &DirFiles,
    options: &PlanOptions,
    taps: &[String],
    out: &Path,
) -> Result<Report, String> {
    run_unmeasured(graph, files, options, taps, out).map(within_plan)
}

/// The report of a run whose buffers have no more bytes than planned.
fn within_plan(report: Report) -> Report {
    let Report { title, buffer_bytes: there, planned_bytes: planned, .. } = &report;
    assert!(there <= planned, "{title}: {there} bytes of buffers, planned {planned}");
    report
}

/// The same without a check of the buffers: those of events may outgrow the plan.
pub fn run_unmeasured(
    graph: &Graph,
    files: &DirFiles,
    options: &PlanOptions,
    taps: &[String],
    out: &Path,
) -> Result<Report, String> {
    run_cached(graph, files, options, taps, None, out)
}

/// The same with a cache.
fn run_cached(
    graph: &Graph,
    files: &DirFiles,
    options: &PlanOptions,
    taps: &[String],
    memo: Option<&Memo>,
    out: &Path,
) -> Result<Report, String> {
    let text = |e: Vec<Diagnostic>| render(&e, &graph.sources, false);
    let taps = taps.iter().map(|tap| check_tap(graph, tap).map_err(|e| text(vec![e])));
    let mut taps = taps.collect::<Result<Vec<_>, _>>()?;
    for tap in &mut taps {
        if let TapTarget::File(path) = &mut tap.target {
            *path = out.join(&*path);
        }
    }
    let tapped = taps.iter().map(|tap| (tap.node, tap.port)).collect();
    let plan = Plan::new(graph, files, &PlanOptions { taps: tapped, ..options.clone() }).map_err(text)?;
    let outputs = DirOutputs::new(out);
    let job = Job {
        graph,
        plan: &plan,
        files,
        outputs: &outputs,
        taps: &taps,
        threads: options.threads,
        seed: graph.seed,
        memo,
        progress: Arc::new(Progress::default()),
    };
    run(&job).map_err(text)
}

/// A run of an example graph, from its file.
pub fn run_file(path: &Path, options: &PlanOptions, out: &Path) -> Result<Report, String> {
    run_file_cached(path, options, None, out)
}

/// The same with a cache.
pub fn run_file_cached(
    path: &Path,
    options: &PlanOptions,
    memo: Option<&Memo>,
    out: &Path,
) -> Result<Report, String> {
    let (graph, files) = opened(path)?;
    run_graph_cached(&graph, &files, options, memo, out)
}

/// The same with taps and without a check of the buffers: those of events may outgrow the plan.
pub fn run_file_unmeasured(
    path: &Path,
    options: &PlanOptions,
    taps: &[String],
    memo: Option<&Memo>,
    out: &Path,
) -> Result<Report, String> {
    let (graph, files) = opened(path)?;
    run_cached(&graph, &files, options, taps, memo, out)
}

fn opened(path: &Path) -> Result<(Graph, DirFiles), String> {
    let loaded = load(path, &LoadOptions::default());
    let graph = loaded.graph.ok_or_else(|| render(&loaded.diagnostics, &loaded.sources, false))?;
    Ok((graph, DirFiles::new(loaded.root, Limits::default())))
}

/// A file or folder of the data beside the repository, if it exists; `FOLEY_DATA` names another folder.
pub fn shared(path: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let folder = std::env::var_os("FOLEY_DATA").map_or_else(beside, PathBuf::from);
    let found = folder.join(path).canonicalize().ok();
    if found.is_none() {
        eprintln!("skipped: there is no {}", folder.join(path).display());
    }
    found
}

/// A numeric stream of a NPY file: the numbers of each item.
pub fn npy(bytes: &[u8]) -> Vec<Vec<f32>> {
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let shape = std::str::from_utf8(&bytes[10..head]).unwrap();
    let shape = shape.split_once("'shape': (").unwrap().1.split_once(')').unwrap().0;
    let width: usize = shape.split(',').skip(1).filter_map(|n| n.trim().parse::<usize>().ok()).product();
    let all: Vec<f32> =
        bytes[head..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    all.chunks(width.max(1)).map(<[f32]>::to_vec).collect()
}

/// Writes a WAV file of 16 bits with interleaved samples.
pub fn write_wav(path: &Path, channels: u16, rate: u32, samples: impl IntoIterator<Item = i16>) {
    let sample_format = hound::SampleFormat::Int;
    let spec = hound::WavSpec { channels, sample_rate: rate, bits_per_sample: 16, sample_format };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    samples.into_iter().for_each(|x| writer.write_sample(x).unwrap());
    writer.finalize().unwrap();
}

/// The samples of a WAV file, channels averaged.
pub fn wav(path: &Path) -> Vec<f32> {
    let file = std::fs::File::open(path).unwrap();
    foley_nodes::io::AudioReader::open(Box::new(file)).unwrap().read_mono().unwrap()
}

/// The program, run in a folder, whose error output is shown where it fails.
pub fn foley(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let report = folder.join("report.json");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments);
    command.args(["--no-cache", "--quiet", "--out"]).arg(folder).arg("--report").arg(&report);
    let ran = command.output().unwrap();
    assert!(ran.status.success(), "{arguments:?}\n{}", String::from_utf8_lossy(&ran.stderr));
    serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap()
}

/// The files in a folder and in those below it, by their path from it.
pub fn files_below(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    all
}
