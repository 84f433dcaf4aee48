//! Functions shared by the benches of whole graphs.

use foley::graph::{DirFiles, Graph, Limits, LoadOptions, Override, Root, load};
use foley::memo::Memo;
use foley::plan::{Plan, PlanOptions};
use foley::run::{DirOutputs, Job, Progress, Report, Values, run, stage};
use foley_nodes::core::time::Rate;
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

/// Calls `time` with a function that runs the next window of a graph, of so many samples at 48 kHz, on one thread, and with its number of nodes.
pub fn with_windows<T>(graph: &Graph, samples: i64, time: impl FnOnce(&mut dyn FnMut(), usize) -> T) -> T {
    let files = DirFiles::new(Root::default(), Limits::default());
    let options = PlanOptions {
        window: Rate::hz(48_000).tick(samples),
        until: Some(i64::MAX / 8),
        memory: usize::MAX,
        ..PlanOptions::default()
    };
    let plan = Plan::new(graph, &files, &options).expect("the graph can be planned");
    let outputs = DirOutputs::in_memory().0;
    let job = Job {
        graph,
        plan: &plan,
        files: &files,
        outputs: &outputs,
        taps: &[],
        threads: 1,
        seed: 0,
        memo: None,
        progress: Arc::new(Progress::default()),
    };
    let region = &plan.phases[0].regions[0];
    let mut stage = stage(&job, region, &Values::new()).expect("the graph can be built");
    stage.set_timed(false);
    let mut now = 0;
    let mut step = || {
        now += options.window;
        stage.advance(now);
        stage.run().expect("the graph runs");
    };
    time(&mut step, region.nodes.len())
}
