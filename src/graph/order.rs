//! The order in which nodes can run, loops that have no order, and unused nodes.

use super::Link;
use super::checked_node::CheckedNode;
use super::raw_node::RawNode;
use crate::diag::Diagnostic;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::ports::PortKind;
use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;
use std::collections::{BTreeMap, HashMap};

/// The topological order. A loop is an error unless a delayed input closes it.
pub(super) fn order(
    raw: &[RawNode],
    checked: &[Option<CheckedNode>],
    links: &[Vec<Vec<Link>>],
    found: &mut Vec<Diagnostic>,
) -> Vec<usize> {
    let delayed = |v: usize, port: usize| checked[v].as_ref().is_some_and(|h| h.ty.inputs[port].delayed);
    let mut all = DiGraph::<(), ()>::new();
    let index: Vec<_> = raw.iter().map(|_| all.add_node(())).collect();
    let edges = || {
        links.iter().enumerate().flat_map(|(v, ports)| {
            ports
                .iter()
                .enumerate()
                .flat_map(move |(port, links)| links.iter().map(move |l| (l.node, v, port, l)))
        })
    };
    for (u, v, _, _) in edges() {
        all.update_edge(index[u], index[v], ());
    }
    let mut group = vec![0; raw.len()];
    for (k, members) in tarjan_scc(&all).iter().enumerate() {
        members.iter().for_each(|n| group[n.index()] = k);
    }
    // Inside a loop, delayed links do not count.
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); raw.len()];
    let mut above = vec![0_usize; raw.len()];
    for (u, v, port, _) in edges() {
        if !(delayed(v, port) && group[u] == group[v]) {
            below[u].push(v);
            above[v] += 1;
        }
    }
    // Last in, first out holds chains together, so that few buffers cross from one part to another.
    let mut ready: Vec<usize> = (0..raw.len()).rev().filter(|&n| above[n] == 0).collect();
    let mut order = Vec::with_capacity(raw.len());
    while let Some(n) = ready.pop() {
        order.push(n);
        for &v in below[n].iter().rev() {
            above[v] -= 1;
            if above[v] == 0 {
                ready.push(v);
            }
        }
    }
    if order.len() < raw.len() {
        report_loops(raw, &below, &above, links, found);
    }
    order
}

/// Maximum number of rounds of the search for loops; each omits the links that close the loops found before.
const ROUNDS: usize = 20;

/// Reports each loop once and completely: one of each connected group, then those without the link that closes it.
fn report_loops(
    raw: &[RawNode],
    below: &[Vec<usize>],
    above: &[usize],
    links: &[Vec<Vec<Link>>],
    found: &mut Vec<Diagnostic>,
) {
    let mut below = below.to_vec();
    for _ in 0..ROUNDS {
        let loops = loops(&below, above);
        if loops.is_empty() {
            return;
        }
        for path in loops {
            if let (Some(first), Some(closing)) = (path.first(), path.last()) {
                below[*closing].retain(|v| v != first);
            }
            found.push(loop_error(raw, links, &path));
        }
    }
}

/// One loop of each set of nodes that all reach each other: the shortest through its first node.
fn loops(below: &[Vec<usize>], above: &[usize]) -> Vec<Vec<usize>> {
    let mut graph = DiGraph::<usize, ()>::new();
    let index: BTreeMap<usize, _> =
        (0..above.len()).filter(|&n| above[n] > 0).map(|n| (n, graph.add_node(n))).collect();
    for (&n, &at) in &index {
        for to in below[n].iter().filter_map(|v| index.get(v)) {
            graph.update_edge(at, *to, ());
        }
    }
    let knots = tarjan_scc(&graph).into_iter().filter_map(|members| {
        let mut members: Vec<usize> = members.iter().map(|n| graph[*n]).collect();
        members.sort_unstable();
        let first = members[0];
        let knot = members.len() > 1 || below[first].contains(&first);
        knot.then(|| shortest_loop(first, below, &members))
    });
    knots.collect()
}

fn loop_error(raw: &[RawNode], links: &[Vec<Vec<Link>>], path: &[usize]) -> Diagnostic {
    let first = path[0];
    let names: Vec<&str> = path.iter().chain([&first]).map(|&n| raw[n].id.as_str()).collect();
    let closing = *path.last().unwrap_or(&first);
    let link = |to: usize, from: usize| links[to].iter().flatten().find(|l| l.node == from);
    let mut diagnostic = Diagnostic::error(
        "F025",
        format!("these nodes feed each other in a loop: {}", names.join(" -> ")),
        link(first, closing).map_or_else(|| raw[first].location.clone(), |l| l.location.clone()),
    )
    .node(&raw[first].id)
    .help("a loop must contain a Feedback node, which sets its delay");
    for pair in path.windows(2) {
        if let Some(link) = link(pair[1], pair[0]) {
            let text = format!("`{}` needs `{}`", raw[pair[1]].id, raw[pair[0]].id);
            diagnostic = diagnostic.label(link.location.clone(), text);
        }
    }
    diagnostic
}

/// The shortest path from a node back to itself inside a sorted set of nodes, without the closing step.
fn shortest_loop(first: usize, below: &[Vec<usize>], members: &[usize]) -> Vec<usize> {
    let mut from: HashMap<usize, usize> = HashMap::new();
    let mut queue = std::collections::VecDeque::from([first]);
    while let Some(n) = queue.pop_front() {
        for &v in below[n].iter().filter(|v| members.binary_search(v).is_ok()) {
            if v == first {
                let mut path = vec![n];
                let mut at = n;
                while at != first {
                    at = from[&at];
                    path.push(at);
                }
                path.reverse();
                return path;
            }
            if v != first && !from.contains_key(&v) {
                from.insert(v, n);
                queue.push_back(v);
            }
        }
    }
    vec![first]
}

/// Warns about nodes that no output file needs. Nodes of sub-graphs are optional: a graph may use only some of them.
pub(super) fn unused(
    raw: &[RawNode],
    checked: &[Option<CheckedNode>],
    links: &[Vec<Vec<Link>>],
    found: &mut Vec<Diagnostic>,
) {
    let mut used = vec![false; raw.len()];
    let sink = |n: usize| checked[n].as_ref().is_none_or(|h| h.ty.outputs.is_empty());
    let mut stack: Vec<usize> = (0..raw.len()).filter(|&n| sink(n)).collect();
    // A graph that writes nothing at all is for use by others.
    if stack.is_empty() {
        return;
    }
    while let Some(n) = stack.pop() {
        if !std::mem::replace(&mut used[n], true) {
            stack.extend(links[n].iter().flatten().map(|l| l.node));
        }
    }
    // A node with only folds is a report, for taps.
    let folds = |ty: &NodeType| ty.outputs.iter().all(|o| matches!(o.kind, PortKind::Fold(_)));
    let is_report = |n: usize| checked[n].as_ref().is_some_and(|h| folds(&h.ty));
    let mut feeds = vec![false; raw.len()];
    links.iter().flatten().flatten().for_each(|l| feeds[l.node] = true);
    for (n, node) in raw.iter().enumerate() {
        if !used[n] && !feeds[n] && node.location.file == 0 && !is_report(n) {
            let warning =
                Diagnostic::warning("F026", format!("nothing uses `{}`", node.id), node.location.clone());
            found.push(warning.node(&node.id).help("link it to a node that writes a file, or remove it"));
        }
    }
}
