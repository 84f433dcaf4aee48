//! Layers of an output, and their mixture.

use super::classes::{Classes, source_value};
use super::morph::Morph;
use super::node_constraints::NodeConstraints;
use super::output::{NONE, OutputTree};
use super::recent::{Recent, Round};
use super::rules::{CandidateSearch, SynthesisRules};
use super::step::predecessor;
use crate::impl_state;
use crate::soundtrack::wavelet::TextureModel;
use std::ops::Range;

/// The candidates of the nodes of one root that are left at the end.
#[derive(Clone, Debug, Default)]
pub struct Remaining {
    /// By node, where its candidates begin and end; empty if they are not used.
    ranges: Vec<(u32, u32)>,
    nodes: Vec<u32>,
}

impl Remaining {
    fn new(depth: usize, is_used: bool) -> Self {
        let nodes = if is_used { (1 << depth.saturating_sub(1)) - 1 } else { 0 };
        Self { ranges: vec![(0, 0); nodes], nodes: Vec::new() }
    }

    /// Sets the candidates of a node.
    pub fn set(&mut self, level: usize, node: usize, candidates: &[u32]) {
        if let Some(range) = self.ranges.get_mut((1 << level) - 1 + node) {
            let start = self.nodes.len() as u32;
            self.nodes.extend_from_slice(candidates);
            *range = (start, self.nodes.len() as u32);
        }
    }

    /// Puts the children of the candidates of the parent of a node into `out`; none for a root.
    pub fn children(&self, level: usize, node: usize, out: &mut Vec<u32>) {
        out.clear();
        if level > 0
            && let Some((from, to)) = self.ranges.get((1 << (level - 1)) - 1 + node / 2)
        {
            out.extend(self.nodes[*from as usize..*to as usize].iter().flat_map(|m| [2 * m, 2 * m + 1]));
        }
    }

    /// Removes all candidates.
    pub fn clear(&mut self) {
        self.ranges.fill((0, 0));
        self.nodes.clear();
    }
}

/// One layer of an output. With [`OverlapMode::Winner`](super::OverlapMode) there is one; otherwise there are two, which differ where two sounds overlap.
#[derive(Clone, Debug)]
pub struct Layer {
    /// The nodes.
    pub tree: OutputTree,
    /// The approximation of the current root by channel.
    pub approximation: Vec<f32>,
    /// The candidates of the current root.
    pub classes: Classes,
    /// Candidates that were left, for a narrow search.
    pub remaining: Remaining,
    /// Candidates that are compared first.
    pub first: Vec<u32>,
    /// Nodes that were chosen recently, by level.
    pub recent: Vec<Recent>,
    /// Roots that were chosen lately.
    pub recent_roots: Recent,
    /// Roots that were heard lately.
    pub round: Round,
}

impl Layer {
    /// Before the first root.
    pub fn new(model: &TextureModel, rules: &SynthesisRules) -> Self {
        let tree = &model.tree;
        let (depth, channels) = (tree.depth as usize, tree.channels);
        let history = rules.predecessors.max(rules.root_predecessors).max(1);
        let of_level = |level: usize, nodes: usize| {
            let limit = (rules.memory * tree.rate / tree.span(level) as f64).ceil() as usize;
            Recent::new(nodes, if rules.repetition < 1.0 { limit } else { 0 })
        };
        let recent = |level: usize| of_level(level, tree.nodes(level));
        Self {
            tree: OutputTree::new(depth, channels, history),
            approximation: vec![0.0; channels],
            classes: Classes::new(depth, rules.candidates),
            remaining: Remaining::new(depth, rules.search == CandidateSearch::Narrow),
            first: Vec::new(),
            recent: (0..depth.max(2) - 1).map(recent).collect(),
            recent_roots: of_level(0, tree.roots()),
            round: Round::new(model),
        }
    }

    /// Copies a node of the model.
    pub fn copy(&mut self, model: &TextureModel, level: usize, node: usize, pick: u32) {
        let before = self.tree.pick(level, node as isize - 1);
        let goes_on = before != NONE && predecessor(model, level, pick, 1) == Some(before);
        self.tree.set(level, node, source_value(model, level, pick), pick, goes_on);
    }

    /// Adds the last root to the round: what is heard of its halves.
    pub fn end_root(&mut self, model: &TextureModel) {
        let leaves = 1 << (model.tree.depth as usize - 1);
        for leaf in [leaves / 4, 3 * leaves / 4] {
            if let Some(root) = self.tree.root_of_leaf(leaf) {
                self.round.add(model, root);
            }
        }
    }

    /// The values of nodes.
    fn values(&self, level: usize, nodes: Range<usize>) -> &[f32] {
        let channels = self.approximation.len();
        &self.tree.current(level)[nodes.start * channels..nodes.end * channels]
    }
}

/// The last root, mixed of both layers.
#[derive(Clone, Debug)]
pub struct Mixed {
    morph: Morph,
    /// Details by level.
    pub details: Vec<Vec<f32>>,
    /// The approximation by channel.
    pub approximation: Vec<f32>,
    /// The leaves of the layer of the greater share.
    pub leaves: Vec<u32>,
}

impl Mixed {
    /// Before the first root.
    pub fn new(morph: Morph, model: &TextureModel) -> Self {
        let (depth, channels) = (model.tree.depth as usize, model.tree.channels);
        Self {
            morph,
            details: (0..depth).map(|level| vec![0.0; channels << level]).collect(),
            approximation: vec![0.0; channels],
            leaves: vec![0; 1 << depth.saturating_sub(1)],
        }
    }

    /// Mixes nodes of both layers.
    pub fn fill(&mut self, layers: &[Layer], wanted: &NodeConstraints, level: usize, nodes: Range<usize>) {
        let channels = self.approximation.len();
        let [first, second] = layers else { return };
        let own = nodes.start * channels..nodes.end * channels;
        let (a, b) = (first.values(level, nodes.clone()), second.values(level, nodes.clone()));
        let (lead, mixture) = match (wanted.share, wanted.own) {
            (Some(share), [Some(a), Some(b)]) => {
                let lead = usize::from(share < 0.5);
                (&layers[lead], Some(self.morph.mixture(level, [a.set, b.set], share)))
            }
            _ => (&layers[wanted.lead], None),
        };
        let values = self.details[level][own].iter_mut();
        match mixture {
            Some(mixture) => values.zip(a.iter().zip(b)).for_each(|(out, (a, b))| *out = mixture.mix(*a, *b)),
            None => values.zip(a).for_each(|(out, a)| *out = *a),
        }
        if level + 1 == self.details.len() {
            for node in nodes {
                self.leaves[node] = lead.tree.pick(level, node as isize);
            }
        }
    }
}

impl_state!(Layer { tree, approximation, each recent, recent_roots, round });
