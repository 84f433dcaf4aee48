//! Makes the stages of a phase from its plan: buffers, nodes and wires.

use super::kept::Streams;
use super::{Job, Values, tap};
use crate::diag::Diagnostic;
use crate::graph::Link;
use crate::plan::{PlanIn, PlanNode, PlanOut, Region, TrackPlan, What};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::random::Random;
use foley_nodes::core::shape::{Build, LinkShape};
use foley_nodes::core::stage::{InWire, OutWire, Stage, StageNode};
use foley_nodes::core::track::AnyTrack;
use std::cell::RefCell;

/// The links of a node with the values that are known by now.
pub fn links_with_values(job: &Job<'_>, n: usize, values: &Values) -> Vec<Vec<LinkShape>> {
    let graph = job.graph;
    let one = |l: &Link| match graph.nodes[l.node].ty.outputs[l.port].kind {
        PortKind::Stream(_) => job.plan.shapes[l.node].outputs[l.port].clone().map(LinkShape::Stream),
        PortKind::Events(_) => Some(LinkShape::Events(job.plan.shapes[l.node].end)),
        PortKind::Value(_) | PortKind::Fold(_) => {
            Some(LinkShape::Value(values.get(&(l.node, l.port)).cloned()))
        }
    };
    graph.nodes[n].links.iter().map(|links| links.iter().filter_map(one).collect()).collect()
}

/// Makes a buffer.
pub fn track(plan: &TrackPlan) -> Box<dyn AnyTrack> {
    match plan {
        TrackPlan::Items { item, width, span, front, pad } => (item.track)(*width, *span, *front, *pad),
        TrackPlan::Events { event, span } => (event.track)(*span),
    }
}

/// Makes the stage of one region.
///
/// # Errors
/// The faults of all nodes that could not be built.
pub fn stage(job: &Job<'_>, region: &Region, values: &Values) -> Result<Stage, Vec<Diagnostic>> {
    stage_with(job, region, values, &Streams::default())
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
) -> Result<Stage, Vec<Diagnostic>> {
    let mut nodes = Vec::new();
    let mut errors = Vec::new();
    for plan in &region.nodes {
        let built = match plan.job {
            What::Node(n) => streams.reader(n).unwrap_or_else(|| build(job, n, values)).map_err(|fault| {
                let place = job.graph.place(n, fault.field.as_deref());
                Diagnostic::of_fault(fault, place, &job.graph.nodes[n].id)
            }),
            What::Tap(k) => streams.writer(k).map_or_else(|| tap::writer(job, k), Ok),
        };
        match built {
            Ok(node) => nodes.push(wired(plan, node, values)),
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut stage = Stage::new(region.tracks.iter().map(track).collect(), region.clocks.clone(), nodes);
    stage.set_timed(true);
    Ok(stage)
}

fn build(job: &Job<'_>, n: usize, values: &Values) -> Result<Box<dyn DynNode>, Fault> {
    let node = &job.graph.nodes[n];
    let links = links_with_values(job, n, values);
    let cx = Build {
        random: Random::new(job.seed, &node.id),
        links: &links,
        shape: &job.plan.shapes[n],
        window: job.plan.window,
        files: job.files,
        outputs: job.outputs,
    };
    node.ty.build(&*node.params, &cx)
}

fn wired(plan: &PlanNode, node: Box<dyn DynNode>, values: &Values) -> StageNode {
    let input = |wire: &PlanIn| match wire {
        PlanIn::Stream { track, clock, past, ahead, delay, width, rate } => Some(InWire::Stream {
            track: *track,
            clock: *clock,
            past: *past,
            ahead: *ahead,
            delay: *delay,
            width: *width,
            rate: *rate,
        }),
        PlanIn::Events { track, clock, past, ahead } => {
            Some(InWire::Events { track: *track, clock: *clock, past: *past, ahead: *ahead })
        }
        PlanIn::Value { node, port } => values.get(&(*node, *port)).cloned().map(InWire::Value),
    };
    let output = |wire: &PlanOut| match wire {
        PlanOut::Stream { track, clock, width, rate } => {
            OutWire::Stream { track: *track, clock: *clock, width: *width, rate: *rate }
        }
        PlanOut::Events { track, clock } => OutWire::Events { track: *track, clock: *clock },
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
