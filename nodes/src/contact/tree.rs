//! A tree of boxes over the triangles of one surface.
//!
//! Triangles are sorted so that each aligned group of 4, 16, 64 ... is compact; the tree is that order. Node j of a level
//! holds the boxes of children 4j .. 4j + 4 side by side, so one test serves four boxes and no child pointers exist.

use super::boxes::{Corners, LANES, Node, larger, smaller};
use super::triangle::closest_point;
use super::vector::widen;
use crate::impl_state;

/// Growth of the summed box areas after which an order is no longer worth keeping.
const GROWTH: f64 = 1.5;
/// Enough pending nodes for 4^16 triangles: three left behind per level, plus the four of the last.
const STACK: usize = 64;

/// A lowest node near a cluster of up to 16 vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Leaf {
    pub node: u32,
    /// For each of its triangles the vertices that may touch it, one bit each.
    pub allowed: [u16; LANES],
}

impl Leaf {
    /// The vertices that may touch one of its triangles.
    #[inline]
    pub fn anyone(&self) -> u16 {
        self.allowed.iter().fold(0, |any, allowed| any | allowed)
    }

    /// One bit for each of its triangles: whether a vertex may touch it.
    #[inline]
    pub fn lanes(&self, vertex: usize) -> u32 {
        let mut lanes = 0;
        for (lane, allowed) in self.allowed.iter().enumerate() {
            lanes |= u32::from(allowed >> vertex & 1) << lane;
        }
        lanes
    }
}

/// Everything within a distance of a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    pub squared_radius: f32,
}

impl Ball {
    /// One bit for each box of a node: whether it reaches into the ball.
    #[inline]
    fn lanes(&self, node: &Node) -> u32 {
        node.lanes_within(&self.lo, &self.hi, self.squared_radius)
    }

    /// A leaf without the triangles whose boxes don't reach into the ball, or none if there are no others.
    #[inline]
    fn part_of(&self, node: &Node, mut leaf: Leaf) -> Option<Leaf> {
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

/// Boxes over the triangles of one surface, refitted as they move.
#[derive(Clone, Debug)]
pub struct Tree {
    triangles: Vec<[u32; 3]>,
    /// Triangle of each slot.
    order: Vec<u32>,
    /// The order that the rest shape gave.
    home: Vec<u32>,
    at_home: bool,
    /// Corner positions of the triangles of each lowest node.
    corners: Vec<Corners>,
    centroids: Vec<[f32; 3]>,
    nodes: Vec<Node>,
    /// Where each level starts in `nodes`, lowest level first, and where the last ends.
    levels: Vec<usize>,
    area: f64,
    kept_area: f64,
}
impl_state!(Tree { order, at_home, kept_area });

impl Tree {
    /// Builds a tree over triangles whose corners all lie below `rest.len()`.
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
        let mut tree = Self {
            triangles: triangles.to_vec(),
            order: (0..count as u32).collect(),
            home: Vec::new(),
            at_home: true,
            corners: vec![Corners::default(); count.div_ceil(LANES)],
            centroids: vec![[0.0; 3]; count],
            nodes,
            levels,
            area: 0.0,
            kept_area: f64::NAN,
        };
        tree.sort(rest);
        tree.home.clone_from(&tree.order);
        tree.refit(rest);
        tree
    }

    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether the surface has no triangles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Moves the boxes to a frame, and sorts anew if their summed area has grown by more than half. Returns whether it did.
    ///
    /// A new order that is hardly better than that of the rest shape is thrown away: exclusions are compact in the latter.
    ///
    /// # Complexity
    /// O(F); O(F log F) when sorting. Never allocates.
    pub fn update(&mut self, positions: &[[f32; 3]]) -> bool {
        self.refit(positions);
        if self.area <= GROWTH * self.kept_area {
            return false;
        }
        let (before, was_home) = (self.area, self.at_home);
        self.sort(positions);
        self.at_home = false;
        self.refit(positions);
        if was_home && before <= GROWTH * self.area {
            self.order.copy_from_slice(&self.home);
            self.at_home = true;
            self.refit(positions);
        }
        self.kept_area = self.area;
        true
    }

    /// Moves the boxes to a frame without changing the order.
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
                lo[axis] = smaller(smaller(t[0][axis], t[1][axis]), t[2][axis]);
                hi[axis] = larger(larger(t[0][axis], t[1][axis]), t[2][axis]);
            }
            self.nodes[slot / LANES].set(slot % LANES, lo, hi);
        }
        let mut area = 0.0f64;
        for level in 1..self.levels.len().saturating_sub(1) {
            let (below, above) = self.nodes.split_at_mut(self.levels[level]);
            for (j, child) in below[self.levels[level - 1]..].iter().enumerate() {
                let (lo, hi) = child.union();
                let [x, y, z] = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]].map(f64::from);
                area += x * y + y * z + z * x;
                above[j / LANES].set(j % LANES, lo, hi);
            }
        }
        self.area = area;
    }

    /// The smallest box around the surface, or none without triangles.
    #[must_use]
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        self.nodes.last().map(Node::union)
    }

    /// The triangle nearest to `p` that `accept` lets through, if one is at most `radius` away; of equals the lowest.
    ///
    /// # Complexity
    /// Expected O(log F) for a radius of a few edges.
    #[must_use]
    pub fn closest(&self, p: [f32; 3], radius: f32, accept: impl Fn(u32) -> bool) -> Option<Hit> {
        let extent = self.extent();
        let mut limit = f64::from(radius) * f64::from(radius);
        let mut best: Option<Hit> = None;
        let mut stack = Stack::at_root(self);
        while let Some((level, node)) = stack.pop() {
            let distances = self.nodes[self.levels[level] + node].squared_distances(&p, &p);
            for (lane, &distance) in distances.iter().enumerate() {
                if distance > reach(limit, extent) {
                    continue;
                }
                let child = node * LANES + lane;
                if level > 0 {
                    stack.push(level - 1, child);
                } else if accept(self.order[child]) {
                    let triangle = self.order[child];
                    let found = closest_point(widen(p), self.corners(child).map(widen)).squared_distance;
                    let better = best.is_none_or(|b| (found, triangle) < (b.squared_distance, b.triangle));
                    if found <= limit && better {
                        best = Some(Hit { triangle, squared_distance: found });
                        limit = found;
                    }
                }
            }
        }
        best
    }

    /// Collects the lowest nodes with a triangle box near a cluster of vertices.
    ///
    /// Nodes for which `skip` holds are left out with all below them. `all` has a bit for each vertex of the cluster.
    #[inline]
    pub(crate) fn gather(&self, near: &Ball, all: u16, skip: impl Fn(usize) -> bool, found: &mut Vec<Leaf>) {
        let Some(root) = self.nodes.len().checked_sub(1) else { return };
        if skip(root) {
            return;
        }
        let visit = |node: usize, found: &mut Vec<Leaf>| {
            if let Some(leaf) =
                near.part_of(&self.nodes[node], Leaf { node: node as u32, allowed: [all; LANES] })
            {
                found.push(leaf);
            }
        };
        if root == 0 {
            return visit(root, found);
        }
        let mut stack = Stack::at_root(self);
        while let Some((level, node)) = stack.pop() {
            let mut lanes = near.lanes(&self.nodes[self.levels[level] + node]);
            while lanes != 0 {
                let child = node * LANES + lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                if skip(self.levels[level - 1] + child) {
                    continue;
                }
                if level == 1 {
                    visit(child, found);
                } else {
                    stack.push(level - 1, child);
                }
            }
        }
    }

    /// Collects those of some lowest nodes with a triangle box near a cluster of vertices.
    #[inline]
    pub(crate) fn sift(&self, near: &Ball, leaves: &[Leaf], found: &mut Vec<Leaf>) {
        for leaf in leaves {
            if let Some(part) = near.part_of(&self.nodes[leaf.node as usize], *leaf) {
                found.push(part);
            }
        }
    }

    /// Replaces an ascending list of lowest nodes by the fewest nodes that hold just these. Returns how many there are.
    ///
    /// # Complexity
    /// O(n log F), in place.
    pub(crate) fn cover(&self, nodes: &mut [u32]) -> usize {
        let mut kept = 0;
        for next in 0..nodes.len() {
            let mut node = nodes[next] as usize;
            nodes[kept] = nodes[next];
            kept += 1;
            // The last child of a complete family completes it.
            for level in self.levels.windows(2).take(self.levels.len() - 2) {
                let first = level[0] + node / LANES * LANES;
                let family = first as u32..(first + LANES).min(level[1]) as u32;
                let Some(place) = kept.checked_sub(family.len()) else { break };
                if !nodes[place..kept].iter().copied().eq(family) {
                    break;
                }
                node /= LANES;
                nodes[place] = (level[1] + node) as u32;
                kept = place + 1;
            }
        }
        kept
    }

    /// The lowest nodes, as numbered by [`Tree::gather`].
    #[inline]
    pub(crate) fn lowest(&self) -> &[Node] {
        &self.nodes[..self.corners.len()]
    }

    /// The corners of the triangles of each lowest node.
    #[inline]
    pub(crate) fn all_corners(&self) -> &[Corners] {
        &self.corners
    }

    /// The node and the lane with the box around a lowest node, unless that is the root.
    #[inline]
    pub(crate) fn above(&self, leaf: &Leaf) -> Option<(&Node, usize)> {
        let node = leaf.node as usize;
        Some((self.nodes.get(self.levels[1] + node / LANES)?, node % LANES))
    }

    /// Number of nodes.
    pub(crate) fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of lowest nodes.
    pub(crate) fn leaves(&self) -> usize {
        self.order.len().div_ceil(LANES)
    }

    #[inline]
    pub(crate) fn corners(&self, slot: usize) -> [[f32; 3]; 3] {
        self.corners[slot / LANES].of(slot % LANES)
    }

    /// Triangle of each slot.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Diagonal of the bounds: the size that rounding errors of distances scale with.
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

/// A squared distance in single precision that no box holding an equally near triangle can exceed.
///
/// Box distances are off by a few units in the last place, exact distances by rounding on the scale of the scene.
#[inline]
pub(crate) fn reach(squared_distance: f64, extent: f64) -> f32 {
    let distance = squared_distance.sqrt() * (1.0 + 1e-6) + 1e-12 * extent;
    (distance * distance) as f32 * (1.0 + 1e-6) + f32::MIN_POSITIVE
}

/// Orders the indices in `order` so that every aligned group of 4, 8, 16 ... of the points they name is compact.
///
/// Median splits along the longest axis, cut where the groups end. Equal coordinates go by index, so the order is unique.
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
            lo[axis] = smaller(points[i as usize][axis], lo[axis]);
            hi[axis] = larger(points[i as usize][axis], hi[axis]);
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

/// Nodes still to visit.
struct Stack {
    pending: [(u32, u32); STACK],
    len: usize,
}

impl Stack {
    #[inline]
    fn at_root(tree: &Tree) -> Self {
        let mut stack = Self { pending: [(0, 0); STACK], len: 0 };
        if tree.levels.len() > 1 {
            stack.push(tree.levels.len() - 2, 0);
        }
        stack
    }

    #[inline]
    fn push(&mut self, level: usize, node: usize) {
        self.pending[self.len] = (level as u32, node as u32);
        self.len += 1;
    }

    #[inline]
    fn pop(&mut self) -> Option<(usize, usize)> {
        self.len = self.len.checked_sub(1)?;
        let (level, node) = self.pending[self.len];
        Some((level as usize, node as usize))
    }
}
