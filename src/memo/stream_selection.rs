//! Selects the streams that are worth caching.

use crate::graph::Graph;
use std::collections::{BTreeSet, HashSet};

/// Costs from which a stream is cached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CachePolicy {
    /// Minimum time to compute a stream, s per byte; writing and reading it takes about a third of the default.
    pub seconds_per_byte: f64,
    /// Minimum time to compute a stream, s.
    pub min_seconds: f64,
    /// Time to read a cached stream, s per byte.
    pub read_seconds_per_byte: f64,
    /// Maximum number of stream nodes of a phase: in larger ones the look-up takes too long.
    pub max_nodes: usize,
}

impl Default for CachePolicy {
    fn default() -> Self {
        Self { seconds_per_byte: 8e-9, min_seconds: 0.02, read_seconds_per_byte: 2.5e-9, max_nodes: 1000 }
    }
}

/// Returns the nodes whose streams are worth caching, in the order of `nodes`, each with the time that this saves, s.
///
/// The cost of a node is its own time and that of all nodes upstream, up to the next cached streams. So the last streams of
/// an expensive part are cached, and none of the cheap ones that follow.
///
/// # Complexity
/// O(nodes x links upstream).
pub fn choose_streams(
    graph: &Graph,
    nodes: &[usize],
    policy: &CachePolicy,
    seconds: &dyn Fn(usize) -> f64,
    bytes: &dyn Fn(usize) -> Option<f64>,
) -> Vec<(usize, f64)> {
    let own: HashSet<usize> = nodes.iter().copied().collect();
    let mut cached: BTreeSet<usize> = BTreeSet::new();
    let mut chosen = Vec::new();
    for &n in nodes {
        let Some(size) = bytes(n) else { continue };
        let mut visited = HashSet::from([n]);
        let mut stack = vec![n];
        let mut cost = 0.0;
        while let Some(v) = stack.pop() {
            if cached.contains(&v) {
                cost += policy.read_seconds_per_byte * bytes(v).unwrap_or(0.0);
                continue;
            }
            cost += seconds(v);
            let upstream = graph.nodes[v].links.iter().flatten().map(|l| l.node);
            stack.extend(upstream.filter(|u| own.contains(u) && visited.insert(*u)));
        }
        if cost >= policy.min_seconds && cost >= policy.seconds_per_byte * size {
            cached.insert(n);
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
    fn the_last_streams_of_an_expensive_part_are_chosen() {
        let mut text =
            String::from("#![schema = \"foley:graph/1\"]\nGraph(nodes: {\n\"n0\": Noise(rate: 8000),\n");
        for k in 1..6 {
            text += &format!("\"n{k}\": Gain(audio: \"n{}\", gain: 0.5),\n", k - 1);
        }
        text += "\"n6\": WavOut(audio: \"n5\", path: \"a.wav\"),\n})";
        let graph = load_text("graph", &text, Path::new("graph.ron"), &LoadOptions::default()).graph.unwrap();
        let policy = CachePolicy {
            seconds_per_byte: 1e-3,
            min_seconds: 0.0,
            read_seconds_per_byte: 1e-4,
            max_nodes: 100,
        };
        let costs = [0.1, 0.2, 9.0, 0.1, 0.1, 0.1, 0.1];
        let seconds = |n: usize| costs[n];
        let bytes = |n: usize| (n < 6).then_some(1000.0);
        let chosen = choose_streams(&graph, &graph.order, &policy, &seconds, &bytes);
        assert_eq!(chosen.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [2]);
        assert!((chosen[0].1 - 9.3).abs() < 1e-9);
        // If that stream is too large, the next smaller ones are chosen.
        let bytes = |n: usize| (n < 6).then_some(if n < 4 { 1e6 } else { 10.0 });
        let chosen = choose_streams(&graph, &graph.order, &policy, &seconds, &bytes);
        assert_eq!(chosen.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [4, 5]);
    }
}
