//! What goes where when one layout takes over from another.

use super::union::Outputs;
use crate::plan::{BufferPlan, Import, LivePlan, Region, What};
use foley_nodes::core::buffer::Pad;
use std::collections::HashMap;

/// The part and the place in it where a job runs.
pub fn place(plan: &LivePlan, job: What) -> Option<(usize, usize)> {
    plan.regions.iter().enumerate().find_map(|(region, r)| {
        let place = r.nodes.iter().position(|node| node.job == job)?;
        Some((region, place))
    })
}

/// What goes where when one layout takes over from another.
pub struct Moves<'a> {
    /// What plays.
    pub old: &'a LivePlan,
    /// What takes over.
    pub new: &'a LivePlan,
    /// Where nodes that go on were before.
    pub moved: &'a HashMap<usize, usize>,
}

/// Places before and after.
pub type Pairs = Vec<(usize, usize)>;

fn pad(buffer: &BufferPlan) -> Option<Pad> {
    match buffer {
        BufferPlan::Items { pad, .. } => Some(*pad),
        BufferPlan::Events { .. } => None,
    }
}

/// The buffers of pairs of outputs, as far as both have one.
pub fn pairs(from: &Region, to: &Region, outputs: &Outputs) -> Pairs {
    let mut pairs = Pairs::new();
    for (a, b) in outputs {
        let Some(source) = from.origins.iter().position(|o| o == a) else { continue };
        let own = |t: &usize| to.origins[*t] == *b;
        pairs.extend((0..to.origins.len()).filter(own).map(|t| (source, t)));
    }
    pairs
}

impl Moves<'_> {
    /// The job in the old layout that a job of the new one goes on from.
    fn before(&self, job: What) -> Option<What> {
        match job {
            What::Node(n) => self.moved.get(&n).map(|&m| What::Node(m)),
            What::Tap(k) => {
                let old = self.old.heard.iter().position(|h| h.id == self.new.heard[k].id)?;
                let width = |plan: &LivePlan, k: usize| {
                    let link = &plan.heard[k].link;
                    plan.prelude.shapes[link.node].outputs[link.port].as_ref().map(|s| s.width)
                };
                (width(self.old, old) == width(self.new, k)).then_some(What::Tap(old))
            }
        }
    }

    /// Nodes and buffers that go from one part to another.
    pub fn between(&self, from: usize, to: usize) -> (Pairs, Pairs) {
        let (old, new) = (&self.old.regions[from], &self.new.regions[to]);
        let places: HashMap<What, usize> = (0..).zip(&old.nodes).map(|(k, n)| (n.job, k)).collect();
        let nodes = (0..)
            .zip(&new.nodes)
            .filter_map(|(k, node): (usize, _)| Some((*places.get(&self.before(node.job)?)?, k)));
        (nodes.collect(), self.buffers(old, new))
    }

    fn buffers(&self, old: &Region, new: &Region) -> Pairs {
        let key = |region: &Region, t: usize| (region.origins[t], pad(&region.buffers[t]));
        let places: HashMap<_, usize> = (0..old.buffers.len()).map(|t| (key(old, t), t)).collect();
        let pair = |t: usize| {
            let ((node, port), pad) = key(new, t);
            let was = (*self.moved.get(&node)?, port);
            Some((*places.get(&(was, pad))?, t))
        };
        (0..new.buffers.len()).filter_map(pair).collect()
    }

    /// Links into the callback that go on.
    pub fn links(&self) -> Pairs {
        let (old, new) = (self.old.callback(), self.new.callback());
        let buffers: HashMap<usize, usize> =
            self.buffers(old, new).into_iter().map(|(a, b)| (b, a)).collect();
        let pair = |(k, import): (usize, &Import)| {
            let was = buffers.get(&import.buffer)?;
            Some((old.imports.iter().position(|i| i.buffer == *was)?, k))
        };
        (0..).zip(&new.imports).filter_map(pair).collect()
    }

    /// Pairs of nodes in a part, by their places, of which the second takes over what fits from the first.
    pub fn adopts(&self, region: usize, adopts: &[(usize, usize)]) -> Pairs {
        let find = |n: usize| self.new.regions[region].nodes.iter().position(|p| p.job == What::Node(n));
        adopts.iter().filter_map(|&(a, b)| find(a).zip(find(b))).collect()
    }
}
