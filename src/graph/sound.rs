//! The valid part of a graph: the nodes that can be shaped although others are wrong, so that their errors are
//! reported in the same pass.

use super::raw_node::RawNode;
use super::{Graph, GraphNode, Link};
use crate::diag::{Diagnostic, Severity, SourceLocation};
use foley_nodes::core::ports::Arity;

/// Completeness of the knowledge about a node.
#[derive(Clone, Copy, PartialEq)]
enum Known {
    /// It is wrong, or reads something that is.
    Nothing,
    /// Some of the links of an input with many are known: enough to compare them.
    Inputs,
    /// All of it, with all above it.
    All,
}

/// Returns true for each node that was read without a mistake; false for all if the text cannot be parsed.
pub(super) fn readable(raw: &[RawNode], found: &[Diagnostic]) -> Vec<bool> {
    let mut good: Vec<bool> = raw.iter().map(|node| node.whole).collect();
    for d in found.iter().filter(|d| d.severity == Severity::Error) {
        let locations = || d.location.iter().chain(d.labels.iter().map(|l| &l.location));
        let touches = |node: &RawNode| {
            let meets = |p: &SourceLocation| {
                p.file == node.location.file
                    && p.span.start <= node.end
                    && node.location.span.start <= p.span.end
            };
            d.node.as_ref() == Some(&node.id) || locations().any(meets)
        };
        let mut one = false;
        for (node, good) in raw.iter().zip(&mut good) {
            if touches(node) {
                (one, *good) = (true, false);
            }
        }
        // A slip outside of all nodes may have swallowed any of them; what is beyond a limit is not looked into.
        if (d.code == "F001" && !one) || d.code == "F009" {
            return vec![false; raw.len()];
        }
    }
    good
}

/// The graph of all nodes in the list, without links to others; `order` is topological.
///
/// A link to a missing node, at an input that takes many, becomes one to the first node of that input: so the others can
/// be compared. Such a node is not [`whole`](GraphNode::whole).
pub(super) fn graph(nodes: Vec<Option<GraphNode>>, order: &[usize]) -> Graph {
    let known = known(&nodes, order);
    let mut at = vec![0; nodes.len()];
    for (count, n) in (0..nodes.len()).filter(|&n| known[n] != Known::Nothing).enumerate() {
        at[n] = count;
    }
    let moved = |links: Vec<Link>| -> Vec<Link> {
        let stand_in = links.iter().find(|l| known[l.node] == Known::All).cloned();
        let one = |link: Link| if known[link.node] == Known::All { Some(link) } else { stand_in.clone() };
        links.into_iter().filter_map(one).map(|l| Link { node: at[l.node], ..l }).collect()
    };
    let mut graph = Graph::default();
    for (node, known) in nodes.into_iter().zip(&known) {
        let Some(node) = node.filter(|_| *known != Known::Nothing) else { continue };
        let links = node.links.into_iter().map(moved).collect();
        graph.nodes.push(GraphNode { links, whole: *known == Known::All, ..node });
    }
    graph.order = order.iter().filter(|&&n| known[n] != Known::Nothing).map(|&n| at[n]).collect();
    graph.rank = vec![0; graph.nodes.len()];
    for (location, &n) in graph.order.iter().enumerate() {
        graph.rank[n] = location;
    }
    graph
}

/// Determines the completeness of each node; an incomplete node makes all of its readers incomplete.
fn known(nodes: &[Option<GraphNode>], order: &[usize]) -> Vec<Known> {
    let mut known = vec![Known::Nothing; nodes.len()];
    order.iter().filter(|&&n| nodes[n].is_some()).for_each(|&n| known[n] = Known::All);
    // One round is enough except for delayed links, which come from later nodes.
    loop {
        let before = known.clone();
        for &n in order {
            let Some(node) = nodes[n].as_ref().filter(|_| known[n] != Known::Nothing) else { continue };
            for (spec, links) in node.ty.inputs.iter().zip(&node.links) {
                let sound = links.iter().filter(|l| known[l.node] == Known::All).count();
                known[n] = match spec.arity {
                    _ if sound == links.len() => known[n],
                    Arity::Many if sound > 0 && known[n] != Known::Nothing => Known::Inputs,
                    _ => Known::Nothing,
                };
            }
        }
        if known == before {
            return known;
        }
    }
}
