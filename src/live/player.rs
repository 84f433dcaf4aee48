//! The side of playback that may wait: builds graphs for the callback, and replaces one by another while it plays.

mod survey;
mod swap;

use super::playback::assembly::Assembly;
use super::playback::callback::{Callback, Command, Reply, Retunes, Shared};
use super::playback::meter::{Histogram, NodeMeter};
use super::playback::timing::{WindowTiming, window_start};
use super::playback::workers::Workers;
use super::reload::diff::{Edit, ReloadAction, reload_actions};
use super::reload::prepared::{LiveGraph, PreparedGraph, build_nodes, summarize};
use super::reload::state_transfer::{OutputPairs, locate};
use super::reload::transition::transition;
use crate::diag::Diagnostic;
use crate::graph::Graph;
use crate::plan::{Continuation, Draft, LivePlan, Runnable, SinkContinuation, shape_notes};
use foley_nodes::core::fault::Fault;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;
use std::sync::atomic::Ordering::Acquire;
use std::time::Duration;
use survey::Surveys;
use swap::{PendingSwap, SwapRequest};

/// Slots of the rings to and from the callback.
const RING_SLOTS: usize = 64;

/// Settings of playback.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Frames per window.
    pub quantum: usize,
    /// Time by which workers are ahead of the callback, s.
    pub ahead: f64,
    /// Worker threads; with 0, [`Player::pump`] runs the workers.
    pub threads: usize,
    /// True to measure the time in each node.
    pub metered: bool,
    /// Channels of the device; `None` for those of the graph.
    pub channels: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self { quantum: 128, ahead: 0.08, threads: 1, metered: false, channels: None }
    }
}

/// The graph that plays.
struct Playing {
    /// The graph of the last load; `None` only while it is being replaced.
    prepared: Option<PreparedGraph>,
    /// Its plan, or that of the transition to it.
    plan: LivePlan,
    /// Ids of the nodes of the planned graph.
    ids: Vec<String>,
}

impl Playing {
    /// Finds the region of a node, and its index in it.
    fn locate(&self, n: usize) -> Option<(usize, usize)> {
        locate(&self.plan, Runnable::Node(n))
    }
}

/// The result of a load.
#[derive(Debug)]
pub enum Reloaded {
    /// Nothing that plays has changed.
    Unchanged,
    /// The new graph replaces the old one.
    Edit(Edit),
}

/// An event of the player between loads.
#[derive(Debug)]
pub enum PlayerEvent {
    /// The callback plays the new graph.
    Swapped,
    /// The transition is over.
    TransitionOver,
    /// The output of this node was not finite, and the node is reset; reported once for each node.
    Renewed(String),
    /// No sound for a second, although input arrives: nodes that give nothing, with the reasons.
    Silent(Vec<(String, String)>),
    /// A node failed; there is silence until the next load.
    Failed(Box<Diagnostic>),
}

/// Plays a graph; [`Callback`] is the other side.
pub struct Player {
    options: Options,
    timing: WindowTiming,
    shared: Arc<Shared>,
    commands: Producer<Command>,
    replies: Consumer<Reply>,
    workers: Workers,
    playing: Playing,
    /// During a transition, the window at which its fades are over.
    transition_end: Option<u64>,
    /// Pairs of a cross-fade and the output that receives its history when the transition is over.
    successor_seeds: OutputPairs,
    /// True while a retune is in transit to the callback.
    retuning: bool,
    /// The swap in transit to the callback.
    pending_swap: Option<PendingSwap>,
    /// True after a fault of a node: no node that plays can continue.
    failed: bool,
    /// True while a new node is in transit to the callback, to replace one whose output is not finite.
    renewing: bool,
    /// Ids of the nodes that were replaced.
    renewed: HashSet<String>,
    /// Events that are not reported yet.
    events: Vec<PlayerEvent>,
    surveys: Surveys,
    times: BTreeMap<String, Arc<Histogram>>,
    /// Estimated time to assemble a swap: the longest of the last ones.
    assembly_time: Duration,
}

impl Player {
    /// Makes both sides of a player.
    ///
    /// # Errors
    /// All errors of the parts of the graph that play.
    pub fn start(graph: LiveGraph, options: Options) -> Result<(Self, Callback), Vec<Diagnostic>> {
        let prepared = PreparedGraph::new(graph)?;
        let rate = prepared.draft.rate;
        let quantum = options.quantum.max(1);
        let depth = (options.ahead * rate.as_f64() / quantum as f64).ceil().max(2.0) as u64;
        let timing = WindowTiming { rate, quantum, depth };
        let shared = Arc::new(Shared::default());
        let window = timing.window_ticks();
        let graph = &prepared.source.graph;
        let prelude = &prepared.draft.prelude;
        let draft = Draft::from_shapes(graph, prelude.shapes.clone(), prelude.limit)?;
        let plan = draft.plan(graph, window, &Continuation::default(), &SinkContinuation::default())?;
        let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
        let channels = options.channels.unwrap_or(plan.channels);
        let mut times = BTreeMap::new();
        let assembly = Assembly {
            plan: &plan,
            ids: &ids,
            site: prepared.site(window),
            values: &prepared.values,
            built: HashMap::new(),
            continued: &HashMap::new(),
            timing,
            metered: options.metered,
        };
        let (stage, mut regions) = assembly.build(0, &mut times)?;
        for region in &mut regions {
            while region.step(&timing, 0) {}
        }
        let mut workers = Workers::new(timing, Arc::clone(&shared), options.threads);
        workers.start(regions);
        let (commands, received) = RingBuffer::new(RING_SLOTS);
        let (sent, replies) = RingBuffer::new(RING_SLOTS);
        let callback = Callback::new(stage, (received, sent), Arc::clone(&shared), rate, quantum, channels);
        let player = Self {
            options,
            timing,
            shared,
            commands,
            replies,
            workers,
            playing: Playing { prepared: Some(prepared), plan, ids },
            transition_end: None,
            successor_seeds: OutputPairs::new(),
            retuning: false,
            pending_swap: None,
            failed: false,
            renewing: false,
            renewed: HashSet::new(),
            events: Vec::new(),
            surveys: Surveys::default(),
            times,
            assembly_time: Duration::from_millis(1),
        };
        Ok((player, callback))
    }

    /// Returns the options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Returns the number of windows by which workers are ahead of the callback.
    #[must_use]
    pub fn depth(&self) -> u64 {
        self.timing.depth
    }

    /// Returns the shared status.
    #[must_use]
    pub fn shared(&self) -> &Arc<Shared> {
        &self.shared
    }

    /// Returns the plan that plays.
    #[must_use]
    pub fn plan(&self) -> &LivePlan {
        &self.playing.plan
    }

    /// Returns the graph of the last load.
    #[must_use]
    pub fn graph(&self) -> Option<&Graph> {
        self.playing.prepared.as_ref().map(|prepared| &prepared.source.graph)
    }

    /// Returns the notes of the nodes of the graph, such as that a recording is shorter than its header says.
    #[must_use]
    pub fn notes(&self) -> Vec<(String, String)> {
        let Some(prepared) = &self.playing.prepared else { return Vec::new() };
        shape_notes(&prepared.source.graph, &prepared.draft.prelude.shapes)
    }

    /// Returns the times of the nodes, if they are measured.
    #[must_use]
    pub fn node_meters(&self) -> Vec<NodeMeter> {
        let known = self.times.iter().filter(|(id, times)| !id.starts_with('~') && times.calls() > 0);
        known.map(|(id, times)| NodeMeter::of(id, times)).collect()
    }

    /// Returns true during a transition; a load has to wait until it is over.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.retuning || self.renewing || self.pending_swap.is_some() || self.transition_end.is_some()
    }

    /// Returns true if the piece is over.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let window = self.shared.window.load(Acquire);
        let played = window_start(self.timing.rate, self.timing.quantum, window);
        !self.is_busy() && self.playing.plan.end.is_some_and(|end| played >= end)
    }

    /// Runs the workers, if they have no threads.
    pub fn pump(&mut self) {
        self.workers.pump();
    }

    /// Changes to another graph, or to other parameters, while it plays.
    ///
    /// # Errors
    /// All errors of the new graph; the old one continues then. Also during a transition: see [`Player::is_busy`].
    pub fn load(&mut self, graph: LiveGraph) -> Result<Reloaded, Vec<Diagnostic>> {
        if self.is_busy() {
            return Err(vec![Diagnostic::general("F091", "the transition before is not over")]);
        }
        let next = PreparedGraph::new(graph)?;
        if next.draft.rate != self.timing.rate {
            let (found, expected) = (next.draft.rate, self.timing.rate);
            let message = format!("the device plays at {expected}, the graph is now at {found}");
            let found = Diagnostic::general("F045", message);
            return Err(vec![found.help("put Resample before the WavOut, or start foley live again")]);
        }
        let Some(current) = self.playing.prepared.take() else {
            return Err(vec![Diagnostic::general("F099", "nothing plays: a defect in foley")]);
        };
        let result = self.change(&current, &next);
        self.playing.prepared = Some(if result.is_ok() { next } else { current });
        result
    }

    /// Retunes nodes, or swaps the graph for the new one or the transition to it.
    fn change(&mut self, current: &PreparedGraph, next: &PreparedGraph) -> Result<Reloaded, Vec<Diagnostic>> {
        let window = self.timing.window_ticks();
        let (old, new) = (current.state(), next.state());
        let old_nodes = &current.draft.nodes;
        let mut actions = reload_actions(&old, old_nodes, &new, &next.draft);
        let built = build_nodes(&old, next, window, &mut actions)?;
        let edit = summarize(&old, old_nodes, next, &actions);
        let kept = actions.iter().filter_map(|(&n, action)| match action {
            ReloadAction::Keep(m) | ReloadAction::Retune(m, _) => Some((n, *m)),
            ReloadAction::Build => None,
        });
        let kept: HashMap<usize, usize> = kept.collect();
        if self.failed {
            self.swap(next, SwapRequest { built, ..SwapRequest::default() })?;
            return Ok(Reloaded::Edit(edit));
        }
        let transition = transition(&old, &new, &actions, (&current.draft.sinks, &next.draft.sinks));
        let retunes = actions.into_iter().filter_map(|(n, action)| match action {
            ReloadAction::Retune(_, params) => Some((n, params)),
            _ => None,
        });
        let retunes: Retunes = retunes.collect();
        let relinked = transition.relinked.iter().map(|&n| next.source.graph.nodes[n].id.clone()).collect();
        let edit = Edit { relinked, ..edit };
        let same_nodes = transition.has_no_fades()
            && edit.rebuilt.is_empty()
            && edit.added.is_empty()
            && edit.relinked.is_empty();
        let ids = next.source.graph.nodes.iter().map(|n| &n.id);
        if same_nodes && edit.removed.is_empty() && ids.eq(&self.playing.ids) {
            return Ok(self.retune(retunes, edit));
        }
        let transition = (!transition.has_no_fades()).then_some(transition);
        let continued = match &transition {
            Some(transition) => transition.continued.clone(),
            None => kept,
        };
        self.swap(next, SwapRequest { transition, continued, built, retunes })?;
        Ok(Reloaded::Edit(edit))
    }

    /// Sets parameters of nodes that play, where nothing else has changed.
    fn retune(&mut self, retunes: Retunes, edit: Edit) -> Reloaded {
        let reloaded = if retunes.is_empty() { Reloaded::Unchanged } else { Reloaded::Edit(edit) };
        let last = self.playing.plan.regions.len() - 1;
        let mut in_callback = Vec::new();
        for (n, params) in retunes {
            match self.playing.locate(n) {
                Some((region, node)) if region == last => in_callback.push((node, params)),
                Some((region, node)) => self.workers.retune(region, node, params),
                None => {}
            }
        }
        if !in_callback.is_empty() {
            self.retuning = self.commands.push(Command::Retune(in_callback)).is_ok();
        } else if matches!(reloaded, Reloaded::Edit(_)) {
            self.events.push(PlayerEvent::Swapped);
        }
        reloaded
    }

    /// Handles the replies of the callback and the faults of workers, and ends a transition that is over.
    pub fn tick(&mut self) -> Vec<PlayerEvent> {
        while let Ok(reply) = self.replies.pop() {
            match reply {
                Reply::Retuned(_) => {
                    self.retuning = false;
                    self.events.push(PlayerEvent::Swapped);
                }
                Reply::Swap(swap) if swap.late => self.retry(*swap),
                // The old stage is dropped here.
                Reply::Swap(_) => {
                    self.pending_swap = None;
                    self.events.push(PlayerEvent::Swapped);
                    if self.transition_end.is_none() {
                        self.events.push(PlayerEvent::TransitionOver);
                    }
                }
                Reply::Renewed(_) => self.renewing = false,
                Reply::Surveyed(survey) => self.surveys.add(*survey),
                Reply::NotFinite(node) => self.renew(None, node),
                Reply::Fault(node, fault) => self.on_fault(None, node, fault),
            }
        }
        while let Some((region, node, fault)) = self.workers.take_fault() {
            match fault {
                Some(fault) => self.on_fault(Some(region), node, fault),
                None => self.renew(Some(region), node),
            }
        }
        self.watch_levels();
        self.watch_silence();
        let played = self.shared.window.load(Acquire);
        if self.pending_swap.is_none() && self.transition_end.is_some_and(|end| played >= end) {
            self.end_transition();
        }
        std::mem::take(&mut self.events)
    }

    /// Replaces a node whose output is not finite by a new one; during a change it is reported again later.
    fn renew(&mut self, region: Option<usize>, node: usize) {
        if self.is_busy() || self.failed {
            return;
        }
        let regions = &self.playing.plan.regions;
        let number = region.unwrap_or(regions.len() - 1);
        let runnable = regions.get(number).and_then(|r| r.nodes.get(node)).map(|n| n.runnable);
        let (Some(Runnable::Node(n)), Some(prepared)) = (runnable, &self.playing.prepared) else { return };
        let Some(id) = prepared.source.graph.nodes.get(n).map(|node| node.id.clone()) else { return };
        let Ok(new) = prepared.site(self.timing.window_ticks()).build(n, &prepared.values) else { return };
        match region {
            Some(region) => self.workers.renew(region, node, new),
            None => self.renewing = self.commands.push(Command::Renew(node, new)).is_ok(),
        }
        if self.renewed.insert(id.clone()) {
            self.events.push(PlayerEvent::Renewed(id));
        }
    }

    fn on_fault(&mut self, region: Option<usize>, node: usize, fault: Fault) {
        self.failed = true;
        // After a fault there is silence, and nothing to fade.
        self.transition_end = None;
        let fault = self.diagnostic(region, node, fault);
        self.events.push(PlayerEvent::Failed(Box::new(fault)));
    }

    /// Replaces the transition by the new graph alone.
    fn end_transition(&mut self) {
        self.transition_end = None;
        let Some(prepared) = self.playing.prepared.take() else { return };
        // The nodes of the new graph have the same indices in the transition graph.
        let continued = prepared.draft.nodes.iter().map(|&n| (n, n)).collect();
        // A graph that was planned with its fades can be planned without them.
        let _ = self.swap(&prepared, SwapRequest { continued, ..SwapRequest::default() });
        self.playing.prepared = Some(prepared);
    }

    /// The diagnostic of a fault, from region (`None` for the callback) and index of the node.
    fn diagnostic(&self, region: Option<usize>, node: usize, fault: Fault) -> Diagnostic {
        let (plan, ids) = match &self.pending_swap {
            Some(pending) if !pending.workers_swapped => (&pending.plan, &pending.ids),
            _ => (&self.playing.plan, &self.playing.ids),
        };
        let region = region.unwrap_or(plan.regions.len() - 1);
        let runnable = plan.regions.get(region).and_then(|r| r.nodes.get(node)).map(|n| n.runnable);
        let id = match runnable {
            Some(Runnable::Node(n)) => ids.get(n).map(|id| id.trim_start_matches('~')),
            _ => None,
        };
        match self.graph().zip(id).and_then(|(graph, id)| Some((graph, graph.find(id)?))) {
            Some((graph, n)) => {
                let location = graph.location(n, fault.field.as_deref());
                Diagnostic::of_fault(fault, location, &graph.nodes[n].id)
            }
            None => Diagnostic::general(fault.code, fault.message),
        }
    }
}
