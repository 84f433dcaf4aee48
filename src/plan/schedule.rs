//! How far behind the run each node works.

use super::PlanOptions;
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link};
use foley_nodes::core::files::Files;
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use foley_nodes::core::shape::{LinkShape, Lookaround, NodeShape, RawShape};
use foley_nodes::core::time::{Tick, seconds};
use std::collections::HashMap;

/// Why a node works as late as it does.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// The node that it waits for.
    pub from: usize,
    /// Input port over which it waits.
    pub port: usize,
    /// Look-ahead of that input, ticks.
    pub ahead: Tick,
}

/// How far behind the run each node of the graph works in one phase; zero for nodes that are not in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Delays {
    /// Ticks per node.
    pub of: Vec<Tick>,
    /// The first tick that each node works on, in its own time.
    pub from: Vec<Tick>,
    /// How far each node is ahead of its delay where it takes over, since its delay has grown.
    pub early: Vec<Tick>,
    /// What each waits for longest.
    pub cause: Vec<Option<Cause>>,
}

/// What is known of a link; nothing of a stream that closes a loop.
fn link_shape(graph: &Graph, shapes: &[NodeShape], link: &Link) -> Option<LinkShape> {
    match graph.nodes[link.node].ty.outputs[link.port].kind {
        PortKind::Stream(_) => {
            shapes[link.node].outputs.get(link.port).cloned().flatten().map(LinkShape::Stream)
        }
        PortKind::Events(_) => Some(LinkShape::Events(shapes[link.node].end)),
        PortKind::Value(_) | PortKind::Fold(_) => Some(LinkShape::Value(None)),
    }
}

/// What shaping a graph has come to.
pub struct Shaped {
    /// Shape of each node; empty for those that failed.
    pub shapes: Vec<NodeShape>,
    /// Nodes that failed, or read from one that did.
    pub failed: Vec<bool>,
    /// What is wrong with them.
    pub errors: Vec<Diagnostic>,
}

/// Shapes every node, in topological order; nodes behind one that failed are passed over in silence.
///
/// Where an input takes many and only some of them failed, the others are still compared.
pub fn shape_all(graph: &Graph, files: &dyn Files) -> Shaped {
    let mut shapes: Vec<NodeShape> = graph.nodes.iter().map(|_| NodeShape::default()).collect();
    let mut failed = vec![false; graph.nodes.len()];
    let mut errors = Vec::new();
    for &n in &graph.order {
        let node = &graph.nodes[n];
        let lost = |link: &Link| failed[link.node] && !closes_loop(graph, n, link);
        let links = known_shapes(graph, &shapes, n, &lost);
        let partly = !node.whole || node.links.iter().flatten().any(lost);
        failed[n] = partly;
        let Some(links) = links else { continue };
        let raw = RawShape::new(&links, node.ty.outputs.len(), files);
        match node.ty.shape(&*node.params, raw) {
            Ok(_) if partly => {}
            Ok(shape) => shapes[n] = shape,
            Err(wrong) => {
                failed[n] = true;
                errors.extend(wrong.into_iter().map(|reject| {
                    let place = graph.place(n, reject.field.as_deref());
                    Diagnostic::of_reject(reject, place, &node.id)
                }));
            }
        }
    }
    errors.extend(late_inputs(graph, &shapes, &failed));
    Shaped { shapes, failed, errors }
}

/// The shapes of a node's links where some are lost: where an input takes many, the first that is known stands for those.
fn known_shapes(
    graph: &Graph,
    shapes: &[NodeShape],
    node: usize,
    lost: &dyn Fn(&Link) -> bool,
) -> Option<Vec<Vec<LinkShape>>> {
    let node = &graph.nodes[node];
    let of_port = |(links, spec): (&Vec<Link>, &PortSpec)| {
        if !links.iter().any(lost) {
            return Some(links.iter().filter_map(|link| link_shape(graph, shapes, link)).collect());
        }
        let first = links.iter().find(|link| !lost(link)).filter(|_| spec.arity == Arity::Many)?;
        links.iter().map(|link| link_shape(graph, shapes, if lost(link) { first } else { link })).collect()
    };
    node.links.iter().zip(node.ty.inputs).map(of_port).collect()
}

/// Whether a link comes from a node that stands later in the topological order.
pub fn closes_loop(graph: &Graph, node: usize, link: &Link) -> bool {
    graph.rank[link.node] >= graph.rank[node]
}

/// Checks what could not be checked when the node that closes a loop was shaped: the stream that comes back.
fn late_inputs(graph: &Graph, shapes: &[NodeShape], failed: &[bool]) -> Vec<Diagnostic> {
    let mut errors = Vec::new();
    for &n in &graph.order {
        for link in graph.nodes[n].links.iter().flatten() {
            if failed[n] || failed[link.node] || !closes_loop(graph, n, link) {
                continue;
            }
            let back = shapes[link.node].outputs[link.port].as_ref();
            let out = shapes[n].outputs.first().and_then(Option::as_ref);
            if let (Some(back), Some(out)) = (back, out)
                && (back.rate != out.rate || back.width != out.width)
            {
                let message = format!(
                    "the stream that closes the loop is {}, {}; the node was told {}, {}",
                    back.rate, back.text, out.rate, out.text
                );
                errors.push(Diagnostic::error("F045", message, link.place.clone()).node(&graph.nodes[n].id));
            }
        }
    }
    errors
}

/// Ticks that an input's look-ahead and lateness are worth.
fn ahead_ticks(lookaround: &Lookaround, stream: Option<&StreamShape>) -> Tick {
    match stream {
        Some(stream) => stream.rate.span(lookaround.ahead) - stream.rate.tick(lookaround.delay as i64),
        None => lookaround.ahead as Tick,
    }
}

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

/// Where a graph takes over from one that plays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resume {
    /// Ticks that have been played.
    pub at: Tick,
    /// Delay and first tick of the nodes that go on as they are; a delay never shrinks while a node plays.
    pub kept: HashMap<usize, (Tick, Tick)>,
}

/// The delay of every node of a phase; loops are followed until nothing changes.
pub fn delays(graph: &Graph, shapes: &[NodeShape], nodes: &[usize], window: Tick, resume: &Resume) -> Delays {
    let count = graph.nodes.len();
    let mut delays =
        Delays { of: vec![0; count], from: vec![0; count], early: vec![0; count], cause: vec![None; count] };
    for (&n, &(delay, _)) in &resume.kept {
        delays.of[n] = delay;
    }
    // Each round settles at least one loop; the window was chosen so that loops do settle.
    for _ in 0..=nodes.len() {
        let mut changed = false;
        for &v in nodes {
            for (port, link, ahead) in inputs(graph, shapes, v) {
                let u = link.node;
                let back = if closes_loop(graph, v, link) { window } else { 0 };
                let wanted = delays.of[u] + shapes[u].lag + ahead + back;
                if wanted > delays.of[v] {
                    delays.of[v] = wanted;
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
        let fresh = (resume.at - delays.of[n]).max(0);
        delays.from[n] = resume.kept.get(&n).map_or(fresh, |&(_, from)| from);
        delays.early[n] = (delays.from[n] - fresh).max(0);
    }
    delays
}

/// The longest window with which every loop of a phase settles.
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
            // The longest way from v to the end of the loop, over nodes between the two.
            let mut way: Vec<Option<Tick>> = vec![None; graph.nodes.len()];
            way[v] = Some(0);
            for &n in nodes.iter().filter(|&&n| n != v) {
                let best = inputs(graph, shapes, n)
                    .filter(|(_, l, _)| !closes_loop(graph, n, l))
                    .filter_map(|(_, l, a)| way[l.node].map(|w| w + shapes[l.node].lag + a.max(0)))
                    .max();
                way[n] = way[n].max(best);
            }
            let Some(loop_time) = way[link.node] else { continue };
            let room = -(loop_time + shapes[link.node].lag + ahead);
            if room < 1 {
                let message = format!(
                    "the loop back to this node takes {:.6} s of look-ahead, its delay is {:.6} s",
                    seconds(loop_time + shapes[link.node].lag),
                    seconds(-ahead)
                );
                let place = link.place.clone();
                errors.push(
                    Diagnostic::error("F049", message, place)
                        .node(&graph.nodes[v].id)
                        .help("make the delay longer than the look-ahead of the nodes in the loop"),
                );
            } else {
                longest = longest.min(room);
            }
        }
    }
    if errors.is_empty() { Ok(longest) } else { Err(errors) }
}

/// Stops every stream at `until` at the latest.
pub fn cut(shapes: &mut [NodeShape], until: Tick) {
    for shape in shapes {
        shape.end = Some(shape.end.map_or(until, |end| end.min(until)));
        for output in shape.outputs.iter_mut().flatten() {
            output.end = shape.end;
        }
    }
}

/// Ticks until the last node that matters has ended.
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
    let until = |n: usize| Some(shapes[n].end? + delays.of[n] + shapes[n].lag);
    let ends = nodes.iter().filter(|&&n| matters(graph, n, options)).filter_map(|&n| until(n));
    Ok(ends.max().unwrap_or(1).max(1))
}

/// Whether a phase goes on until a node has ended.
fn matters(graph: &Graph, node: usize, options: &PlanOptions) -> bool {
    let outputs = graph.nodes[node].ty.outputs;
    let folds = outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
    folds || outputs.is_empty() || options.taps.iter().any(|(t, _)| *t == node)
}

/// What is said of the nodes that would have to end, and never do.
pub fn endless(
    graph: &Graph,
    shapes: &[NodeShape],
    nodes: &[usize],
    options: &PlanOptions,
) -> Vec<Diagnostic> {
    let never = nodes.iter().filter(|&&n| matters(graph, n, options) && shapes[n].end.is_none());
    let tell = |&n: &usize| {
        let id = &graph.nodes[n].id;
        Diagnostic::error("F048", format!("`{id}` never ends"), graph.nodes[n].place.clone())
            .node(id)
            .help("give a source in front of it a duration, or run with --until SECONDS")
    };
    never.map(tell).collect()
}
