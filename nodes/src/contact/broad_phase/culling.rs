//! Conservative culling: removes triangles that are certainly too far from a vertex to touch it, in single precision and many
//! at once.
//!
//! The remaining triangles are measured exactly afterwards, so the contacts do not depend on rounding here.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x4, f32x8, f32x16, mask32x8};

use super::boxes::{CLUSTER, Corners, LANES, Node};

/// Vertices of a cluster, axis by axis, and the squared distance within which each looks for triangles.
pub(in crate::contact) struct ClusterPoints {
    pub columns: [[f32; CLUSTER]; 3],
    pub limits: [f32; CLUSTER],
}

impl ClusterPoints {
    /// Position of one vertex.
    #[inline(always)]
    pub fn at(&self, i: usize) -> [f32; 3] {
        let [x, y, z] = &self.columns;
        [x[i % CLUSTER], y[i % CLUSTER], z[i % CLUSTER]]
    }
}

/// A vertex of a cluster and a leaf with triangles that may be near it.
#[derive(Clone, Copy, Debug)]
pub(in crate::contact) struct Pair {
    pub node: u32,
    pub point: u16,
    /// Triangles that are not culled, one bit each.
    pub lanes: u16,
}

/// One bit per vertex, set where the box of a lane is within its limit.
pub(in crate::contact) fn points_near_box(
    level: Level,
    node: &Node,
    lane: usize,
    points: &ClusterPoints,
) -> u16 {
    dispatch!(level, simd => {
        let mut squared = f32x16::splat(simd, 0.0);
        for (axis, column) in points.columns.iter().enumerate() {
            let p = f32x16::simd_from(simd, *column);
            let (lo, hi) = node.bounds(axis);
            let gap = (f32x16::splat(simd, lo[lane % LANES]) - p).max(p - f32x16::splat(simd, hi[lane % LANES]));
            let gap = gap.max(f32x16::splat(simd, 0.0));
            squared += gap * gap;
        }
        squared.simd_le(f32x16::simd_from(simd, points.limits)).to_bitmask() as u16
    })
}

/// Culls the triangles whose boxes are beyond the limit of the vertex.
pub(in crate::contact) fn cull_boxes(
    level: Level,
    nodes: &[Node],
    points: &ClusterPoints,
    pairs: &mut [Pair],
) {
    dispatch!(level, simd => {
        for two in pairs.chunks_mut(2) {
            let (p, limit, [a, b]) = load(simd, points, two);
            let (a, b) = (&nodes[a], &nodes[b]);
            let mut squared = f32x8::splat(simd, 0.0);
            for (axis, p) in p.into_iter().enumerate() {
                let ((a_lo, a_hi), (b_lo, b_hi)) = (a.bounds(axis), b.bounds(axis));
                let gap = (join(simd, a_lo, b_lo) - p).max(p - join(simd, a_hi, b_hi));
                let gap = gap.max(f32x8::splat(simd, 0.0));
                squared += gap * gap;
            }
            retain(two, squared.simd_le(limit).to_bitmask() as u16);
        }
    });
}

/// Culls the triangles that are certainly beyond the limit of the vertex.
///
/// A plane that separates the three corners from the vertex separates the triangle from it. Two planes are tried: the triangle's
/// own, and the one perpendicular to the line from the vertex to the nearest point of the triangle's border. The plane itself need
/// not be exact; only the distances of the corners from it count, and [`ROUNDING`] bounds their errors.
pub(in crate::contact) fn cull_triangles(
    level: Level,
    corners: &[Corners],
    points: &ClusterPoints,
    pairs: &mut [Pair],
) {
    dispatch!(level, simd => {
        for two in pairs.chunks_mut(2) {
            let (p, limit, [a, b]) = load(simd, points, two);
            let (a, b) = (&corners[a], &corners[b]);
            let corners =
                [relative(simd, a, b, 0, &p), relative(simd, a, b, 1, &p), relative(simd, a, b, 2, &p)];
            retain(two, !separated(simd, corners, limit));
        }
    });
}

/// Retains in two pairs the triangles whose bits are set, the lower four for the first pair.
#[inline(always)]
fn retain(pairs: &mut [Pair], bits: u16) {
    for (k, pair) in pairs.iter_mut().enumerate() {
        pair.lanes &= bits >> (LANES * k) & 15;
    }
}

/// Vertices and limits of two pairs, each four times, and their leaves; a single pair counts twice.
#[inline(always)]
fn load<S: Simd>(simd: S, points: &ClusterPoints, pairs: &[Pair]) -> ([f32x8<S>; 3], f32x8<S>, [usize; 2]) {
    let (a, b) = (&pairs[0], &pairs[pairs.len() - 1]);
    let (i, j) = (a.point as usize % CLUSTER, b.point as usize % CLUSTER);
    let [x, y, z] = &points.columns;
    let limit = broadcast(simd, &points.limits, i, j);
    let p = [broadcast(simd, x, i, j), broadcast(simd, y, i, j), broadcast(simd, z, i, j)];
    (p, limit, [a.node as usize, b.node as usize])
}

/// The `i`-th number four times, then the `j`-th.
#[inline(always)]
fn broadcast<S: Simd>(simd: S, x: &[f32; CLUSTER], i: usize, j: usize) -> f32x8<S> {
    f32x4::splat(simd, x[i]).combine(f32x4::splat(simd, x[j]))
}

/// Corner `k` of the triangles of two leaves, relative to a point.
#[inline(always)]
fn relative<S: Simd>(simd: S, a: &Corners, b: &Corners, k: usize, p: &Vector<S>) -> Vector<S> {
    let (a, b) = (a.corner(k), b.corner(k));
    [join(simd, &a[0], &b[0]) - p[0], join(simd, &a[1], &b[1]) - p[1], join(simd, &a[2], &b[2]) - p[2]]
}

#[inline(always)]
fn join<S: Simd>(simd: S, a: &[f32; LANES], b: &[f32; LANES]) -> f32x8<S> {
    f32x4::simd_from(simd, *a).combine(f32x4::simd_from(simd, *b))
}

/// About eight times the largest error of a product of corners, relative to the squared distance of the farthest corner.
const ROUNDING: f32 = 1e-5;

/// Eight vectors, axis by axis.
type Vector<S> = [f32x8<S>; 3];

#[inline(always)]
fn dot<S: Simd>(a: &Vector<S>, b: &Vector<S>) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn sub<S: Simd>(a: &Vector<S>, b: &Vector<S>) -> Vector<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// One bit for each triangle that is certainly farther from the origin than the square root of its limit.
#[inline(always)]
fn separated<S: Simd>(simd: S, [a, b, c]: [Vector<S>; 3], limit: f32x8<S>) -> u16 {
    let (aa, bb, cc) = (dot(&a, &a), dot(&b, &b), dot(&c, &c));
    let (ab, bc, ca) = (dot(&a, &b), dot(&b, &c), dot(&c, &a));
    let limit = limit + aa.max(bb).max(cc) * f32x8::splat(simd, ROUNDING);
    let (u, v) = (sub(&b, &a), sub(&c, &a));
    let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let heights = [dot(&a, &normal), dot(&b, &normal), dot(&c, &normal)];
    let by_own_plane = exceeds(simd, heights, dot(&normal, &normal), limit);
    let near = nearer(edge_point(simd, aa, ab, bb, ca, bc), edge_point(simd, bb, bc, cc, ab, ca));
    let near = nearer(near, edge_point(simd, cc, ca, aa, bc, ab));
    // A point within the limit is near enough itself, and its direction may consist of rounding errors.
    let by_border = exceeds(simd, near.products, near.squared, limit) & near.squared.simd_gt(limit);
    (by_own_plane | by_border).to_bitmask() as u16
}

/// A point of an edge: its squared distance from the origin, and its dot products with the corners of the triangle.
struct EdgePoint<S: Simd> {
    squared: f32x8<S>,
    products: Vector<S>,
}

/// The point nearest to the origin on the edge from `u` to `v`, by dot products of these and of the third corner `w`.
#[inline(always)]
fn edge_point<S: Simd>(
    simd: S,
    uu: f32x8<S>,
    uv: f32x8<S>,
    vv: f32x8<S>,
    wu: f32x8<S>,
    vw: f32x8<S>,
) -> EdgePoint<S> {
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let (from_u, from_v) = (uu - uv, vv - uv);
    let t = (from_u / (from_u + from_v + f32x8::splat(simd, f32::MIN_POSITIVE))).max(zero).min(one);
    let u = uu - t * from_u;
    let v = uv + t * from_v;
    EdgePoint { squared: u + t * (v - u), products: [u, v, wu + t * (vw - wu)] }
}

/// The one of two points that is nearer to the origin.
#[inline(always)]
fn nearer<S: Simd>(a: EdgePoint<S>, b: EdgePoint<S>) -> EdgePoint<S> {
    let first = a.squared.simd_lt(b.squared);
    EdgePoint {
        squared: a.squared.min(b.squared),
        products: [
            first.select(a.products[0], b.products[0]),
            first.select(a.products[1], b.products[1]),
            first.select(a.products[2], b.products[2]),
        ],
    }
}

/// True where all corners lie farther along a direction than the square root of `limit`, or all as far against it.
///
/// The vector holds the dot products of the corners with the direction, `squared` that of the direction with itself.
#[inline(always)]
fn exceeds<S: Simd>(simd: S, [a, b, c]: Vector<S>, squared: f32x8<S>, limit: f32x8<S>) -> mask32x8<S> {
    let (near, far) = (a.min(b).min(c), a.max(b).max(c));
    let height = near.max(-far).max(f32x8::splat(simd, 0.0));
    (height * height).simd_gt(limit * squared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::triangle::closest_point;
    use crate::contact::vector::widen;
    use crate::core::random::Rng;

    /// A cluster whose vertices are all at one position, with one limit.
    fn all_at(p: [f32; 3], limit: f32) -> ClusterPoints {
        ClusterPoints { columns: p.map(|x| [x; CLUSTER]), limits: [limit; CLUSTER] }
    }

    fn culled(corners: &Corners, p: [f32; 3], limit: f32) -> u16 {
        let mut pairs = [Pair { node: 0, point: 7, lanes: 15 }];
        cull_triangles(Level::new(), std::slice::from_ref(corners), &all_at(p, limit), &mut pairs);
        15 & !pairs[0].lanes
    }

    /// Four triangles around a point; with `degenerate` 1 needles, with 2 points.
    fn triangles(rng: &mut Rng, size: f64, p: [f32; 3], degenerate: u64) -> [[[f32; 3]; 3]; LANES] {
        let mut triangles = [[[0.0f32; 3]; 3]; LANES];
        for triangle in &mut triangles {
            *triangle = [(); 3].map(|()| p.map(|x| x + rng.between(-size, size) as f32));
            if degenerate == 1 {
                triangle[2] = [0, 1, 2].map(|k| 0.5 * (triangle[0][k] + triangle[1][k]));
            } else if degenerate == 2 {
                *triangle = [triangle[0]; 3];
            }
        }
        triangles
    }

    #[test]
    fn no_triangle_within_the_limit_is_culled_and_few_beyond_it_remain() {
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
                // The smallest limit that includes it, and one that excludes it by a tenth of the distance.
                let limit = (squared * (1.0 + 1e-7)) as f32 * (1.0 + f32::EPSILON);
                assert_eq!(
                    culled(&corners, p, limit) >> lane & 1,
                    0,
                    "seed {seed}: {triangles:?} from {p:?}"
                );
                if size < 1e10 {
                    let culled = culled(&corners, p, (squared / 1.2) as f32) >> lane & 1;
                    (missed, far) = (missed + u32::from(culled == 0), far + 1);
                }
            }
        }
        assert!(missed * 20 < far, "{missed} of {far}");
    }

    #[test]
    fn boxes_are_culled_by_the_same_rule_for_points_and_for_pairs() {
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
            cull_boxes(Level::new(), &nodes, &points, &mut pairs);
            for pair in pairs {
                let (node, i) = (&nodes[pair.node as usize], pair.point as usize);
                let expected = node.lanes_within(&points.at(i), &points.at(i), 0.3);
                assert_eq!(u32::from(pair.lanes), expected);
                for lane in 0..LANES {
                    let within = points_near_box(Level::new(), node, lane, &points) >> i & 1;
                    assert_eq!(u32::from(within), expected >> lane & 1);
                }
            }
        }
    }
}
