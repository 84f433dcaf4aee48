//! State transfer: the nodes, buffers and links that move from the running graph to the next.

use crate::plan::{BufferPlan, Import, LivePlan, Region, Runnable};
use foley_nodes::core::buffer::Pad;
use std::collections::HashMap;

/// IndexPairs of outputs, each a node and a port.
pub type OutputPairs = Vec<((usize, usize), (usize, usize))>;

/// IndexPairs of an old and a new index.
pub type IndexPairs = Vec<(usize, usize)>;

/// Finds the region of a runnable, and its index in it.
pub fn locate(plan: &LivePlan, runnable: Runnable) -> Option<(usize, usize)> {
    plan.regions.iter().enumerate().find_map(|(region, r)| {
        let index = r.nodes.iter().position(|node| node.runnable == runnable)?;
        Some((region, index))
    })
}

/// The transfer between two plans.
pub struct StateTransfer<'a> {
    /// The plan that plays.
    pub old: &'a LivePlan,
    /// The next plan.
    pub new: &'a LivePlan,
    /// Old index of the nodes that continue, by new index.
    pub continued: &'a HashMap<usize, usize>,
}

fn pad(buffer: &BufferPlan) -> Option<Pad> {
    match buffer {
        BufferPlan::Items { pad, .. } => Some(*pad),
        BufferPlan::Events { .. } => None,
    }
}

/// Finds the buffers of pairs of outputs that are in both regions.
pub fn buffer_pairs(from: &Region, to: &Region, outputs: &OutputPairs) -> IndexPairs {
    let mut pairs = IndexPairs::new();
    for (a, b) in outputs {
        let Some(source) = from.origins.iter().position(|o| o == a) else { continue };
        let of_output = |t: &usize| to.origins[*t] == *b;
        pairs.extend((0..to.origins.len()).filter(of_output).map(|t| (source, t)));
    }
    pairs
}

impl StateTransfer<'_> {
    /// The old runnable that a new one continues.
    fn old_runnable(&self, runnable: Runnable) -> Option<Runnable> {
        match runnable {
            Runnable::Node(n) => self.continued.get(&n).map(|&m| Runnable::Node(m)),
            Runnable::Tap(k) => {
                let old = self.old.sinks.iter().position(|sink| sink.id == self.new.sinks[k].id)?;
                let width = |plan: &LivePlan, k: usize| {
                    let link = &plan.sinks[k].link;
                    plan.prelude.shapes[link.node].outputs[link.port].as_ref().map(|s| s.width)
                };
                (width(self.old, old) == width(self.new, k)).then_some(Runnable::Tap(old))
            }
        }
    }

    /// Finds the nodes and buffers that move from one region to another.
    pub fn between(&self, from: usize, to: usize) -> (IndexPairs, IndexPairs) {
        let (old, new) = (&self.old.regions[from], &self.new.regions[to]);
        let index: HashMap<Runnable, usize> = (0..).zip(&old.nodes).map(|(k, n)| (n.runnable, k)).collect();
        let nodes = (0..)
            .zip(&new.nodes)
            .filter_map(|(k, node): (usize, _)| Some((*index.get(&self.old_runnable(node.runnable)?)?, k)));
        (nodes.collect(), self.buffers(old, new))
    }

    fn buffers(&self, old: &Region, new: &Region) -> IndexPairs {
        let key = |region: &Region, t: usize| (region.origins[t], pad(&region.buffers[t]));
        let index: HashMap<_, usize> = (0..old.buffers.len()).map(|t| (key(old, t), t)).collect();
        let pair = |t: usize| {
            let ((node, port), pad) = key(new, t);
            let old_output = (*self.continued.get(&node)?, port);
            Some((*index.get(&(old_output, pad))?, t))
        };
        (0..new.buffers.len()).filter_map(pair).collect()
    }

    /// Finds the links to the callback that continue.
    pub fn links(&self) -> IndexPairs {
        let (old, new) = (self.old.callback_region(), self.new.callback_region());
        let buffers: HashMap<usize, usize> =
            self.buffers(old, new).into_iter().map(|(a, b)| (b, a)).collect();
        let pair = |(k, import): (usize, &Import)| {
            let old_buffer = buffers.get(&import.buffer)?;
            Some((old.imports.iter().position(|i| i.buffer == *old_buffer)?, k))
        };
        (0..).zip(&new.imports).filter_map(pair).collect()
    }

    /// Finds the pairs of nodes in a region whose second node adopts the state of the first.
    pub fn adoptions(&self, region: usize, adoptions: &[(usize, usize)]) -> IndexPairs {
        let find =
            |n: usize| self.new.regions[region].nodes.iter().position(|p| p.runnable == Runnable::Node(n));
        adoptions.iter().filter_map(|&(a, b)| find(a).zip(find(b))).collect()
    }
}
