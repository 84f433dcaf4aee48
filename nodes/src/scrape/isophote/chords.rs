//! The positions of a contact over one segment, cut into parts that lie in small boxes on one tile.

use super::end_points::{LINE, Line, Strip};
use super::index::{IsophoteIndex, Tile};
use crate::scrape::force::ramp::Ramp;
use crate::scrape::force::segment::{CELL, Segment};

/// Maximum length of a box of a segment in one query, and of a chord, px.
const BOX: f64 = 8.0;
/// Maximum jump of a contact between two touching pieces, px.
const JOINT: f64 = 0.5;

/// The positions at the samples of a segment and at the one after.
#[derive(Clone, Debug)]
pub(super) struct Chords {
    /// Positions along x and along y, px.
    pub positions: [Line; 2],
    /// Positions of the part that was cut last, on the image.
    pub local: [Line; 2],
}

/// Some samples of a segment whose positions lie on one tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct SegmentPart {
    /// First sample, and the one after the last; a chord leads from each to the next.
    pub range: [usize; 2],
    /// The tile that all chords begin on.
    pub tile: [Tile; 2],
    /// The box around the positions on the image.
    pub bounds: [[f64; 2]; 2],
    /// True if it is too long to be resolved.
    pub long: bool,
}

impl Chords {
    /// Chords without positions.
    pub fn new() -> Self {
        Self { positions: [[0.0; LINE]; 2], local: [[0.0; LINE]; 2] }
    }

    /// Takes the positions of a segment in pixels. A chord begins where the one before has ended, to the bit: `trace` is the last
    /// sample of the contact, and its position.
    #[inline(always)]
    pub fn walk(
        &mut self,
        segment: &Segment,
        density: [f64; 2],
        scale: &Ramp,
        trace: Option<(i64, [f64; 2])>,
    ) {
        let [a, b, c, d] = segment.path();
        let (from, to) = (segment.from.min(CELL), segment.to.min(CELL));
        let settled = scale.settled(segment.anchor);
        for k in 0..2 {
            let coefficients = [a[k], b[k], c[k], d[k]];
            if let Some(scale) = settled {
                let pixels = density[k] / scale;
                for n in 0..LINE {
                    self.positions[k][n] = cubic(coefficients, n as f64) * pixels;
                }
            } else {
                for n in from..=to {
                    let scale = scale.at(segment.anchor + n as i64);
                    self.positions[k][n] = cubic(coefficients, n as f64) * (density[k] / scale);
                }
            }
        }
        let first = self.position(from);
        if let Some((sample, position)) = trace
            && sample == segment.anchor + segment.from as i64
            && norm([position[0] - first[0], position[1] - first[1]]) < JOINT
        {
            (self.positions[0][from], self.positions[1][from]) = (position[0], position[1]);
        }
    }

    /// The position at a sample, px.
    #[inline(always)]
    pub fn position(&self, n: usize) -> [f64; 2] {
        [self.positions[0][n], self.positions[1][n]]
    }

    /// The step from a sample to the next, px.
    #[inline(always)]
    pub fn step(&self, n: usize) -> [f64; 2] {
        let (from, to) = (self.position(n), self.position(n + 1));
        [to[0] - from[0], to[1] - from[1]]
    }

    /// The position of a sample of the last part on the image.
    #[inline(always)]
    pub fn on_image(&self, n: usize) -> [f64; 2] {
        [self.local[0][n], self.local[1][n]]
    }

    /// Cuts the first part from the samples `[from, end)`.
    #[inline(always)]
    pub fn part(&mut self, index: &IsophoteIndex, from: usize, end: usize) -> SegmentPart {
        let tile = index.tile(self.position(from));
        let mut to = end;
        let [mut x, mut y] = extents(&self.positions, [from, to]);
        let small = x[1] - x[0] <= BOX && y[1] - y[0] <= BOX;
        if !(small && index.holds(&tile, [x[0], y[0]]) && index.holds(&tile, [x[1], y[1]])) {
            to = self.first(index, &tile, from, to);
            [x, y] = extents(&self.positions, [from, to]);
        }
        let long = x[1] - x[0] > BOX || y[1] - y[0] > BOX;
        for k in 0..2 {
            index.line_on_image(&tile, k, &self.positions[k], &mut self.local[k]);
        }
        let [x, y] = extents(&self.local, [from, to]);
        SegmentPart { range: [from, to], tile, bounds: [[x[0], y[0]], [x[1], y[1]]], long }
    }

    /// Returns the number of samples from `from` on whose chords begin on a tile and stay in a small box: at least one.
    #[inline(always)]
    fn first(&self, index: &IsophoteIndex, tile: &[Tile; 2], from: usize, end: usize) -> usize {
        let (mut low, mut high) = (self.position(from), self.position(from));
        for to in from..end {
            let next = self.position(to + 1);
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(next[k]), high[k].max(next[k]));
            }
            let wide = high[0] - low[0] > BOX || high[1] - low[1] > BOX;
            if to > from && (wide || !index.holds(tile, self.position(to))) {
                return to;
            }
        }
        end
    }

    /// The narrowest straight strip around a part in the direction from its first to its last position.
    #[inline(always)]
    pub fn strip(&self, part: &SegmentPart) -> Strip {
        let [from, to] = part.range;
        let ([low, high], [a, b]) = (part.bounds, [self.on_image(from), self.on_image(to)]);
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let step = [b[0] - a[0], b[1] - a[1]];
        let long = norm(step);
        let [tx, ty] = if long > 1e-9 { [step[0] / long, step[1] / long] } else { [1.0, 0.0] };
        let mut turned = [[0.0; LINE]; 2];
        let [along, beside] = &mut turned;
        for n in 0..LINE {
            let off = [self.local[0][n] - middle[0], self.local[1][n] - middle[1]];
            along[n] = tx * off[0] + ty * off[1];
            beside[n] = tx * off[1] - ty * off[0];
        }
        let [along, beside] = extents(&turned, part.range);
        let single = |x: [f64; 2]| [x[0] as f32, x[1] as f32];
        Strip { middle, direction: [tx as f32, ty as f32], along: single(along), beside: single(beside) }
    }
}

/// Length of a vector whose square is a number.
#[inline(always)]
pub(super) fn norm([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

#[inline(always)]
fn cubic([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    a + t * (b + t * (c + t * d))
}

#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The least and the greatest of two lines between two samples.
#[inline(always)]
fn extents(lines: &[Line; 2], [from, to]: [usize; 2]) -> [[f64; 2]; 2] {
    [extent(&lines[0][from..=to]), extent(&lines[1][from..=to])]
}

/// The least and the greatest of some numbers.
#[inline(always)]
fn extent(all: &[f64]) -> [f64; 2] {
    const LANES: usize = 8;
    let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
    let chunks = all.chunks_exact(LANES);
    for (l, x) in chunks.remainder().iter().enumerate() {
        (low[l], high[l]) = (*x, *x);
    }
    for chunk in chunks {
        for l in 0..LANES {
            (low[l], high[l]) = (least(low[l], chunk[l]), most(high[l], chunk[l]));
        }
    }
    let mut both = [low[0], high[0]];
    for l in 1..LANES {
        both = [least(both[0], low[l]), most(both[1], high[l])];
    }
    both
}
