//! What exclusion means for the search: the lowest nodes of the cloth's own tree that some of a cluster may not touch.
//!
//! They change only when the tree is sorted anew, so a search passes by them and takes them from a list instead. It then asks
//! nothing about exclusion on its way down.

use super::boxes::{CLUSTER, LANES};
use super::exclusion::{Exclusion, SharedRun};
use super::tree::{Leaf, Tree};

/// For each cluster the lowest nodes with a triangle that is excluded for one of its vertices.
#[derive(Clone, Debug)]
pub(super) struct Neighbourhoods {
    /// Exclusions of each cluster.
    shared: Vec<Vec<SharedRun>>,
    /// Where each cluster's room starts in `leaves` and in `covers`, and where the last ends.
    starts: Vec<usize>,
    lens: Vec<[u32; 2]>,
    /// Lowest nodes that are left to some vertices.
    leaves: Vec<Leaf>,
    /// Nodes that hold nothing but lowest nodes with an exclusion, the largest possible.
    covers: Vec<u32>,
    /// The slot of each rank.
    slots: Vec<u32>,
    excluded: Vec<(u32, u16)>,
}

impl Neighbourhoods {
    /// Makes room for any order of the tree.
    ///
    /// # Complexity
    /// Memory O(triangles excluded for each cluster).
    pub fn new(vertices: usize, exclusion: &Exclusion, shared: Vec<Vec<SharedRun>>, own: &Tree) -> Self {
        let counts = shared.iter().map(|runs| runs.iter().map(|run| run.ranks().len()).sum::<usize>());
        let mut starts = vec![0];
        for count in counts.clone() {
            starts.push(starts[starts.len() - 1] + count);
        }
        let room = starts[starts.len() - 1];
        let mut lists = Self {
            lens: vec![[0; 2]; shared.len()],
            leaves: vec![Leaf { node: 0, allowed: [0; LANES] }; room],
            covers: vec![0; room],
            slots: vec![0; own.len()],
            excluded: Vec::with_capacity(counts.max().unwrap_or(0)),
            shared,
            starts,
        };
        lists.follow(vertices, exclusion, own);
        lists
    }

    /// Lists the nodes by the tree's present order.
    ///
    /// # Complexity
    /// O(n log n) for n triangles excluded per cluster, for each cluster. Never allocates.
    pub fn follow(&mut self, vertices: usize, exclusion: &Exclusion, own: &Tree) {
        for (slot, &triangle) in own.order().iter().enumerate() {
            self.slots[exclusion.rank(triangle) as usize] = slot as u32;
        }
        for (cluster, runs) in self.shared.iter().enumerate() {
            self.excluded.clear();
            for run in runs {
                let slots = self.slots[run.ranks()].iter();
                self.excluded.extend(slots.map(|&slot| (slot, run.members())));
            }
            self.excluded.sort_unstable();
            let room = self.starts[cluster]..self.starts[cluster + 1];
            let (leaves, covers) = (&mut self.leaves[room.clone()], &mut self.covers[room]);
            let all = everyone((vertices - cluster * CLUSTER).min(CLUSTER));
            let (mut left, mut touched) = (0, 0);
            for slots in self.excluded.chunk_by(|a, b| a.0 / LANES as u32 == b.0 / LANES as u32) {
                let node = slots[0].0 / LANES as u32;
                let mut allowed = [all; LANES];
                for &(slot, members) in slots {
                    allowed[slot as usize % LANES] &= !members;
                }
                covers[touched] = node;
                touched += 1;
                if allowed != [0; LANES] {
                    leaves[left] = Leaf { node, allowed };
                    left += 1;
                }
            }
            self.lens[cluster] = [left as u32, own.cover(&mut covers[..touched]) as u32];
        }
    }

    /// Lowest nodes with an exclusion that are left to some of a cluster's vertices.
    #[inline]
    pub fn leaves(&self, cluster: usize) -> &[Leaf] {
        &self.leaves[self.starts[cluster]..][..self.lens[cluster][0] as usize]
    }

    /// The fewest nodes that hold all lowest nodes with an exclusion and no other.
    #[inline]
    pub fn covers(&self, cluster: usize) -> &[u32] {
        &self.covers[self.starts[cluster]..][..self.lens[cluster][1] as usize]
    }
}

/// One bit for each of a cluster's vertices.
#[inline]
pub(super) fn everyone(vertices: usize) -> u16 {
    u16::MAX >> (CLUSTER - vertices)
}
