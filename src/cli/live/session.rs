//! A graph that plays: loads, reloads, device and messages.

use super::level_curve::LevelCurves;
use super::level_file::LevelFile;
use super::{LiveSettings, LoadedGraph, load_graph};
use crate::cli::Exit;
use crate::cli::console::{Throttle, print_line, print_message};
use crate::cli::run::show;
use crate::cli::watch::{SETTLE, no_events};
use crate::diag::{Diagnostic, Sources};
use crate::graph::{Override, Texts, message_source};
use crate::live::device::{self, Device, Running};
use crate::live::input::{Hub, Listener, MAX_SETS, Refusal, Set};
use crate::live::{CEILING, LiveGraph, Player, PlayerEvent, Reloaded};
use crate::memo::Memo;
use crate::run::clipping_advice;
use crate::watch::FileWatcher;
use foley_nodes::core::time::seconds;
use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Interval between two calls of the player.
const TICK: Duration = Duration::from_millis(3);
/// Time for which windows are missed before it is reported, s.
const LONG_GAP: f64 = 0.5;
/// Time after the first sample beyond full scale at which it is reported, with the peak so far.
const SETTLE_LEVEL: Duration = Duration::from_millis(300);
/// Interval between two attempts to reopen a device.
const AGAIN: Duration = Duration::from_secs(2);

/// A failed load, which is reported unless another load comes soon.
pub(super) struct FailedLoad {
    at: Instant,
    errors: Vec<Diagnostic>,
    sources: Sources,
}

/// A graph that plays.
pub(super) struct Session<'a> {
    pub(super) settings: &'a LiveSettings<'a>,
    pub(super) hub: Arc<Hub>,
    /// Errors that anybody can cause.
    pub(super) errors: Arc<Throttle>,
    pub(super) stop: Arc<AtomicBool>,
    /// Parameters that messages have set in the graph that plays.
    pub(super) messages: Vec<Override>,
    /// Parameters that wait to be set, and the time of the first message.
    pub(super) waiting: Vec<(Instant, Override)>,
    /// True if those that wait are set one at a time, since they cannot be set together.
    pub(super) one_by_one: bool,
    /// Texts of the graph that plays.
    pub(super) texts: Arc<Texts>,
    /// The cache in memory, from load to load.
    pub(super) memo: Option<Arc<Memo>>,
    pub(super) watcher: Option<FileWatcher>,
    pub(super) player: Player,
    pub(super) device: Option<Running>,
    /// Time of the change of a file that has to be loaded.
    pub(super) pending: Option<Instant>,
    pub(super) wrong: Option<FailedLoad>,
    /// Loads that are not audible yet: the time at which they began, and their description.
    pub(super) coming: Option<(Instant, String)>,
    /// Milliseconds from each save to its sound.
    pub(super) delays: Vec<f64>,
    pub(super) shown: Instant,
    /// Levels of the last seconds.
    pub(super) curves: LevelCurves,
    /// The file of the present levels.
    pub(super) levels: LevelFile,
    pub(super) lost: Option<Instant>,
    pub(super) over: bool,
    /// Windows that are reported as missing in the recording.
    pub(super) lost_windows: u64,
    /// Time at which the sound first exceeded full scale.
    pub(super) loud: Option<Instant>,
    /// True if that is reported.
    pub(super) exceeded: bool,
    /// True if it is reported that the sound is cut.
    pub(super) cut: bool,
    /// Notes of nodes that are reported.
    pub(super) noted: HashSet<(String, String)>,
    /// Nodes whose reason for giving nothing has been reported since the last load.
    pub(super) silent: HashSet<(String, String)>,
    /// True if it is reported that windows are missed.
    pub(super) starved: bool,
}

impl Session<'_> {
    /// Prints the device and the latency.
    fn begin(&mut self, listening: &[(&str, Listener)]) -> std::io::Result<()> {
        let settings = self.settings;
        if !settings.quiet && !settings.json {
            let plan = self.player.plan();
            let callback = plan.callback_region().nodes.len() - plan.sinks.len();
            let mut line = format!(
                "playing at {}, {} channel(s), quantum {} ({:.1} ms), latency {:.1} ms; {callback} node(s) in the callback, {} ahead",
                plan.rate,
                plan.channels,
                settings.device.quantum,
                settings.device.quantum as f64 / plan.rate.as_f64() * 1e3,
                seconds(plan.latency) * 1e3,
                plan.nodes.len() - callback
            );
            for (what, listening) in listening {
                line += &format!("; {what} at {}", listening.at);
            }
            if let Some(watcher) = &self.watcher {
                line += &format!("; watching {} file(s)", watcher.files());
            }
            print_line(&line)?;
            print_line("Ctrl-C ends")?;
        }
        self.report_notes();
        Ok(())
    }

    /// Plays to the end, and finishes the recording and the report even if standard output is closed.
    pub(super) fn run_loop(mut self, listening: &[(&str, Listener)]) -> anyhow::Result<Exit> {
        match self.begin(listening).map_err(Into::into).and_then(|()| self.play()) {
            Ok(exit) => self.end(exit),
            Err(e) => self.end(Exit::Done).and(Err(e)),
        }
    }

    fn play(&mut self) -> anyhow::Result<Exit> {
        let start = Instant::now();
        let limit = self.settings.device.duration.map(Duration::from_secs_f64);
        let mut exit = Exit::Done;
        while !self.stop.load(Relaxed) && limit.is_none_or(|limit| start.elapsed() < limit) {
            self.hub.take_sets(TICK).into_iter().for_each(|set| self.queue(set));
            self.report_messages();
            self.errors.flush();
            if let Some(watcher) = &mut self.watcher {
                no_events(watcher);
            }
            if let Some(at) = self.watcher.as_mut().and_then(FileWatcher::changed) {
                self.pending = Some(self.pending.map_or(at, |before| before.min(at)));
                self.wrong = None;
            }
            if !self.player.is_busy() {
                if let Some(at) = self.pending.take() {
                    self.load_files(at);
                } else if !self.waiting.is_empty() {
                    self.load_messages();
                }
            }
            for event in self.player.tick() {
                if !self.on_event(event)? {
                    exit = Exit::Failed;
                }
            }
            self.report_errors();
            self.report_missed();
            self.report_device();
            self.report_loudness();
            self.check_device();
            self.status()?;
            if self.player.is_over() && !self.over {
                self.over = true;
                if self.watcher.is_none() {
                    break;
                }
                if !self.settings.quiet {
                    print_line("the piece has ended; the next save restarts it")?;
                }
            }
            if exit == Exit::Failed && self.watcher.is_none() {
                break;
            }
        }
        Ok(exit)
    }

    /// Queues a parameter to set. The newest value of each counts; parameters for which there is no room are left out.
    fn queue(&mut self, set: Set) {
        let new = Override { target: set.target, value: set.value };
        match self.waiting.iter().position(|(_, waits)| waits.target == new.target) {
            Some(k) => self.waiting[k].1 = new,
            None if self.waiting.len() < MAX_SETS => self.waiting.push((Instant::now(), new)),
            None => self.hub.refusals.add(Refusal::Dropped),
        }
    }

    /// Loads the files as they are now, with the parameters that messages have set.
    fn load_files(&mut self, at: Instant) {
        let texts = Arc::new(Texts::default());
        let (result, sources) = self.load(&texts, self.messages.clone(), at);
        let Err(errors) = result else {
            (self.wrong, self.texts) = (None, texts);
            return;
        };
        // A parameter that the new text lacks must not keep it from playing.
        let lost = set_by(&errors, &sources, &self.messages);
        let remaining: Vec<_> =
            self.messages.iter().filter(|set| !lost.contains(&set.target)).cloned().collect();
        if !lost.is_empty() && self.load(&texts, remaining.clone(), at).0.is_ok() {
            print_message(format_args!(
                "values set by messages no longer fit the graph, and are dropped: {}",
                lost.join(", ")
            ));
            (self.wrong, self.texts, self.messages) = (None, texts, remaining);
        } else {
            self.wrong = Some(FailedLoad { at: Instant::now(), errors, sources });
        }
    }

    /// Sets the parameters that wait, in the texts of the graph that plays: all together, or after an error one by one.
    fn load_messages(&mut self) {
        let count = if self.one_by_one { 1 } else { self.waiting.len() };
        let batch: Vec<_> = self.waiting.drain(..count).collect();
        let mut all = self.messages.clone();
        all.retain(|set| batch.iter().all(|(_, new)| new.target != set.target));
        all.extend(batch.iter().map(|(_, new)| new.clone()));
        let at = batch.iter().map(|(at, _)| *at).min().unwrap_or_else(Instant::now);
        let (result, sources) = self.load(&Arc::clone(&self.texts), all.clone(), at);
        let Err(errors) = result else {
            self.messages = all;
            self.one_by_one &= !self.waiting.is_empty();
            return;
        };
        let wrong = set_by(&errors, &sources, &all);
        let (bad, rest): (Vec<_>, Vec<_>) =
            batch.into_iter().partition(|(_, set)| count == 1 || wrong.contains(&set.target));
        bad.iter().for_each(|_| self.hub.refusals.add(Refusal::NotSet));
        if bad.is_empty() {
            self.one_by_one = true;
        } else {
            let shown: Vec<_> = errors.iter().take(self.errors.allow(errors.len())).cloned().collect();
            if !shown.is_empty() {
                show(&shown, &sources);
                print_message("the graph continues unchanged");
            }
        }
        // What came in the meantime is newer.
        let newer = std::mem::take(&mut self.waiting);
        self.waiting = rest;
        for (at, set) in newer {
            self.waiting.retain(|(_, waits)| waits.target != set.target);
            self.waiting.push((at, set));
        }
        self.one_by_one &= !self.waiting.is_empty();
    }

    /// Loads the graph of these texts with parameters that messages have set.
    fn load(
        &mut self,
        texts: &Arc<Texts>,
        messages: Vec<Override>,
        at: Instant,
    ) -> (Result<(), Vec<Diagnostic>>, Sources) {
        let LoadedGraph { material, found, sources, asked } =
            load_graph(self.settings, &messages, texts, &self.hub, self.memo.as_ref());
        if let Some(watcher) = &mut self.watcher
            && watcher.watch(&asked, material.is_some())
        {
            // It has changed again already.
            self.pending = Some(at);
        }
        let Some(material) = material else { return (Err(found), sources) };
        let files = material.files.clone();
        let result = if self.over { self.begin_again(material) } else { self.player.load(material) };
        if let Some(watcher) = &mut self.watcher {
            watcher.watch(&files.asked(), false);
        }
        let result = result.map(|reported| {
            if let Reloaded::Edit(edit) = reported {
                self.coming = Some((at, edit.to_string()));
            }
        });
        if result.is_ok() {
            self.silent.clear();
            self.report_notes();
        }
        (result, sources)
    }

    /// Plays from the beginning.
    fn begin_again(&mut self, material: LiveGraph) -> Result<Reloaded, Vec<Diagnostic>> {
        let options = self.player.options().clone();
        let (mut player, callback) = Player::start(material, options)?;
        player.measure_levels();
        if let Some(device) = self.device.take() {
            let _ = device.stop();
        }
        let wanted = Device::parse(self.settings.device.device.as_deref());
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
                    if !self.settings.quiet && !self.settings.json {
                        print_line(&format!("reloaded in {ms:.0} ms: {what}"))?;
                    }
                }
            }
            PlayerEvent::TransitionOver => {}
            PlayerEvent::Renewed(id) => {
                print_message(format_args!(
                    "`{id}`: its output was not finite; it is reset, and reported once"
                ));
            }
            PlayerEvent::Silent(notes) => {
                for (node, note) in notes {
                    self.noted.insert((node.clone(), note.clone()));
                    if self.silent.insert((node.clone(), note.clone())) && !self.settings.quiet {
                        print_message(format_args!("note: {node}: {note}"));
                    }
                }
            }
            PlayerEvent::Failed(fault) => {
                let sources = self.player.graph().map(|g| g.sources.clone()).unwrap_or_default();
                show(&[*fault], &sources);
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reports the first message of each mistake.
    fn report_messages(&self) {
        let texts = self.hub.refusals.take_texts();
        texts
            .iter()
            .filter(|_| !self.settings.quiet)
            .for_each(|text| print_message(format_args!("message: {text}")));
    }

    /// Reports errors that persist.
    fn report_errors(&mut self) {
        if self.wrong.as_ref().is_some_and(|wrong| wrong.at.elapsed() >= SETTLE || self.watcher.is_none())
            && let Some(wrong) = self.wrong.take()
        {
            show(&wrong.errors, &wrong.sources);
            match self.watcher {
                Some(_) => print_message("the graph that plays is the older one; waiting for the next save"),
                None => print_message("the graph continues unchanged"),
            }
        }
    }

    /// Reports once that windows have been missed for half a second.
    fn report_missed(&mut self) {
        let plan = self.player.plan();
        let window = self.settings.device.quantum as f64 / plan.rate.as_f64();
        let missed = self.player.shared().meter.missed_in_a_row.load(Relaxed) as f64 * window;
        if missed == 0.0 {
            self.starved = false;
        } else if missed > LONG_GAP && !std::mem::replace(&mut self.starved, true) {
            print_message(format_args!(
                "the nodes ahead of the callback have delivered nothing for {LONG_GAP} s: they are slower than real time, and \
                 the nodes that depend on them are silent until they catch up"
            ));
        }
    }

    /// Reports once that the sound exceeds full scale, and once that it is cut at the ceiling of the device.
    fn report_loudness(&mut self) {
        let meter = &self.player.shared().meter;
        let card = matches!(Device::parse(self.settings.device.device.as_deref()), Device::Card(_));
        let (ceiling, what) = if card { (1.0, "full scale") } else { (CEILING, "120 dB over full scale") };
        if !self.cut && (meter.loudest() > ceiling || meter.cut.load(Relaxed) > 0) {
            (self.cut, self.loud) = (true, self.loud.or_else(|| Some(Instant::now())));
            print_message(format_args!("the sound exceeds {what} and is clipped there: {}", self.advice()));
        } else if self.loud.is_none() && meter.loudest() > 1.0 {
            self.loud = Some(Instant::now());
        } else if !self.cut && !self.exceeded && self.loud.is_some_and(|at| at.elapsed() >= SETTLE_LEVEL) {
            // The peak of the first sound is known by now.
            self.exceeded = true;
            print_message(format_args!("the sound exceeds full scale: {}", self.advice()));
        }
    }

    /// Advice on how to lower the sound that was played.
    pub(super) fn advice(&self) -> String {
        let shared = self.player.shared();
        let samples = shared.window.load(Relaxed) * self.settings.device.quantum as u64;
        let sound = shared.meter.loudness(samples * self.player.plan().channels as u64);
        let graph = self.player.graph();
        let sink = self.player.plan().sinks.first();
        let sink = graph.zip(sink).and_then(|(graph, sink)| graph.find(&sink.id));
        graph.zip(sink).map_or_else(String::new, |(graph, sink)| clipping_advice(graph, sink, sound))
    }

    /// Prints the notes of the nodes that are new, such as that a recording ends early.
    fn report_notes(&mut self) {
        for (node, note) in self.player.notes() {
            if self.noted.insert((node.clone(), note.clone())) && !self.settings.quiet {
                print_message(format_args!("note: {node}: {note}"));
            }
        }
    }

    /// Reports the losses of the device at once.
    fn report_device(&mut self) {
        let Some(status) = self.device.as_ref().map(|device| &device.status) else { return };
        if let Some(failure) = status.take_failure() {
            show(&[Diagnostic::general("F080", failure)], &Sources::default());
            print_message("the piece continues without a recording");
        }
        let stopped = status.stopped_ms.swap(0, Relaxed);
        if stopped > 0 {
            print_message(format_args!(
                "the clock stood still for {:.1} s: the process was stopped, or the machine slept",
                stopped as f64 / 1e3
            ));
        }
        let lost = status.lost_windows.load(Relaxed);
        if lost > self.lost_windows && !status.cut.load(Relaxed) && self.errors.allow(1) == 1 {
            let seconds =
                lost as f64 * self.settings.device.quantum as f64 / self.player.plan().rate.as_f64();
            print_message(format_args!(
                "{seconds:.2} s of sound are missing in the recording: the disk is too slow"
            ));
            self.lost_windows = lost;
        }
    }

    /// Switches to a clock when the card disappears, and back when it returns.
    fn check_device(&mut self) {
        if self.device.as_ref().is_some_and(Running::is_lost)
            && let Some(Ok(Some(callback))) = self.device.take().map(Running::stop)
        {
            print_message("the device is disconnected; the piece continues silently until it is back");
            self.device = device::start(&Device::Null, callback).ok();
            self.lost = Some(Instant::now());
        }
        if self.lost.is_some_and(|at| at.elapsed() >= AGAIN)
            && let Some(Ok(Some(callback))) = self.device.take().map(Running::stop)
        {
            let wanted = Device::parse(self.settings.device.device.as_deref());
            match device::start(&wanted, callback) {
                Ok(running) => {
                    print_message("the device is back");
                    (self.device, self.lost) = (Some(running), None);
                }
                Err((callback, _)) => {
                    (self.device, self.lost) =
                        (device::start(&Device::Null, *callback).ok(), Some(Instant::now()));
                }
            }
        }
    }
}

/// The targets among `messages` that errors point to.
fn set_by(errors: &[Diagnostic], sources: &Sources, messages: &[Override]) -> Vec<String> {
    let files = errors.iter().flat_map(|error| {
        let labels = error.labels.iter().map(|label| label.location.file);
        error.location.iter().map(|location| location.file).chain(labels)
    });
    let names: HashSet<&str> = files.filter_map(|file| Some(&*sources.get(file)?.name)).collect();
    let targets = messages.iter().map(|set| &set.target);
    targets.filter(|target| names.contains(&*message_source(target))).cloned().collect()
}
