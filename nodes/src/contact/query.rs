//! The search of one frame, a cluster of neighbouring vertices at a time.
//!
//! A cluster walks each tree once for all of its vertices, and drops what is excluded for all of them on the way; the few
//! lowest nodes that remain are then tested against each vertex.

use fearless_simd::Level;

use super::boxes::{CLUSTER, LANES, larger, smaller};
use super::detector::Frame;
use super::neighbourhood::{Neighbourhoods, everyone};
use super::sieve::{Pair, Points, drop_far_boxes, drop_far_triangles, points_within};
use super::tree::{Ball, Leaf, Tree, reach};
use super::triangle::closest_point;
use super::vector::{cross, dot, sub, widen};

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
    pairs: Vec<Pair>,
    last: Vec<Candidate>,
    /// The nodes of the cloth's own tree that a search leaves out; all false between searches.
    covered: Vec<bool>,
}

impl Scratch {
    /// Room for searches of `trees`, the cloth's own first.
    pub fn new(trees: &[Tree], slots: usize) -> Self {
        let leaves = trees.iter().map(Tree::leaves).max().unwrap_or(0);
        let own = trees.first().map_or(0, Tree::nodes);
        let last = vec![Candidate::NONE; slots];
        Self {
            leaves: Vec::with_capacity(leaves),
            pairs: Vec::with_capacity(CLUSTER * leaves),
            last,
            covered: vec![false; own],
        }
    }
}

/// Everything that stays the same during one frame.
pub(super) struct Scene<'a> {
    pub now: Frame<'a>,
    pub triangles: &'a [Vec<[u32; 3]>],
    pub trees: &'a [Tree],
    pub neighbourhoods: &'a Neighbourhoods,
    pub squared_radius: f64,
    pub two_sided: bool,
    pub extent: f64,
    pub level: Level,
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
    pub fn query(&self, cluster: usize, vertices: &[u32], found: &mut [Candidate], scratch: &mut Scratch) {
        let slots = scratch.last.len();
        let mut points = Points { columns: [[0.0; CLUSTER]; 3], reaches: [0.0; CLUSTER] };
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (i, (&v, kept)) in vertices.iter().zip(found.chunks_mut(slots)).enumerate() {
            let p = self.now.vertex(v as usize);
            for axis in 0..3 {
                points.columns[axis][i] = p[axis];
                lo[axis] = smaller(p[axis], lo[axis]);
                hi[axis] = larger(p[axis], hi[axis]);
            }
            // What was touched a frame ago is probably still near: starting from it keeps the search short.
            scratch.last.copy_from_slice(kept);
            kept.fill(Candidate::NONE);
            for candidate in scratch.last.iter().filter(|c| c.is_some()) {
                let corners = self.now.triangle(candidate.surface as usize, self.corners(candidate));
                self.offer(p, corners, candidate.surface, candidate.triangle, kept);
            }
            points.reaches[i] = self.reach(kept);
        }
        let all = everyone(vertices.len());
        let Scratch { leaves, covered, pairs, .. } = scratch;
        for (surface, tree) in self.trees.iter().enumerate() {
            leaves.clear();
            let near = Ball { lo, hi, squared_radius: points.reaches.iter().copied().fold(0.0, larger) };
            if surface == 0 {
                let covers = self.neighbourhoods.covers(cluster);
                covers.iter().for_each(|&node| covered[node as usize] = true);
                tree.gather(&near, all, |node| covered[node], leaves);
                covers.iter().for_each(|&node| covered[node as usize] = false);
                tree.sift(&near, self.neighbourhoods.leaves(cluster), leaves);
            } else {
                tree.gather(&near, all, |_| false, leaves);
            }
            self.visit(surface, leaves, pairs, &mut points, found, slots);
        }
    }

    /// Offers the triangles of some lowest nodes to the vertices of a cluster that they are near to.
    ///
    /// In three passes, so that none waits for the branches of another: boxes, distances in single precision, exact distances.
    #[inline]
    fn visit(
        &self,
        surface: usize,
        leaves: &[Leaf],
        pairs: &mut Vec<Pair>,
        points: &mut Points,
        found: &mut [Candidate],
        slots: usize,
    ) {
        let tree = &self.trees[surface];
        pairs.clear();
        for leaf in leaves {
            // Of most leaves that were found the cluster's box is near, but none of the vertices allowed.
            let mut near = leaf.anyone();
            if let Some((above, lane)) = tree.above(leaf) {
                near &= points_within(self.level, above, lane, points);
            }
            while near != 0 {
                let point = near.trailing_zeros() as usize;
                near &= near - 1;
                pairs.push(Pair { node: leaf.node, point: point as u16, lanes: leaf.lanes(point) as u16 });
            }
        }
        drop_far_boxes(self.level, tree.lowest(), points, pairs);
        let mut kept = 0;
        for k in 0..pairs.len() {
            pairs[kept] = pairs[k];
            kept += usize::from(pairs[k].lanes != 0);
        }
        pairs.truncate(kept);
        drop_far_triangles(self.level, tree.all_corners(), points, pairs);
        for pair in pairs.iter() {
            let mut lanes = pair.lanes;
            let i = pair.point as usize;
            while lanes != 0 {
                let slot = pair.node as usize * LANES + lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let p = points.at(i);
                let kept = &mut found[i * slots..(i + 1) * slots];
                if self.offer(p, tree.corners(slot), surface as u32, tree.order()[slot], kept) {
                    points.reaches[i] = self.reach(kept);
                }
            }
        }
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
        let [a, b, c] = corners;
        let (p, corners) = (widen(p), [widen(a), widen(b), widen(c)]);
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
