//! Search of one frame, for a cluster of neighbouring vertices at a time.
//!
//! Each hierarchy is traversed once for all vertices of a cluster, without the nodes that are excluded for all of them; the
//! leaves found are then tested against each vertex.

use fearless_simd::Level;

use super::frame::Frame;
use crate::contact::broad_phase::bvh::{Bvh, Leaf, SearchRegion, search_limit};
use crate::contact::broad_phase::{
    CLUSTER, ClusterPoints, ExcludedLeaves, LANES, Pair, all_members, cull_boxes, cull_triangles, max, min,
    points_near_box,
};
use crate::contact::triangle::{closest_point, is_behind};
use crate::contact::vector::widen;

/// A triangle near a vertex. Candidates are ordered by distance, then surface, then triangle.
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

/// Scratch memory of the search of one cluster.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    leaves: Vec<Leaf>,
    pairs: Vec<Pair>,
    /// Contacts of one vertex in the previous frame.
    previous: Vec<Candidate>,
    /// True for the nodes of the cloth's own hierarchy that a search skips; all false between searches.
    skipped: Vec<bool>,
}

impl Scratch {
    /// Allocates memory for searches of `hierarchies`, the cloth's own first.
    pub fn new(hierarchies: &[Bvh], slots: usize) -> Self {
        let leaves = hierarchies.iter().map(Bvh::leaf_count).max().unwrap_or(0);
        let own = hierarchies.first().map_or(0, Bvh::node_count);
        Self {
            leaves: Vec::with_capacity(leaves),
            pairs: Vec::with_capacity(CLUSTER * leaves),
            previous: vec![Candidate::NONE; slots],
            skipped: vec![false; own],
        }
    }
}

/// Constants of the search of one frame.
pub(super) struct Scene<'a> {
    pub now: Frame<'a>,
    pub triangles: &'a [Vec<[u32; 3]>],
    pub hierarchies: &'a [Bvh],
    pub excluded_leaves: &'a ExcludedLeaves,
    pub squared_radius: f64,
    pub two_sided: bool,
    pub extent: f64,
    pub level: Level,
}

impl Scene<'_> {
    /// Vertices of a candidate's triangle.
    #[inline]
    pub fn corners(&self, candidate: &Candidate) -> [u32; 3] {
        self.triangles[candidate.surface as usize][candidate.triangle as usize]
    }

    /// Counts the leaves that overlap the boxes of the clusters; stops above `limit`.
    ///
    /// # Complexity
    /// O(V log F + limit).
    pub fn overlaps(&self, order: &[u32], limit: usize, scratch: &mut Scratch) -> usize {
        let mut count = 0;
        for (cluster, vertices) in order.chunks(CLUSTER).enumerate() {
            let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for p in vertices.iter().map(|&v| self.now.vertex(v as usize)) {
                for axis in 0..3 {
                    lo[axis] = min(p[axis], lo[axis]);
                    hi[axis] = max(p[axis], hi[axis]);
                }
            }
            let region = SearchRegion { lo, hi, squared_radius: 0.0 };
            for surface in 0..self.hierarchies.len() {
                self.collect(surface, cluster, &region, all_members(vertices.len()), scratch);
                count += scratch.leaves.len();
            }
            if count > limit {
                break;
            }
        }
        count
    }

    /// Collects the leaves of a surface in the region around a cluster that some of its vertices may touch.
    #[inline]
    fn collect(
        &self,
        surface: usize,
        cluster: usize,
        region: &SearchRegion,
        members: u16,
        scratch: &mut Scratch,
    ) {
        let (bvh, Scratch { leaves, skipped, .. }) = (&self.hierarchies[surface], scratch);
        leaves.clear();
        if surface == 0 {
            let covers = self.excluded_leaves.covers(cluster);
            covers.iter().for_each(|&node| skipped[node as usize] = true);
            bvh.collect_leaves(region, members, |node| skipped[node], leaves);
            covers.iter().for_each(|&node| skipped[node as usize] = false);
            bvh.filter_leaves(region, self.excluded_leaves.partial(cluster), leaves);
        } else {
            bvh.collect_leaves(region, members, |_| false, leaves);
        }
    }

    /// Replaces the contacts of a cluster in the previous frame, `found`, by those of this frame. Returns the number of leaves
    /// visited.
    ///
    /// # Shapes
    /// `found` holds the same number of slots for each of `vertices`, nearest first.
    pub fn query(
        &self,
        cluster: usize,
        vertices: &[u32],
        found: &mut [Candidate],
        scratch: &mut Scratch,
    ) -> usize {
        let slots = scratch.previous.len();
        let mut points = ClusterPoints { columns: [[0.0; CLUSTER]; 3], limits: [0.0; CLUSTER] };
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (i, (&v, nearest)) in vertices.iter().zip(found.chunks_mut(slots)).enumerate() {
            let p = self.now.vertex(v as usize);
            for axis in 0..3 {
                points.columns[axis][i] = p[axis];
                lo[axis] = min(p[axis], lo[axis]);
                hi[axis] = max(p[axis], hi[axis]);
            }
            // The contacts of the previous frame are probably still near, and limit the search.
            scratch.previous.copy_from_slice(nearest);
            nearest.fill(Candidate::NONE);
            for candidate in scratch.previous.iter().filter(|c| c.is_some()) {
                let corners = self.now.triangle(candidate.surface as usize, self.corners(candidate));
                self.insert(p, corners, candidate.surface, candidate.triangle, nearest);
            }
            points.limits[i] = self.limit(nearest);
        }
        let members = all_members(vertices.len());
        let mut visited = 0;
        for surface in 0..self.hierarchies.len() {
            let squared_radius = points.limits.iter().copied().fold(0.0, max);
            let region = SearchRegion { lo, hi, squared_radius };
            self.collect(surface, cluster, &region, members, scratch);
            visited += scratch.leaves.len();
            let Scratch { leaves, pairs, .. } = &mut *scratch;
            self.test_leaves(surface, leaves, pairs, &mut points, found, slots);
        }
        visited
    }

    /// Inserts the triangles of some leaves into the candidates of the vertices that they are near.
    ///
    /// Three passes, so that none stalls on the branches of another: boxes, distances in single precision, exact distances.
    #[inline]
    fn test_leaves(
        &self,
        surface: usize,
        leaves: &[Leaf],
        pairs: &mut Vec<Pair>,
        points: &mut ClusterPoints,
        found: &mut [Candidate],
        slots: usize,
    ) {
        let bvh = &self.hierarchies[surface];
        pairs.clear();
        for leaf in leaves {
            // Most leaves found are near the cluster's box, but not near any of the allowed vertices.
            let mut near = leaf.members();
            if let Some((parent, lane)) = bvh.parent(leaf) {
                near &= points_near_box(self.level, parent, lane, points);
            }
            while near != 0 {
                let point = near.trailing_zeros() as usize;
                near &= near - 1;
                pairs.push(Pair { node: leaf.node, point: point as u16, lanes: leaf.lanes(point) as u16 });
            }
        }
        cull_boxes(self.level, bvh.leaf_boxes(), points, pairs);
        let mut len = 0;
        for k in 0..pairs.len() {
            pairs[len] = pairs[k];
            len += usize::from(pairs[k].lanes != 0);
        }
        pairs.truncate(len);
        cull_triangles(self.level, bvh.leaf_corners(), points, pairs);
        for pair in pairs.iter() {
            let mut lanes = pair.lanes;
            let i = pair.point as usize;
            while lanes != 0 {
                let slot = pair.node as usize * LANES + lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let p = points.at(i);
                let nearest = &mut found[i * slots..(i + 1) * slots];
                if self.insert(p, bvh.corners(slot), surface as u32, bvh.order()[slot], nearest) {
                    points.limits[i] = self.limit(nearest);
                }
            }
        }
    }

    /// Squared distance within which a vertex with these candidates looks for triangles.
    #[inline]
    fn limit(&self, nearest: &[Candidate]) -> f32 {
        let farthest = nearest.last().map_or(0.0, |c| c.squared_distance);
        search_limit(farthest.min(self.squared_radius), self.extent)
    }

    /// Inserts a triangle into the nearest candidates. Returns false if it is too far, excluded by its side or already there.
    #[inline]
    fn insert(
        &self,
        p: [f32; 3],
        corners: [[f32; 3]; 3],
        surface: u32,
        triangle: u32,
        nearest: &mut [Candidate],
    ) -> bool {
        let Some(farthest) = nearest.last() else { return false };
        // Of many triangles through one place only the lowest count.
        if farthest.squared_distance == 0.0 && (surface, triangle) >= (farthest.surface, farthest.triangle) {
            return false;
        }
        let [a, b, c] = corners;
        let (p, corners) = (widen(p), [widen(a), widen(b), widen(c)]);
        let squared_distance = closest_point(p, corners).squared_distance;
        let candidate = Candidate { squared_distance, surface, triangle };
        if squared_distance > self.squared_radius || candidate >= *farthest {
            return false;
        }
        if !self.two_sided && is_behind(p, corners) {
            return false;
        }
        let index = nearest.partition_point(|c| *c < candidate);
        if nearest[index] == candidate {
            return false;
        }
        nearest[index..].rotate_right(1);
        nearest[index] = candidate;
        true
    }
}
