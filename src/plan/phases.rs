//! Which nodes run in which pass over the streams.

use crate::graph::Graph;
use foley_nodes::core::ports::PortKind;

/// Nodes by phase.
pub struct Split {
    /// Stream nodes of each phase, in topological order. A node that several phases need runs in each of them.
    pub phases: Vec<Vec<usize>>,
    /// Value nodes in topological order, with the phase before which each can run.
    pub values: Vec<(usize, usize)>,
    /// The first phase of each node.
    pub phase_of: Vec<usize>,
    /// Nodes that nothing uses.
    pub idle: Vec<usize>,
}

/// Splits a graph at its folds.
///
/// A node belongs to the phase after the last fold above it. A stream that a later phase needs as well is computed
/// again there rather than kept: memory stays bounded, and the same node gives the same bits.
pub fn split(graph: &Graph, taps: &[(usize, usize)]) -> Split {
    let count = graph.nodes.len();
    let mut phase_of = vec![0; count];
    for &n in &graph.order {
        let above = graph.nodes[n].links.iter().flatten().map(|link| {
            let fold = matches!(graph.nodes[link.node].ty.outputs[link.port].kind, PortKind::Fold(_));
            phase_of[link.node] + usize::from(fold)
        });
        phase_of[n] = above.max().unwrap_or(0).max(phase_of[n]);
    }
    let mut wanted = vec![false; count];
    let roots: Vec<usize> = (0..count)
        .filter(|&n| graph.nodes[n].ty.outputs.is_empty() || taps.iter().any(|(t, _)| *t == n))
        .collect();
    let mut stack = roots.clone();
    while let Some(n) = stack.pop() {
        if !std::mem::replace(&mut wanted[n], true) {
            stack.extend(graph.nodes[n].links.iter().flatten().map(|l| l.node));
        }
    }
    let last = (0..count).filter(|&n| wanted[n]).map(|n| phase_of[n]).max().unwrap_or(0);
    let phases = (0..=last)
        .map(|phase| {
            let mut needed = vec![false; count];
            let mut stack: Vec<usize> = (0..count)
                .filter(|&n| {
                    let folds = graph.nodes[n].ty.outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
                    wanted[n] && phase_of[n] == phase && (folds || roots.contains(&n))
                })
                .collect();
            while let Some(n) = stack.pop() {
                if graph.nodes[n].ty.eval.is_some() || std::mem::replace(&mut needed[n], true) {
                    continue;
                }
                for (spec, links) in graph.nodes[n].ty.inputs.iter().zip(&graph.nodes[n].links) {
                    if !matches!(spec.kind, PortKind::Value(_)) {
                        stack.extend(links.iter().map(|l| l.node));
                    }
                }
            }
            graph.order.iter().copied().filter(|&n| needed[n]).collect()
        })
        .collect();
    let values = graph.order.iter().copied().filter(|&n| wanted[n] && graph.nodes[n].ty.eval.is_some());
    Split {
        phases,
        values: values.map(|n| (n, phase_of[n])).collect(),
        idle: (0..count).filter(|&n| !wanted[n]).collect(),
        phase_of,
    }
}
