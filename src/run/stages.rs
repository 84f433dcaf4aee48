//! Makes the stages of a phase from its plan: buffers, nodes and wires.

use super::cached_streams::CachedStreams;
use super::{Job, Values, tap_writers};
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link};
use crate::plan::{BufferPlan, PlanInput, PlanNode, PlanOutput, Region, Runnable};
use foley_nodes::core::buffer::{AnyBuffer, Budget};
use foley_nodes::core::computation::{Background, Monitor, NotStored, Partial, unmonitored};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::files::{Files, Outputs};
use foley_nodes::core::input::{Inputs, NoInputs};
use foley_nodes::core::node::DynNode;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::random::Random;
use foley_nodes::core::shape::{Build, LinkShape, NodeShape};
use foley_nodes::core::stage::{Stage, StageNode};
use foley_nodes::core::time::Tick;
use std::sync::{Arc, LazyLock};

/// Runs work on a thread of its own; without a thread the work is dropped, and the receiver of its result finds the channel closed.
static BACKGROUND: LazyLock<Background> = LazyLock::new(|| {
    Arc::new(|work| drop(std::thread::Builder::new().name("background".into()).spawn(work)))
});

/// Everything that nodes are built from.
pub struct BuildSite<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Shapes of its nodes.
    pub shapes: &'a [NodeShape],
    /// Longest window, ticks.
    pub window: Tick,
    /// The files that nodes read.
    pub files: &'a dyn Files,
    /// The files that nodes write.
    pub outputs: &'a dyn Outputs,
    /// Messages that arrive while the graph plays.
    pub inputs: &'a dyn Inputs,
    /// Seed of the graph.
    pub seed: u64,
    /// Watches long computations.
    pub monitor: &'a Monitor<'a>,
    /// Partial results of interrupted computations.
    pub partial: &'a dyn Partial,
}

impl<'a> BuildSite<'a> {
    /// The site of an offline run.
    #[must_use]
    pub fn of(job: &'a Job<'_>) -> Self {
        let (graph, shapes, window) = (job.graph, &job.plan.shapes, job.plan.window);
        let (files, outputs) = (job.files, job.outputs);
        Self {
            graph,
            shapes,
            window,
            files,
            outputs,
            inputs: &NoInputs,
            seed: job.seed,
            monitor: &unmonitored,
            partial: &NotStored,
        }
    }

    /// The shapes of the links of a node, with the values that are known.
    #[must_use]
    pub fn links(&self, n: usize, values: &Values) -> Vec<Vec<LinkShape>> {
        let graph = self.graph;
        let one = |l: &Link| match graph.nodes[l.node].ty.outputs[l.port].kind {
            PortKind::Stream(_) => self.shapes[l.node].outputs[l.port].clone().map(LinkShape::Stream),
            PortKind::Events(_) => Some(LinkShape::Events(self.shapes[l.node].end)),
            PortKind::Value(_) | PortKind::Fold(_) => {
                Some(LinkShape::Value(values.get(&(l.node, l.port)).cloned()))
            }
        };
        graph.nodes[n].links.iter().map(|links| links.iter().filter_map(one).collect()).collect()
    }

    /// The context in which a node is built over these links.
    #[must_use]
    pub fn build_cx<'b>(&'b self, n: usize, links: &'b [Vec<LinkShape>]) -> Build<'b> {
        Build {
            random: Random::new(self.seed, &self.graph.nodes[n].id),
            links,
            shape: &self.shapes[n],
            window: self.window,
            files: self.files,
            outputs: self.outputs,
            inputs: self.inputs,
            monitor: self.monitor,
            partial: self.partial,
            background: &BACKGROUND,
        }
    }

    /// Makes a node.
    ///
    /// # Errors
    /// Its fault, with its source location.
    pub fn build(&self, n: usize, values: &Values) -> Result<Box<dyn DynNode>, Diagnostic> {
        let node = &self.graph.nodes[n];
        let links = self.links(n, values);
        node.ty.build(&*node.params, &self.build_cx(n, &links)).map_err(|fault| self.diagnostic(n, fault))
    }

    /// The diagnostic of a fault of a node.
    fn diagnostic(&self, n: usize, fault: Fault) -> Diagnostic {
        let location = self.graph.location(n, fault.field.as_deref());
        Diagnostic::of_fault(fault, location, &self.graph.nodes[n].id)
    }
}

/// Makes a buffer; event buffers grow within the budget.
pub fn buffer(plan: &BufferPlan, budget: &Budget) -> Box<dyn AnyBuffer> {
    let (mut buffer, first) = match plan {
        BufferPlan::Items { item, width, capacity, front, pad, first } => {
            ((item.buffer)(*width, *capacity, *front, *pad), *first)
        }
        BufferPlan::Events { event, capacity, first } => ((event.buffer)(*capacity, budget), *first),
    };
    buffer.begin(first);
    buffer
}

/// Makes the stage of one region.
///
/// # Errors
/// The faults of all nodes that could not be built.
pub fn stage(job: &Job<'_>, region: &Region, values: &Values) -> Result<Stage, Vec<Diagnostic>> {
    stage_with(job, region, values, &CachedStreams::default(), &Budget::default())
}

/// Makes the stage of one region, with streams that are read from the cache or written to it.
///
/// # Errors
/// The faults of all nodes that could not be built.
pub(super) fn stage_with(
    job: &Job<'_>,
    region: &Region,
    values: &Values,
    streams: &CachedStreams,
    budget: &Budget,
) -> Result<Stage, Vec<Diagnostic>> {
    let site = BuildSite::of(job);
    let stage = assemble(region, values, budget, |runnable| match runnable {
        Runnable::Node(n) => match streams.reader(n) {
            Some(reader) => reader.map_err(|fault| site.diagnostic(n, fault)),
            None => site.build(n, values),
        },
        Runnable::Tap(k) => streams.writer(k).map_or_else(|| tap_writers::writer(job, k), Ok),
    });
    stage.map(|mut stage| {
        stage.set_activity();
        stage
    })
}

/// Makes the stage of one region from the nodes that `make` returns.
///
/// # Errors
/// All errors of `make`.
pub fn assemble(
    region: &Region,
    values: &Values,
    budget: &Budget,
    mut make: impl FnMut(Runnable) -> Result<Box<dyn DynNode>, Diagnostic>,
) -> Result<Stage, Vec<Diagnostic>> {
    let mut nodes = Vec::new();
    let mut errors = Vec::new();
    for plan in &region.nodes {
        match make(plan.runnable) {
            Ok(node) => nodes.push(wire_node(plan, node, values)),
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut stage = Stage::new(
        region.buffers.iter().map(|plan| buffer(plan, budget)).collect(),
        region.clocks.clone(),
        nodes,
    );
    stage.set_timed(true);
    Ok(stage)
}

fn wire_node(plan: &PlanNode, node: Box<dyn DynNode>, values: &Values) -> StageNode {
    let input = |wire: &PlanInput| wire.with_value(|at| values.get(at).cloned());
    StageNode {
        node,
        clock: plan.clock,
        inputs: plan.inputs.iter().map(|links| links.iter().filter_map(input).collect()).collect(),
        outputs: plan.outputs.iter().map(PlanOutput::with_room).collect(),
        copies: plan.copies.clone(),
    }
}
