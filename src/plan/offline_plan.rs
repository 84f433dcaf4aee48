//! The plan of a run: phases between folds, each laid out in regions.

use super::delays::{self, Continuation, Delays};
use super::options::{PlanOptions, WINDOW};
use super::region::Region;
use super::shapes::{self, Shaped};
use super::wiring::{self, Schedule, TapPlan};
use super::{memory, partition, phases};
use crate::diag::Diagnostic;
use crate::graph::Graph;
use foley_nodes::core::files::Files;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::Tick;

/// One pass over the streams, which ends before the folds of the next phase have their inputs.
#[derive(Debug)]
pub struct Phase {
    /// Regions that run in parallel, in topological order.
    pub regions: Vec<Region>,
    /// Nodes with streams, in topological order.
    pub nodes: Vec<usize>,
    /// Number of windows.
    pub windows: u64,
    /// Delay of each node, and its cause.
    pub delays: Delays,
    /// Ticks until the last node has ended.
    pub duration: Tick,
    /// Bytes of all buffers.
    pub bytes: usize,
}

impl Phase {
    /// Lays out some nodes, in topological order, with outputs to write: number, node and port of each.
    ///
    /// # Errors
    /// A graph that never ends.
    pub(super) fn new(
        graph: &Graph,
        shapes: &[NodeShape],
        nodes: Vec<usize>,
        taps: &[(usize, (usize, usize))],
        window: Tick,
        options: &PlanOptions,
    ) -> Result<Self, Vec<Diagnostic>> {
        let delays = delays::delays(graph, shapes, &nodes, window, &Continuation::default());
        let duration = delays::duration(graph, shapes, &nodes, &delays, options)?;
        let tap = |&(tap, (node, port)): &(usize, (usize, usize))| TapPlan {
            tap,
            node,
            port,
            delay: delays.of[node] + shapes[node].lag,
            from: 0,
        };
        let taps: Vec<TapPlan> = taps.iter().map(tap).collect();
        let schedule =
            Schedule { graph, shapes, nodes: &nodes, delays: &delays, taps: &taps, duration, window };
        let region_of = partition::by_work(&schedule, options.threads, options.min_region_ns);
        let regions = wiring::wire(&schedule, &region_of);
        let bytes = regions.iter().map(Region::bytes).sum();
        let windows = (duration as u64).div_ceil(window as u64);
        Ok(Self { regions, nodes, windows, delays, duration, bytes })
    }
}

/// The shapes, phases and window of a graph, before its phases are laid out.
struct Analysis {
    shapes: Vec<NodeShape>,
    split: phases::Split,
    window: Tick,
    errors: Vec<Diagnostic>,
}

impl Analysis {
    /// Shapes a graph; errors of nodes that do not depend on a failed one are found as well.
    fn of(graph: &Graph, files: &dyn Files, options: &PlanOptions) -> Self {
        let Shaped { mut shapes, failed, mut errors } = shapes::shape_all(graph, files);
        if let Some(until) = options.until {
            shapes::truncate(&mut shapes, until);
        }
        let split = phases::split(graph, &options.taps);
        // A window longer than the piece only takes memory. A very short piece still has a tail, hence the minimum.
        let longest = shapes.iter().filter_map(|s| s.end).max().unwrap_or(Tick::MAX);
        let mut window = options.window.min(longest.max(WINDOW)).max(1);
        for nodes in &split.phases {
            let sound: Vec<usize> = nodes.iter().copied().filter(|&n| !failed[n]).collect();
            match delays::longest_window(graph, &shapes, &sound) {
                Ok(longest) => window = window.min(longest),
                Err(short) => errors.extend(short),
            }
            errors.extend(delays::endless(graph, &shapes, &sound, options));
        }
        Self { shapes, split, window, errors }
    }
}

/// Shapes of the [sound part](crate::graph::Loaded::sound) of a graph, empty for nodes that failed, and the errors that planning finds in it.
pub fn sound_shapes(
    sound: &Graph,
    files: &dyn Files,
    options: &PlanOptions,
) -> (Vec<NodeShape>, Vec<Diagnostic>) {
    let Analysis { shapes, errors, .. } = Analysis::of(sound, files, options);
    (shapes, errors)
}

/// The plan of a run.
#[derive(Debug)]
pub struct Plan {
    /// Shape of each node of the graph.
    pub shapes: Vec<NodeShape>,
    /// Nodes that compute values, with the phase before which each can run.
    pub values: Vec<(usize, usize)>,
    /// Passes over the streams.
    pub phases: Vec<Phase>,
    /// Length of one window; shorter than requested if a feedback loop requires it, or if the piece is shorter.
    pub window: Tick,
    /// Maximum bytes of all buffers at one time.
    pub bytes: usize,
    /// Memory limit of the buffers, bytes; the rest of it is for more events than were planned.
    pub limit: usize,
    /// Unused nodes.
    pub unused: Vec<usize>,
}

impl Plan {
    /// Plans a run.
    ///
    /// # Errors
    /// Every reason found why the graph cannot run: rates or formats that do not match, loops that are too short, a graph
    /// without end, buffers beyond the memory limit.
    ///
    /// # Complexity
    /// O(nodes + links).
    pub fn new(graph: &Graph, files: &dyn Files, options: &PlanOptions) -> Result<Self, Vec<Diagnostic>> {
        let Analysis { shapes, split, window, errors } = Analysis::of(graph, files, options);
        if !errors.is_empty() {
            return Err(errors);
        }
        let mut phases = Vec::new();
        for (k, nodes) in split.phases.iter().enumerate() {
            if nodes.is_empty() {
                continue;
            }
            // Values are written when the run has ended; only streams and events need a writer that runs along.
            let runs = |n: usize, port: usize| {
                let kind = graph.nodes[n].ty.outputs[port].kind;
                split.phase_of[n] == k && matches!(kind, PortKind::Stream(_) | PortKind::Events(_))
            };
            let taps = options.taps.iter().copied().enumerate().filter(|(_, (n, p))| runs(*n, *p));
            // Of the phases in which a node runs, the last one runs to the end of the piece.
            let last = |n: usize| split.phases.iter().rposition(|nodes| nodes.contains(&n)) == Some(k);
            let observed = (options.taps.len()..).zip(options.observed.iter().copied());
            let taps: Vec<_> = taps.chain(observed.filter(|(_, (n, _))| last(*n))).collect();
            phases.push(Phase::new(graph, &shapes, nodes.clone(), &taps, window, options)?);
        }
        let bytes = phases.iter().map(|p| p.bytes).max().unwrap_or(0);
        let plan = Self {
            shapes,
            values: split.values,
            phases,
            window,
            bytes,
            limit: options.memory,
            unused: split.unused,
        };
        let regions = plan.phases.iter().flat_map(|p| &p.regions);
        memory::check_limit(options.memory, bytes, graph, &plan.shapes, regions)?;
        Ok(plan)
    }

    /// Lays out a phase again for fewer nodes, in topological order, and with more taps: number, node and port of each.
    ///
    /// `graph` is the planned graph, in which nodes whose outputs are read from the cache may have lost their inputs. Only
    /// the first `planned_taps` taps determine the duration, as in the plan.
    ///
    /// # Errors
    /// A graph that never ends.
    pub fn replan_phase(
        &self,
        graph: &Graph,
        nodes: Vec<usize>,
        taps: &[(usize, (usize, usize))],
        planned_taps: usize,
        threads: usize,
    ) -> Result<Phase, Vec<Diagnostic>> {
        let planned = taps.iter().take(planned_taps).map(|(_, tap)| *tap).collect();
        let options = PlanOptions { window: self.window, threads, taps: planned, ..PlanOptions::default() };
        Phase::new(graph, &self.shapes, nodes, taps, self.window, &options)
    }

    /// Returns the length of the piece: the end of the last node that writes, or of the last node if none does.
    #[must_use]
    pub fn length(&self, graph: &Graph) -> Tick {
        let sinks = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty());
        let nodes: Vec<usize> = sinks.collect();
        let all = if nodes.is_empty() { (0..graph.nodes.len()).collect() } else { nodes };
        all.into_iter().filter_map(|n| self.shapes[n].end).max().unwrap_or(0)
    }
}
