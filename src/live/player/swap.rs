//! Swaps of the running graph: assembled here, done by the callback at the start of a window.

use super::Player;
use crate::diag::Diagnostic;
use crate::live::PlayerEvent;
use crate::live::playback::assembly::{Assembly, Placeholder};
use crate::live::playback::callback::{Command, Retunes, Swap};
use crate::live::playback::workers::WorkerRegion;
use crate::live::reload::prepared::PreparedGraph;
use crate::live::reload::state_transfer::{IndexPairs, OutputPairs, StateTransfer, buffer_pairs, locate};
use crate::live::reload::transition::TransitionGraph;
use crate::plan::{Continuation, Draft, LivePlan, Region, Runnable, SinkContinuation};
use crate::run::BuildSite;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::time::Tick;
use std::collections::HashMap;
use std::sync::atomic::Ordering::Acquire;
use std::time::{Duration, Instant};

/// The changes of a swap; by default no node continues.
#[derive(Default)]
pub struct SwapRequest {
    /// The transition to the new graph; `None` for the new graph alone.
    pub transition: Option<TransitionGraph>,
    /// Old index of the nodes that continue, by new index.
    pub continued: HashMap<usize, usize>,
    /// New nodes that are built already.
    pub built: HashMap<usize, Box<dyn DynNode>>,
    /// New parameters, by index of the node in the new graph.
    pub retunes: Retunes,
}

/// A swap in transit to the callback, with everything to repeat it.
pub struct PendingSwap {
    /// The plan that the callback plays until then.
    pub plan: LivePlan,
    /// Ids of its nodes.
    pub ids: Vec<String>,
    successor_seeds: OutputPairs,
    transition: Option<TransitionGraph>,
    continued: HashMap<usize, usize>,
    /// True if the workers run the new graph already.
    pub workers_swapped: bool,
}

/// Histories that move between outputs, and pairs of nodes; the second adopts the state of the first.
struct Handover<'a> {
    fade_seeds: &'a OutputPairs,
    successor_seeds: &'a OutputPairs,
    adoptions: &'a IndexPairs,
}

impl Player {
    /// Returns the first window at which a swap that is assembled now can be done, at most `max` windows from now.
    fn earliest_window(&self, max: u64) -> u64 {
        let window_seconds = self.timing.quantum as f64 / self.timing.rate.as_f64();
        let margin = (3.0 * self.assembly_time.as_secs_f64() / window_seconds).ceil() as u64 + 2;
        self.shared.window.load(Acquire) + margin.min(max)
    }

    /// Assembles `next`, or the transition to it, and sends it to the callback.
    ///
    /// Everything that does not depend on the time is done before, since the callback approaches the window of the swap.
    pub(super) fn swap(&mut self, next: &PreparedGraph, request: SwapRequest) -> Result<(), Vec<Diagnostic>> {
        let SwapRequest { mut transition, continued, built, retunes } = request;
        let start = Instant::now();
        let mut window = self.earliest_window(u64::MAX);
        let mut plan = self.plan_swap(next, transition.as_ref(), &continued, window)?;
        let mut stopped = None;
        if !self.workers_continue(&plan, &continued) {
            let mut regions = self.workers.halt();
            let furthest = regions.iter().map(|region| region.window).max().unwrap_or(0);
            if continued.is_empty() {
                window = self.earliest_window(u64::MAX);
            } else {
                // Workers cannot be further ahead than `depth`: the rings have no room for more windows.
                window = self.earliest_window(self.timing.depth).max(furthest);
                self.workers.align(&mut regions, window);
            }
            plan = self.plan_swap(next, transition.as_ref(), &continued, window)?;
            stopped = Some(regions);
        }
        let tick = self.timing.window_start(window);
        let end = transition.as_mut().map(|transition| transition.set_fades(&plan.delays, tick));
        let adoptions = transition.as_ref().map(|t| t.adoptions.clone()).unwrap_or_default();
        let fade_seeds = transition.as_ref().map(TransitionGraph::fade_seeds).unwrap_or_default();
        let successor_seeds = std::mem::take(&mut self.successor_seeds);
        let graph = transition.as_ref().map_or(&next.source.graph, |t| &t.graph);
        let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
        let window_ticks = self.timing.window_ticks();
        let assembly = Assembly {
            plan: &plan,
            ids: &ids,
            site: BuildSite { graph, shapes: &plan.prelude.shapes, ..next.site(window_ticks) },
            values: transition.as_ref().map_or(&next.values, |t| &t.values),
            built,
            continued: &continued,
            timing: self.timing,
            metered: self.options.metered,
        };
        let (stage, regions) = match assembly.build(window, &mut self.times) {
            Ok(assembled) => assembled,
            Err(errors) => {
                self.workers.start(stopped.unwrap_or_default());
                return Err(errors);
            }
        };
        let transfer = StateTransfer { old: &self.playing.plan, new: &plan, continued: &continued };
        let handover =
            Handover { fade_seeds: &fade_seeds, successor_seeds: &successor_seeds, adoptions: &adoptions };
        let workers_swapped = stopped.is_some();
        let mut links = Vec::new();
        match stopped {
            None => links = transfer.links(),
            Some(stopped) => {
                self.workers.start(transfer_to_workers(&transfer, &handover, &retunes, stopped, regions));
            }
        }
        let last = plan.regions.len() - 1;
        let (nodes, buffers) = transfer.between(self.playing.plan.regions.len() - 1, last);
        let (in_callback, on_workers): (Vec<_>, Vec<_>) = retunes
            .into_iter()
            .filter_map(|(n, params)| Some((locate(&plan, Runnable::Node(n))?, params)))
            .partition(|((region, _), _)| *region == last);
        if !workers_swapped {
            for ((region, node), params) in on_workers {
                self.workers.retune(region, node, params);
            }
        }
        let (old_region, region) = (self.playing.plan.callback_region(), plan.callback_region());
        let swap = Swap {
            window,
            next: stage,
            nodes,
            buffers,
            fade_seeds: buffer_pairs(old_region, region, &fade_seeds),
            successor_seeds: buffer_pairs(old_region, region, &successor_seeds),
            links,
            adoptions: transfer.adoptions(last, &adoptions),
            retunes: in_callback.into_iter().map(|((_, node), params)| (node, params)).collect(),
            discontinuous: continued.is_empty(),
            late: false,
        };
        // The ring is empty before each load.
        let _ = self.commands.push(Command::Swap(Box::new(swap)));
        self.failed = false;
        self.surveys.begin_again();
        self.transition_end = end.map(|end: Tick| (end / window_ticks.max(1)) as u64 + 2);
        self.successor_seeds = transition.as_ref().map(TransitionGraph::successor_seeds).unwrap_or_default();
        let plan = std::mem::replace(&mut self.playing.plan, plan);
        let ids = std::mem::replace(&mut self.playing.ids, ids);
        self.pending_swap =
            Some(PendingSwap { plan, ids, successor_seeds, transition, continued, workers_swapped });
        let limit = Duration::from_millis(200);
        self.assembly_time = (self.assembly_time / 2).max(start.elapsed()).min(limit);
        Ok(())
    }

    /// Plans the new graph, or the transition to it, so that it continues the running graph at a window.
    fn plan_swap(
        &self,
        next: &PreparedGraph,
        transition: Option<&TransitionGraph>,
        continued: &HashMap<usize, usize>,
        window: u64,
    ) -> Result<LivePlan, Vec<Diagnostic>> {
        let at = self.timing.window_start(window);
        let (graph, shapes) = match transition {
            Some(transition) => (&transition.graph, transition.shapes.clone()),
            None => (&next.source.graph, next.draft.prelude.shapes.clone()),
        };
        let old = &self.playing.plan;
        let first_tick = |delay: Tick, from: Tick| from.max(at - delay);
        let nodes = continued.iter().map(|(&n, &m)| {
            let (delay, from) = (old.delays.of[m], old.delays.from[m]);
            (n, (delay, first_tick(delay, from)))
        });
        let continuation = Continuation { at, nodes: nodes.collect() };
        let sinks = old.sinks.iter().zip(&old.taps);
        let sink_continuation = SinkContinuation {
            delay: old.taps.iter().map(|tap| tap.delay).max().unwrap_or(0),
            sinks: sinks.map(|(sink, tap)| (sink.id.clone(), first_tick(tap.delay, tap.from))).collect(),
        };
        let draft = Draft::from_shapes(graph, shapes, next.draft.prelude.limit)?;
        draft.plan(graph, self.timing.window_ticks(), &continuation, &sink_continuation)
    }

    /// Returns true if all regions on workers can continue unchanged.
    fn workers_continue(&self, plan: &LivePlan, continued: &HashMap<usize, usize>) -> bool {
        let old = &self.playing.plan;
        let transfer = StateTransfer { old, new: plan, continued };
        let runnables = |r: &Region| r.nodes.iter().map(|n| n.runnable).collect::<Vec<_>>();
        let old_runnable = |runnable: &Runnable| match runnable {
            Runnable::Node(n) => continued.get(n).map(|&m| Runnable::Node(m)),
            Runnable::Tap(_) => None,
        };
        let same = |(a, b): (&Region, &Region)| {
            let continues: Option<Vec<Runnable>> = runnables(b).iter().map(old_runnable).collect();
            continues == Some(runnables(a))
                && a.exports.len() == b.exports.len()
                && a.buffers.len() == b.buffers.len()
        };
        let imports = plan.callback_region().imports.len();
        old.regions.len() == plan.regions.len()
            && old.worker_regions().iter().zip(plan.worker_regions()).all(same)
            && transfer.links().len() == imports
            && old.callback_region().imports.len() == imports
    }

    /// Assembles a swap again that reached the callback after its window.
    ///
    /// If the workers run the new graph already, they cannot return, and the graph begins again.
    pub(super) fn retry(&mut self, mut late: Swap) {
        let (min, max) = (Duration::from_millis(2), Duration::from_millis(200));
        self.assembly_time = (self.assembly_time * 4).clamp(min, max);
        let (Some(pending), Some(prepared)) = (self.pending_swap.take(), self.playing.prepared.take()) else {
            return;
        };
        let late_plan = std::mem::replace(&mut self.playing.plan, pending.plan);
        (self.playing.ids, self.successor_seeds, self.transition_end) =
            (pending.ids, pending.successor_seeds, None);
        let result = if pending.workers_swapped || self.failed {
            self.successor_seeds = OutputPairs::new();
            self.swap(&prepared, SwapRequest::default())
        } else {
            let node_at = |index: usize| match late_plan.callback_region().nodes.get(index)?.runnable {
                Runnable::Node(n) => Some(n),
                Runnable::Tap(_) => None,
            };
            let retunes = std::mem::take(&mut late.retunes).into_iter();
            let retunes = retunes.filter_map(|(index, params)| Some((node_at(index)?, params))).collect();
            let mut built = HashMap::new();
            for (index, node) in late.next.stage.nodes_mut().iter_mut().enumerate() {
                if let Some(n) = node_at(index).filter(|n| !pending.continued.contains_key(n)) {
                    built.insert(n, std::mem::replace(&mut node.node, Box::new(Placeholder)));
                }
            }
            // The cross-fades begin at another time.
            let fades = pending.transition.as_ref().map(TransitionGraph::fade_nodes).unwrap_or_default();
            fades.iter().for_each(|n| drop(built.remove(n)));
            let (transition, continued) = (pending.transition, pending.continued);
            self.swap(&prepared, SwapRequest { transition, continued, built, retunes })
        };
        if let Err(errors) = result {
            self.events.extend(errors.into_iter().map(|e| PlayerEvent::Failed(Box::new(e))));
            self.failed = true;
        }
        self.playing.prepared = Some(prepared);
    }
}

/// Moves nodes, buffers and histories from stopped regions to new ones.
fn transfer_to_workers(
    transfer: &StateTransfer<'_>,
    handover: &Handover<'_>,
    retunes: &Retunes,
    mut stopped: Vec<WorkerRegion>,
    mut regions: Vec<WorkerRegion>,
) -> Vec<WorkerRegion> {
    for region in &mut regions {
        let stage = &mut region.stage;
        for old in &mut stopped {
            let old_plan = &transfer.old.regions[old.number];
            let plan = &transfer.new.regions[region.number];
            let (nodes, buffers) = transfer.between(old.number, region.number);
            for (from, to) in buffer_pairs(old_plan, plan, handover.fade_seeds) {
                stage.seed(&mut old.stage, from, to);
            }
            stage.take_over(&mut old.stage, &nodes, &buffers);
            for (from, to) in buffer_pairs(old_plan, plan, handover.successor_seeds) {
                stage.seed(&mut old.stage, from, to);
            }
        }
        for (from, to) in transfer.adoptions(region.number, handover.adoptions) {
            stage.adopt(from, to);
        }
        for (n, params) in retunes {
            if let Some((number, node)) = locate(transfer.new, Runnable::Node(*n))
                && number == region.number
            {
                stage.nodes_mut()[node].node.retune(&**params);
            }
        }
    }
    regions
}
