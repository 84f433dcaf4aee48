//! `foley live`, and `foley watch --live`.

mod level_curve;
mod level_file;
mod listeners;
mod report;
mod session;

use super::Exit;
use super::args::{DeviceArgs, GraphArgs, LiveArgs, MemoArgs, WatchArgs};
use super::console::Throttle;
use super::run::show;
use crate::diag::{Diagnostic, Sources};
use crate::graph::{Asked, Override, Texts};
use crate::live::device::{self, Device};
use crate::live::input::Hub;
use crate::live::{LiveGraph, Options, Player};
use crate::memo::{MEMORY, Memo};
use crate::run::check_given;
use crate::watch::FileWatcher;
use foley_nodes::registry::Registry;
use level_curve::LevelCurves;
use level_file::LevelFile;
use listeners::listen;
use session::Session;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// Shared settings of `foley live` and `foley watch --live`.
struct LiveSettings<'a> {
    graph: &'a GraphArgs,
    registry: &'a Arc<Registry>,
    memo: &'a MemoArgs,
    device: &'a DeviceArgs,
    report: Option<&'a Path>,
    json: bool,
    quiet: bool,
    /// Seconds between comparisons of files, where events are not wanted.
    poll: Option<f64>,
    watch: bool,
}

/// Plays a graph.
///
/// # Errors
/// If standard output is closed, or the report cannot be written.
pub fn live(args: &LiveArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    play(&LiveSettings {
        graph: &args.graph,
        registry,
        memo: &args.memo,
        device: &args.device,
        report: args.report.as_deref(),
        json: args.json,
        quiet: args.quiet,
        poll: None,
        watch: false,
    })
}

/// Plays a graph, and reloads it after each save.
///
/// # Errors
/// As [`live`].
pub fn watch(args: &WatchArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    play(&LiveSettings {
        graph: &args.run.graph,
        registry,
        memo: &args.run.memo,
        device: &args.device,
        report: args.run.report.as_deref(),
        json: false,
        quiet: args.run.quiet,
        poll: args.poll,
        watch: true,
    })
}

/// Result of loading a graph file.
struct LoadedGraph {
    material: Option<LiveGraph>,
    found: Vec<Diagnostic>,
    sources: Sources,
    asked: Asked,
}

fn load_graph(
    settings: &LiveSettings<'_>,
    messages: &[Override],
    texts: &Arc<Texts>,
    hub: &Arc<Hub>,
    memo: Option<&Arc<Memo>>,
) -> LoadedGraph {
    let args = settings.graph;
    let mut session = args.session(settings.registry).with_until(Some(1.0)).with_quiet(settings.quiet);
    session = session.with_texts(Some(Arc::clone(texts)));
    for given in messages {
        session.set_from_message(&given.target, &given.value);
    }
    let (loaded, files) = session.load();
    let asked = files.asked();
    let material = loaded.graph.map(|graph| LiveGraph {
        seed: args.seed.unwrap_or(graph.seed),
        graph,
        files,
        memo: memo.cloned(),
        inputs: Arc::clone(hub) as _,
    });
    LoadedGraph { material, found: loaded.diagnostics, sources: loaded.sources, asked }
}

fn play(settings: &LiveSettings<'_>) -> anyhow::Result<Exit> {
    let hub = Arc::new(Hub::new());
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    // Only the first handler of a process can be set; a second session in the same process uses the first one.
    let _ = ctrlc::set_handler(move || stopped.store(true, Relaxed));
    let memo = settings.memo.memo(&settings.graph.graph).map(|memo| Arc::new(memo.with_memory(MEMORY)));
    let texts = Arc::new(Texts::default());
    let LoadedGraph { material, found, sources, asked } =
        load_graph(settings, &[], &texts, &hub, memo.as_ref());
    show(&found, &sources);
    let Some(material) = material else { return Ok(Exit::Wrong) };
    let files = material.files.clone();
    let options = Options {
        quantum: settings.device.quantum,
        ahead: settings.device.lead,
        threads: std::thread::available_parallelism().map_or(1, |n| usize::from(n).saturating_sub(1)).max(1),
        metered: settings.report.is_some() || settings.json,
        channels: None,
    };
    let (mut player, callback) = match Player::start(material, options) {
        Ok(both) => both,
        Err(errors) => {
            show(&errors, &sources);
            return Ok(Exit::Wrong);
        }
    };
    player.measure_levels();
    if let Some(wanted) = settings.device.rate
        && callback.rate().as_f64() != f64::from(wanted)
    {
        let message = format!("the graph plays at {}, but --rate is {wanted} Hz", callback.rate());
        let found = Diagnostic::general("F045", message);
        show(&[found.help(format!("put Resample(rate: {wanted}) before the WavOut"))], &sources);
        return Ok(Exit::Wrong);
    }
    hub.set_clock(Arc::clone(player.shared()), callback.rate(), callback.quantum(), player.depth());
    let wanted = Device::parse(settings.device.device.as_deref());
    let sound = if let Device::File(path) = &wanted { Some(("--device", path.as_path())) } else { None };
    let given: Vec<_> = sound.into_iter().chain(settings.report.map(|path| ("--report", path))).collect();
    let errors = check_given(&given, &files.asked());
    if !errors.is_empty() {
        show(&errors, &sources);
        return Ok(Exit::Wrong);
    }
    let running = match device::start(&wanted, callback) {
        Ok(running) => running,
        Err((_, e)) => {
            show(&[Diagnostic::general("F054", e)], &Sources::default());
            return Ok(Exit::Failed);
        }
    };
    let watcher = settings.watch.then(|| {
        let mut watcher = FileWatcher::new(settings.poll);
        watcher.watch(&asked, true);
        watcher.watch(&files.asked(), false);
        watcher
    });
    let errors = Arc::new(Throttle::default());
    let listening = listen(settings, &hub, &errors);
    let session = Session {
        settings,
        hub,
        errors,
        stop,
        messages: Vec::new(),
        waiting: Vec::new(),
        one_by_one: false,
        texts,
        memo,
        watcher,
        player,
        device: Some(running),
        pending: None,
        wrong: None,
        coming: None,
        delays: Vec::new(),
        shown: Instant::now(),
        curves: LevelCurves::default(),
        levels: LevelFile::new(&settings.graph.graph),
        lost: None,
        over: false,
        lost_windows: 0,
        loud: None,
        exceeded: false,
        cut: false,
        noted: HashSet::new(),
        silent: HashSet::new(),
        starved: false,
    };
    session.run_loop(&listening)
}
