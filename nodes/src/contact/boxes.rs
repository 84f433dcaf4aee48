//! Four boxes or triangles side by side, and the tests of points and boxes against them.

/// Boxes per node.
pub(crate) const LANES: usize = 4;
/// Points that are tested against one box together: one per bit of a mask.
pub(crate) const CLUSTER: usize = 16;
/// The bit of each point.
const BITS: [u32; CLUSTER] = {
    let mut bits = [1; CLUSTER];
    let mut i = 1;
    while i < CLUSTER {
        bits[i] = 2 * bits[i - 1];
        i += 1;
    }
    bits
};

/// Four boxes, axis by axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    lo: [[f32; LANES]; 3],
    hi: [[f32; LANES]; 3],
}

impl Node {
    /// No boxes: infinitely far from everything.
    pub const EMPTY: Node = Node { lo: [[f32::INFINITY; LANES]; 3], hi: [[f32::NEG_INFINITY; LANES]; 3] };

    /// Squared distances from the box [lo, hi] to the four boxes; 0 where they overlap.
    #[inline]
    pub fn squared_distances(&self, lo: &[f32; 3], hi: &[f32; 3]) -> [f32; LANES] {
        let mut sum = [0.0f32; LANES];
        for axis in 0..3 {
            for ((sum, &box_lo), &box_hi) in sum.iter_mut().zip(&self.lo[axis]).zip(&self.hi[axis]) {
                let gap = larger(larger(box_lo - hi[axis], lo[axis] - box_hi), 0.0);
                *sum += gap * gap;
            }
        }
        sum
    }

    /// One bit per box: whether its squared distance from the box [lo, hi] is at most `limit`.
    #[inline]
    pub fn lanes_within(&self, lo: &[f32; 3], hi: &[f32; 3], limit: f32) -> u32 {
        let distances = self.squared_distances(lo, hi);
        let mut near = 0;
        for (lane, &distance) in distances.iter().enumerate() {
            near |= u32::from(distance <= limit) << lane;
        }
        near
    }

    /// One bit per point: whether its squared distance from the box of a lane is at most its limit.
    #[inline]
    pub fn points_within(&self, lane: usize, points: &[[f32; CLUSTER]; 3], limits: &[f32; CLUSTER]) -> u16 {
        let mut distances = [0.0f32; CLUSTER];
        for (column, (los, his)) in points.iter().zip(self.lo.iter().zip(&self.hi)) {
            let (lo, hi) = (los[lane], his[lane]);
            for (distance, &p) in distances.iter_mut().zip(column) {
                let gap = larger(larger(lo - p, p - hi), 0.0);
                *distance += gap * gap;
            }
        }
        // A sum of weights instead of shifted bits: the compiler keeps it in vectors.
        let mut near = 0u32;
        for ((distance, limit), bit) in distances.iter().zip(limits).zip(&BITS) {
            near += if distance <= limit { *bit } else { 0 };
        }
        near as u16
    }

    pub fn union(&self) -> ([f32; 3], [f32; 3]) {
        let lo = self.lo.map(|l| smaller(smaller(l[0], l[1]), smaller(l[2], l[3])));
        let hi = self.hi.map(|h| larger(larger(h[0], h[1]), larger(h[2], h[3])));
        (lo, hi)
    }

    pub fn set(&mut self, lane: usize, lo: [f32; 3], hi: [f32; 3]) {
        for axis in 0..3 {
            self.lo[axis][lane] = lo[axis];
            self.hi[axis][lane] = hi[axis];
        }
    }
}

/// The corners of four triangles, axis by axis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Corners([[[f32; LANES]; 3]; 3]);

/// One number for each of four boxes or triangles.
type Lanes = [f32; LANES];

#[inline(always)]
fn lanes(f: impl Fn(usize) -> f32) -> Lanes {
    [f(0), f(1), f(2), f(3)]
}

#[inline(always)]
fn dot(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    lanes(|l| a[0][l] * b[0][l] + a[1][l] * b[1][l] + a[2][l] * b[2][l])
}

impl Corners {
    /// Sets one triangle.
    #[inline]
    pub fn set(&mut self, lane: usize, triangle: [[f32; 3]; 3]) {
        for (columns, corner) in self.0.iter_mut().zip(triangle) {
            for (column, x) in columns.iter_mut().zip(corner) {
                column[lane] = x;
            }
        }
    }

    /// One triangle.
    #[inline]
    pub fn of(&self, lane: usize) -> [[f32; 3]; 3] {
        let [a, b, c] = &self.0;
        let corner = |[x, y, z]: &[Lanes; 3]| [x[lane], y[lane], z[lane]];
        [corner(a), corner(b), corner(c)]
    }

    /// One bit for each triangle that lies surely farther from `p` than the root of `limit`.
    ///
    /// A triangle lies beyond every plane that its three corners lie beyond. Two planes are tried: its own, and the one across the way
    /// from `p` to the nearest point of its border. Where a plane lies need not be exact, so single precision serves; only the
    /// distances of the corners from it count, and they are off by a few roundings of how far the corners are.
    //
    // Not inlined: in a loop it runs out of registers, and then costs three times as much.
    #[inline(never)]
    pub fn beyond(&self, p: &[f32; 3], limit: f32) -> u32 {
        let [a, b, c] = &self.0;
        let (a, b, c) = (seen(a, p), seen(b, p), seen(c, p));
        let (ab, bc, ca) = (minus(&b, &a), minus(&c, &b), minus(&a, &c));
        let (aa, bb, cc) = (dot(&a, &a), dot(&b, &b), dot(&c, &c));
        let reach = lanes(|l| limit + 4e-6 * larger(larger(aa[l], bb[l]), cc[l]));

        let normal = [
            lanes(|l| ab[1][l] * bc[2][l] - ab[2][l] * bc[1][l]),
            lanes(|l| ab[2][l] * bc[0][l] - ab[0][l] * bc[2][l]),
            lanes(|l| ab[0][l] * bc[1][l] - ab[1][l] * bc[0][l]),
        ];
        let own = over(&a, &b, &c, &normal, &reach);
        let (e, f, g) = (foot(&a, &ab), foot(&b, &bc), foot(&c, &ca));
        let best = nearer(&nearer(&e, &f), &g);
        let border = over(&a, &b, &c, &best, &reach);
        let mut bits = 0;
        for l in 0..LANES {
            bits |= u32::from(own[l] | border[l]) << l;
        }
        bits
    }
}

/// Corners as seen from a point.
#[inline(always)]
fn seen(corner: &[Lanes; 3], p: &[f32; 3]) -> [Lanes; 3] {
    [lanes(|l| corner[0][l] - p[0]), lanes(|l| corner[1][l] - p[1]), lanes(|l| corner[2][l] - p[2])]
}

#[inline(always)]
fn minus(a: &[Lanes; 3], b: &[Lanes; 3]) -> [Lanes; 3] {
    [lanes(|l| a[0][l] - b[0][l]), lanes(|l| a[1][l] - b[1][l]), lanes(|l| a[2][l] - b[2][l])]
}

/// The point nearest to the origin on the edges that start at `a` and go by `d`.
#[inline(always)]
fn foot(a: &[Lanes; 3], d: &[Lanes; 3]) -> [Lanes; 3] {
    let (along, length) = (dot(a, d), dot(d, d));
    let t = lanes(|l| smaller(larger(-along[l] / (length[l] + f32::MIN_POSITIVE), 0.0), 1.0));
    [
        lanes(|l| a[0][l] + t[l] * d[0][l]),
        lanes(|l| a[1][l] + t[l] * d[1][l]),
        lanes(|l| a[2][l] + t[l] * d[2][l]),
    ]
}

/// Of two points the one nearer to the origin.
#[inline(always)]
fn nearer(a: &[Lanes; 3], b: &[Lanes; 3]) -> [Lanes; 3] {
    let (aa, bb) = (dot(a, a), dot(b, b));
    let pick = |a: &Lanes, b: &Lanes| lanes(|l| if aa[l] < bb[l] { a[l] } else { b[l] });
    [pick(&a[0], &b[0]), pick(&a[1], &b[1]), pick(&a[2], &b[2])]
}

/// Whether all corners, seen from the origin, lie farther along a direction than the root of `reach`, or all as far against it.
#[inline(always)]
fn over(
    a: &[Lanes; 3],
    b: &[Lanes; 3],
    c: &[Lanes; 3],
    direction: &[Lanes; 3],
    reach: &Lanes,
) -> [bool; LANES] {
    let (a, b, c) = (dot(a, direction), dot(b, direction), dot(c, direction));
    let length = dot(direction, direction);
    let near = lanes(|l| smaller(smaller(a[l], b[l]), c[l]));
    let far = lanes(|l| larger(larger(a[l], b[l]), c[l]));
    let height = lanes(|l| larger(larger(near[l], -far[l]), 0.0));
    [0, 1, 2, 3].map(|l| height[l] * height[l] > reach[l] * length[l])
}

// Unlike f32::max these need no care for NaN, which lets four lanes become one instruction.
#[inline]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::super::triangle::closest_point;
    use super::super::vector::widen;
    use super::*;
    use crate::core::random::Draw;

    #[test]
    fn no_triangle_that_is_near_enough_counts_as_beyond_and_few_others_do_not() {
        let (mut missed, mut far) = (0, 0);
        for seed in 0..3000 {
            let mut draw = Draw::new(seed);
            let size = [1.0, 1e-3, 1e-6][draw.below(3)];
            let mut point = |size: f64, at: [f32; 3]| at.map(|x| x + draw.between(-size, size) as f32);
            let p = point(10.0, [0.0; 3]);
            let mut corners = Corners::default();
            let flat = seed % 4;
            let mut triangles = [[[0.0f32; 3]; 3]; LANES];
            for (lane, triangle) in triangles.iter_mut().enumerate() {
                *triangle = [(); 3].map(|()| point(size, p));
                // Needles and points among them.
                if flat == 1 {
                    triangle[2] = [0, 1, 2].map(|k| 0.5 * (triangle[0][k] + triangle[1][k]));
                } else if flat == 2 {
                    *triangle = [triangle[0]; 3];
                }
                corners.set(lane, *triangle);
                assert_eq!(corners.of(lane), *triangle);
            }
            let exact = triangles
                .map(|[a, b, c]| closest_point(widen(p), [widen(a), widen(b), widen(c)]).squared_distance);
            for (lane, &squared) in exact.iter().enumerate() {
                // The least limit that includes it, and one that leaves it out by a tenth.
                let limit = (squared * (1.0 + 1e-7)) as f32 * (1.0 + f32::EPSILON);
                assert_eq!(corners.beyond(&p, limit) >> lane & 1, 0, "seed {seed}: {triangles:?} from {p:?}");
                let beyond = corners.beyond(&p, (squared / 1.2) as f32) >> lane & 1;
                (missed, far) = (missed + u32::from(beyond == 0), far + 1);
            }
        }
        assert!(missed * 20 < far, "{missed} of {far}");
    }
}
