//! Bounding volume hierarchy over the triangles of one surface.
//!
//! Triangles are sorted so that each aligned group of 4, 16, 64 ... is compact. Node j of a level holds the boxes of children
//! 4j .. 4j + 4 side by side, so one test serves four boxes and no child pointers exist.

use super::boxes::{Corners, LANES, Node, max, min};
use crate::contact::triangle::closest_point;
use crate::contact::vector::widen;
use crate::impl_state;

/// Growth of the summed box areas above which the triangles are sorted again.
const MAX_GROWTH: f64 = 1.5;
/// Capacity of the stack, enough for 4^16 triangles: three pending nodes per level, plus the four of the last.
const STACK: usize = 64;

/// A leaf node near a cluster of up to 16 vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Leaf {
    pub node: u32,
    /// Vertices that may touch each of its triangles, one bit per vertex.
    pub allowed: [u16; LANES],
}

impl Leaf {
    /// Vertices that may touch any of its triangles, one bit per vertex.
    #[inline]
    pub fn members(&self) -> u16 {
        self.allowed.iter().fold(0, |members, allowed| members | allowed)
    }

    /// Triangles that a vertex may touch, one bit per triangle.
    #[inline]
    pub fn lanes(&self, vertex: usize) -> u32 {
        let mut lanes = 0;
        for (lane, allowed) in self.allowed.iter().enumerate() {
            lanes |= u32::from(allowed >> vertex & 1) << lane;
        }
        lanes
    }
}

/// Space within a distance of a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchRegion {
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    pub squared_radius: f32,
}

impl SearchRegion {
    /// Boxes of a node that overlap the region, one bit per box.
    #[inline]
    fn lanes(&self, node: &Node) -> u32 {
        node.lanes_within(&self.lo, &self.hi, self.squared_radius)
    }

    /// A leaf without the triangles whose boxes lie outside the region; none if all do.
    #[inline]
    fn clip(&self, node: &Node, mut leaf: Leaf) -> Option<Leaf> {
        let lanes = self.lanes(node);
        for (lane, allowed) in leaf.allowed.iter_mut().enumerate() {
            *allowed &= ((lanes >> lane & 1) as u16).wrapping_neg();
        }
        (lanes != 0).then_some(leaf)
    }
}

/// A triangle found by a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Triangle index.
    pub triangle: u32,
    /// Squared distance from the query point.
    pub squared_distance: f64,
}

/// Bounding volume hierarchy over the triangles of one surface, refitted as they move.
#[derive(Clone, Debug)]
pub struct Bvh {
    triangles: Vec<[u32; 3]>,
    /// Triangle of each slot.
    order: Vec<u32>,
    /// Order of the rest shape.
    rest_order: Vec<u32>,
    has_rest_order: bool,
    /// Corner positions of the triangles of each leaf.
    corners: Vec<Corners>,
    centroids: Vec<[f32; 3]>,
    nodes: Vec<Node>,
    /// Index in `nodes` at which each level starts, leaves first, and at which the last ends.
    levels: Vec<usize>,
    /// Summed area of all boxes.
    area: f64,
    /// The same when the triangles were last sorted.
    sorted_area: f64,
}
impl_state!(Bvh { order, has_rest_order, sorted_area });

impl Bvh {
    /// Builds a hierarchy over triangles whose corners are all less than `rest.len()`.
    ///
    /// # Complexity
    /// O(F log F) once; memory O(F).
    #[must_use]
    pub fn new(rest: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let count = triangles.len();
        let mut levels = vec![0];
        let mut width = count.div_ceil(LANES);
        while width > 0 {
            levels.push(levels[levels.len() - 1] + width);
            width = if width == 1 { 0 } else { width.div_ceil(LANES) };
        }
        let nodes = vec![Node::EMPTY; levels[levels.len() - 1]];
        let mut bvh = Self {
            triangles: triangles.to_vec(),
            order: (0..count as u32).collect(),
            rest_order: Vec::new(),
            has_rest_order: true,
            corners: vec![Corners::default(); count.div_ceil(LANES)],
            centroids: vec![[0.0; 3]; count],
            nodes,
            levels,
            area: 0.0,
            sorted_area: f64::NAN,
        };
        bvh.sort(rest);
        bvh.rest_order.clone_from(&bvh.order);
        bvh.refit(rest);
        bvh
    }

    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Returns true if the surface has no triangles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Refits the boxes to a frame, and sorts the triangles again if the summed area of the boxes has grown by more than half.
    /// Returns true if it sorted.
    ///
    /// Exclusions are compact in the order of the rest shape, which is restored if the new one is hardly better.
    ///
    /// # Complexity
    /// O(F); O(F log F) when sorting. Never allocates.
    pub fn update(&mut self, positions: &[[f32; 3]]) -> bool {
        self.refit(positions);
        if self.area <= MAX_GROWTH * self.sorted_area {
            return false;
        }
        let (old_area, had_rest_order) = (self.area, self.has_rest_order);
        self.sort(positions);
        self.has_rest_order = false;
        self.refit(positions);
        if had_rest_order && old_area <= MAX_GROWTH * self.area {
            self.order.copy_from_slice(&self.rest_order);
            self.has_rest_order = true;
            self.refit(positions);
        }
        self.sorted_area = self.area;
        true
    }

    /// Refits the boxes to a frame without changing the order.
    ///
    /// # Complexity
    /// O(F).
    pub fn refit(&mut self, positions: &[[f32; 3]]) {
        for (slot, &triangle) in self.order.iter().enumerate() {
            let [a, b, c] = self.triangles[triangle as usize];
            let t = [positions[a as usize], positions[b as usize], positions[c as usize]];
            self.corners[slot / LANES].set(slot % LANES, t);
            let mut lo = t[0];
            let mut hi = t[0];
            for axis in 0..3 {
                lo[axis] = min(min(t[0][axis], t[1][axis]), t[2][axis]);
                hi[axis] = max(max(t[0][axis], t[1][axis]), t[2][axis]);
            }
            self.nodes[slot / LANES].set(slot % LANES, lo, hi);
        }
        let mut area = 0.0f64;
        for level in 1..self.levels.len().saturating_sub(1) {
            let (children, parents) = self.nodes.split_at_mut(self.levels[level]);
            for (j, child) in children[self.levels[level - 1]..].iter().enumerate() {
                let (lo, hi) = child.union();
                let [x, y, z] = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]].map(f64::from);
                area += x * y + y * z + z * x;
                parents[j / LANES].set(j % LANES, lo, hi);
            }
        }
        self.area = area;
    }

    /// Returns the smallest box around the surface; none without triangles.
    #[must_use]
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        self.nodes.last().map(Node::union)
    }

    /// Returns the triangle nearest to `p` within `radius` for which `accept` is true; of equally near ones the lowest.
    ///
    /// # Complexity
    /// Expected O(log F) for a radius of a few edges.
    #[must_use]
    pub fn closest(&self, p: [f32; 3], radius: f32, accept: impl Fn(u32) -> bool) -> Option<Hit> {
        let extent = self.extent();
        let mut best: Option<Hit> = None;
        let mut limit = f64::from(radius) * f64::from(radius);
        // Boxes without a triangle are infinitely far.
        let mut reach = search_limit(limit, extent).min(f32::MAX);
        // Squared distance, level and index of each node; the nearest is last, so that most others are out of reach when their turn comes.
        let root = self.root_level().map(|level| (0.0, level, 0));
        let mut stack = Stack::of(root);
        while let Some((nearest, level, node)) = stack.pop() {
            if nearest > reach {
                continue;
            }
            let lanes = sorted_lanes(self.nodes[self.levels[level] + node].squared_distances(&p, &p));
            if level > 0 {
                for (distance, lane) in lanes.into_iter().rev().filter(|(distance, _)| *distance <= reach) {
                    stack.push((distance, level - 1, node * LANES + lane));
                }
                continue;
            }
            for (distance, lane) in lanes {
                if distance > reach {
                    break;
                }
                let slot = node * LANES + lane;
                let triangle = self.order[slot];
                if !accept(triangle) {
                    continue;
                }
                let found = closest_point(widen(p), self.corners(slot).map(widen)).squared_distance;
                let better = best.is_none_or(|b| (found, triangle) < (b.squared_distance, b.triangle));
                if found <= limit && better {
                    best = Some(Hit { triangle, squared_distance: found });
                    limit = found;
                    reach = search_limit(limit, extent);
                }
            }
        }
        best
    }

    /// Level of the root; none without triangles.
    #[inline]
    fn root_level(&self) -> Option<usize> {
        self.levels.len().checked_sub(2)
    }

    /// Appends the leaves with a triangle box in the region around a cluster of vertices.
    ///
    /// Nodes for which `skip` is true are left out with their descendants. `members` has a bit for each vertex of the cluster.
    #[inline]
    pub(crate) fn collect_leaves(
        &self,
        region: &SearchRegion,
        members: u16,
        skip: impl Fn(usize) -> bool,
        found: &mut Vec<Leaf>,
    ) {
        let Some(root) = self.nodes.len().checked_sub(1) else { return };
        if skip(root) {
            return;
        }
        let visit = |node: usize, found: &mut Vec<Leaf>| {
            if let Some(leaf) =
                region.clip(&self.nodes[node], Leaf { node: node as u32, allowed: [members; LANES] })
            {
                found.push(leaf);
            }
        };
        if root == 0 {
            return visit(root, found);
        }
        let mut stack = Stack::of(self.root_level().map(|level| (level, 0)));
        while let Some((level, node)) = stack.pop() {
            let mut lanes = region.lanes(&self.nodes[self.levels[level] + node]);
            while lanes != 0 {
                let child = node * LANES + lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                if skip(self.levels[level - 1] + child) {
                    continue;
                }
                if level == 1 {
                    visit(child, found);
                } else {
                    stack.push((level - 1, child));
                }
            }
        }
    }

    /// Appends those of some leaves that have a triangle box in the region around a cluster of vertices.
    #[inline]
    pub(crate) fn filter_leaves(&self, region: &SearchRegion, leaves: &[Leaf], found: &mut Vec<Leaf>) {
        for leaf in leaves {
            if let Some(leaf) = region.clip(&self.nodes[leaf.node as usize], *leaf) {
                found.push(leaf);
            }
        }
    }

    /// Replaces an ascending list of leaves by the smallest set of nodes whose descendants are just these. Returns its size.
    ///
    /// # Complexity
    /// O(n log F), in place.
    pub(crate) fn merge_into_ancestors(&self, nodes: &mut [u32]) -> usize {
        let mut len = 0;
        for next in 0..nodes.len() {
            let mut node = nodes[next] as usize;
            nodes[len] = nodes[next];
            len += 1;
            // After the last child of a parent, all children stand at the end of the list, or some are missing.
            for level in self.levels.windows(2).take(self.levels.len() - 2) {
                let first = level[0] + node / LANES * LANES;
                let children = first as u32..(first + LANES).min(level[1]) as u32;
                let Some(start) = len.checked_sub(children.len()) else { break };
                if !nodes[start..len].iter().copied().eq(children) {
                    break;
                }
                node /= LANES;
                nodes[start] = (level[1] + node) as u32;
                len = start + 1;
            }
        }
        len
    }

    /// Boxes of the leaves.
    #[inline]
    pub(crate) fn leaf_boxes(&self) -> &[Node] {
        &self.nodes[..self.corners.len()]
    }

    /// Corners of the triangles of each leaf.
    #[inline]
    pub(crate) fn leaf_corners(&self) -> &[Corners] {
        &self.corners
    }

    /// Parent of a leaf, and the lane of the leaf's box in it; none for the root.
    #[inline]
    pub(crate) fn parent(&self, leaf: &Leaf) -> Option<(&Node, usize)> {
        let node = leaf.node as usize;
        Some((self.nodes.get(self.levels[1] + node / LANES)?, node % LANES))
    }

    /// Number of nodes.
    pub(crate) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Number of leaves.
    pub(crate) fn leaf_count(&self) -> usize {
        self.order.len().div_ceil(LANES)
    }

    /// Corners of the triangle of a slot.
    #[inline]
    pub(crate) fn corners(&self, slot: usize) -> [[f32; 3]; 3] {
        self.corners[slot / LANES].of(slot % LANES)
    }

    /// Triangle of each slot.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Diagonal of the bounds, with which the rounding errors of distances scale.
    pub(crate) fn extent(&self) -> f64 {
        let Some((lo, hi)) = self.bounds() else { return 0.0 };
        (0..3).map(|k| (f64::from(hi[k]) - f64::from(lo[k])).powi(2)).sum::<f64>().sqrt()
    }

    fn sort(&mut self, positions: &[[f32; 3]]) {
        for (centroid, t) in self.centroids.iter_mut().zip(&self.triangles) {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            *centroid = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
        }
        sort_by_locality(&mut self.order, &self.centroids);
    }
}

/// Upper bound in single precision of the squared distance to a box that holds a triangle at `squared_distance`.
///
/// Box distances are off by a few units in the last place, exact distances by rounding on the scale of the scene.
#[inline]
pub(crate) fn search_limit(squared_distance: f64, extent: f64) -> f32 {
    let distance = squared_distance.sqrt() * (1.0 + 1e-6) + 1e-12 * extent;
    (distance * distance) as f32 * (1.0 + 1e-6) + f32::MIN_POSITIVE
}

/// Sorts the indices in `order` so that every aligned group of 4, 8, 16 ... of their points is compact.
///
/// Median splits along the longest axis, at group boundaries. Equal coordinates are sorted by index, so the order is unique.
///
/// # Complexity
/// O(n log n), in place.
pub(crate) fn sort_by_locality(order: &mut [u32], points: &[[f32; 3]]) {
    let capacity = order.len().next_power_of_two();
    split(order, capacity, points);
}

fn split(order: &mut [u32], capacity: usize, points: &[[f32; 3]]) {
    if order.len() <= LANES {
        order.sort_unstable();
        return;
    }
    let half = capacity / 2;
    if order.len() <= half {
        return split(order, half, points);
    }
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &i in order.iter() {
        for axis in 0..3 {
            lo[axis] = min(points[i as usize][axis], lo[axis]);
            hi[axis] = max(points[i as usize][axis], hi[axis]);
        }
    }
    let size = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]];
    let axis = if size[0] >= size[1] && size[0] >= size[2] {
        0
    } else if size[1] >= size[2] {
        1
    } else {
        2
    };
    order.select_nth_unstable_by(half, |&i, &j| {
        points[i as usize][axis].total_cmp(&points[j as usize][axis]).then(i.cmp(&j))
    });
    let (left, right) = order.split_at_mut(half);
    split(left, half, points);
    split(right, half, points);
}

/// The lanes of a node with their squared distances, the nearest first.
#[inline]
fn sorted_lanes(distances: [f32; LANES]) -> [(f32, usize); LANES] {
    // Numbers that are not negative sort as their bits do; the lane is below them.
    let mut keys = [0, 1, 2, 3].map(|lane| u64::from(distances[lane].to_bits()) << 2 | lane as u64);
    for (a, b) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        (keys[a], keys[b]) = (keys[a].min(keys[b]), keys[a].max(keys[b]));
    }
    keys.map(|key| (f32::from_bits((key >> 2) as u32), (key & 3) as usize))
}

/// Nodes still to visit.
struct Stack<T> {
    pending: [T; STACK],
    len: usize,
}

impl<T: Copy + Default> Stack<T> {
    /// A stack with the root, if there is one.
    #[inline]
    fn of(root: Option<T>) -> Self {
        let mut stack = Self { pending: [T::default(); STACK], len: 0 };
        root.into_iter().for_each(|root| stack.push(root));
        stack
    }

    #[inline]
    fn push(&mut self, node: T) {
        self.pending[self.len] = node;
        self.len += 1;
    }

    #[inline]
    fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        Some(self.pending[self.len])
    }
}
