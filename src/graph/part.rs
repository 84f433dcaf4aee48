//! The part of a graph that some of its nodes need.

use super::{Graph, GraphNode, Link};
use std::sync::Arc;

impl Graph {
    /// The nodes `ends` with all nodes from which a path leads to them, and the index in it of each node of the whole graph.
    ///
    /// Ids and order are unchanged, so that each node computes the same as in the whole graph.
    ///
    /// # Complexity
    /// O(nodes + links).
    #[must_use]
    pub fn part(&self, ends: &[usize]) -> (Self, Vec<Option<usize>>) {
        let mut needed = vec![false; self.nodes.len()];
        let mut open = ends.to_vec();
        while let Some(n) = open.pop() {
            if !std::mem::replace(&mut needed[n], true) {
                open.extend(self.nodes[n].links.iter().flatten().map(|link| link.node));
            }
        }
        let mut count = 0;
        let places: Vec<Option<usize>> = needed
            .iter()
            .map(|needed| {
                count += usize::from(*needed);
                needed.then(|| count - 1)
            })
            .collect();
        let moved = |link: &Link| Some(Link { node: places[link.node]?, ..link.clone() });
        let copy = |node: &GraphNode| GraphNode {
            id: node.id.clone(),
            ty: Arc::clone(&node.ty),
            params: node.params.boxed(),
            links: node.links.iter().map(|links| links.iter().filter_map(moved).collect()).collect(),
            location: node.location.clone(),
            fields: node.fields.clone(),
            whole: node.whole,
        };
        let order: Vec<usize> = self.order.iter().filter_map(|&n| places[n]).collect();
        let mut rank = vec![0; order.len()];
        order.iter().enumerate().for_each(|(at, &n)| rank[n] = at);
        let nodes = self.nodes.iter().zip(&needed).filter(|(_, needed)| **needed);
        let part = Self {
            title: self.title.clone(),
            seed: self.seed,
            nodes: nodes.map(|(node, _)| copy(node)).collect(),
            order,
            rank,
            sources: self.sources.clone(),
        };
        (part, places)
    }
}

#[cfg(test)]
mod tests {
    use crate::graph::{LoadOptions, load_text};
    use std::path::Path;

    #[test]
    fn a_part_holds_what_its_ends_need_and_nothing_else() {
        let text = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"out\": WavOut(audio: \"loud\", path: \"o.wav\"),
    \"other\": Tone(frequency: 1.0, rate: 8000, duration: Some(1.0)),
    \"loud\": Gain(audio: \"room\"),
    \"room\": Mix(inputs: [\"tone\", \"echo\"]),
    \"echo\": Feedback(audio: \"room\", like: \"tone\", delay: 0.1),
    \"tone\": Tone(frequency: 2.0, rate: 8000, duration: Some(1.0)),
    \"far\": Gain(audio: \"other\"),
})";
        let whole = load_text("a.ron", text, Path::new("a.ron"), &LoadOptions::default()).graph.unwrap();
        let (part, places) = whole.part(&[whole.find("loud").unwrap()]);
        let ids: Vec<&str> = part.nodes.iter().map(|node| node.id.as_str()).collect();
        assert_eq!(ids, ["loud", "room", "echo", "tone"]);
        assert_eq!(places[whole.find("room").unwrap()], part.find("room"));
        assert_eq!(places[whole.find("out").unwrap()], None);
        // The links of the loop lead to the same nodes, and the order has all of them once.
        let inputs = &part.nodes[part.find("room").unwrap()].links[0];
        assert_eq!(inputs.iter().map(|l| ids[l.node]).collect::<Vec<_>>(), ["tone", "echo"]);
        let mut order = part.order.clone();
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 3]);
        assert!(part.order.iter().enumerate().all(|(at, &n)| part.rank[n] == at));
    }
}
