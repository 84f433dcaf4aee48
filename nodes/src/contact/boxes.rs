//! Four boxes side by side, and the tests of points and boxes against them.

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

// Unlike f32::max these need no care for NaN, which lets four lanes become one instruction.
#[inline]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
