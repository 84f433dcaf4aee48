//! The search of one frame, a cluster of neighbouring vertices at a time.
//!
//! A cluster walks each tree once for all of its vertices, and drops what is excluded for all of them on the way; the few
//! lowest nodes that remain are then tested against each vertex.

use std::ops::Range;

use super::detector::Frame;
use super::exclusion::{Exclusion, SharedRun};
use super::tree::{CLUSTER, LANES, Leaf, Tree, reach};
use super::triangle::closest_point;
use super::vector::{cross, dot, sub, widen};

/// Most slots whose marks are worth reading to skip a subtree.
const WIDEST_MARKED: usize = 256;

/// A triangle near a vertex; candidates order by distance, then surface, then triangle.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Candidate {
    pub squared_distance: f64,
    pub surface: u32,
    pub triangle: u32,
}

impl Candidate {
    pub const NONE: Candidate =
        Candidate { squared_distance: f64::INFINITY, surface: u32::MAX, triangle: u32::MAX };

    #[inline]
    pub fn is_some(&self) -> bool {
        self.surface != u32::MAX
    }
}

/// Memory of one cluster's search.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    leaves: Vec<Leaf>,
    last: Vec<Candidate>,
    /// For each rank the vertices of the cluster that it is excluded for; all 0 between searches.
    marks: Vec<u16>,
}

impl Scratch {
    pub fn new(leaves: usize, slots: usize, ranks: usize) -> Self {
        Self { leaves: Vec::with_capacity(leaves), last: vec![Candidate::NONE; slots], marks: vec![0; ranks] }
    }
}

/// Everything that stays the same during one frame.
pub(super) struct Scene<'a> {
    pub now: Frame<'a>,
    pub triangles: &'a [Vec<[u32; 3]>],
    pub trees: &'a [Tree],
    pub exclusion: &'a Exclusion,
    pub squared_radius: f64,
    pub two_sided: bool,
    pub extent: f64,
}

impl Scene<'_> {
    /// The vertices of a candidate's triangle.
    #[inline]
    pub fn corners(&self, candidate: &Candidate) -> [u32; 3] {
        self.triangles[candidate.surface as usize][candidate.triangle as usize]
    }

    /// Replaces last frame's contacts of a cluster, `found`, by those of this frame.
    ///
    /// # Shapes
    /// `found` holds the same number of slots for each of `vertices`, nearest first.
    pub fn query(
        &self,
        vertices: &[u32],
        shared: &[SharedRun],
        found: &mut [Candidate],
        scratch: &mut Scratch,
    ) {
        let slots = scratch.last.len();
        let mut columns = [[0.0f32; CLUSTER]; 3];
        let mut reaches = [0.0f32; CLUSTER];
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (i, (&v, kept)) in vertices.iter().zip(found.chunks_mut(slots)).enumerate() {
            let p = self.now.vertex(v as usize);
            for axis in 0..3 {
                columns[axis][i] = p[axis];
                lo[axis] = lo[axis].min(p[axis]);
                hi[axis] = hi[axis].max(p[axis]);
            }
            // What was touched a frame ago is probably still near: starting from it keeps the search short.
            scratch.last.copy_from_slice(kept);
            kept.fill(Candidate::NONE);
            for candidate in scratch.last.iter().filter(|c| c.is_some()) {
                let corners = self.now.triangle(candidate.surface as usize, self.corners(candidate));
                self.offer(p, corners, candidate.surface, candidate.triangle, kept);
            }
            reaches[i] = self.reach(kept);
        }
        for run in shared {
            scratch.marks[run.ranks()].fill(run.members());
        }
        let all = u16::MAX >> (CLUSTER - vertices.len());
        for (surface, tree) in self.trees.iter().enumerate() {
            let widest = reaches[..vertices.len()].iter().copied().fold(0.0, f32::max);
            let own = surface == 0;
            let excluded =
                |slots: Range<u32>| if own { self.members_excluded(&scratch.marks, slots) } else { 0 };
            scratch.leaves.clear();
            tree.gather(&lo, &hi, widest, all, excluded, &mut scratch.leaves);
            for &leaf in &scratch.leaves {
                let node = tree.leaf(leaf);
                for lane in (0..LANES).filter(|&lane| leaf.allowed[lane] != 0) {
                    let mut near = leaf.allowed[lane] & node.points_within(lane, &columns, &reaches);
                    let slot = leaf.node as usize * LANES + lane;
                    while near != 0 {
                        let i = near.trailing_zeros() as usize;
                        near &= near - 1;
                        let p = columns.map(|column| column[i]);
                        let kept = &mut found[i * slots..(i + 1) * slots];
                        if self.offer(p, tree.corners(slot), surface as u32, tree.order()[slot], kept) {
                            reaches[i] = self.reach(kept);
                        }
                    }
                }
            }
        }
        for run in shared {
            scratch.marks[run.ranks()].fill(0);
        }
    }

    /// The vertices of a cluster for which all of some slots of the cloth's own tree are excluded.
    #[inline]
    fn members_excluded(&self, marks: &[u16], slots: Range<u32>) -> u16 {
        let (start, end) = (slots.start as usize, slots.end as usize);
        let tree = &self.trees[0];
        if tree.at_home() && end - start <= WIDEST_MARKED {
            let mut all = u16::MAX;
            for piece in marks[start..end].chunks(CLUSTER) {
                all = piece.iter().fold(all, |all, mark| all & mark);
                // Most subtrees are not excluded at all, and their first marks already say so.
                if all == 0 {
                    break;
                }
            }
            return all;
        }
        // Slots and ranks part company when the tree is sorted anew; then only single triangles can be looked up.
        if end - start > 1 {
            return 0;
        }
        marks[self.exclusion.rank(tree.order()[start]) as usize]
    }

    /// The squared distance beyond which no box matters to a vertex.
    #[inline]
    fn reach(&self, kept: &[Candidate]) -> f32 {
        let limit = kept.last().map_or(0.0, |c| c.squared_distance);
        reach(limit.min(self.squared_radius), self.extent)
    }

    /// Keeps a triangle if it is near enough and nearer than the farthest one kept. Returns whether it was.
    #[inline]
    fn offer(
        &self,
        p: [f32; 3],
        corners: [[f32; 3]; 3],
        surface: u32,
        triangle: u32,
        kept: &mut [Candidate],
    ) -> bool {
        let (p, corners) = (widen(p), corners.map(widen));
        let squared_distance = closest_point(p, corners).squared_distance;
        let candidate = Candidate { squared_distance, surface, triangle };
        let Some(worst) = kept.last() else { return false };
        if squared_distance > self.squared_radius || candidate >= *worst {
            return false;
        }
        if !self.two_sided && is_behind(p, corners) {
            return false;
        }
        let place = kept.partition_point(|c| *c < candidate);
        if kept[place] == candidate {
            return false;
        }
        kept[place..].rotate_right(1);
        kept[place] = candidate;
        true
    }
}

/// Whether a point lies on the inner side of the triangle's plane.
#[inline]
pub(super) fn is_behind(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> bool {
    dot(cross(sub(b, a), sub(c, a)), sub(p, a)) < 0.0
}
