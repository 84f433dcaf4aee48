//! Nearest curve at each sample of a segment.

use super::chords::{Chords, SegmentPart};
use super::curve_piece::CurvePiece;
use super::index::IsophoteIndex;
use crate::scrape::force::segment::{CELL, Cell};

/// Pieces of curves that are compared at once.
const MAX_COUNT: usize = 512;
/// A position without a curve within reach.
const NONE: u32 = u32::MAX;

/// The nearest point of all curves for each sample of a segment.
///
/// # Complexity
/// The distances of all samples from a piece of a curve are found together; a piece that is further from the middle of the samples
/// than another by more than they are apart is passed over.
#[derive(Clone, Debug)]
pub(super) struct NearestCurve {
    /// Pieces that may be the nearest.
    pieces: Vec<CurvePiece>,
    best: Best,
    /// Gradient of the curve at the nearest point as the sample meets it, along x and along y.
    pub x: [f64; CELL],
    pub y: [f64; CELL],
    /// Square of its distance, px.
    pub squares: Cell,
    /// True if there is one within reach.
    pub found: [bool; CELL],
}

/// The nearest point compared so far, for all samples; only those of the range are valid.
#[derive(Clone, Debug)]
struct Best {
    /// Positions of the samples, px.
    x: Cell,
    y: Cell,
    /// Square of its distance, px.
    square: Cell,
    /// Position on the piece, 0 to 1.
    along: Cell,
    /// The number of the piece, and its position in the list.
    number: [u32; CELL],
    position: [u32; CELL],
}

impl NearestCurve {
    /// An empty result, without samples.
    pub fn new() -> Self {
        let (zero, none) = ([0.0; CELL], [NONE; CELL]);
        Self {
            pieces: Vec::with_capacity(MAX_COUNT),
            best: Best { x: zero, y: zero, square: zero, along: zero, number: none, position: none },
            x: [0.0; CELL],
            y: [0.0; CELL],
            squares: zero,
            found: [false; CELL],
        }
    }

    /// Clears the results.
    pub fn clear(&mut self) {
        self.found = [false; CELL];
    }

    /// Finds the nearest points within `reach` of the samples of a part, whose positions are relative to `origin`.
    #[inline(always)]
    pub fn find(
        &mut self,
        index: &IsophoteIndex,
        chords: &Chords,
        part: &SegmentPart,
        origin: [f64; 2],
        reach: f64,
    ) {
        let best = &mut self.best;
        for n in 0..CELL {
            let position = chords.on_image(n);
            (best.x[n], best.y[n]) = ((position[0] - origin[0]) as f32, (position[1] - origin[1]) as f32);
        }
        best.square = [(reach * reach) as f32; CELL];
        (best.number, best.position) = ([NONE; CELL], [NONE; CELL]);
        let [low, high] = part.bounds;
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let (dx, dy) = (high[0] - middle[0], high[1] - middle[1]);
        let half = (dx * dx + dy * dy).sqrt();
        let bounds = [[low[0] - reach, low[1] - reach], [high[0] + reach, high[1] + reach]];
        self.pieces.clear();
        // A piece that is further from the middle than the nearest by a whole box is nowhere the nearest.
        index.around(
            bounds,
            middle,
            [reach + half, 2.0 * half],
            #[inline(always)]
            |piece| {
                if self.pieces.len() == MAX_COUNT {
                    self.compare(index, chords, part, origin);
                }
                self.pieces.push(piece);
            },
        );
        self.compare(index, chords, part, origin);
    }

    /// Compares all pieces of the list, and clears it.
    #[inline(always)]
    fn compare(&mut self, index: &IsophoteIndex, chords: &Chords, part: &SegmentPart, origin: [f64; 2]) {
        let Self { pieces, best, .. } = self;
        for (position, piece) in (0..).zip(&*pieces) {
            best.take(origin, (position, piece));
        }
        let steps_x = index.line_steps(&part.tile, 0, &chords.positions[0]);
        let steps_y = index.line_steps(&part.tile, 1, &chords.positions[1]);
        let [mut from, to] = part.range;
        while from < to {
            // Neighbours mostly lie near the same piece.
            let position = best.position[from];
            let mut end = from + 1;
            while end < to && best.position[end] == position {
                end += 1;
            }
            if let Some(piece) = pieces.get(position as usize) {
                let slopes = index.slopes(piece);
                for n in from..end {
                    let [gx, gy] = slopes.at(f64::from(best.along[n]));
                    (self.x[n], self.y[n]) = (gx * steps_x[n], gy * steps_y[n]);
                    (self.found[n], self.squares[n]) = (true, best.square[n]);
                }
            }
            from = end;
        }
        best.position = [NONE; CELL];
        pieces.clear();
    }
}

impl Best {
    /// Compares the distances of all samples from one more piece; on a tie the piece of the lower number counts.
    #[inline(always)]
    fn take(&mut self, origin: [f64; 2], (position, piece): (u32, &CurvePiece)) {
        let [a, b] = piece.ends;
        let a = [(a[0] - origin[0]) as f32, (a[1] - origin[1]) as f32];
        let b = [(b[0] - origin[0]) as f32, (b[1] - origin[1]) as f32];
        let step = [b[0] - a[0], b[1] - a[1]];
        let long = step[0] * step[0] + step[1] * step[1];
        let part = if long > 0.0 { 1.0 / long } else { 0.0 };
        for n in 0..CELL {
            let off = [self.x[n] - a[0], self.y[n] - a[1]];
            let along = (off[0] * step[0] + off[1] * step[1]) * part;
            let along = if along > 0.0 { along } else { 0.0 };
            let along = if along < 1.0 { along } else { 1.0 };
            let miss = [off[0] - along * step[0], off[1] - along * step[1]];
            let square = miss[0] * miss[0] + miss[1] * miss[1];
            let same = (square == self.square[n]) & (piece.number < self.number[n]);
            let better = (square < self.square[n]) | same;
            self.square[n] = if better { square } else { self.square[n] };
            self.along[n] = if better { along } else { self.along[n] };
            self.number[n] = if better { piece.number } else { self.number[n] };
            self.position[n] = if better { position } else { self.position[n] };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance of a position from a piece.
    fn distance([a, b]: &[[f64; 2]; 2], p: [f64; 2]) -> f64 {
        let (step, off) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let long = step[0] * step[0] + step[1] * step[1];
        let along =
            if long > 0.0 { ((off[0] * step[0] + off[1] * step[1]) / long).clamp(0.0, 1.0) } else { 0.0 };
        let miss = [off[0] - along * step[0], off[1] - along * step[1]];
        (miss[0] * miss[0] + miss[1] * miss[1]).sqrt()
    }

    #[test]
    fn distances_are_to_the_piece_and_not_to_its_line() {
        let ends = [[0.0, 0.0], [4.0, 0.0]];
        let far = |p| distance(&ends, p);
        assert_eq!([far([1.0, 2.0]), far([-3.0, 4.0]), far([5.0, 0.0])], [2.0, 5.0, 1.0]);
        assert_eq!(distance(&[[1.0; 2]; 2], [1.0, 2.0]), 1.0);
    }

    #[test]
    fn the_nearest_piece_is_the_nearest_of_all_for_each_sample() {
        let mut state = 3_u32;
        let mut draw = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) * 8.0
        };
        let pieces: Vec<CurvePiece> = (0..20)
            .map(|number| {
                let ends = [[draw(), draw()], [draw(), draw()]];
                CurvePiece { number, point: number, part: [0, 1], ends }
            })
            .collect();
        let (mut x, mut y) = ([0.0; CELL], [0.0; CELL]);
        (0..CELL).for_each(|n| (x[n], y[n]) = (draw() as f32, draw() as f32));
        let mut best = NearestCurve::new().best;
        (best.x, best.y, best.square) = (x, y, [1.0; CELL]);
        (0..).zip(&pieces).for_each(|(position, piece)| best.take([0.0; 2], (position, piece)));
        for n in 0..CELL {
            let at = [x[n], y[n]].map(f64::from);
            let least = pieces.iter().map(|p| distance(&p.ends, at)).fold(1.0, f64::min);
            assert!((f64::from(best.square[n]).sqrt() - least).abs() < 1e-5);
            let Some(piece) = pieces.get(best.position[n] as usize) else {
                assert_eq!(least, 1.0);
                continue;
            };
            let fraction = f64::from(best.along[n]);
            let [a, b] = piece.ends;
            let point = [0, 1].map(|k| a[k] + fraction * (b[k] - a[k]));
            assert!(((point[0] - at[0]).hypot(point[1] - at[1]) - least).abs() < 1e-5);
        }
    }
}
