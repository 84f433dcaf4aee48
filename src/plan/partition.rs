//! Partitions of a graph into regions: by work for a run, by what may run in the audio callback for playing.

use super::region::Runnable;
use super::shapes::closes_loop;
use super::wiring::{Schedule, TapPlan};
use crate::graph::{Graph, Link};
use foley_nodes::core::node::Class;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::time::Rate;
use std::collections::HashMap;

/// Partitions the topological order into regions of about equal work, at least `min_ns` per window each; nodes that read or
/// write files, and taps, have a region each.
pub fn by_work(schedule: &Schedule<'_>, threads: usize, min_ns: f64) -> HashMap<Runnable, usize> {
    let Schedule { graph, shapes, nodes, taps, window, .. } = *schedule;
    let work = |n: usize| {
        let ty = &graph.nodes[n].ty;
        let per_window = |rate: Rate, width: usize| rate.first_at(window) as f64 * width as f64;
        let outs = shapes[n].outputs.iter().flatten().map(|s| per_window(s.rate, s.width));
        let ins = graph.nodes[n].links.iter().flatten().filter_map(|l| {
            let s = shapes[l.node].outputs.get(l.port)?.as_ref()?;
            Some(per_window(s.rate, s.width))
        });
        30.0 + ty.cost * outs.fold(0.0, f64::max).max(ins.fold(0.0, f64::max))
    };
    let inner: Vec<usize> = nodes.iter().copied().filter(|&n| graph.nodes[n].ty.class != Class::Io).collect();
    let total: f64 = inner.iter().map(|&n| work(n)).sum();
    let parts = if threads < 2 { 1.0 } else { (total / min_ns).floor().clamp(1.0, 2.0 * threads as f64) };
    // A loop stays in one region: no boundary lies between the node that closes it and the end of the loop.
    let mut open_until = 0;
    let mut region_of = HashMap::new();
    let (mut region, mut sum, mut begin) = (0, 0.0, 0.0);
    for (k, &n) in inner.iter().enumerate() {
        let w = work(n);
        let due = sum + w / 2.0 > total * (region + 1) as f64 / parts;
        if due && k > open_until && sum - begin >= min_ns && total - sum >= min_ns {
            region += 1;
            begin = sum;
        }
        sum += w;
        region_of.insert(Runnable::Node(n), region);
        for link in graph.nodes[n].links.iter().flatten().filter(|l| closes_loop(graph, n, l)) {
            let end = inner.iter().position(|&m| m == link.node).unwrap_or(0);
            open_until = open_until.max(end);
        }
    }
    let first = if inner.is_empty() { 0 } else { region + 1 };
    let io = nodes.iter().filter(|&&n| graph.nodes[n].ty.class == Class::Io).map(|&n| Runnable::Node(n));
    region_of.extend(io.chain(taps.iter().map(|t| Runnable::Tap(t.tap))).zip(first..));
    region_of
}

/// The links of a node over which streams or events run.
fn stream_links(graph: &Graph, n: usize) -> impl Iterator<Item = &Link> {
    let node = &graph.nodes[n];
    let pairs = node.ty.inputs.iter().zip(&node.links);
    pairs.filter(|(spec, _)| !matches!(spec.kind, PortKind::Value(_))).flat_map(|(_, links)| links)
}

/// For each node of the graph, true if it runs on a worker: it must not run in the callback, or feeds one that must not.
#[must_use]
pub fn runs_on_worker(graph: &Graph, nodes: &[usize]) -> Vec<bool> {
    let mut on_worker = vec![false; graph.nodes.len()];
    let waits = |n: &&usize| graph.nodes[**n].ty.class != Class::Audio;
    let mut stack: Vec<usize> = nodes.iter().filter(waits).copied().collect();
    while let Some(n) = stack.pop() {
        if !std::mem::replace(&mut on_worker[n], true) {
            stack.extend(stream_links(graph, n).map(|l| l.node));
        }
    }
    on_worker
}

/// Partitions a graph that plays, and counts its regions: one per connected group of worker nodes, and last the callback.
pub fn by_callback(graph: &Graph, nodes: &[usize], taps: &[TapPlan]) -> (HashMap<Runnable, usize>, usize) {
    let on_worker = runs_on_worker(graph, nodes);
    // Union-find: the smallest node of a connected group is its root.
    let mut parent: Vec<usize> = (0..graph.nodes.len()).collect();
    fn root(parent: &[usize], mut n: usize) -> usize {
        while parent[n] != n {
            n = parent[n];
        }
        n
    }
    for &n in nodes.iter().filter(|&&n| on_worker[n]) {
        for link in stream_links(graph, n) {
            let (a, b) = (root(&parent, n), root(&parent, link.node));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut numbers = HashMap::new();
    let mut region_of = HashMap::new();
    for &n in nodes.iter().filter(|&&n| on_worker[n]) {
        let next = numbers.len();
        let number = *numbers.entry(root(&parent, n)).or_insert(next);
        region_of.insert(Runnable::Node(n), number);
    }
    let last = numbers.len();
    region_of.extend(nodes.iter().filter(|&&n| !on_worker[n]).map(|&n| (Runnable::Node(n), last)));
    region_of.extend(taps.iter().map(|t| (Runnable::Tap(t.tap), last)));
    (region_of, last + 1)
}
