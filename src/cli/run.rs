//! `foley run`.

use super::Exit;
use super::args::{EngineArgs, GraphArgs, RunArgs};
use super::progress::Watch;
use crate::diag::{Diagnostic, Severity, Sources, render, sort};
use crate::graph::{Asked, DirFiles, Graph, Limits, Loaded, Override, load};
use crate::memo::Memo;
use crate::plan::{Plan, PlanOptions, faults};
use crate::run::{self, DirOutputs, Job, Progress, Report, Tap, check_tap, check_targets};
use foley_nodes::core::time::{Tick, ticks};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A graph that is loaded, with everything to run it.
pub struct Ready {
    /// The graph.
    pub graph: Graph,
    /// Its files.
    pub files: DirFiles,
    /// Its plan.
    pub plan: Plan,
    /// Outputs to write to files.
    pub taps: Vec<Tap>,
    /// Threads that compute.
    pub threads: usize,
    /// Seed.
    pub seed: u64,
}

/// Prints diagnostics on standard error.
pub fn show(diagnostics: &[Diagnostic], sources: &Sources) {
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    eprint!("{}", render(diagnostics, sources, colour));
}

/// What was made of a graph file, and everything that was found on the way.
pub struct Prepared {
    /// The graph, if it can run.
    pub ready: Option<Ready>,
    /// Errors and warnings.
    pub found: Vec<Diagnostic>,
    /// The texts that they point into.
    pub sources: Sources,
    /// What was asked for.
    pub asked: Asked,
}

/// Loads, checks and plans a graph; prints what is wrong.
pub fn prepare(graph: &GraphArgs, engine: &EngineArgs, quiet: bool) -> Option<Ready> {
    let prepared = look(graph, engine, quiet);
    show(&prepared.found, &prepared.sources);
    prepared.ready
}

/// Reads a graph; of one that cannot run, what is wrong with its sound part is told with the rest.
pub fn read(
    path: &Path,
    sets: &[Override],
    allow_read: &[PathBuf],
    limits: Limits,
    until: Option<Tick>,
) -> (Loaded, DirFiles) {
    let mut loaded = load(path, sets, allow_read, limits);
    let files = DirFiles::new(std::mem::take(&mut loaded.root), limits);
    if let Some(sound) = &loaded.sound {
        let options = PlanOptions { until, ..PlanOptions::default() };
        loaded.diagnostics.extend(faults(sound, &files, &options));
        sort(&mut loaded.diagnostics, &loaded.sources);
    }
    (loaded, files)
}

/// Loads, checks and plans a graph.
pub fn look(graph: &GraphArgs, engine: &EngineArgs, quiet: bool) -> Prepared {
    let (limits, until) = (graph.limits.limits(), engine.until.map(ticks));
    let (loaded, files) = read(&graph.graph, &graph.sets, &graph.allow_read, limits, until);
    let mut found = loaded.diagnostics;
    found.retain(|d| !quiet || d.severity == Severity::Error);
    let planned = loaded.graph.map(|g| plan(g, engine, &files));
    let asked = files.asked();
    let ready = match planned {
        Some(Ok((own, plan, taps, threads))) => {
            let seed = graph.seed.unwrap_or(own.seed);
            Some(Ready { graph: own, files, plan, taps, threads, seed })
        }
        Some(Err(errors)) => {
            found.extend(errors);
            sort(&mut found, &loaded.sources);
            None
        }
        None => None,
    };
    Prepared { ready, found, sources: loaded.sources, asked }
}

type Planned = (Graph, Plan, Vec<Tap>, usize);

/// Plans a graph with its taps.
fn plan(found: Graph, engine: &EngineArgs, files: &DirFiles) -> Result<Planned, Vec<Diagnostic>> {
    let mut errors = Vec::new();
    let mut taps = Vec::new();
    for text in &engine.taps {
        match check_tap(&found, text) {
            Ok(tap) => taps.push(tap),
            Err(e) => errors.push(e),
        }
    }
    let threads =
        engine.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let options = PlanOptions {
        window: ticks(engine.window),
        threads,
        until: engine.until.map(ticks),
        memory: files.limits().memory,
        taps: taps.iter().map(|t| (t.node, t.port)).collect(),
        ..PlanOptions::default()
    };
    match Plan::new(&found, files, &options) {
        Ok(plan) if errors.is_empty() => Ok((found, plan, taps, threads)),
        Ok(_) => Err(errors),
        Err(e) => {
            errors.extend(e);
            Err(errors)
        }
    }
}

/// Runs a graph.
///
/// # Errors
/// When the report cannot be written, which is known before the run but for a disk that fills up.
pub fn run(args: &RunArgs) -> anyhow::Result<Exit> {
    let Some(ready) = prepare(&args.graph, &args.engine, args.quiet) else { return Ok(Exit::Wrong) };
    let progress = Arc::new(Progress::default());
    let stop = Arc::clone(&progress);
    // Only the first handler of a process can be set; a second run in the same process keeps the first.
    let _ = ctrlc::set_handler(move || {
        // The first waits for what is being computed, so that nothing half written stays; who asks twice does not.
        if stop.stop.swap(true, Ordering::SeqCst) {
            eprintln!("stopped at once: what was begun may lie in the output folder as `.part`");
            std::process::exit(Exit::Again.code().into());
        }
    });
    let mut memo = args.memo.memo(&args.graph.graph);
    if args.checkpoint > 0.0 {
        memo = memo.map(|memo| memo.with_checkpoints(&args.out, Duration::from_secs_f64(args.checkpoint)));
    }
    match render_files(&ready, args, memo.as_ref(), &progress) {
        Ok(report) => {
            tell(&report, &ready, args)?;
            Ok(Exit::Done)
        }
        Err(errors) => {
            show(&errors, &ready.graph.sources);
            Ok(if progress.stop.load(Ordering::SeqCst) { Exit::Again } else { Exit::of(&errors) })
        }
    }
}

/// Runs a graph and leaves its files in their places.
///
/// # Errors
/// As [`run::run`].
pub fn render_files(
    ready: &Ready,
    args: &RunArgs,
    memo: Option<&Memo>,
    progress: &Arc<Progress>,
) -> Result<Report, Vec<Diagnostic>> {
    let outputs = DirOutputs::new(&args.out);
    let asked = ready.files.asked();
    let errors = check_targets(&ready.graph, &ready.taps, args.report.as_deref(), &outputs, &asked);
    if !errors.is_empty() {
        return Err(errors);
    }
    if let Some(path) = &args.report {
        // Whether it can be put in its place is known before the work that it tells of is done.
        let told = DirOutputs::new(".").create_at(path).map(drop);
        told.map_err(|e| vec![Diagnostic::general(e.code, e.message)])?;
    }
    let watch = Watch::start(&ready.graph.title, Arc::clone(progress), args.quiet);
    let job = Job {
        graph: &ready.graph,
        plan: &ready.plan,
        files: &ready.files,
        outputs: &outputs,
        taps: &ready.taps,
        threads: ready.threads,
        seed: ready.seed,
        memo,
        progress: Arc::clone(progress),
    };
    let result = run::run(&job);
    watch.end();
    result
}

/// Tells what a run gave, on standard output and in the report.
///
/// # Errors
/// When standard output is gone, or the report cannot be written.
pub fn tell(report: &Report, ready: &Ready, args: &RunArgs) -> anyhow::Result<()> {
    if report.outputs.is_empty() && ready.taps.is_empty() {
        eprintln!("foley: the graph writes nothing: add a WavOut, or give --tap NODE.PORT=FILE");
    }
    if !args.quiet {
        print_report(report, ready)?;
    }
    if let Some(path) = &args.report {
        write_whole(path, &format!("{:#}\n", report.json()))?;
    }
    Ok(())
}

/// Writes a file under a temporary name and moves it to its place.
pub(super) fn write_whole(path: &std::path::Path, text: &str) -> anyhow::Result<()> {
    use anyhow::Context as _;
    let outputs = DirOutputs::new(".");
    let mut file = outputs.create_at(path).map_err(|e| anyhow::anyhow!(e.message))?;
    file.write_all(text.as_bytes())
        .and_then(|()| file.flush())
        .with_context(|| path.display().to_string())?;
    drop(file);
    outputs.commit().with_context(|| path.display().to_string())
}

fn print_report(report: &Report, ready: &Ready) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    for (id, note) in report.warnings() {
        writeln!(out, "note: {id}: {note}")?;
    }
    let fact = |facts: &serde_json::Map<String, serde_json::Value>, key: &str| {
        facts.get(key).and_then(|v| v.as_f64())
    };
    for output in &report.outputs {
        write!(out, "wrote {}", output.path)?;
        let get = |key| fact(&output.facts, key);
        if let (Some(frames), Some(rate), Some(channels)) = (get("frames"), get("rate"), get("channels")) {
            write!(out, ": {:.3} s, {rate} Hz, {channels} channel(s)", frames / rate)?;
        }
        if let (Some(peak), Some(rms)) = (get("peak"), get("rms")) {
            write!(out, ", peak {:.4}, rms {:.4}", peak, rms)?;
        }
        if let Some(clipped) = get("clipped").filter(|&c| c > 0.0) {
            write!(out, ", {clipped} samples clipped: lower the level, or write Float32")?;
        }
        writeln!(out)?;
    }
    for tap in &ready.taps {
        writeln!(out, "wrote {}", tap.path.display())?;
    }
    if let Some(at) = report.went_on_at {
        writeln!(out, "went on at {at:.2} s, where an earlier run was interrupted")?;
    }
    let cached = report.nodes.iter().filter(|n| n.cached).count();
    if cached > 0 {
        writeln!(out, "{cached} node(s) from the cache, {} computed", report.computed().len())?;
    }
    let speed = report.length / report.wall.as_secs_f64().max(1e-9);
    writeln!(
        out,
        "{:.2} s of sound in {:.2} s ({speed:.1} times real time), {} of buffers, {} thread(s)",
        report.length,
        report.wall.as_secs_f64(),
        crate::plan::size(report.buffer_bytes),
        ready.threads
    )
}
