//! Which streams are worth keeping.

use crate::graph::Graph;
use std::collections::{BTreeSet, HashSet};

/// From what cost on a stream is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// Seconds per byte that it takes to compute, at least: writing and reading one takes about a third of the default.
    pub per_byte: f64,
    /// Seconds that it takes to compute, at least.
    pub least: f64,
    /// Seconds to read a byte of what is kept.
    pub read: f64,
    /// Stream nodes of a phase at most: to look for kept streams in larger graphs takes too long.
    pub most_nodes: usize,
}

impl Default for Rule {
    fn default() -> Self {
        Self { per_byte: 8e-9, least: 0.02, read: 2.5e-9, most_nodes: 1000 }
    }
}

/// The nodes whose streams are worth keeping, in the order of `nodes`, each with the seconds that keeping it saves.
///
/// What a node costs is its own time and that of all above it, as far as they are not kept themselves: so the streams at the
/// lower edge of what is expensive are kept, and none of the cheap ones that follow.
///
/// # Complexity
/// O(nodes x links above).
pub fn choose(
    graph: &Graph,
    nodes: &[usize],
    rule: &Rule,
    seconds: &dyn Fn(usize) -> f64,
    bytes: &dyn Fn(usize) -> Option<f64>,
) -> Vec<(usize, f64)> {
    let own: HashSet<usize> = nodes.iter().copied().collect();
    let mut kept: BTreeSet<usize> = BTreeSet::new();
    let mut chosen = Vec::new();
    for &n in nodes {
        let Some(size) = bytes(n) else { continue };
        let mut seen = HashSet::from([n]);
        let mut stack = vec![n];
        let mut cost = 0.0;
        while let Some(v) = stack.pop() {
            cost += match kept.contains(&v) {
                true => rule.read * bytes(v).unwrap_or(0.0),
                false => seconds(v),
            };
            if !kept.contains(&v) {
                let above = graph.nodes[v].links.iter().flatten().map(|l| l.node);
                stack.extend(above.filter(|u| own.contains(u) && seen.insert(*u)));
            }
        }
        if cost >= rule.least && cost >= rule.per_byte * size {
            kept.insert(n);
            chosen.push((n, cost));
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{LoadOptions, load_text};
    use std::path::Path;

    #[test]
    fn the_lower_edge_of_what_is_expensive_is_kept() {
        let mut text =
            String::from("#![schema = \"foley:graph/1\"]\nGraph(nodes: {\n\"n0\": Noise(rate: 8000),\n");
        for k in 1..6 {
            text += &format!("\"n{k}\": Gain(audio: \"n{}\", gain: 0.5),\n", k - 1);
        }
        text += "\"n6\": WavOut(audio: \"n5\", path: \"a.wav\"),\n})";
        let graph = load_text("graph", &text, Path::new("graph.ron"), &LoadOptions::default()).graph.unwrap();
        let rule = Rule { per_byte: 1e-3, least: 0.0, read: 1e-4, most_nodes: 100 };
        let costs = [0.1, 0.2, 9.0, 0.1, 0.1, 0.1, 0.1];
        let seconds = |n: usize| costs[n];
        let bytes = |n: usize| (n < 6).then_some(1000.0);
        let chosen = choose(&graph, &graph.order, &rule, &seconds, &bytes);
        assert_eq!(chosen.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [2]);
        assert!((chosen[0].1 - 9.3).abs() < 1e-9);
        // Where that stream is too large, the next that is not takes its place.
        let bytes = |n: usize| (n < 6).then_some(if n < 4 { 1e6 } else { 10.0 });
        let chosen = choose(&graph, &graph.order, &rule, &seconds, &bytes);
        assert_eq!(chosen.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [4, 5]);
    }
}
