//! Four bounding boxes or triangles side by side, for vector instructions.

/// Boxes per node.
pub(crate) const LANES: usize = 4;
/// Vertices that one search handles together: one per bit of a mask.
pub(crate) const CLUSTER: usize = 16;

/// Four boxes, axis by axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    lo: [[f32; LANES]; 3],
    hi: [[f32; LANES]; 3],
}

impl Node {
    /// No boxes: at an infinite distance from everything.
    pub const EMPTY: Node = Node { lo: [[f32::INFINITY; LANES]; 3], hi: [[f32::NEG_INFINITY; LANES]; 3] };

    /// Squared distances from the box [lo, hi] to the four boxes; 0 where they overlap.
    #[inline]
    pub fn squared_distances(&self, lo: &[f32; 3], hi: &[f32; 3]) -> [f32; LANES] {
        let mut sum = [0.0f32; LANES];
        for axis in 0..3 {
            for ((sum, &box_lo), &box_hi) in sum.iter_mut().zip(&self.lo[axis]).zip(&self.hi[axis]) {
                let gap = max(max(box_lo - hi[axis], lo[axis] - box_hi), 0.0);
                *sum += gap * gap;
            }
        }
        sum
    }

    /// One bit per box, set where its squared distance from the box [lo, hi] is at most `limit`.
    #[inline]
    pub fn lanes_within(&self, lo: &[f32; 3], hi: &[f32; 3], limit: f32) -> u32 {
        let distances = self.squared_distances(lo, hi);
        let mut mask = 0;
        for (lane, &distance) in distances.iter().enumerate() {
            mask |= u32::from(distance <= limit) << lane;
        }
        mask
    }

    /// Lower and upper ends of the boxes along an axis.
    #[inline(always)]
    pub fn bounds(&self, axis: usize) -> (&[f32; LANES], &[f32; LANES]) {
        (&self.lo[axis], &self.hi[axis])
    }

    /// The smallest box around all four.
    pub fn union(&self) -> ([f32; 3], [f32; 3]) {
        let lo = self.lo.map(|l| min(min(l[0], l[1]), min(l[2], l[3])));
        let hi = self.hi.map(|h| max(max(h[0], h[1]), max(h[2], h[3])));
        (lo, hi)
    }

    /// Sets one box.
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
        let corner = |[x, y, z]: &[[f32; LANES]; 3]| [x[lane], y[lane], z[lane]];
        [corner(a), corner(b), corner(c)]
    }

    /// Corner `k` of all, axis by axis.
    #[inline(always)]
    pub fn corner(&self, k: usize) -> &[[f32; LANES]; 3] {
        &self.0[k]
    }
}

// Unlike f32::max these ignore NaN, so that the compiler turns four lanes into one instruction.
#[inline]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
