//! Delays: the time by which each node works behind the run, and the lengths that follow from it.

use super::options::PlanOptions;
use super::shapes::closes_loop;
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link};
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::{Lookaround, NodeShape};
use foley_nodes::core::time::{Tick, seconds};
use std::collections::HashMap;

/// The input that determines the delay of a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// The node that feeds it.
    pub from: usize,
    /// Input port.
    pub port: usize,
    /// Look-ahead of the input, ticks.
    pub ahead: Tick,
}

/// The delay of each node of the graph in one phase; zero for nodes that are not in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Delays {
    /// Delay of each node behind the run, ticks.
    pub of: Vec<Tick>,
    /// First tick of each node, in its own time.
    pub from: Vec<Tick>,
    /// Ticks by which each node continues ahead of its delay, because the delay has grown in a reload.
    pub early: Vec<Tick>,
    /// The input that determines each delay.
    pub cause: Vec<Option<Cause>>,
}

/// The schedule that a graph continues in a hot reload; the default begins at tick 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Continuation {
    /// Tick of the run at which it continues.
    pub at: Tick,
    /// Delay and first tick of the nodes that continue; the delay of a playing node never shrinks.
    pub nodes: HashMap<usize, (Tick, Tick)>,
}

/// Ticks of an input's look-ahead, less its delay.
fn ahead_ticks(lookaround: &Lookaround, stream: Option<&StreamShape>) -> Tick {
    match stream {
        Some(stream) => stream.rate.span(lookaround.ahead) - stream.rate.tick(lookaround.delay as i64),
        None => lookaround.ahead as Tick,
    }
}

/// The links of a node over which streams or events run: input port, link, look-ahead.
fn inputs<'g>(
    graph: &'g Graph,
    shapes: &'g [NodeShape],
    node: usize,
) -> impl Iterator<Item = (usize, &'g Link, Tick)> {
    graph.nodes[node].links.iter().enumerate().flat_map(move |(port, links)| {
        let lookaround = shapes[node].lookaround.get(port).copied().unwrap_or_default();
        let value = matches!(graph.nodes[node].ty.inputs[port].kind, PortKind::Value(_));
        links.iter().filter(move |_| !value).map(move |link| {
            let stream = shapes[link.node].outputs.get(link.port).and_then(Option::as_ref);
            (port, link, ahead_ticks(&lookaround, stream))
        })
    })
}

/// Computes the delay of every node of a phase; loops are followed until nothing changes.
pub fn delays(
    graph: &Graph,
    shapes: &[NodeShape],
    nodes: &[usize],
    window: Tick,
    continuation: &Continuation,
) -> Delays {
    let count = graph.nodes.len();
    let mut delays =
        Delays { of: vec![0; count], from: vec![0; count], early: vec![0; count], cause: vec![None; count] };
    for (&n, &(delay, _)) in &continuation.nodes {
        delays.of[n] = delay;
    }
    // Each round settles at least one loop; `longest_window` guarantees that all loops settle.
    for _ in 0..=nodes.len() {
        let mut changed = false;
        for &v in nodes {
            for (port, link, ahead) in inputs(graph, shapes, v) {
                let u = link.node;
                let back = if closes_loop(graph, v, link) { window } else { 0 };
                let delay = delays.of[u] + shapes[u].lag + ahead + back;
                if delay > delays.of[v] {
                    delays.of[v] = delay;
                    delays.cause[v] = Some(Cause { from: u, port, ahead });
                    changed = true;
                }
            }
        }
        if !changed {
            break;
        }
    }
    for &n in nodes {
        let added = (continuation.at - delays.of[n]).max(0);
        delays.from[n] = continuation.nodes.get(&n).map_or(added, |&(_, from)| from);
        delays.early[n] = (delays.from[n] - added).max(0);
    }
    delays
}

/// Returns the longest window with which the delays of every loop of a phase settle.
///
/// # Errors
/// A loop whose delay is shorter than its own look-ahead and lag.
pub fn longest_window(graph: &Graph, shapes: &[NodeShape], nodes: &[usize]) -> Result<Tick, Vec<Diagnostic>> {
    let mut longest = Tick::MAX;
    let mut errors = Vec::new();
    for &v in nodes {
        for (_, link, ahead) in inputs(graph, shapes, v) {
            if !closes_loop(graph, v, link) {
                continue;
            }
            // The longest path from v to the end of the loop, in lag and look-ahead.
            let mut path: Vec<Option<Tick>> = vec![None; graph.nodes.len()];
            path[v] = Some(0);
            for &n in nodes.iter().filter(|&&n| n != v) {
                let longest = inputs(graph, shapes, n)
                    .filter(|(_, l, _)| !closes_loop(graph, n, l))
                    .filter_map(|(_, l, a)| path[l.node].map(|p| p + shapes[l.node].lag + a.max(0)))
                    .max();
                path[n] = path[n].max(longest);
            }
            let Some(loop_time) = path[link.node] else { continue };
            let slack = -(loop_time + shapes[link.node].lag + ahead);
            if slack < 1 {
                let message = format!(
                    "the loop back to this node takes {:.6} s of look-ahead, its delay is {:.6} s",
                    seconds(loop_time + shapes[link.node].lag),
                    seconds(-ahead)
                );
                errors.push(
                    Diagnostic::error("F049", message, link.location.clone())
                        .node(&graph.nodes[v].id)
                        .help("make the delay longer than the look-ahead of the nodes in the loop"),
                );
            } else {
                longest = longest.min(slack);
            }
        }
    }
    if errors.is_empty() { Ok(longest) } else { Err(errors) }
}

/// Returns the ticks until the last node that determines the length of a phase has ended.
///
/// # Errors
/// A graph that never ends.
pub fn duration(
    graph: &Graph,
    shapes: &[NodeShape],
    nodes: &[usize],
    delays: &Delays,
    options: &PlanOptions,
) -> Result<Tick, Vec<Diagnostic>> {
    let errors = endless(graph, shapes, nodes, options);
    if !errors.is_empty() {
        return Err(errors);
    }
    let end = |n: usize| Some(shapes[n].end? + delays.of[n] + shapes[n].lag);
    let ends = nodes.iter().filter(|&&n| ends_phase(graph, n, options)).filter_map(|&n| end(n));
    Ok(ends.max().unwrap_or(1).max(1))
}

/// Returns true if a phase lasts until the node has ended: it folds, writes or is tapped.
fn ends_phase(graph: &Graph, node: usize, options: &PlanOptions) -> bool {
    let outputs = graph.nodes[node].ty.outputs;
    let folds = outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
    folds || outputs.is_empty() || options.taps.iter().any(|(t, _)| *t == node)
}

/// Errors for the nodes that have to end and never do.
pub fn endless(
    graph: &Graph,
    shapes: &[NodeShape],
    nodes: &[usize],
    options: &PlanOptions,
) -> Vec<Diagnostic> {
    let endless = nodes.iter().filter(|&&n| ends_phase(graph, n, options) && shapes[n].end.is_none());
    let error = |&n: &usize| {
        let id = &graph.nodes[n].id;
        Diagnostic::error("F048", format!("`{id}` never ends"), graph.nodes[n].location.clone())
            .node(id)
            .help("give a source in front of it a duration, or run with --until SECONDS")
    };
    endless.map(error).collect()
}
