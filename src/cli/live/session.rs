//! A graph that plays: loads, reloads, device and messages.

use super::{LiveSettings, LoadedGraph, load_graph};
use crate::cli::Exit;
use crate::cli::console::{say, tell};
use crate::cli::run::show;
use crate::cli::watch::{SETTLE, no_events};
use crate::diag::{Diagnostic, Sources};
use crate::graph::Override;
use crate::live::device::{self, Device, Running};
use crate::live::input::{Hub, Listener, Set};
use crate::live::{LiveGraph, Player, PlayerEvent, Reloaded};
use crate::memo::Memo;
use crate::watch::FileWatcher;
use crossbeam_channel::{Receiver, RecvTimeoutError};
use foley_nodes::core::time::seconds;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Interval between two calls of the player.
const TICK: Duration = Duration::from_millis(3);
/// Interval between two attempts to reopen a device.
const AGAIN: Duration = Duration::from_secs(2);

/// A change that has to be loaded.
pub(super) struct Pending {
    /// When it happened.
    at: Instant,
    /// True if a parameter was set.
    set: bool,
}

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
    pub(super) sets: Receiver<Set>,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) overrides: Vec<Override>,
    /// Contents of the last successful load.
    pub(super) good: Vec<Override>,
    /// The cache in memory, from load to load.
    pub(super) memo: Option<Arc<Memo>>,
    pub(super) watcher: Option<FileWatcher>,
    pub(super) player: Player,
    pub(super) device: Option<Running>,
    pub(super) pending: Option<Pending>,
    pub(super) wrong: Option<FailedLoad>,
    /// Loads that are not audible yet: the time at which they began, and their description.
    pub(super) coming: Option<(Instant, String)>,
    /// Milliseconds from each save to its sound.
    pub(super) delays: Vec<f64>,
    pub(super) shown: Instant,
    pub(super) lost: Option<Instant>,
    pub(super) over: bool,
}

impl Session<'_> {
    /// Prints the device and the latency.
    pub(super) fn begin(self, listening: &[(&str, Listener)]) -> std::io::Result<Self> {
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
            say(&line)?;
            say("Ctrl-C ends")?;
        }
        Ok(self)
    }

    /// Plays to the end, and finishes the recording and the report even if nobody reads standard output any more.
    pub(super) fn run_loop(mut self) -> anyhow::Result<Exit> {
        match self.play() {
            Ok(exit) => self.end(exit),
            Err(e) => self.end(Exit::Done).and(Err(e)),
        }
    }

    fn play(&mut self) -> anyhow::Result<Exit> {
        let start = Instant::now();
        let limit = self.settings.device.duration.map(Duration::from_secs_f64);
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
            self.report_errors();
            self.check_device();
            self.status()?;
            if self.player.is_over() && !self.over {
                self.over = true;
                if self.watcher.is_none() {
                    break;
                }
                if !self.settings.quiet {
                    say("the piece is over; the next save begins it again")?;
                }
            }
            if exit == Exit::Failed && self.watcher.is_none() {
                break;
            }
        }
        Ok(exit)
    }

    /// Applies a received parameter; the newest value of each counts.
    fn set(&mut self, set: Set) {
        let new = Override { target: set.target, value: set.value };
        self.overrides.retain(|o| o.target != new.target);
        self.overrides.push(new);
        let at = self.pending.as_ref().map_or_else(Instant::now, |p| p.at);
        self.pending = Some(Pending { at, set: true });
    }

    fn load(&mut self) -> anyhow::Result<()> {
        let Some(pending) = self.pending.take() else { return Ok(()) };
        let LoadedGraph { material, found, sources, asked } =
            load_graph(self.settings, &self.overrides, &self.hub, self.memo.as_ref());
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
                    // A value that cannot be set is discarded; otherwise no other load would succeed.
                    self.overrides.clone_from(&self.good);
                }
                self.wrong = Some(FailedLoad { at: Instant::now(), errors, sources });
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
    fn report_errors(&mut self) {
        if self.wrong.as_ref().is_some_and(|wrong| wrong.at.elapsed() >= SETTLE || self.watcher.is_none())
            && let Some(wrong) = self.wrong.take()
        {
            show(&wrong.errors, &wrong.sources);
            match self.watcher {
                Some(_) => tell("the graph that plays is the older one; waiting for the next save"),
                None => tell("the graph plays on as it was"),
            }
        }
    }

    /// Switches to a clock when the card disappears, and back when it returns.
    fn check_device(&mut self) {
        if self.device.as_ref().is_some_and(Running::is_lost)
            && let Some(Ok(Some(callback))) = self.device.take().map(Running::stop)
        {
            tell("the device is gone; the piece continues silently until it is back");
            self.device = device::start(&Device::Null, callback).ok();
            self.lost = Some(Instant::now());
        }
        if self.lost.is_some_and(|at| at.elapsed() >= AGAIN)
            && let Some(Ok(Some(callback))) = self.device.take().map(Running::stop)
        {
            let wanted = Device::parse(self.settings.device.device.as_deref());
            match device::start(&wanted, callback) {
                Ok(running) => {
                    tell("the device is back");
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
