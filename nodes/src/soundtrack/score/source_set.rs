//! Sets of sounds, and their nodes in a wavelet tree.

use super::node_set::NodeSet;
use crate::soundtrack::wavelet::WaveletTree;

/// Share of the nodes of a level that must remain for all nodes with a part in an excluded sound to be left out.
const LEFT: usize = 20;

/// The nodes of one set of sounds, whose targets share a constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceSet {
    /// The sounds of the score.
    pub sources: Vec<usize>,
    /// By level, the nodes that overlap a segment, with all their ancestors.
    pub included: Vec<NodeSet>,
    /// By level, the nodes that an exclusion leaves out: those that overlap a segment, or at coarse levels at which hardly a node would
    /// remain, those within one.
    pub excluded: Vec<NodeSet>,
    /// By level, the nodes that a weight between -1 and 1 acts on: those whose centres are in a segment, and at least one for each. They last about as
    /// long as the segments, so that the share of the time is that of the probability.
    pub centred: Vec<NodeSet>,
}

impl SourceSet {
    /// The nodes of sounds, whose segments are in samples.
    pub(super) fn new(sources: &[usize], segments: &[Vec<(u64, u64)>], tree: &WaveletTree) -> Self {
        let own: Vec<(u64, u64)> =
            sources.iter().filter_map(|k| segments.get(*k)).flatten().copied().collect();
        let depth = tree.depth as usize;
        let nodes = |level: usize, is_whole: bool| {
            let span = tree.span(level) as u64;
            let interval = |(from, to): &(u64, u64)| match is_whole {
                false => ((from / span) as u32, to.div_ceil(span) as u32),
                true => (from.div_ceil(span) as u32, (to / span) as u32),
            };
            NodeSet::new(own.iter().map(interval).collect())
        };
        let included: Vec<NodeSet> = (0..depth).map(|level| nodes(level, false)).collect();
        let excluded = |level: usize| {
            let left = tree.nodes(level).saturating_sub(included[level].len());
            let is_enough = left >= (tree.nodes(level) / LEFT).max(2);
            if is_enough || level + 2 >= depth { included[level].clone() } else { nodes(level, true) }
        };
        let excluded = (0..depth).map(excluded).collect();
        let centred = |level: usize| {
            let span = tree.span(level) as u64;
            let interval = |(from, to): &(u64, u64)| {
                let [first, end] = [from, to].map(|at| ((at + span / 2) / span) as u32);
                let middle = ((from + to) / 2 / span) as u32;
                if first < end { (first, end) } else { (middle, middle + 1) }
            };
            NodeSet::new(own.iter().map(interval).collect())
        };
        let centred = (0..depth).map(centred).collect();
        Self { sources: sources.to_vec(), included, excluded, centred }
    }
}
