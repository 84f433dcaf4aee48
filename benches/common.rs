//! Functions shared by the benches of whole graphs.

use crate::peers::measure::processor_time;
use foley::graph::{DirFiles, Graph, Limits, LoadOptions, Override, Root, load};
use foley::live::device::{self, Device};
use foley::live::{LiveGraph, NodeMeter, Options, Player};
use foley::memo::Memo;
use foley::plan::{Plan, PlanOptions};
use foley::run::{DirOutputs, Job, Progress, Report, Values, run, stage};
use foley_nodes::core::input::NoInputs;
use foley_nodes::core::time::Rate;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

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

/// Calls `time` with a function that runs the next window of a graph, of `samples` samples at 48 kHz, on one thread, and with its number of nodes.
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

/// A graph file that plays without input.
pub fn live_graph(path: &Path, options: &LoadOptions) -> LiveGraph {
    let loaded = load(path, options);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{:?}", loaded.diagnostics));
    let files = DirFiles::new(loaded.root, Limits::default());
    LiveGraph { seed: graph.seed, graph, files, memo: None, inputs: Arc::new(NoInputs) }
}

/// A graph that played on a clock without a card, and its times.
pub struct Played {
    player: Player,
    /// Times of the nodes before the clock began.
    before: Vec<NodeMeter>,
    /// Length of a window, s.
    window: f64,
    /// Time that it played, s.
    pub seconds: f64,
    /// Processor time of the process, s.
    used: f64,
    late: u64,
}

/// Plays a graph for a time, in windows of `quantum` samples at a rate.
pub fn play(graph: LiveGraph, quantum: usize, rate: u32, seconds: f64) -> Played {
    let options = Options { quantum, metered: true, ..Options::default() };
    let (mut player, callback) = Player::start(graph, options).unwrap_or_else(|e| panic!("{e:?}"));
    let (used, start) = (processor_time(), Instant::now());
    let running = device::start(&Device::Null, callback).map_err(|e| e.1).expect("the clock starts");
    let before = player.node_meters();
    while start.elapsed().as_secs_f64() < seconds && !player.is_over() {
        player.tick();
        std::thread::sleep(Duration::from_millis(3));
    }
    let (seconds, used) = (start.elapsed().as_secs_f64(), processor_time() - used);
    let late = running.status.late.load(Relaxed);
    let _ = running.stop();
    Played { player, before, window: quantum as f64 / f64::from(rate), seconds, used, late }
}

impl Played {
    /// A time as a share of a core, in percent.
    pub fn share(&self, time: Duration) -> f64 {
        100.0 * time.as_secs_f64() / self.seconds
    }

    /// Share of a core in the callback, in percent.
    pub fn callback_share(&self) -> f64 {
        self.share(self.player.shared().meter.callback.total())
    }

    /// Times of the nodes while the clock ran, the longest first; values computed before do not count.
    pub fn node_times(&self) -> Vec<(String, Duration)> {
        let spent = |node: &NodeMeter| {
            let before = self.before.iter().find(|m| m.id == node.id).map_or(Duration::ZERO, |m| m.total);
            node.total.saturating_sub(before)
        };
        let mut nodes: Vec<(String, Duration)> =
            self.player.node_meters().iter().map(|node| (node.id.clone(), spent(node))).collect();
        nodes.sort_by_key(|(_, time)| std::cmp::Reverse(*time));
        nodes
    }

    /// Prints the processor time and the late windows.
    pub fn print(&self) {
        let meter = &self.player.shared().meter;
        println!("  process  {:>6.1} % of a core, by the system", 100.0 * self.used / self.seconds);
        println!(
            "  missed {}, overruns {}, late windows of the clock {}   (at most 0)",
            meter.missed.load(Relaxed),
            meter.overruns.load(Relaxed),
            self.late
        );
        println!(
            "  callback: median {:.1} us, p99 {:.1} us, worst {:.1} us of {:.0} us",
            meter.callback.quantile(0.5).as_secs_f64() * 1e6,
            meter.callback.quantile(0.99).as_secs_f64() * 1e6,
            meter.callback.worst().as_secs_f64() * 1e6,
            self.window * 1e6
        );
    }
}
