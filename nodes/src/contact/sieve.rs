//! Which triangles are surely too far from a vertex to touch it: in single precision, for many at once.
//!
//! Nothing here decides what touches: what is kept is measured exactly afterwards, so roundings may differ between machines.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x4, f32x8, f32x16, mask32x8};

use super::boxes::{CLUSTER, Corners, LANES, Node};

/// The vertices of a cluster, and for each the squared distance beyond which no box matters to it.
pub(super) struct Points {
    pub columns: [[f32; CLUSTER]; 3],
    pub reaches: [f32; CLUSTER],
}

impl Points {
    /// One vertex.
    #[inline(always)]
    pub fn at(&self, i: usize) -> [f32; 3] {
        let [x, y, z] = &self.columns;
        [x[i % CLUSTER], y[i % CLUSTER], z[i % CLUSTER]]
    }
}

/// A vertex of a cluster and a lowest node with triangles that may be near it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub node: u32,
    pub point: u16,
    /// One bit for each of its triangles.
    pub lanes: u16,
}

/// One bit per vertex: whether the box of a lane is within its reach.
pub(super) fn points_within(level: Level, node: &Node, lane: usize, points: &Points) -> u16 {
    dispatch!(level, simd => {
        let mut squared = f32x16::splat(simd, 0.0);
        for (axis, column) in points.columns.iter().enumerate() {
            let p = f32x16::simd_from(simd, *column);
            let (lo, hi) = node.bounds(axis);
            let gap = (f32x16::splat(simd, lo[lane % LANES]) - p).max(p - f32x16::splat(simd, hi[lane % LANES]));
            let gap = gap.max(f32x16::splat(simd, 0.0));
            squared += gap * gap;
        }
        squared.simd_le(f32x16::simd_from(simd, points.reaches)).to_bitmask() as u16
    })
}

/// Drops the triangles whose boxes are beyond the reach of the vertex.
pub(super) fn drop_far_boxes(level: Level, nodes: &[Node], points: &Points, pairs: &mut [Pair]) {
    dispatch!(level, simd => {
        for two in pairs.chunks_mut(2) {
            let (p, reach, [a, b]) = seen_by(simd, points, two);
            let (a, b) = (&nodes[a], &nodes[b]);
            let mut squared = f32x8::splat(simd, 0.0);
            for (axis, p) in p.into_iter().enumerate() {
                let ((a_lo, a_hi), (b_lo, b_hi)) = (a.bounds(axis), b.bounds(axis));
                let gap = (join(simd, a_lo, b_lo) - p).max(p - join(simd, a_hi, b_hi));
                let gap = gap.max(f32x8::splat(simd, 0.0));
                squared += gap * gap;
            }
            keep(two, squared.simd_le(reach).to_bitmask() as u16);
        }
    });
}

/// Drops triangles that lie surely farther from the vertex than it reaches.
///
/// A triangle lies beyond every plane that its three corners lie beyond. Two planes are tried: its own, and the one across the way
/// from the vertex to the nearest point of its border. Where a plane lies need not be exact, so single precision serves; only the
/// distances of the corners from it count, and [`ROUNDING`] bounds how far those are off.
pub(super) fn drop_far_triangles(level: Level, corners: &[Corners], points: &Points, pairs: &mut [Pair]) {
    dispatch!(level, simd => {
        for two in pairs.chunks_mut(2) {
            let (p, reach, [a, b]) = seen_by(simd, points, two);
            let (a, b) = (&corners[a], &corners[b]);
            let corners = [seen(simd, a, b, 0, &p), seen(simd, a, b, 1, &p), seen(simd, a, b, 2, &p)];
            keep(two, !beyond(simd, corners, reach));
        }
    });
}

/// Keeps in two pairs the triangles whose bits are set, the lower four for the first.
#[inline(always)]
fn keep(pairs: &mut [Pair], bits: u16) {
    for (k, pair) in pairs.iter_mut().enumerate() {
        pair.lanes &= bits >> (LANES * k) & 15;
    }
}

/// The vertices of two pairs and their reaches, each four times, and the nodes; of one pair, twice the same.
#[inline(always)]
fn seen_by<S: Simd>(simd: S, points: &Points, pairs: &[Pair]) -> ([f32x8<S>; 3], f32x8<S>, [usize; 2]) {
    let (a, b) = (&pairs[0], &pairs[pairs.len() - 1]);
    let (i, j) = (a.point as usize % CLUSTER, b.point as usize % CLUSTER);
    let [x, y, z] = &points.columns;
    let reach = spread(simd, &points.reaches, i, j);
    let p = [spread(simd, x, i, j), spread(simd, y, i, j), spread(simd, z, i, j)];
    (p, reach, [a.node as usize, b.node as usize])
}

#[inline(always)]
fn spread<S: Simd>(simd: S, x: &[f32; CLUSTER], i: usize, j: usize) -> f32x8<S> {
    f32x4::splat(simd, x[i]).combine(f32x4::splat(simd, x[j]))
}

/// Corner `k` of the triangles of two nodes, seen from a point.
#[inline(always)]
fn seen<S: Simd>(simd: S, a: &Corners, b: &Corners, k: usize, p: &Three<S>) -> Three<S> {
    let (a, b) = (a.corner(k), b.corner(k));
    [join(simd, &a[0], &b[0]) - p[0], join(simd, &a[1], &b[1]) - p[1], join(simd, &a[2], &b[2]) - p[2]]
}

#[inline(always)]
fn join<S: Simd>(simd: S, a: &[f32; LANES], b: &[f32; LANES]) -> f32x8<S> {
    f32x4::simd_from(simd, *a).combine(f32x4::simd_from(simd, *b))
}

/// Some eight times what products of corners are off by at most, as a part of the farthest corner's squared distance.
const ROUNDING: f32 = 1e-5;

type Three<S> = [f32x8<S>; 3];

#[inline(always)]
fn dot<S: Simd>(a: &Three<S>, b: &Three<S>) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn minus<S: Simd>(a: &Three<S>, b: &Three<S>) -> Three<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// One bit for each triangle that lies surely farther from the origin than the root of its limit.
#[inline(always)]
fn beyond<S: Simd>(simd: S, [a, b, c]: [Three<S>; 3], limit: f32x8<S>) -> u16 {
    let (aa, bb, cc) = (dot(&a, &a), dot(&b, &b), dot(&c, &c));
    let (ab, bc, ca) = (dot(&a, &b), dot(&b, &c), dot(&c, &a));
    let reach = limit + aa.max(bb).max(cc) * f32x8::splat(simd, ROUNDING);
    let (u, v) = (minus(&b, &a), minus(&c, &a));
    let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let heights = [dot(&a, &normal), dot(&b, &normal), dot(&c, &normal)];
    let own = over(simd, heights, dot(&normal, &normal), reach);
    // All that is asked of the nearest point of an edge is how far the corners lie along the way to it.
    let near = nearer(foot(simd, aa, ab, bb, ca, bc), foot(simd, bb, bc, cc, ab, ca));
    let near = nearer(near, foot(simd, cc, ca, aa, bc, ab));
    // What is nearer than it has to be lies within reach itself, and its direction would be made of roundings.
    let border = over(simd, near.along, near.squared, reach) & near.squared.simd_gt(reach);
    (own | border).to_bitmask() as u16
}

/// A point near the origin: its squared distance, and its products with the corners of the triangle.
struct Foot<S: Simd> {
    squared: f32x8<S>,
    along: Three<S>,
}

/// The point nearest to the origin on the edge from `u` to `v`, by products of these and of the third corner `w`.
#[inline(always)]
fn foot<S: Simd>(simd: S, uu: f32x8<S>, uv: f32x8<S>, vv: f32x8<S>, wu: f32x8<S>, vw: f32x8<S>) -> Foot<S> {
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let (back, forth) = (uu - uv, vv - uv);
    let t = (back / (back + forth + f32x8::splat(simd, f32::MIN_POSITIVE))).max(zero).min(one);
    let u = uu - t * back;
    let v = uv + t * forth;
    Foot { squared: u + t * (v - u), along: [u, v, wu + t * (vw - wu)] }
}

/// Of two points the one nearer to the origin.
#[inline(always)]
fn nearer<S: Simd>(a: Foot<S>, b: Foot<S>) -> Foot<S> {
    let first = a.squared.simd_lt(b.squared);
    Foot {
        squared: a.squared.min(b.squared),
        along: [
            first.select(a.along[0], b.along[0]),
            first.select(a.along[1], b.along[1]),
            first.select(a.along[2], b.along[2]),
        ],
    }
}

/// Whether all corners lie farther along a direction than the root of `reach`, or all as far against it.
///
/// `along` holds the products of the corners with the direction, `squared` that of the direction with itself.
#[inline(always)]
fn over<S: Simd>(simd: S, [a, b, c]: Three<S>, squared: f32x8<S>, reach: f32x8<S>) -> mask32x8<S> {
    let (near, far) = (a.min(b).min(c), a.max(b).max(c));
    let height = near.max(-far).max(f32x8::splat(simd, 0.0));
    (height * height).simd_gt(reach * squared)
}

#[cfg(test)]
mod tests {
    use super::super::triangle::closest_point;
    use super::super::vector::widen;
    use super::*;
    use crate::core::random::Rng;

    /// A cluster all at one place, with one reach.
    fn all_at(p: [f32; 3], reach: f32) -> Points {
        Points { columns: p.map(|x| [x; CLUSTER]), reaches: [reach; CLUSTER] }
    }

    fn beyond(corners: &Corners, p: [f32; 3], reach: f32) -> u16 {
        let mut pairs = [Pair { node: 0, point: 7, lanes: 15 }];
        drop_far_triangles(Level::new(), std::slice::from_ref(corners), &all_at(p, reach), &mut pairs);
        15 & !pairs[0].lanes
    }

    /// Four triangles around a point, on request needles or points.
    fn triangles(rng: &mut Rng, size: f64, p: [f32; 3], flat: u64) -> [[[f32; 3]; 3]; LANES] {
        let mut triangles = [[[0.0f32; 3]; 3]; LANES];
        for triangle in &mut triangles {
            *triangle = [(); 3].map(|()| p.map(|x| x + rng.between(-size, size) as f32));
            if flat == 1 {
                triangle[2] = [0, 1, 2].map(|k| 0.5 * (triangle[0][k] + triangle[1][k]));
            } else if flat == 2 {
                *triangle = [triangle[0]; 3];
            }
        }
        triangles
    }

    #[test]
    fn no_triangle_that_is_near_enough_is_dropped_and_few_others_are_kept() {
        let (mut missed, mut far) = (0, 0);
        for seed in 0..4000 {
            let mut rng = Rng::new(seed);
            let size = [1.0, 1e-3, 1e-6, 1e25][rng.below(4)];
            let p = [(); 3].map(|()| rng.between(-10.0, 10.0) as f32);
            let triangles = triangles(&mut rng, size, p, seed % 4);
            let mut corners = Corners::default();
            for (lane, triangle) in triangles.iter().enumerate() {
                corners.set(lane, *triangle);
                assert_eq!(corners.of(lane), *triangle);
            }
            for (lane, [a, b, c]) in triangles.into_iter().enumerate() {
                let squared = closest_point(widen(p), [widen(a), widen(b), widen(c)]).squared_distance;
                // The least reach that includes it, and one that leaves it out by a tenth.
                let reach = (squared * (1.0 + 1e-7)) as f32 * (1.0 + f32::EPSILON);
                assert_eq!(
                    beyond(&corners, p, reach) >> lane & 1,
                    0,
                    "seed {seed}: {triangles:?} from {p:?}"
                );
                if size < 1e10 {
                    let beyond = beyond(&corners, p, (squared / 1.2) as f32) >> lane & 1;
                    (missed, far) = (missed + u32::from(beyond == 0), far + 1);
                }
            }
        }
        assert!(missed * 20 < far, "{missed} of {far}");
    }

    #[test]
    fn boxes_are_kept_by_the_same_rule_for_points_and_for_pairs() {
        let mut rng = Rng::new(5);
        let mut random = |size: f64| [(); 3].map(|()| rng.between(-size, size) as f32);
        for _ in 0..200 {
            let mut nodes = [Node::EMPTY; 2];
            for node in &mut nodes {
                for lane in 0..LANES - 1 {
                    let (a, b) = (random(1.0), random(1.0));
                    node.set(lane, [0, 1, 2].map(|k| a[k].min(b[k])), [0, 1, 2].map(|k| a[k].max(b[k])));
                }
            }
            let mut points = all_at([0.0; 3], 0.3);
            for i in 0..CLUSTER {
                let p = random(2.0);
                points.columns.iter_mut().zip(p).for_each(|(column, x)| column[i] = x);
            }
            let mut pairs: Vec<Pair> =
                (0..31).map(|k| Pair { node: k % 2, point: (k / 2) as u16, lanes: 15 }).collect();
            drop_far_boxes(Level::new(), &nodes, &points, &mut pairs);
            for pair in pairs {
                let (node, i) = (&nodes[pair.node as usize], pair.point as usize);
                let expected = node.lanes_within(&points.at(i), &points.at(i), 0.3);
                assert_eq!(u32::from(pair.lanes), expected);
                for lane in 0..LANES {
                    let within = points_within(Level::new(), node, lane, &points) >> i & 1;
                    assert_eq!(u32::from(within), expected >> lane & 1);
                }
            }
        }
    }
}
