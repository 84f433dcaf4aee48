//! `foley live`, and `foley watch --live`.

use super::Exit;
use super::args::{DeviceArgs, GraphArgs, LiveArgs, MemoArgs, WatchArgs};
use super::run::{show, write_whole};
use super::watch::{SETTLE, no_events, say};
use crate::diag::{Diagnostic, Severity, Sources};
use crate::graph::{Asked, Override};
use crate::live::device::{self, Device, Running};
use crate::live::input::{Hub, Listener, Set, listen_to_meshes, listen_to_osc, read_lines};
use crate::live::{Histogram, LiveGraph, Options, Player, PlayerEvent, Reloaded};
use crate::memo::{MEMORY, Memo};
use crate::run::check_given;
use crate::watch::FileWatcher;
use crossbeam_channel::{Receiver, RecvTimeoutError, unbounded};
use foley_nodes::core::time::seconds;
use foley_nodes::registry::Registry;
use serde_json::json;
use std::io::{IsTerminal, Write as _};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Interval between two calls of the player.
const TICK: Duration = Duration::from_millis(3);
/// Interval between two status lines.
const STATUS: Duration = Duration::from_secs(1);
/// Interval between two attempts to reopen a device.
const AGAIN: Duration = Duration::from_secs(2);

/// Shared settings of `foley live` and `foley watch --live`.
struct Asking<'a> {
    graph: &'a GraphArgs,
    registry: &'a Arc<Registry>,
    memo: &'a MemoArgs,
    device: &'a DeviceArgs,
    report: Option<&'a Path>,
    json: bool,
    quiet: bool,
    /// Seconds between looks at files, where events are not wanted.
    poll: Option<f64>,
    watch: bool,
}

/// Plays a graph.
///
/// # Errors
/// When standard output goes away, or the report cannot be written.
pub fn live(args: &LiveArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    play(&Asking {
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

/// Plays a graph, and goes over to it again after each save.
///
/// # Errors
/// As [`live`].
pub fn watch(args: &WatchArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    play(&Asking {
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

/// A change that has to be loaded.
struct Pending {
    /// When it happened.
    at: Instant,
    /// True if a parameter was set.
    set: bool,
}

/// A load that failed, and is reported unless another comes soon.
struct Wrong {
    at: Instant,
    errors: Vec<Diagnostic>,
    sources: Sources,
}

struct Session<'a> {
    asking: &'a Asking<'a>,
    hub: Arc<Hub>,
    sets: Receiver<Set>,
    stop: Arc<AtomicBool>,
    overrides: Vec<Override>,
    /// Those of the last load that was right.
    good: Vec<Override>,
    /// Holds what was kept in memory, from load to load.
    memo: Option<Arc<Memo>>,
    watcher: Option<FileWatcher>,
    player: Player,
    device: Option<Running>,
    pending: Option<Pending>,
    wrong: Option<Wrong>,
    /// Loads on their way to being heard: when they began, what they are.
    coming: Option<(Instant, String)>,
    /// Milliseconds from each save to its sound.
    delays: Vec<f64>,
    shown: Instant,
    lost: Option<Instant>,
    over: bool,
}

/// Result of loading a graph file.
struct Found {
    material: Option<LiveGraph>,
    found: Vec<Diagnostic>,
    sources: Sources,
    asked: Asked,
}

fn look(asking: &Asking<'_>, overrides: &[Override], hub: &Arc<Hub>, memo: Option<&Arc<Memo>>) -> Found {
    let args = asking.graph;
    let mut session = args.session(asking.registry).with_until(Some(1.0)).with_quiet(asking.quiet);
    for given in overrides {
        session.set(&given.target, &given.value);
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
    Found { material, found: loaded.diagnostics, sources: loaded.sources, asked }
}

fn play(asking: &Asking<'_>) -> anyhow::Result<Exit> {
    let (sender, sets) = unbounded();
    let hub = Arc::new(Hub::new(sender));
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    // Only the first handler of a process can be set; a second session in the same process keeps the first.
    let _ = ctrlc::set_handler(move || stopped.store(true, Relaxed));
    let memo = asking.memo.memo(&asking.graph.graph).map(|memo| Arc::new(memo.with_memory(MEMORY)));
    let Found { material, found, sources, asked } = look(asking, &[], &hub, memo.as_ref());
    show(&found, &sources);
    let Some(material) = material else { return Ok(Exit::Wrong) };
    let files = material.files.clone();
    let options = Options {
        quantum: asking.device.quantum,
        ahead: asking.device.lead,
        threads: std::thread::available_parallelism().map_or(1, |n| usize::from(n).saturating_sub(1)).max(1),
        metered: asking.report.is_some() || asking.json,
        channels: None,
    };
    let (player, callback) = match Player::start(material, options) {
        Ok(both) => both,
        Err(errors) => {
            show(&errors, &sources);
            return Ok(Exit::Wrong);
        }
    };
    if let Some(wanted) = asking.device.rate
        && callback.rate().as_f64() != f64::from(wanted)
    {
        let message = format!("the graph plays at {}, --rate asks for {wanted} Hz", callback.rate());
        let found = Diagnostic::general("F045", message);
        show(&[found.help(format!("put Resample(rate: {wanted}) before the WavOut"))], &sources);
        return Ok(Exit::Wrong);
    }
    hub.set_clock(Arc::clone(player.shared()), callback.rate(), callback.quantum(), player.depth());
    let wanted = Device::parse(asking.device.device.as_deref());
    let sound = if let Device::File(path) = &wanted { Some(("--device", path.as_path())) } else { None };
    let given: Vec<_> = sound.into_iter().chain(asking.report.map(|path| ("--report", path))).collect();
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
    let watcher = asking.watch.then(|| {
        let mut watcher = FileWatcher::new(asking.poll);
        watcher.watch(&asked, true);
        watcher.watch(&files.asked(), false);
        watcher
    });
    let listening = hear(asking, &hub);
    let session = Session {
        asking,
        hub,
        sets,
        stop,
        overrides: Vec::new(),
        good: Vec::new(),
        memo,
        watcher,
        player,
        device: Some(running),
        pending: None,
        wrong: None,
        coming: None,
        delays: Vec::new(),
        shown: Instant::now(),
        lost: None,
        over: false,
    };
    session.begin(&listening)?.go_on()
}

/// Opens what messages come in by, each with its name.
fn hear(asking: &Asking<'_>, hub: &Arc<Hub>) -> Vec<(&'static str, Listener)> {
    let quiet = asking.quiet;
    if !std::io::stdin().is_terminal() {
        let hub = Arc::clone(hub);
        // It ends with the process: reading cannot be interrupted.
        std::thread::spawn(move || {
            read_lines(std::io::stdin().lock(), &hub, |line, message| {
                if !quiet {
                    eprintln!("foley: standard input, line {line}: {message}");
                }
            });
        });
    }
    let tell = move |message: &str| {
        if !quiet {
            eprintln!("foley: {message}");
        }
    };
    let osc = port(&asking.device.osc).map(|at| ("OSC", "--osc", at, listen_to_osc(at, Arc::clone(hub))));
    let meshes = port(&asking.device.meshes)
        .map(|at| ("meshes", "--meshes", at, listen_to_meshes(at, Arc::clone(hub), tell)));
    let mut all = Vec::new();
    for (what, option, at, listening) in osc.into_iter().chain(meshes) {
        match listening {
            Ok(listening) => all.push((what, listening)),
            Err(e) => {
                let message = format!("cannot listen for {what} at {at}: {e}");
                let warning =
                    Diagnostic { severity: Severity::Warning, ..Diagnostic::general("F055", message) };
                let help = format!("{option} PORT takes another port, {option} off none");
                show(&[warning.help(help)], &Sources::default());
            }
        }
    }
    all
}

/// The address of an option: a port of this machine, ADDRESS:PORT, or `off`.
fn port(text: &str) -> Option<SocketAddr> {
    // Clap has checked that it is one of them.
    let here = || Some(SocketAddr::from((Ipv4Addr::LOCALHOST, text.parse().ok()?)));
    text.parse().ok().or_else(here)
}

fn us(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e7).round() / 10.0
}

fn times(histogram: &Histogram) -> serde_json::Value {
    json!({
        "calls": histogram.calls(),
        "median_us": us(histogram.quantile(0.5)),
        "p99_us": us(histogram.quantile(0.99)),
        "worst_us": us(histogram.worst()),
    })
}

impl Session<'_> {
    /// Prints the device and the latency.
    fn begin(self, listening: &[(&str, Listener)]) -> std::io::Result<Self> {
        let asking = self.asking;
        if !asking.quiet && !asking.json {
            let plan = self.player.plan();
            let callback = plan.callback_region().nodes.len() - plan.sinks.len();
            let mut line = format!(
                "playing at {}, {} channel(s), quantum {} ({:.1} ms), latency {:.1} ms; {callback} node(s) in the callback, {} ahead",
                plan.rate,
                plan.channels,
                asking.device.quantum,
                asking.device.quantum as f64 / plan.rate.as_f64() * 1e3,
                seconds(plan.latency) * 1e3,
                plan.nodes.len() - callback
            );
            for (what, listening) in listening {
                line += &format!("; {what} at {}", listening.at);
            }
            if let Some(watcher) = &self.watcher {
                line += &format!("; watching {} file(s)", watcher.files());
            }
            say(&line)?;
            say("Ctrl-C ends")?;
        }
        Ok(self)
    }

    fn go_on(mut self) -> anyhow::Result<Exit> {
        let start = Instant::now();
        let limit = self.asking.device.duration.map(Duration::from_secs_f64);
        let mut exit = Exit::Done;
        while !self.stop.load(Relaxed) && limit.is_none_or(|limit| start.elapsed() < limit) {
            match self.sets.recv_timeout(TICK) {
                Ok(set) => self.set(set),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
            if let Some(watcher) = &mut self.watcher {
                no_events(watcher);
            }
            if let Some(at) = self.watcher.as_mut().and_then(FileWatcher::changed) {
                let before = self.pending.take();
                let at = before.as_ref().map_or(at, |p| p.at.min(at));
                self.pending = Some(Pending { at, set: before.is_some_and(|p| p.set) });
                self.wrong = None;
            }
            if self.pending.is_some() && !self.player.is_busy() {
                self.load()?;
            }
            for event in self.player.tick() {
                if !self.on_event(event)? {
                    exit = Exit::Failed;
                }
            }
            self.tell_wrong();
            self.look_after_device();
            self.status()?;
            if self.player.is_over() && !self.over {
                self.over = true;
                if self.watcher.is_none() {
                    break;
                }
                if !self.asking.quiet {
                    say("the piece is over; the next save begins it again")?;
                }
            }
            if exit == Exit::Failed && self.watcher.is_none() {
                break;
            }
        }
        self.end(exit)
    }

    /// Takes up a parameter that came in; the newest value of each counts.
    fn set(&mut self, set: Set) {
        let new = Override { target: set.target, value: set.value };
        self.overrides.retain(|o| o.target != new.target);
        self.overrides.push(new);
        let at = self.pending.as_ref().map_or_else(Instant::now, |p| p.at);
        self.pending = Some(Pending { at, set: true });
    }

    fn load(&mut self) -> anyhow::Result<()> {
        let Some(pending) = self.pending.take() else { return Ok(()) };
        let Found { material, found, sources, asked } =
            look(self.asking, &self.overrides, &self.hub, self.memo.as_ref());
        if let Some(watcher) = &mut self.watcher
            && watcher.watch(&asked, material.is_some())
        {
            // It has changed again already.
            self.pending = Some(Pending { at: pending.at, set: false });
        }
        let result = match material {
            None => Err(found),
            Some(material) => {
                let files = material.files.clone();
                let result = if self.over { self.begin_again(material) } else { self.player.load(material) };
                if let Some(watcher) = &mut self.watcher {
                    watcher.watch(&files.asked(), false);
                }
                result
            }
        };
        match result {
            Ok(reported) => {
                self.wrong = None;
                self.good.clone_from(&self.overrides);
                if let Reloaded::Edit(edit) = reported {
                    self.coming = Some((pending.at, edit.to_string()));
                }
            }
            Err(errors) => {
                if pending.set {
                    // What cannot be set is forgotten, or nothing else could be loaded any more.
                    self.overrides.clone_from(&self.good);
                }
                self.wrong = Some(Wrong { at: Instant::now(), errors, sources });
            }
        }
        Ok(())
    }

    /// Plays from the beginning.
    fn begin_again(&mut self, material: LiveGraph) -> Result<Reloaded, Vec<Diagnostic>> {
        let options = self.player.options().clone();
        let (player, callback) = Player::start(material, options)?;
        if let Some(device) = self.device.take() {
            let _ = device.stop();
        }
        let wanted = Device::parse(self.asking.device.device.as_deref());
        self.device = match device::start(&wanted, callback) {
            Ok(running) => Some(running),
            Err((callback, _)) => device::start(&Device::Null, *callback).ok(),
        };
        let (rate, quantum) = (player.plan().rate, player.options().quantum);
        self.hub.set_clock(Arc::clone(player.shared()), rate, quantum, player.depth());
        self.player = player;
        self.over = false;
        Ok(Reloaded::Unchanged)
    }

    /// Reports an event of the player; returns false if a node has failed.
    fn on_event(&mut self, event: PlayerEvent) -> std::io::Result<bool> {
        match event {
            PlayerEvent::Swapped => {
                if let Some((at, what)) = self.coming.take() {
                    let ms = at.elapsed().as_secs_f64() * 1e3;
                    self.delays.push(ms);
                    if !self.asking.quiet && !self.asking.json {
                        say(&format!("reloaded in {ms:.0} ms: {what}"))?;
                    }
                }
            }
            PlayerEvent::TransitionOver => {}
            PlayerEvent::Failed(fault) => {
                let sources = self.player.graph().map(|g| g.sources.clone()).unwrap_or_default();
                show(&[*fault], &sources);
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reports errors that persist.
    fn tell_wrong(&mut self) {
        if self.wrong.as_ref().is_some_and(|wrong| wrong.at.elapsed() >= SETTLE || self.watcher.is_none())
            && let Some(wrong) = self.wrong.take()
        {
            show(&wrong.errors, &wrong.sources);
            match self.watcher {
                Some(_) => {
                    eprintln!("foley: the graph that plays is the older one; waiting for the next save")
                }
                None => eprintln!("foley: the graph plays on as it was"),
            }
        }
    }

    /// Switches to a clock when the card disappears, and back when it returns.
    fn look_after_device(&mut self) {
        if self.device.as_ref().is_some_and(Running::is_lost)
            && let Some(Ok(Some(callback))) = self.device.take().map(Running::stop)
        {
            eprintln!("foley: the device is gone; the piece continues silently until it is back");
            self.device = device::start(&Device::Null, callback).ok();
            self.lost = Some(Instant::now());
        }
        if self.lost.is_some_and(|at| at.elapsed() >= AGAIN)
            && let Some(Ok(Some(callback))) = self.device.take().map(Running::stop)
        {
            let wanted = Device::parse(self.asking.device.device.as_deref());
            match device::start(&wanted, callback) {
                Ok(running) => {
                    eprintln!("foley: the device is back");
                    (self.device, self.lost) = (Some(running), None);
                }
                Err((callback, _)) => {
                    (self.device, self.lost) =
                        (device::start(&Device::Null, *callback).ok(), Some(Instant::now()));
                }
            }
        }
    }

    fn status(&mut self) -> std::io::Result<()> {
        let terminal = std::io::stderr().is_terminal();
        if self.shown.elapsed() < STATUS || self.asking.quiet || !(self.asking.json || terminal) {
            return Ok(());
        }
        self.shown = Instant::now();
        let shared = self.player.shared();
        let meter = &shared.meter;
        let budget = self.asking.device.quantum as f64 / self.player.plan().rate.as_f64();
        let played = shared.window.load(Relaxed) as f64 * budget;
        let peak = meter.take_peak();
        if self.asking.json {
            let late = self.device.as_ref().map_or(0, |d| d.status.late.load(Relaxed));
            return say(&json!({
                "played_s": played,
                "callback": times(&meter.callback),
                "missed": meter.missed.load(Relaxed),
                "overruns": meter.overruns.load(Relaxed),
                "late": late,
                "peak": peak,
                "nodes": self.nodes(),
            })
            .to_string());
        }
        let load = meter.callback.quantile(0.99).as_secs_f64() / budget * 100.0;
        eprint!(
            "\r{played:8.1} s   load {load:5.1} %   worst {:7.0} us   missed {}   peak {:6.1} dB \x1b[K",
            us(meter.callback.worst()),
            meter.missed.load(Relaxed),
            20.0 * f64::from(peak.max(1e-6)).log10()
        );
        std::io::stderr().flush()
    }

    fn nodes(&self) -> Vec<serde_json::Value> {
        let one = |n: crate::live::NodeMeter| {
            json!({
                "id": n.id,
                "calls": n.calls,
                "median_us": us(n.median),
                "p99_us": us(n.p99),
                "worst_us": us(n.worst),
            })
        };
        self.player.node_meters().into_iter().map(one).collect()
    }

    fn end(mut self, exit: Exit) -> anyhow::Result<Exit> {
        let late = self.device.as_ref().map_or(0, |d| d.status.late.load(Relaxed));
        if let Some(Err(e)) = self.device.take().map(Running::stop) {
            show(&[Diagnostic::general("F080", e)], &Sources::default());
            return Ok(Exit::Failed);
        }
        let shared = self.player.shared();
        let (meter, plan) = (&shared.meter, self.player.plan());
        let played =
            shared.window.load(Relaxed) as f64 * self.asking.device.quantum as f64 / plan.rate.as_f64();
        if !self.asking.quiet && !self.asking.json {
            say(&format!(
                "played {played:.2} s; callback median {:.0} us, worst {:.0} us; {} window(s) missed, {} overrun(s)",
                us(meter.callback.quantile(0.5)),
                us(meter.callback.worst()),
                meter.missed.load(Relaxed),
                meter.overruns.load(Relaxed)
            ))?;
        }
        if let Some(path) = self.asking.report {
            let report = json!({
                "played_s": played,
                "rate": plan.rate.as_f64(),
                "quantum": self.asking.device.quantum,
                "channels": plan.channels,
                "latency_s": seconds(plan.latency),
                "callback": times(&meter.callback),
                "missed": meter.missed.load(Relaxed),
                "overruns": meter.overruns.load(Relaxed),
                "late": late,
                "late_swaps": meter.late_swaps.load(Relaxed),
                "not_finite": meter.not_finite.load(Relaxed),
                "reload_ms": self.delays,
                "messages": {
                    "delivered": self.hub.delivered.load(Relaxed),
                    "malformed": self.hub.malformed.load(Relaxed),
                    "unclaimed": self.hub.unclaimed.load(Relaxed),
                },
                "nodes": self.nodes(),
            });
            write_whole(path, &format!("{report:#}\n"))?;
        }
        Ok(exit)
    }
}
