//! The phases of a graph: the nodes that run in each pass over the streams.

use crate::graph::Graph;
use foley_nodes::core::ports::PortKind;

/// Nodes by phase.
pub struct Split {
    /// Stream nodes of each phase, in topological order; a node that several phases need is in each of them.
    pub phases: Vec<Vec<usize>>,
    /// Value nodes in topological order, with the phase before which each can run.
    pub values: Vec<(usize, usize)>,
    /// The first phase of each node.
    pub phase_of: Vec<usize>,
    /// Nodes that nothing uses.
    pub unused: Vec<usize>,
}

/// Splits a graph at its folds.
///
/// A node belongs to the phase after the last fold upstream of it. A stream that a later phase also needs is computed again
/// there instead of stored: memory stays bounded, and the same node computes the same bits.
pub fn split(graph: &Graph, taps: &[(usize, usize)]) -> Split {
    let phase_of = phase_of(graph);
    let roots: Vec<usize> = (0..graph.nodes.len())
        .filter(|&n| graph.nodes[n].ty.outputs.is_empty() || taps.iter().any(|(t, _)| *t == n))
        .collect();
    let used = upstream(graph, &roots, |_| true);
    let last = used.iter().map(|&n| phase_of[n]).max().unwrap_or(0);
    let phases = (0..=last)
        .map(|phase| {
            let ends = used.iter().copied();
            let ends = ends.filter(|&n| phase_of[n] == phase && (folds(graph, n) || roots.contains(&n)));
            streams_upstream(graph, &ends.collect::<Vec<_>>())
        })
        .collect();
    let values = used.iter().copied().filter(|&n| graph.nodes[n].ty.eval.is_some());
    Split {
        phases,
        values: values.map(|n| (n, phase_of[n])).collect(),
        unused: (0..graph.nodes.len()).filter(|n| !used.contains(n)).collect(),
        phase_of,
    }
}

/// Nodes that run before a graph plays, and nodes that play.
pub struct LiveSplit {
    /// Stream nodes of the phases that compute folds.
    pub prelude: Vec<Vec<usize>>,
    /// Value nodes in topological order, with the phase before which each can run.
    pub values: Vec<(usize, usize)>,
    /// Stream nodes that play, in topological order.
    pub nodes: Vec<usize>,
}

/// Splits a graph in which only the nodes that feed `sinks` play: its folds are computed before.
pub fn split_live(graph: &Graph, sinks: &[usize]) -> LiveSplit {
    let phase_of = phase_of(graph);
    let nodes = streams_upstream(graph, sinks);
    let used = upstream(graph, sinks, |_| true);
    // A fold that nothing reads would have its value only after the piece.
    let read_folds: Vec<usize> = used
        .iter()
        .copied()
        .filter(|&n| {
            let reads = |m: usize| {
                graph.nodes[m].links.iter().flatten().any(|l| {
                    let kind = graph.nodes[l.node].ty.outputs[l.port].kind;
                    l.node == n && matches!(kind, PortKind::Fold(_))
                })
            };
            folds(graph, n) && used.iter().any(|&m| reads(m))
        })
        .collect();
    let last = read_folds.iter().map(|&n| phase_of[n] + 1).max().unwrap_or(0);
    let prelude = (0..last)
        .map(|phase| {
            let ends = read_folds.iter().copied().filter(|&n| phase_of[n] == phase);
            streams_upstream(graph, &ends.collect::<Vec<_>>())
        })
        .collect();
    let values = used.iter().copied().filter(|&n| graph.nodes[n].ty.eval.is_some());
    LiveSplit { prelude, values: values.map(|n| (n, phase_of[n])).collect(), nodes }
}

/// The phase after the last fold upstream of each node.
fn phase_of(graph: &Graph) -> Vec<usize> {
    let mut phase_of = vec![0; graph.nodes.len()];
    for &n in &graph.order {
        let phases = graph.nodes[n].links.iter().flatten().map(|link| {
            let fold = matches!(graph.nodes[link.node].ty.outputs[link.port].kind, PortKind::Fold(_));
            phase_of[link.node] + usize::from(fold)
        });
        phase_of[n] = phases.max().unwrap_or(0).max(phase_of[n]);
    }
    phase_of
}

fn folds(graph: &Graph, n: usize) -> bool {
    graph.nodes[n].ty.outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)))
}

/// `ends` and all nodes upstream of them over inputs that `follow` accepts, in topological order.
fn upstream(graph: &Graph, ends: &[usize], follow: impl Fn(&PortKind) -> bool) -> Vec<usize> {
    let mut found = vec![false; graph.nodes.len()];
    let mut stack = ends.to_vec();
    while let Some(n) = stack.pop() {
        if std::mem::replace(&mut found[n], true) {
            continue;
        }
        for (spec, links) in graph.nodes[n].ty.inputs.iter().zip(&graph.nodes[n].links) {
            if follow(&spec.kind) {
                stack.extend(links.iter().map(|l| l.node));
            }
        }
    }
    graph.order.iter().copied().filter(|&n| found[n]).collect()
}

/// `ends` and all nodes whose streams or events reach them, in topological order, without nodes that compute values.
fn streams_upstream(graph: &Graph, ends: &[usize]) -> Vec<usize> {
    let mut nodes = upstream(graph, ends, |kind| !matches!(kind, PortKind::Value(_)));
    nodes.retain(|&n| graph.nodes[n].ty.eval.is_none());
    nodes
}
