//! Candidates by the number of their ancestors that match, found as they are needed.
//!
//! A candidate of an output node matches to the depth `a` if it and its `a - 1` nearest ancestors are similar to those of the output, and the
//! next one is not. The candidates of depth `a > 1` are the similar children of those of depth `a - 1` of the parent, so each list is short
//! and found once; only those of depth 1 need a search by value.

use super::output::OutputTree;
use crate::soundtrack::wavelet::TextureModel;

/// A list that was not found yet.
const OPEN: (u32, u32) = (u32::MAX, 0);

/// Candidates of all nodes below one root.
#[derive(Clone, Debug)]
pub struct Classes {
    depth: usize,
    limit: usize,
    lists: Vec<(u32, u32)>,
    nodes: Vec<u32>,
    /// Lists that were too long.
    pub capped: u64,
}

/// True if the values of two nodes are similar.
#[inline]
pub fn are_similar(a: &[f32], b: &[f32], threshold: f32) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= threshold)
}

/// The values of a node of a model.
#[inline]
pub fn source_value(model: &TextureModel, level: usize, node: u32) -> &[f32] {
    let channels = model.tree.channels;
    let k = node as usize * channels;
    &model.tree.details[level][k..k + channels]
}

/// True if a node of the model is similar to one of the output.
#[inline]
pub fn matches(model: &TextureModel, out: &OutputTree, level: usize, node: usize, candidate: u32) -> bool {
    let threshold = model.thresholds[level];
    are_similar(source_value(model, level, candidate), out.value(level, node as isize), threshold)
}

/// The number of ancestors in a row that match, with the node itself.
pub fn path(model: &TextureModel, out: &OutputTree, level: usize, node: usize, candidate: u32) -> usize {
    (0..=level).take_while(|up| matches(model, out, level - up, node >> up, candidate >> up)).count()
}

impl Classes {
    /// Room for the candidates below one root.
    pub fn new(depth: usize, limit: usize) -> Self {
        // Leaves are copied with their parents.
        let nodes = (1 << depth.saturating_sub(1)) - 1;
        Self { depth, limit: limit.max(1), lists: vec![OPEN; nodes * depth], nodes: Vec::new(), capped: 0 }
    }

    /// Removes all candidates.
    pub fn clear(&mut self) {
        self.lists.fill(OPEN);
        self.nodes.clear();
    }

    /// The candidates of a node that match to a depth from 1 to `level + 1`.
    pub fn get(
        &mut self,
        model: &TextureModel,
        out: &OutputTree,
        level: usize,
        node: usize,
        a: usize,
    ) -> &[u32] {
        let (from, to) = self.find(model, out, level, node, a);
        &self.nodes[from as usize..to as usize]
    }

    fn find(
        &mut self,
        model: &TextureModel,
        out: &OutputTree,
        level: usize,
        node: usize,
        a: usize,
    ) -> (u32, u32) {
        let k = ((1 << level) - 1 + node) * self.depth + a - 1;
        if self.lists[k] != OPEN {
            return self.lists[k];
        }
        let parents = if a > 1 { self.find(model, out, level - 1, node / 2, a - 1) } else { (0, 0) };
        let start = self.nodes.len();
        if a > 1 {
            for parent in parents.0..parents.1 {
                let child = 2 * self.nodes[parent as usize];
                for child in [child, child + 1] {
                    if !model.is_redundant(level, child) && matches(model, out, level, node, child) {
                        self.nodes.push(child);
                    }
                }
            }
        } else {
            let is_new = |candidate: &&u32| {
                (model.tree.channels == 1 || matches(model, out, level, node, **candidate))
                    && (level == 0 || !matches(model, out, level - 1, node / 2, **candidate / 2))
            };
            self.nodes.extend(model.similar(level, out.value(level, node as isize)[0]).iter().filter(is_new));
        }
        let found = self.nodes.len() - start;
        if found > self.limit {
            for k in 0..self.limit {
                self.nodes[start + k] = self.nodes[start + k * found / self.limit];
            }
            self.nodes.truncate(start + self.limit);
            self.capped += 1;
        }
        self.lists[k] = (start as u32, self.nodes.len() as u32);
        self.lists[k]
    }
}
