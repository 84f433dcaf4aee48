//! Functions shared by the benches of whole graphs.
#![allow(dead_code, reason = "no bench uses all of these functions")]

use foley::graph::{DirFiles, Limits, LoadOptions, Override, load};
use foley::memo::Memo;
use foley::plan::{Plan, PlanOptions};
use foley::run::{DirOutputs, Job, Progress, Report, run};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Writes a graph as `graph.ron` into a folder and runs it on two threads into `out` there. Returns the seconds from reading it to the
/// written files, and the report.
pub fn run_text(folder: &Path, text: &str, memo: Option<&Memo>) -> (f64, Report) {
    let path = folder.join("graph.ron");
    std::fs::write(&path, text).expect("the folder can be written");
    run_file(&path, &[], folder, memo)
}

/// The same for an existing graph, which may also read files in `folder`.
pub fn run_file(path: &Path, sets: &[Override], folder: &Path, memo: Option<&Memo>) -> (f64, Report) {
    run_by(path, sets, folder, memo, &PlanOptions { threads: 2, ..PlanOptions::default() })
}

/// The same, planned otherwise.
pub fn run_by(
    path: &Path,
    sets: &[Override],
    folder: &Path,
    memo: Option<&Memo>,
    options: &PlanOptions,
) -> (f64, Report) {
    let start = Instant::now();
    let loaded = load(path, &LoadOptions::default().overrides(sets.to_vec()).allow_read(folder));
    let graph = loaded.graph.unwrap_or_else(|| panic!("{:?}", loaded.diagnostics));
    let files = DirFiles::new(loaded.root, Limits::default());
    let plan = Plan::new(&graph, &files, options).expect("the graph can be planned");
    let outputs = DirOutputs::new(folder.join("out"));
    let job = Job {
        graph: &graph,
        plan: &plan,
        files: &files,
        outputs: &outputs,
        taps: &[],
        threads: options.threads,
        seed: graph.seed,
        memo,
        progress: Arc::new(Progress::default()),
    };
    let report = run(&job).expect("the graph runs");
    (start.elapsed().as_secs_f64(), report)
}
