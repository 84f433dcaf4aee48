//! Leaves of the cloth's own hierarchy with triangles that some vertices of a cluster must not touch.
//!
//! They change only when the hierarchy is sorted. A search skips them and takes them from these lists, so that its traversal
//! does not test exclusion.

use super::boxes::{CLUSTER, LANES};
use super::bvh::{Bvh, Leaf};
use super::exclusion::{Exclusion, SharedRun};

/// For each cluster, the leaves with a triangle that is excluded for one of its vertices.
#[derive(Clone, Debug)]
pub(in crate::contact) struct ExcludedLeaves {
    /// Exclusions of each cluster.
    runs: Vec<Vec<SharedRun>>,
    /// Start of each cluster's part of `partial` and of `covers`, and the end of the last.
    starts: Vec<usize>,
    /// Numbers of `partial` and of `covers` of each cluster.
    lens: Vec<[u32; 2]>,
    /// Leaves that some vertices of the cluster may touch.
    partial: Vec<Leaf>,
    /// Nodes whose leaves all have an exclusion, as near the root as possible.
    covers: Vec<u32>,
    /// Slot of each rank.
    slots: Vec<u32>,
    /// Scratch: excluded slots of a cluster, with its vertices.
    excluded: Vec<(u32, u16)>,
}

impl ExcludedLeaves {
    /// Allocates the lists for any order of the hierarchy, and fills them.
    ///
    /// # Complexity
    /// Memory O(triangles excluded for each cluster).
    pub fn new(vertices: usize, exclusion: &Exclusion, runs: Vec<Vec<SharedRun>>, own: &Bvh) -> Self {
        let counts = runs.iter().map(|runs| runs.iter().map(|run| run.ranks().len()).sum::<usize>());
        let mut starts = vec![0];
        for count in counts.clone() {
            starts.push(starts[starts.len() - 1] + count);
        }
        let capacity = starts[starts.len() - 1];
        let mut lists = Self {
            lens: vec![[0; 2]; runs.len()],
            partial: vec![Leaf { node: 0, allowed: [0; LANES] }; capacity],
            covers: vec![0; capacity],
            slots: vec![0; own.len()],
            excluded: Vec::with_capacity(counts.max().unwrap_or(0)),
            runs,
            starts,
        };
        lists.update(vertices, exclusion, own);
        lists
    }

    /// Fills the lists for the present order of the hierarchy.
    ///
    /// # Complexity
    /// O(n log n) for n triangles excluded per cluster, for each cluster. Never allocates.
    pub fn update(&mut self, vertices: usize, exclusion: &Exclusion, own: &Bvh) {
        for (slot, &triangle) in own.order().iter().enumerate() {
            self.slots[exclusion.rank(triangle) as usize] = slot as u32;
        }
        for (cluster, runs) in self.runs.iter().enumerate() {
            self.excluded.clear();
            for run in runs {
                let slots = self.slots[run.ranks()].iter();
                self.excluded.extend(slots.map(|&slot| (slot, run.members())));
            }
            self.excluded.sort_unstable();
            let part = self.starts[cluster]..self.starts[cluster + 1];
            let (partial, covers) = (&mut self.partial[part.clone()], &mut self.covers[part]);
            let all = all_members((vertices - cluster * CLUSTER).min(CLUSTER));
            let (mut partial_len, mut leaves) = (0, 0);
            for slots in self.excluded.chunk_by(|a, b| a.0 / LANES as u32 == b.0 / LANES as u32) {
                let node = slots[0].0 / LANES as u32;
                let mut allowed = [all; LANES];
                for &(slot, members) in slots {
                    allowed[slot as usize % LANES] &= !members;
                }
                covers[leaves] = node;
                leaves += 1;
                if allowed != [0; LANES] {
                    partial[partial_len] = Leaf { node, allowed };
                    partial_len += 1;
                }
            }
            self.lens[cluster] = [partial_len as u32, own.merge_into_ancestors(&mut covers[..leaves]) as u32];
        }
    }

    /// Leaves with an exclusion that some of a cluster's vertices may touch.
    #[inline]
    pub fn partial(&self, cluster: usize) -> &[Leaf] {
        &self.partial[self.starts[cluster]..][..self.lens[cluster][0] as usize]
    }

    /// The smallest set of nodes whose leaves are the leaves with an exclusion and no others.
    #[inline]
    pub fn covers(&self, cluster: usize) -> &[u32] {
        &self.covers[self.starts[cluster]..][..self.lens[cluster][1] as usize]
    }
}

/// One bit for each of a cluster's vertices.
#[inline]
pub(in crate::contact) fn all_members(vertices: usize) -> u16 {
    u16::MAX >> (CLUSTER - vertices)
}
