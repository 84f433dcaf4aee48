//! A k-d tree that yields points from the nearest on.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Points in a leaf.
const LEAF: usize = 8;
/// Marks an entry of the search that is a point.
const POINT: u32 = u32::MAX;

/// A node: its points in `order`, their box, and its children where it has any.
#[derive(Clone, Debug)]
struct Node<const P: usize> {
    low: [f64; P],
    high: [f64; P],
    from: u32,
    to: u32,
    /// First child; the other one follows it. 0 in a leaf.
    child: u32,
    /// Least label in the subtree.
    least: u32,
}

/// A k-d tree over labelled points of `P` dimensions, with the box of its points at every node.
///
/// # Complexity
/// Built in O(m log² m); each yielded point takes O(log m) on data of low dimension.
///
/// # Source
/// Hjaltason and Samet, "Distance browsing in spatial databases" (1999): best-first search with one queue of nodes and points.
#[derive(Clone, Debug)]
pub struct KdTree<const P: usize> {
    nodes: Vec<Node<P>>,
    points: Vec<[f64; P]>,
    labels: Vec<u32>,
}

/// Entry of the queue of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Waiting {
    squared: f64,
    label: u32,
    node: u32,
}

impl Eq for Waiting {}

impl Ord for Waiting {
    /// The nearest is the greatest; of equally near ones that with the least label.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .squared
            .total_cmp(&self.squared)
            .then(other.label.cmp(&self.label))
            .then(self.node.cmp(&other.node))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Reusable memory of searches, and their limit.
#[derive(Clone, Debug, Default)]
pub struct Search {
    queue: BinaryHeap<Waiting>,
    stack: Vec<(f64, u32)>,
    /// Nodes and points that may still be looked at; `None` for all.
    pub left: Option<usize>,
}

/// Counts one node or point; returns false if none is left.
#[inline]
fn spend(left: &mut Option<usize>) -> bool {
    match left {
        Some(0) => return false,
        Some(left) => *left -= 1,
        None => {}
    }
    true
}

/// Squared distance of two points.
#[inline]
#[must_use]
pub fn squared<const P: usize>(a: &[f64; P], b: &[f64; P]) -> f64 {
    let mut sum = 0.0;
    for d in 0..P {
        sum += (a[d] - b[d]) * (a[d] - b[d]);
    }
    sum
}

impl<const P: usize> KdTree<P> {
    /// Builds the tree.
    #[must_use]
    pub fn new(mut items: Vec<(u32, [f64; P])>) -> Self {
        let mut nodes = Vec::with_capacity(items.len() / 2 + 1);
        if !items.is_empty() {
            nodes.push(bounds(&items, 0));
            let mut next = 0;
            while let Some(node) = nodes.get(next).cloned() {
                let (from, to) = (node.from as usize, node.to as usize);
                if to - from > LEAF {
                    let widest = (0..P).max_by(|&a, &b| {
                        (node.high[a] - node.low[a]).total_cmp(&(node.high[b] - node.low[b]))
                    });
                    let (axis, middle) = (widest.unwrap_or(0), (to - from) / 2);
                    let part = &mut items[from..to];
                    part.select_nth_unstable_by(middle, |a, b| {
                        a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0))
                    });
                    nodes[next].child = nodes.len() as u32;
                    nodes.push(bounds(&items[from..from + middle], from));
                    nodes.push(bounds(&items[from + middle..to], from + middle));
                }
                next += 1;
            }
        }
        let (labels, points) = items.into_iter().unzip();
        Self { nodes, points, labels }
    }

    /// Its points with their labels, in no order that means anything.
    #[cfg(test)]
    pub(super) fn items(&self) -> Vec<(u32, [f64; P])> {
        self.labels.iter().copied().zip(self.points.iter().copied()).collect()
    }

    /// Visits points by increasing distance from `query`, equally near ones by increasing label, until `visit` ends the
    /// search or `search.left` is used up.
    ///
    /// `visit` gets the squared distance and the label, and returns the squared distance beyond which it needs no more
    /// points.
    pub fn nearest(
        &self,
        query: &[f64; P],
        within: f64,
        search: &mut Search,
        mut visit: impl FnMut(f64, u32) -> f64,
    ) {
        let Search { queue, left, .. } = search;
        queue.clear();
        let mut within = within;
        if let Some(root) = self.nodes.first() {
            queue.push(Waiting { squared: root.distance(query), label: root.least, node: 0 });
        }
        while let Some(first) = queue.pop() {
            if first.squared > within || !spend(left) {
                break;
            }
            if first.node == POINT {
                within = visit(first.squared, first.label);
                continue;
            }
            let node = &self.nodes[first.node as usize];
            if node.child > 0 {
                for child in [node.child, node.child + 1] {
                    let below = &self.nodes[child as usize];
                    let squared = below.distance(query);
                    if squared <= within {
                        queue.push(Waiting { squared, label: below.least, node: child });
                    }
                }
                continue;
            }
            for at in node.from as usize..node.to as usize {
                let squared = squared(&self.points[at], query);
                if squared <= within {
                    queue.push(Waiting { squared, label: self.labels[at], node: POINT });
                }
            }
        }
    }
}

impl<const P: usize> KdTree<P> {
    /// Visits all points within a squared distance of `query`, roughly nearest first, until `search.left` is used up.
    ///
    /// `visit` gets the squared distance and the label, and returns the squared distance beyond which it needs no more
    /// points. If all near points are wanted this is faster than [`nearest`](Self::nearest), which has to sort them.
    pub fn within(
        &self,
        query: &[f64; P],
        within: f64,
        search: &mut Search,
        mut visit: impl FnMut(f64, u32) -> f64,
    ) {
        let Search { stack, left, .. } = search;
        stack.clear();
        let mut within = within;
        stack.extend(self.nodes.first().map(|root| (root.distance(query), 0)));
        while let Some((squared, node)) = stack.pop() {
            if squared > within {
                continue;
            }
            if !spend(left) {
                break;
            }
            let node = &self.nodes[node as usize];
            if node.child > 0 {
                let [a, b] =
                    [node.child, node.child + 1].map(|k| (self.nodes[k as usize].distance(query), k));
                let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
                stack.extend([far, near].into_iter().filter(|(squared, _)| *squared <= within));
                continue;
            }
            for at in node.from as usize..node.to as usize {
                let squared = self::squared(&self.points[at], query);
                if squared <= within && spend(left) {
                    within = visit(squared, self.labels[at]);
                }
            }
        }
    }
}

impl<const P: usize> Node<P> {
    /// Squared distance from a point to the box; never above that to any point in it.
    #[inline]
    fn distance(&self, query: &[f64; P]) -> f64 {
        let mut nearest = *query;
        for d in 0..P {
            nearest[d] = query[d].max(self.low[d]).min(self.high[d]);
        }
        squared(&nearest, query)
    }
}

fn bounds<const P: usize>(items: &[(u32, [f64; P])], from: usize) -> Node<P> {
    let mut node = Node {
        low: [f64::INFINITY; P],
        high: [f64::NEG_INFINITY; P],
        from: from as u32,
        to: (from + items.len()) as u32,
        child: 0,
        least: POINT,
    };
    for (label, point) in items {
        node.least = node.least.min(*label);
        for ((low, high), x) in node.low.iter_mut().zip(&mut node.high).zip(point) {
            *low = low.min(*x);
            *high = high.max(*x);
        }
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn both_searches_find_what_lies_within_a_distance() {
        let mut rng = Rng::new(7);
        let mut point = || [0; 3].map(|_| rng.between(-1.0, 1.0));
        let points: Vec<(u32, [f64; 3])> = (0..700).map(|label| (label, point())).collect();
        let (tree, mut search) = (KdTree::new(points.clone()), Search::default());
        for within in [0.0, 0.01, 0.3, 20.0] {
            let query = point();
            let mut wanted: Vec<(f64, u32)> =
                points.iter().map(|(label, p)| (squared(p, &query), *label)).collect();
            wanted.retain(|(distance, _)| *distance <= within);
            wanted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let (mut sorted, mut any) = (Vec::new(), Vec::new());
            tree.nearest(&query, within, &mut search, |distance, label| {
                sorted.push((distance, label));
                within
            });
            tree.within(&query, within, &mut search, |distance, label| {
                any.push((distance, label));
                within
            });
            assert_eq!(sorted, wanted);
            any.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            assert_eq!(any, wanted);
        }
        // A search that narrows ends with the nearest.
        let query = point();
        let mut best = (f64::INFINITY, 0);
        tree.within(&query, f64::INFINITY, &mut search, |distance, label| {
            best = if distance < best.0 { (distance, label) } else { best };
            best.0
        });
        let nearest = points.iter().map(|(label, p)| (squared(p, &query), *label));
        assert_eq!(Some(best), nearest.min_by(|a, b| a.0.total_cmp(&b.0)));
    }
}
