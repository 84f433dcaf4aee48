//! Shapes of all nodes of a graph: formats, rates, lengths and look-around.

use crate::diag::{Diagnostic, Fix};
use crate::graph::{Graph, Link, resample};
use foley_nodes::core::fault::Reject;
use foley_nodes::core::files::Files;
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use foley_nodes::core::shape::{LinkShape, NodeShape, RawShape};
use foley_nodes::core::time::Tick;

/// The shapes of a graph.
pub struct Shaped {
    /// Shape of each node; empty for nodes that failed.
    pub shapes: Vec<NodeShape>,
    /// True for nodes that failed, or that read one that did.
    pub failed: Vec<bool>,
    /// The errors found.
    pub errors: Vec<Diagnostic>,
}

/// Shapes every node, in topological order; nodes downstream of one that failed are skipped without a message.
///
/// If only some links of an input with many failed, the others are still compared.
pub fn shape_all(graph: &Graph, files: &dyn Files) -> Shaped {
    let mut shapes: Vec<NodeShape> = graph.nodes.iter().map(|_| NodeShape::default()).collect();
    let mut failed = vec![false; graph.nodes.len()];
    let mut errors = Vec::new();
    for &n in &graph.order {
        let node = &graph.nodes[n];
        let lost = |link: &Link| failed[link.node] && !closes_loop(graph, n, link);
        let links = known_shapes(graph, &shapes, n, &lost);
        let incomplete = !node.whole || node.links.iter().flatten().any(lost);
        failed[n] = incomplete;
        let Some(links) = links else { continue };
        let raw = RawShape::new(&links, node.ty.outputs.len(), files);
        match node.ty.shape(&*node.params, raw) {
            Ok(_) if incomplete => {}
            Ok(shape) => shapes[n] = shape,
            Err(rejects) => {
                failed[n] = true;
                errors.extend(rejects.into_iter().map(|reject| {
                    let location = graph.location(n, reject.field.as_deref());
                    let source = rate_source(graph, &shapes, n, &reject);
                    let fix = resampled(graph, n, &reject);
                    Diagnostic::of_reject(with_source(reject, source), location, &node.id).fixes(fix)
                }));
            }
        }
    }
    errors.extend(check_loops(graph, &shapes, &failed));
    Shaped { shapes, failed, errors }
}

/// The node whose parameter `rate` sets the rate of the stream that a rejection is about.
fn rate_source<'a>(graph: &'a Graph, shapes: &[NodeShape], n: usize, reject: &Reject) -> Option<&'a str> {
    reject.rate?;
    let field = reject.field.as_deref()?;
    let (port, item) = match field.split_once('[') {
        Some((port, item)) => (port, item.trim_end_matches(']').parse().ok()?),
        None => (field, 0),
    };
    let port = graph.nodes[n].ty.inputs.iter().position(|spec| spec.name == port)?;
    let mut link = graph.nodes[n].links[port].get(item)?;
    loop {
        let node = &graph.nodes[link.node];
        if (node.ty.params)().iter().any(|spec| spec.name == "rate") {
            return Some(&node.id);
        }
        // The only stream of this rate that it reads sets the rate of what it gives.
        let rate = |link: &Link| Some(shapes[link.node].outputs.get(link.port)?.as_ref()?.rate);
        let own = rate(link)?;
        let mut inputs = node.links.iter().flatten().filter(|input| rate(input) == Some(own));
        let first = inputs.next().filter(|first| !closes_loop(graph, link.node, first))?;
        if inputs.next().is_some() {
            return None;
        }
        link = first;
    }
}

/// The correction of a stream of audio that has another rate.
fn resampled(graph: &Graph, n: usize, reject: &Reject) -> Option<Fix> {
    let (field, rate) = (reject.field.as_deref()?, reject.rate?);
    let port = graph.nodes[n].ty.inputs.iter().find(|spec| Some(spec.name) == field.split('[').next())?;
    let audio = matches!(port.kind, PortKind::Stream(item) if item.name == "audio");
    audio.then(|| resample(graph, n, field, rate))?
}

/// A rejection whose advice names the node that sets the rate.
fn with_source(reject: Reject, source: Option<&str>) -> Reject {
    let advice = reject.help.as_deref().zip(source).zip(reject.rate);
    let advice = advice.map(|((help, source), rate)| {
        format!("{help}, or set `rate: {rate}` on `{source}`").replace(" Hz", "")
    });
    match advice {
        Some(help) => reject.help(help),
        None => reject,
    }
}

/// The shape of a link; `None` for a stream that closes a loop.
fn link_shape(graph: &Graph, shapes: &[NodeShape], link: &Link) -> Option<LinkShape> {
    match graph.nodes[link.node].ty.outputs[link.port].kind {
        PortKind::Stream(_) => {
            shapes[link.node].outputs.get(link.port).cloned().flatten().map(LinkShape::Stream)
        }
        PortKind::Events(_) => Some(LinkShape::Events(shapes[link.node].end)),
        PortKind::Value(_) | PortKind::Fold(_) => Some(LinkShape::Value(None)),
    }
}

/// The shapes of a node's links; for an input that takes many, the first known one replaces the missing ones.
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

/// Returns true if a link comes from a node that is later in the topological order.
pub fn closes_loop(graph: &Graph, node: usize, link: &Link) -> bool {
    graph.rank[link.node] >= graph.rank[node]
}

/// Checks the streams that close loops; they are not known when their reader is shaped.
fn check_loops(graph: &Graph, shapes: &[NodeShape], failed: &[bool]) -> Vec<Diagnostic> {
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
                    "the stream that closes the loop is {}, {}; the node expects {}, {}",
                    back.rate, back.text, out.rate, out.text
                );
                errors
                    .push(Diagnostic::error("F045", message, link.location.clone()).node(&graph.nodes[n].id));
            }
        }
    }
    errors
}

/// Notes of nodes about their files: the id of each node, and a text.
#[must_use]
pub fn shape_notes(graph: &Graph, shapes: &[NodeShape]) -> Vec<(String, String)> {
    let nodes = graph.nodes.iter().zip(shapes);
    nodes.flat_map(|(n, shape)| shape.notes.iter().map(|note| (n.id.clone(), note.clone()))).collect()
}

/// Ends every stream at `until` at the latest.
pub fn truncate(shapes: &mut [NodeShape], until: Tick) {
    for shape in shapes {
        shape.end = Some(shape.end.map_or(until, |end| end.min(until)));
        for output in shape.outputs.iter_mut().flatten() {
            output.end = shape.end;
        }
    }
}
