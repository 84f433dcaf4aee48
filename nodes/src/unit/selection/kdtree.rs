//! A k-d tree for searches within a distance, with 16 children at each node so that one comparison of vectors passes over all of them.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};

/// Children of a node, and points of a leaf.
pub const LANES: usize = 16;

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

/// Coordinates that a vector register of any processor holds.
const QUAD: usize = 4;

/// Minimum number of points that two threads sort.
const SHARED: usize = 4096;

/// Number of children of a node over some points: as many as a tree of this height needs, each with as many points.
fn children(points: usize) -> usize {
    let mut most = LANES;
    while most * LANES < points {
        most *= LANES;
    }
    points.div_ceil(most)
}

/// Number of points in the first half of some parts: whole leaves, so that few lanes are empty.
fn middle(points: usize, parts: usize) -> usize {
    (points * (parts / 2) / parts).next_multiple_of(LANES).min(points - 1)
}

/// The point of a key.
fn point(key: u64) -> usize {
    key as u32 as usize
}

/// A number whose order is that of [`f32::total_cmp`].
fn in_order(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

/// Points while a tree is built over them.
struct Points {
    dims: usize,
    /// Number of quads of a point.
    quads: usize,
    /// Coordinates of point after point, each with zeros up to whole quads.
    coordinates: Vec<[f32; QUAD]>,
}

impl Points {
    fn new(count: usize, dims: usize) -> Self {
        let quads = dims.div_ceil(QUAD);
        Self { dims, quads, coordinates: vec![[0.0; QUAD]; count * quads] }
    }

    fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f32]> {
        let dims = self.dims;
        self.coordinates
            .chunks_exact_mut(self.quads.max(1))
            .map(move |quads| &mut quads.as_flattened_mut()[..dims])
    }

    fn row(&self, point: usize) -> &[f32] {
        &self.coordinates[point * self.quads..][..self.quads].as_flattened()[..self.dims]
    }

    /// The ends of the box around some points, for the axes of quad `k`.
    fn ends(&self, keys: &[u64], k: usize) -> [[f32; QUAD]; 2] {
        let (mut low, mut high) = ([f32::INFINITY; QUAD], [f32::NEG_INFINITY; QUAD]);
        for key in keys {
            let quad = &self.coordinates[point(*key) * self.quads + k];
            low.iter_mut().zip(quad).for_each(|(low, x)| *low = if *x < *low { *x } else { *low });
            high.iter_mut().zip(quad).for_each(|(high, x)| *high = if *x > *high { *x } else { *high });
        }
        [low, high]
    }

    /// Largest magnitude of a coordinate of some points.
    fn extent(&self, keys: &[u64]) -> f64 {
        let ends = (0..self.quads).flat_map(|k| {
            let [low, high] = self.ends(keys, k);
            low.into_iter().zip(high)
        });
        // Not those of an axis without numbers.
        let magnitudes = ends.filter(|(low, high)| low <= high).map(|(low, high)| f64::from(high.max(-low)));
        magnitudes.fold(0.0, f64::max)
    }

    /// The axis along which some points spread most; of equals the last.
    fn widest(&self, keys: &[u64]) -> usize {
        let widths = (0..self.quads).flat_map(|k| {
            let [low, high] = self.ends(keys, k);
            std::array::from_fn::<f32, QUAD, _>(|k| high[k] - low[k])
        });
        let widest = widths.take(self.dims).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        widest.map_or(0, |(axis, _)| axis)
    }

    /// Puts the keys of points in the order of the leaves, on all cores: each of `parts` parts in turn lies in a box of its own, and is ordered
    /// in the same way as a node. The lower half of a key is the number of a point.
    fn arrange(&self, keys: &mut [u64], parts: usize) {
        if parts <= 1 {
            if keys.len() > LANES {
                self.arrange(keys, children(keys.len()));
            }
            return;
        }
        let axis = self.widest(keys);
        // Of equal coordinates the first point is first.
        for key in &mut *keys {
            let x = self.coordinates[point(*key) * self.quads + axis / QUAD][axis % QUAD];
            *key = u64::from(in_order(x)) << 32 | u64::from(*key as u32);
        }
        let (count, middle) = (keys.len(), middle(keys.len(), parts));
        keys.select_nth_unstable(middle);
        let (low, high) = keys.split_at_mut(middle);
        let mut low = || self.arrange(low, parts / 2);
        let mut high = || self.arrange(high, parts - parts / 2);
        if count < SHARED {
            low();
            high();
        } else {
            rayon::join(low, high);
        }
    }
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
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn found(tree: &KdTree, query: &[f32], distance: f64, search: &mut Search) -> Vec<u32> {
        let mut labels = Vec::new();
        dispatch!(Level::new(), simd => tree.within(simd, query, distance, search, |label| {
            labels.push(label);
            None
        }));
        labels.sort_unstable();
        labels
    }

    #[test]
    fn a_search_finds_what_lies_within_a_distance() {
        let mut rng = Rng::new(7);
        for (count, dims, size) in
            [(1, 3, 1.0), (16, 1, 1.0), (17, 2, 1e-22), (700, 3, 1e-6), (5000, 6, 1.0), (300, 64, 1e15)]
        {
            let mut numbers = |n: usize| (0..n).map(|_| rng.between(-size, size) as f32).collect::<Vec<_>>();
            let points = numbers(count * dims);
            let labels: Vec<u32> = (0..count as u32).map(|label| 7 * label).collect();
            let (tree, mut search) = (KdTree::new(&labels, &points, dims), Search::default());
            for part in [0.0, 0.1, 0.3, 0.7, 20.0] {
                let query = numbers(dims);
                let mut distances: Vec<f64> =
                    points.chunks(dims).map(|p| squared(p, &query).sqrt()).collect();
                let distance = part * size * (dims as f64).sqrt();
                let labels = found(&tree, &query, distance, &mut search);
                let at = |label: &u32| distances[*label as usize / 7];
                let beyond = labels.iter().map(at).fold(0.0, f64::max);
                let wanted = distances.iter().filter(|d| **d <= distance).count();
                assert_eq!(labels.iter().filter(|label| at(label) <= distance).count(), wanted);
                // Squares below the normal numbers are as good as equal.
                assert!(beyond <= distance * 1.0001 + 1e-5 * size + 2e-19, "{beyond} {distance}");
                // The nearest, by a search that narrows; exactly there too.
                let nearest = tree.nearest(Level::new(), &query, &mut search, |label| {
                    Some((distances[label as usize / 7], label as usize))
                });
                distances.sort_by(f64::total_cmp);
                assert_eq!(nearest.map(|(least, _)| least), Some(distances[0]));
                let own = found(&tree, &points[..dims], 0.0, &mut search);
                assert!(own.contains(&0));
            }
        }
    }

    /// Labels of the leaves in turn, by comparisons of the points themselves.
    fn plain_leaves(
        points: &[f32],
        dims: usize,
        order: &mut [usize],
        parts: usize,
        leaves: &mut Vec<Vec<u32>>,
    ) {
        if parts > 1 {
            let x = |at: usize, axis: usize| points[at * dims + axis];
            let width = |axis: usize| {
                let ends = order.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], at| {
                    [low.min(x(*at, axis)), high.max(x(*at, axis))]
                });
                ends[1] - ends[0]
            };
            let axis = (0..dims).max_by(|a, b| width(*a).total_cmp(&width(*b))).unwrap();
            let middle = middle(order.len(), parts);
            order.select_nth_unstable_by(middle, |a, b| x(*a, axis).total_cmp(&x(*b, axis)).then(a.cmp(b)));
            let (low, high) = order.split_at_mut(middle);
            plain_leaves(points, dims, low, parts / 2, leaves);
            plain_leaves(points, dims, high, parts - parts / 2, leaves);
        } else if order.len() > LANES {
            plain_leaves(points, dims, order, children(order.len()), leaves);
        } else {
            leaves.push(order.iter().map(|at| 3 * *at as u32).collect());
        }
    }

    #[test]
    fn keys_split_points_as_comparisons_do() {
        let mut rng = Rng::new(3);
        for (count, dims) in
            [(1, 1), (2, 3), (9, 4), (40, 5), (67, 3), (130, 8), (257, 2), (5000, 3), (5000, 6)]
        {
            for ties in [false, true] {
                let mut number = || {
                    let x = rng.between(-3.0, 3.0) as f32;
                    if ties { x.round() + 0.0 } else { x }
                };
                let points: Vec<f32> = (0..count * dims).map(|_| number()).collect();
                let labels: Vec<u32> = (0..count as u32).map(|at| 3 * at).collect();
                let (mut order, mut wanted): (Vec<usize>, _) = ((0..count).collect(), Vec::new());
                plain_leaves(&points, dims, &mut order, children(count), &mut wanted);
                for threads in [1, 3] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    let tree = pool.install(|| KdTree::new(&labels, &points, dims));
                    let leaves = tree.leaves.iter().map(|leaf| &leaf.entries[..leaf.count as usize]);
                    assert!(leaves.eq(wanted.iter().map(Vec::as_slice)), "{count} {dims} {ties}");
                    for (label, point) in tree.items() {
                        assert_eq!(point, points[label as usize / 3 * dims..][..dims]);
                    }
                    assert_eq!(
                        tree.extent,
                        points.iter().fold(0.0, |most, x| f64::max(most, f64::from(x.abs())))
                    );
                }
            }
        }
    }

    #[test]
    fn a_search_ends_at_the_given_distance_and_at_its_limit() {
        let points: Vec<f32> = (0..900).map(|k| k as f32).collect();
        let labels: Vec<u32> = (0..900).collect();
        let tree = KdTree::new(&labels, &points, 1);
        let mut search = Search::default();
        let mut seen = 0;
        dispatch!(Level::new(), simd => tree.within(simd, &[450.0], f64::INFINITY, &mut search, |_| {
            seen += 1;
            Some(-1.0)
        }));
        assert_eq!(seen, 1);
        search.left = Some(100);
        // Two nodes and six leaves.
        assert_eq!(found(&tree, &[450.0], f64::INFINITY, &mut search).len(), 92);
        assert_eq!(search.left, Some(0));
        assert!(
            found(&KdTree::new(&[], &[], 3), &[0.0; 3], f64::INFINITY, &mut Search::default()).is_empty()
        );
    }
}
