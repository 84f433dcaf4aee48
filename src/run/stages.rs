//! Makes the stages of a phase from its plan: buffers, nodes and wires.

use super::kept::Streams;
use super::{Job, Values, tap};
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link};
use crate::plan::{BufferPlan, PlanIn, PlanNode, PlanOut, Region, What};
use foley_nodes::core::buffer::{AnyBuffer, Budget};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::files::{Files, Outputs};
use foley_nodes::core::input::{Inputs, NoInputs};
use foley_nodes::core::node::DynNode;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::random::Random;
use foley_nodes::core::shape::{Build, LinkShape, NodeShape};
use foley_nodes::core::stage::{InWire, OutWire, Stage, StageNode};
use foley_nodes::core::time::Tick;
use std::cell::RefCell;

/// What nodes are built from.
pub struct Site<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Shapes of its nodes.
    pub shapes: &'a [NodeShape],
    /// Longest window, ticks.
    pub window: Tick,
    /// Where inputs come from.
    pub files: &'a dyn Files,
    /// Where outputs go.
    pub outputs: &'a dyn Outputs,
    /// What comes in while the graph plays.
    pub inputs: &'a dyn Inputs,
    /// Seed of the graph.
    pub seed: u64,
}

impl<'a> Site<'a> {
    /// Where the nodes of an offline run are built.
    #[must_use]
    pub fn of(job: &'a Job<'_>) -> Self {
        let (graph, shapes, window) = (job.graph, &job.plan.shapes, job.plan.window);
        let (files, outputs) = (job.files, job.outputs);
        Self { graph, shapes, window, files, outputs, inputs: &NoInputs, seed: job.seed }
    }

    /// The links of a node with the values that are known by now.
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

    /// What a node finds when it is built over these links.
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
        }
    }

    /// Makes a node.
    ///
    /// # Errors
    /// Its fault, with its place in the text.
    pub fn build(&self, n: usize, values: &Values) -> Result<Box<dyn DynNode>, Diagnostic> {
        let node = &self.graph.nodes[n];
        let links = self.links(n, values);
        node.ty.build(&*node.params, &self.build_cx(n, &links)).map_err(|fault| self.told(n, fault))
    }

    /// A fault of a node with its place in the text.
    fn told(&self, n: usize, fault: Fault) -> Diagnostic {
        let place = self.graph.place(n, fault.field.as_deref());
        Diagnostic::of_fault(fault, place, &self.graph.nodes[n].id)
    }
}

/// Makes a buffer; events grow as far as the budget goes.
pub fn buffer(plan: &BufferPlan, budget: &Budget) -> Box<dyn AnyBuffer> {
    let (mut buffer, at) = match plan {
        BufferPlan::Items { item, width, span, front, pad, at } => {
            ((item.buffer)(*width, *span, *front, *pad), *at)
        }
        BufferPlan::Events { event, span, at } => ((event.buffer)(*span, budget), *at),
    };
    buffer.begin(at);
    buffer
}

/// Makes the stage of one region.
///
/// # Errors
/// The faults of all nodes that could not be built.
pub fn stage(job: &Job<'_>, region: &Region, values: &Values) -> Result<Stage, Vec<Diagnostic>> {
    stage_with(job, region, values, &Streams::default(), &Budget::default())
}

/// The same, with streams that are read and written in place of nodes and taps.
///
/// # Errors
/// The faults of all nodes that could not be built.
pub(super) fn stage_with(
    job: &Job<'_>,
    region: &Region,
    values: &Values,
    streams: &Streams,
    budget: &Budget,
) -> Result<Stage, Vec<Diagnostic>> {
    let site = Site::of(job);
    assemble(region, values, budget, |what| match what {
        What::Node(n) => match streams.reader(n) {
            Some(reader) => reader.map_err(|fault| site.told(n, fault)),
            None => site.build(n, values),
        },
        What::Tap(k) => streams.writer(k).map_or_else(|| tap::writer(job, k), Ok),
    })
}

/// Makes the stage of one region out of nodes that `make` gives.
///
/// # Errors
/// All that `make` refuses.
pub fn assemble(
    region: &Region,
    values: &Values,
    budget: &Budget,
    mut make: impl FnMut(What) -> Result<Box<dyn DynNode>, Diagnostic>,
) -> Result<Stage, Vec<Diagnostic>> {
    let mut nodes = Vec::new();
    let mut errors = Vec::new();
    for plan in &region.nodes {
        match make(plan.job) {
            Ok(node) => nodes.push(wired(plan, node, values)),
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

fn wired(plan: &PlanNode, node: Box<dyn DynNode>, values: &Values) -> StageNode {
    let input = |wire: &PlanIn| match wire {
        PlanIn::Stream { buffer, clock, behind, ahead, delay, width, rate } => Some(InWire::Stream {
            buffer: *buffer,
            clock: *clock,
            behind: *behind,
            ahead: *ahead,
            delay: *delay,
            width: *width,
            rate: *rate,
        }),
        PlanIn::Events { buffer, clock, behind, ahead } => {
            Some(InWire::Events { buffer: *buffer, clock: *clock, behind: *behind, ahead: *ahead })
        }
        PlanIn::Value { node, port } => values.get(&(*node, *port)).cloned().map(InWire::Value),
    };
    let output = |wire: &PlanOut| match wire {
        PlanOut::Stream { buffer, clock, width, rate } => {
            OutWire::Stream { buffer: *buffer, clock: *clock, width: *width, rate: *rate }
        }
        PlanOut::Events { buffer, clock } => OutWire::Events { buffer: *buffer, clock: *clock },
        PlanOut::Value => OutWire::Value(RefCell::default()),
    };
    StageNode {
        node,
        clock: plan.clock,
        inputs: plan.inputs.iter().map(|links| links.iter().filter_map(input).collect()).collect(),
        outputs: plan.outputs.iter().map(output).collect(),
        copies: plan.copies.clone(),
    }
}
