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
            let mut distances: Vec<f64> = points.chunks(dims).map(|p| squared(p, &query).sqrt()).collect();
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
fn plain_leaves(points: &[f32], dims: usize, order: &mut [usize], parts: usize, leaves: &mut Vec<Vec<u32>>) {
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
    for (count, dims) in [(1, 1), (2, 3), (9, 4), (40, 5), (67, 3), (130, 8), (257, 2), (5000, 3), (5000, 6)]
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
    assert!(found(&KdTree::new(&[], &[], 3), &[0.0; 3], f64::INFINITY, &mut Search::default()).is_empty());
}
