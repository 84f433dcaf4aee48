//! From a checked graph to what is known before it runs: delays, buffers, memory, phases and parallel parts.
//!
//! [`Plan::new`] shapes every node, then finds for each how far behind the run it works:
//! `D(v) = max over inputs (D(u) + lag(u) + ahead(v))`, so that in topological order every node can always run.

mod again;
mod layout;
mod live;
mod phases;
mod schedule;
mod show;

pub use layout::{BufferPlan, DEPTH, Export, Import, PlanIn, PlanNode, PlanOut, Region, TapPlan, What};
pub use live::{Draft, Heard, LivePlan, SinksResume, ahead};
pub use schedule::{Cause, Delays, Resume};
pub use show::size;

use crate::diag::Diagnostic;
use crate::graph::Graph;
use foley_nodes::core::files::Files;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::Tick;
use layout::Parts;

/// How a graph is to be run.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanOptions {
    /// Length of one window, ticks.
    pub window: Tick,
    /// Threads that compute.
    pub threads: usize,
    /// Where an endless graph is stopped.
    pub until: Option<Tick>,
    /// Compute time per window, nanoseconds, below which a part of its own is not worth its hand-over.
    pub worth: f64,
    /// Most bytes that buffers may take.
    pub memory: usize,
    /// Outputs to write to files: node and port.
    pub taps: Vec<(usize, usize)>,
}

/// The default window: long enough to pay for handing it over, short enough to stay in the cache.
pub const WINDOW: Tick = foley_nodes::core::time::TICKS_PER_SECOND / 50;

impl Default for PlanOptions {
    fn default() -> Self {
        Self { window: WINDOW, threads: 1, worth: 200_000.0, until: None, memory: 4 << 30, taps: Vec::new() }
    }
}

/// One pass over the streams: everything that has to end before the folds of the next phase have their inputs.
#[derive(Debug)]
pub struct Phase {
    /// Parts that run in parallel, in topological order.
    pub regions: Vec<Region>,
    /// Nodes with streams, in topological order.
    pub nodes: Vec<usize>,
    /// Windows to run.
    pub windows: u64,
    /// How far behind the run each node works, and why.
    pub delays: Delays,
    /// Ticks until the last node has ended.
    pub duration: Tick,
    /// Bytes in buffers.
    pub bytes: usize,
}

impl Phase {
    /// Lays out a pass over some nodes, in topological order, with outputs to write: number, node and port of each.
    ///
    /// # Errors
    /// A graph that never ends.
    fn new(
        graph: &Graph,
        shapes: &[NodeShape],
        nodes: Vec<usize>,
        taps: &[(usize, (usize, usize))],
        window: Tick,
        options: &PlanOptions,
    ) -> Result<Self, Vec<Diagnostic>> {
        let delays = schedule::delays(graph, shapes, &nodes, window, &Resume::default());
        let duration = schedule::duration(graph, shapes, &nodes, &delays, options)?;
        let place = |&(tap, (node, port)): &(usize, (usize, usize))| TapPlan {
            tap,
            node,
            port,
            delay: delays.of[node] + shapes[node].lag,
            from: 0,
        };
        let taps: Vec<TapPlan> = taps.iter().map(place).collect();
        let parts = Parts { graph, shapes, nodes: &nodes, delays: &delays, taps: &taps, duration, window };
        let regions = layout::regions(&parts, &layout::cut(&parts, options.threads, options.worth));
        let bytes = regions.iter().map(Region::bytes).sum();
        let windows = (duration as u64).div_ceil(window as u64);
        Ok(Self { regions, nodes, windows, delays, duration, bytes })
    }
}

/// What is known of a graph before its passes are laid out.
struct Look {
    shapes: Vec<NodeShape>,
    split: phases::Split,
    window: Tick,
    errors: Vec<Diagnostic>,
}

impl Look {
    /// Shapes a graph; a node that fails hides nothing that does not depend on it.
    fn at(graph: &Graph, files: &dyn Files, options: &PlanOptions) -> Self {
        let schedule::Shaped { mut shapes, failed, mut errors } = schedule::shape_all(graph, files);
        if let Some(until) = options.until {
            schedule::cut(&mut shapes, until);
        }
        let split = phases::split(graph, &options.taps);
        // What is longer than the take would only be buffers that nothing fills; a take of next to nothing still has a tail.
        let longest = shapes.iter().filter_map(|s| s.end).max().unwrap_or(Tick::MAX);
        let mut window = options.window.min(longest.max(WINDOW)).max(1);
        for nodes in &split.phases {
            let sound: Vec<usize> = nodes.iter().copied().filter(|&n| !failed[n]).collect();
            match schedule::longest_window(graph, &shapes, &sound) {
                Ok(longest) => window = window.min(longest),
                Err(short) => errors.extend(short),
            }
            errors.extend(schedule::endless(graph, &shapes, &sound, options));
        }
        Self { shapes, split, window, errors }
    }
}

/// What else is wrong with a graph whose text is: with the [sound part](crate::graph::Loaded::sound) of it.
pub fn faults(sound: &Graph, files: &dyn Files, options: &PlanOptions) -> Vec<Diagnostic> {
    Look::at(sound, files, options).errors
}

/// All that is known of a run before it starts.
#[derive(Debug)]
pub struct Plan {
    /// Shape of each node of the graph.
    pub shapes: Vec<NodeShape>,
    /// Nodes that compute values, with the phase before which each can run.
    pub values: Vec<(usize, usize)>,
    /// Passes over the streams.
    pub phases: Vec<Phase>,
    /// Length of one window; shorter than asked for where a feedback loop needs it, or the take is shorter.
    pub window: Tick,
    /// Bytes in buffers, at most, at one time.
    pub bytes: usize,
    /// Most bytes that buffers may take: what the plan leaves of it is there for more events than were planned.
    pub limit: usize,
    /// Nodes that nothing uses.
    pub idle: Vec<usize>,
}

impl Plan {
    /// Plans a run.
    ///
    /// # Errors
    /// Every reason found why the graph cannot run: rates or formats that do not meet, loops that are too short, a graph
    /// without end, buffers beyond the memory limit.
    ///
    /// # Complexity
    /// O(nodes + links).
    pub fn new(graph: &Graph, files: &dyn Files, options: &PlanOptions) -> Result<Self, Vec<Diagnostic>> {
        let Look { shapes, split, window, errors } = Look::at(graph, files, options);
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
            let taps: Vec<_> = taps.collect();
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
            idle: split.idle,
        };
        let regions = plan.phases.iter().flat_map(|p| &p.regions);
        show::within(options.memory, bytes, graph, &plan.shapes, regions)?;
        Ok(plan)
    }

    /// How long the piece is: until the last node that writes or keeps something has ended.
    #[must_use]
    pub fn length(&self, graph: &Graph) -> Tick {
        let sinks = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty());
        let nodes: Vec<usize> = sinks.collect();
        let all = if nodes.is_empty() { (0..graph.nodes.len()).collect() } else { nodes };
        all.into_iter().filter_map(|n| self.shapes[n].end).max().unwrap_or(0)
    }
}
