//! End points of many pieces of curves, to select candidates.
//!
//! Single precision, sixteen at a time; callers have to allow for its rounding.

use crate::scrape::force::segment::CELL;

/// Samples of a segment and the one after.
pub(super) const LINE: usize = CELL + 1;

/// A number for each of these.
pub(super) type Line = [f64; LINE];

/// Number of pieces that are processed together.
pub(super) const LANES: usize = 16;

/// End points of pieces, one list for each coordinate. There are [`LANES`] more than
/// pieces.
#[derive(Clone, Debug, Default)]
pub(super) struct EndPoints([Vec<f32>; 4]);

impl EndPoints {
    /// Coordinates of pieces, in the order of the queries.
    pub fn new(pieces: impl Iterator<Item = [[f32; 2]; 2]> + Clone) -> Self {
        let list = |end: usize, axis: usize| {
            let all = pieces.clone().map(|ends| ends[end][axis]);
            all.chain([f32::INFINITY; LANES]).collect()
        };
        Self([list(0, 0), list(0, 1), list(1, 0), list(1, 1)])
    }

    /// One coordinate of the pieces from `k` on.
    #[inline(always)]
    fn lanes(&self, list: usize, k: usize) -> &[f32; LANES] {
        self.0[list].get(k..).and_then(<[f32]>::first_chunk).unwrap_or(&[f32::INFINITY; LANES])
    }

    /// Squares of the distances of the pieces from `k` on from a position.
    #[inline(always)]
    pub fn squares(&self, k: usize, [x, y]: [f32; 2]) -> [f32; LANES] {
        let (ax, ay, bx, by) = (self.lanes(0, k), self.lanes(1, k), self.lanes(2, k), self.lanes(3, k));
        let mut squares = [0.0; LANES];
        for l in 0..LANES {
            let (dx, dy, px, py) = (bx[l] - ax[l], by[l] - ay[l], x - ax[l], y - ay[l]);
            let along = (px * dx + py * dy) / (dx * dx + dy * dy);
            // Also of a point, whose share is no number.
            let along = if along > 0.0 { along } else { 0.0 };
            let along = if along < 1.0 { along } else { 1.0 };
            let (mx, my) = (px - along * dx, py - along * dy);
            squares[l] = mx * mx + my * my;
        }
        squares
    }

    /// Lower bounds of the distance of the pieces from `k` on to a strip around a position; those that are not above 0 may touch it.
    #[inline(always)]
    pub fn apart(&self, k: usize, [x, y]: [f32; 2], strip: &Strip) -> [f32; LANES] {
        let (ax, ay, bx, by) = (self.lanes(0, k), self.lanes(1, k), self.lanes(2, k), self.lanes(3, k));
        let [tx, ty] = strip.direction;
        let mut apart = [0.0; LANES];
        for l in 0..LANES {
            let (px, py, qx, qy) = (ax[l] - x, ay[l] - y, bx[l] - x, by[l] - y);
            let beside = outside(tx * py - ty * px, tx * qy - ty * qx, strip.beside);
            let along = outside(tx * px + ty * py, tx * qx + ty * qy, strip.along);
            apart[l] = if beside > along { beside } else { along };
        }
        apart
    }
}

/// Distance of an interval from another.
#[inline(always)]
fn outside(a: f32, b: f32, [low, high]: [f32; 2]) -> f32 {
    let (least, most) = if a < b { (a, b) } else { (b, a) };
    let (under, over) = (low - most, least - high);
    if under > over { under } else { over }
}

/// A straight strip of the image, around its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// Reference position, px.
    pub middle: [f64; 2],
    /// Unit vector along it.
    pub direction: [f32; 2],
    /// Start and end along that vector, px.
    pub along: [f32; 2],
    /// Start and end across it, px.
    pub beside: [f32; 2],
}
