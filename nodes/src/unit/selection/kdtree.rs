//! A k-d tree for searches within a distance, with 16 children at each node so that one comparison of vectors passes over all of them.

mod leaf_order;

pub use leaf_order::LANES;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};
use leaf_order::{Points, QUAD, children, middle, point};

/// Marks a number that names a leaf.
const LEAF: u32 = 1 << 31;

/// Relative error of a distance in single precision, many times over: of its square up to 1.2e-7 for each dimension and 2.4e-7 more.
const ROUNDING: f64 = 1e-5;

/// A k-d tree over labelled points.
///
/// Distances are compared in single precision and with a margin: a search finds every point within a distance, and may find others that are
/// beyond it by 2e-5 of it, or by the rounding of the coordinates. Callers that need the exact distance of a found point compute it.
///
/// # Complexity
/// Built in O(m log² m); on data of few dimensions a search takes O(log m) and the points that it finds. Memory: `4 dims + 4` bytes for each
/// point, and an eighth more for the boxes.
///
/// # Source
/// Bentley, "Multidimensional binary search trees used for associative searching" (1975); four of its levels lie in one node, as in trees
/// of boxes for ray tracing (Wald, Benthin and Boulos, "Getting rid of packets", 2008).
#[derive(Clone, Debug)]
pub struct KdTree {
    dims: usize,
    nodes: Vec<Node>,
    /// For each node and dimension, the lower and the upper ends of the boxes of its children.
    boxes: Vec<Row>,
    leaves: Vec<Node>,
    /// For each leaf and dimension, the coordinates of its points.
    points: Vec<Row>,
    /// Number of the root; `None` without points.
    root: Option<u32>,
    /// Largest magnitude of a coordinate.
    extent: f64,
}

/// A coordinate of each child or point of a node, in one line of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Row([f32; LANES]);

/// Numbers of the children, or labels of the points.
#[derive(Clone, Copy, Debug)]
struct Node {
    entries: [u32; LANES],
    count: u32,
}

/// Reusable memory of searches, and their limit.
#[derive(Clone, Debug, Default)]
pub struct Search {
    stack: Vec<(f32, u32)>,
    /// Nodes and points that may still be examined; `None` for all.
    pub left: Option<usize>,
}

impl Search {
    /// Counts one node or point; returns false if none is left.
    #[inline(always)]
    fn spend(&mut self) -> bool {
        match &mut self.left {
            Some(0) => return false,
            Some(left) => *left -= 1,
            None => {}
        }
        true
    }
}

impl KdTree {
    /// Builds the tree over `points`, `dims` coordinates for each label, on all cores.
    #[must_use]
    pub fn new(labels: &[u32], points: &[f32], dims: usize) -> Self {
        let mut points = points.chunks_exact(dims.max(1));
        Self::from_fn(labels, dims, |_, point| {
            points.next().into_iter().for_each(|new| point.copy_from_slice(new));
        })
    }

    /// Builds the tree over the points that `set` sets for each label in turn, on all cores.
    #[must_use]
    pub fn from_fn(labels: &[u32], dims: usize, mut set: impl FnMut(u32, &mut [f32])) -> Self {
        let mut points = Points::new(labels.len(), dims);
        for (label, row) in labels.iter().zip(points.rows_mut()) {
            set(*label, row);
        }
        // Few lanes are empty.
        let leaves = labels.len() / (LANES - 1) + 1;
        let nodes = leaves / (LANES / 2) + 1;
        let mut tree = Self {
            dims,
            nodes: Vec::with_capacity(nodes),
            boxes: Vec::with_capacity(2 * dims * nodes),
            leaves: Vec::with_capacity(leaves),
            points: Vec::with_capacity(dims * leaves),
            root: None,
            extent: 0.0,
        };
        if !labels.is_empty() {
            let mut keys: Vec<u64> = (0..labels.len() as u64).collect();
            points.arrange(&mut keys, children(labels.len()));
            tree.root = Some(Builder { tree: &mut tree, labels, points: &points }.build(&keys));
            tree.extent = points.extent(&keys);
        }
        tree
    }

    /// Its labels with their points.
    #[cfg(test)]
    pub(super) fn items(&self) -> Vec<(u32, Vec<f32>)> {
        let leaves = self.leaves.iter().zip(self.points.chunks(self.dims));
        leaves
            .flat_map(|(leaf, points)| {
                let of = |lane: usize| (leaf.entries[lane], points.iter().map(|x| x.0[lane]).collect());
                (0..leaf.count as usize).map(of).collect::<Vec<_>>()
            })
            .collect()
    }

    /// Visits all points within a distance of `query`, roughly nearest first, until the limit of `search` is used up.
    ///
    /// `visit` receives a label, and returns the distance beyond which it needs no more points where that has changed.
    #[inline(always)]
    pub fn within<S: Simd>(
        &self,
        simd: S,
        query: &[f32],
        distance: f64,
        search: &mut Search,
        mut visit: impl FnMut(u32) -> Option<f64>,
    ) {
        let rounding = self.rounding(query);
        let mut within = square_with_margin(distance, rounding);
        let mut stack = std::mem::take(&mut search.stack);
        stack.clear();
        stack.extend(self.root.map(|root| (0.0, root)));
        while let Some((squared, number)) = stack.pop() {
            if squared > within {
                continue;
            }
            if !search.spend() {
                break;
            }
            if number < LEAF {
                let at = number as usize;
                let boxes = &self.boxes[2 * self.dims * at..][..2 * self.dims];
                push_near(&mut stack, &self.nodes[at], gaps(simd, boxes, query), within);
                continue;
            }
            let at = (number - LEAF) as usize;
            let squared = distances(simd, &self.points[self.dims * at..][..self.dims], query);
            let leaf = &self.leaves[at];
            let near = near(squared, leaf.count, within);
            let squared: [f32; LANES] = squared.into();
            for lane in lanes(near) {
                // Points before it may have narrowed the search.
                if squared[lane] <= within
                    && search.spend()
                    && let Some(distance) = visit(leaf.entries[lane])
                {
                    within = square_with_margin(distance, rounding);
                }
            }
        }
        search.stack = stack;
    }

    /// The least distance that `of` returns for a label, with the number that it returns: of equal distances the least number.
    ///
    /// `of` receives the labels of points that can be the nearest; `None` skips one.
    pub fn nearest(
        &self,
        level: Level,
        query: &[f32],
        search: &mut Search,
        mut of: impl FnMut(u32) -> Option<(f64, usize)>,
    ) -> Option<(f64, usize)> {
        let mut found: Option<(f64, usize)> = None;
        dispatch!(level, simd => {
            self.within(simd, query, f64::INFINITY, search, #[inline(always)] |label| {
                let new = of(label)?;
                found = found.filter(|found| *found < new).or(Some(new));
                found.map(|(least, _)| least)
            });
        });
        found
    }

    /// Distance that the rounding of the coordinates to single precision may add or remove.
    #[inline(always)]
    fn rounding(&self, query: &[f32]) -> f64 {
        let extent = query.iter().fold(self.extent, |extent, x| extent.max(f64::from(x.abs())));
        extent * f64::from(f32::EPSILON) * self.dims as f64
    }
}

/// The square of a distance with the rounding error that may add to it; negative where no distance is small enough.
#[inline(always)]
fn square_with_margin(distance: f64, rounding: f64) -> f32 {
    if distance < 0.0 {
        return -1.0;
    }
    let reach = distance * (1.0 + ROUNDING) + rounding;
    // Squares below the normal numbers have fewer digits.
    (reach * reach) as f32 + f32::MIN_POSITIVE
}

/// One bit for each of the first `count` lanes that is within a squared distance.
#[inline(always)]
fn near<S: Simd>(squared: f32x16<S>, count: u32, within: f32) -> u32 {
    squared.simd_le(within).to_bitmask() as u32 & ((1 << count) - 1)
}

/// The lanes whose bits are set.
#[inline(always)]
fn lanes(bits: u32) -> impl Iterator<Item = usize> {
    let with_lowest_cleared = |bits: &u32| Some(*bits & (*bits - 1)).filter(|bits| *bits > 0);
    std::iter::successors(Some(bits).filter(|bits| *bits > 0), with_lowest_cleared)
        .map(|bits| bits.trailing_zeros() as usize % LANES)
}

/// Adds the children that are near enough, the nearest last.
#[inline(always)]
fn push_near<S: Simd>(stack: &mut Vec<(f32, u32)>, node: &Node, squared: f32x16<S>, within: f32) {
    let (first, near) = (stack.len(), near(squared, node.count, within));
    let squared: [f32; LANES] = squared.into();
    stack.extend(lanes(near).map(|lane| (squared[lane], node.entries[lane])));
    let nearest = (first..stack.len()).min_by(|a, b| stack[*a].0.total_cmp(&stack[*b].0));
    if let Some(nearest) = nearest {
        let last = stack.len() - 1;
        stack.swap(nearest, last);
    }
}

/// Squared distances of a point to 16 boxes.
#[inline(always)]
fn gaps<S: Simd>(simd: S, boxes: &[Row], query: &[f32]) -> f32x16<S> {
    let zero = f32x16::splat(simd, 0.0);
    let mut sum = zero;
    for (ends, x) in boxes.chunks_exact(2).zip(query) {
        let x = f32x16::splat(simd, *x);
        let (low, high) = (f32x16::simd_from(simd, ends[0].0), f32x16::simd_from(simd, ends[1].0));
        let gap = (low - x).max(x - high).max(zero);
        sum = gap.mul_add(gap, sum);
    }
    sum
}

/// Squared distances of a point to 16 points.
#[inline(always)]
fn distances<S: Simd>(simd: S, points: &[Row], query: &[f32]) -> f32x16<S> {
    let mut sum = f32x16::splat(simd, 0.0);
    for (points, x) in points.iter().zip(query) {
        let difference = f32x16::simd_from(simd, points.0) - f32x16::splat(simd, *x);
        sum = difference.mul_add(difference, sum);
    }
    sum
}

/// Squared distance of two vectors, in double precision.
#[inline]
#[must_use]
pub fn squared(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)) * (f64::from(*a) - f64::from(*b))).sum()
}

/// A tree under construction.
struct Builder<'a> {
    tree: &'a mut KdTree,
    labels: &'a [u32],
    points: &'a Points,
}

impl Builder<'_> {
    /// Builds the subtree over points in the order of the leaves; returns its number.
    fn build(&mut self, keys: &[u64]) -> u32 {
        if keys.len() <= LANES {
            return self.leaf(keys);
        }
        let number = self.tree.nodes.len();
        self.tree.nodes.push(Node { entries: [0; LANES], count: 0 });
        self.tree.boxes.resize(self.tree.boxes.len() + 2 * self.tree.dims, Row([0.0; LANES]));
        self.add_children(number, keys, children(keys.len()));
        number as u32
    }

    /// Adds some parts to a node.
    fn add_children(&mut self, number: usize, keys: &[u64], parts: usize) {
        if parts > 1 {
            let (low, high) = keys.split_at(middle(keys.len(), parts));
            self.add_children(number, low, parts / 2);
            return self.add_children(number, high, parts - parts / 2);
        }
        let child = self.build(keys);
        let node = &mut self.tree.nodes[number];
        let lane = node.count as usize;
        node.entries[lane] = child;
        node.count += 1;
        let boxes = &mut self.tree.boxes[2 * self.tree.dims * number..][..2 * self.tree.dims];
        for (k, rows) in boxes.chunks_mut(2 * QUAD).enumerate() {
            let [low, high] = self.points.ends(keys, k);
            for (rows, (low, high)) in rows.chunks_exact_mut(2).zip(low.into_iter().zip(high)) {
                (rows[0].0[lane], rows[1].0[lane]) = (low, high);
            }
        }
    }

    fn leaf(&mut self, keys: &[u64]) -> u32 {
        let mut leaf = Node { entries: [0; LANES], count: keys.len() as u32 };
        let first = self.tree.points.len();
        self.tree.points.resize(first + self.tree.dims, Row([0.0; LANES]));
        for (lane, key) in keys.iter().enumerate() {
            leaf.entries[lane] = self.labels[point(*key)];
            for (row, x) in self.tree.points[first..].iter_mut().zip(self.points.row(point(*key))) {
                row.0[lane] = *x;
            }
        }
        self.tree.leaves.push(leaf);
        LEAF + self.tree.leaves.len() as u32 - 1
    }
}

#[cfg(test)]
mod tests;
