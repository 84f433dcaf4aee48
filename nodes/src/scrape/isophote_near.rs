//! Which curve is nearest to each sample of a stretch.

use super::isophote_index::{IsophoteIndex, Piece};
use super::voices::{CELL, Cell};

/// Pieces of curves that are compared at once.
const MOST: usize = 512;
/// A place without a curve within reach.
const NONE: u32 = u32::MAX;

/// The nearest point of all curves for each sample of a stretch, and the place of the sample.
///
/// # Complexity
/// The distances of all samples from a piece of a curve are found together; a piece that is further from the middle of the samples
/// than another by more than they are apart is passed over.
#[derive(Clone, Debug)]
pub(super) struct Near {
    /// What the places are counted from, px.
    origin: [f64; 2],
    range: [usize; 2],
    x: Cell,
    y: Cell,
    /// What steps along the axes count on the image.
    steps: [[f64; 2]; CELL],
    /// Pieces that may be the nearest, with their distance from the middle.
    pieces: Vec<(f64, Piece)>,
    best: Best,
    /// Gradient of the curve at the nearest point, as the sample meets it.
    gradients: [[f64; 2]; CELL],
    /// Square of its distance, px, where there is one within reach.
    found: [Option<f32>; CELL],
}

/// The nearest point of what has been compared, for all samples; only those of the range mean something.
#[derive(Clone, Debug)]
struct Best {
    /// Square of its distance, px.
    square: Cell,
    /// Where on the piece it lies, 0 to 1.
    along: Cell,
    /// The number of the piece, and its place in the list.
    number: [u32; CELL],
    place: [u32; CELL],
}

impl Near {
    /// Without any sample.
    pub fn new() -> Self {
        let zero = [0.0; CELL];
        Self {
            origin: [0.0; 2],
            range: [0; 2],
            x: zero,
            y: zero,
            steps: [[0.0; 2]; CELL],
            pieces: Vec::with_capacity(MOST),
            best: Best { square: zero, along: zero, number: [NONE; CELL], place: [NONE; CELL] },
            gradients: [[0.0; 2]; CELL],
            found: [None; CELL],
        }
    }

    /// Forgets what was found.
    pub fn clear(&mut self) {
        self.found = [None; CELL];
    }

    /// Takes the places of the samples `[from, to)` on the image, and what steps count there.
    #[inline(always)]
    pub fn place(
        &mut self,
        origin: [f64; 2],
        [from, to]: [usize; 2],
        on_image: impl Fn(usize) -> ([f64; 2], [f64; 2]),
    ) {
        (self.origin, self.range) = (origin, [from, to]);
        for n in from..to.min(CELL) {
            let (place, steps) = on_image(n);
            (self.x[n], self.y[n]) = ((place[0] - origin[0]) as f32, (place[1] - origin[1]) as f32);
            self.steps[n] = steps;
        }
    }

    /// Finds what is nearest within `reach`, of all that touches a box around the samples and their reach.
    #[inline(always)]
    pub fn find(&mut self, index: &IsophoteIndex, [low, high]: [[f64; 2]; 2], reach: f64) {
        let range = self.range[0]..self.range[1].min(CELL);
        self.best.square[range].fill((reach * reach) as f32);
        (self.best.number, self.best.place) = ([NONE; CELL], [NONE; CELL]);
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        let half = (0.5 * (high[0] - low[0]) - reach).hypot(0.5 * (high[1] - low[1]) - reach);
        let mut nearest = f64::INFINITY;
        self.pieces.clear();
        index.near(
            low,
            high,
            #[inline(always)]
            |piece| {
                if self.pieces.len() == MOST {
                    self.compare(index, f64::INFINITY);
                }
                let far = distance(&piece.ends, middle);
                nearest = nearest.min(far);
                self.pieces.push((far, piece));
            },
        );
        // What is further from the middle than the nearest by a whole box is nowhere the nearest.
        self.compare(index, nearest + 2.0 * half);
    }

    /// Compares all pieces of the list that are no further from the middle than `reach`, and begins another.
    #[inline(always)]
    fn compare(&mut self, index: &IsophoteIndex, reach: f64) {
        let Self { origin, x, y, pieces, best, .. } = self;
        for (place, (_, piece)) in (0..).zip(&*pieces).filter(|(_, (far, _))| *far <= reach) {
            best.take(*origin, (place, piece), x, y);
        }
        for n in self.range[0]..self.range[1].min(CELL) {
            if let Some((_, piece)) = self.pieces.get(self.best.place[n] as usize) {
                let [gx, gy] = index.gradient(piece, f64::from(self.best.along[n]));
                let [sx, sy] = self.steps[n];
                (self.gradients[n], self.found[n]) = ([gx * sx, gy * sy], Some(self.best.square[n]));
            }
        }
        self.best.place = [NONE; CELL];
        self.pieces.clear();
    }

    /// Square of the distance of sample `n` from the nearest curve in px, and the gradient there as the sample meets it.
    #[inline(always)]
    pub fn at(&self, n: usize) -> Option<(f64, [f64; 2])> {
        let square = self.found.get(n).copied().flatten()?;
        Some((f64::from(square), *self.gradients.get(n)?))
    }
}

impl Best {
    /// Compares the distances of all samples from one more piece; of equal ones the piece of lower number counts.
    #[inline(always)]
    fn take(&mut self, origin: [f64; 2], (place, piece): (u32, &Piece), x: &Cell, y: &Cell) {
        let [a, b] = piece.ends.map(|p| [(p[0] - origin[0]) as f32, (p[1] - origin[1]) as f32]);
        let step = [b[0] - a[0], b[1] - a[1]];
        let long = step[0] * step[0] + step[1] * step[1];
        let part = if long > 0.0 { 1.0 / long } else { 0.0 };
        for n in 0..CELL {
            let off = [x[n] - a[0], y[n] - a[1]];
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
            self.place[n] = if better { place } else { self.place[n] };
        }
    }
}

/// Distance of a place from a piece.
#[inline(always)]
fn distance([a, b]: &[[f64; 2]; 2], p: [f64; 2]) -> f64 {
    let (step, off) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let long = step[0] * step[0] + step[1] * step[1];
    let along = if long > 0.0 { ((off[0] * step[0] + off[1] * step[1]) / long).clamp(0.0, 1.0) } else { 0.0 };
    let miss = [off[0] - along * step[0], off[1] - along * step[1]];
    (miss[0] * miss[0] + miss[1] * miss[1]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let pieces: Vec<Piece> = (0..20)
            .map(|number| {
                let ends = [[draw(), draw()], [draw(), draw()]];
                Piece { number, point: number, part: [0, 1], ends }
            })
            .collect();
        let (mut x, mut y) = ([0.0; CELL], [0.0; CELL]);
        (0..CELL).for_each(|n| (x[n], y[n]) = (draw() as f32, draw() as f32));
        let mut best = Near::new().best;
        best.square = [1.0; CELL];
        (0..).zip(&pieces).for_each(|(place, piece)| best.take([0.0; 2], (place, piece), &x, &y));
        for n in 0..CELL {
            let at = [x[n], y[n]].map(f64::from);
            let least = pieces.iter().map(|p| distance(&p.ends, at)).fold(1.0, f64::min);
            assert!((f64::from(best.square[n]).sqrt() - least).abs() < 1e-5);
            let Some(piece) = pieces.get(best.place[n] as usize) else {
                assert_eq!(least, 1.0);
                continue;
            };
            let way = f64::from(best.along[n]);
            let [a, b] = piece.ends;
            let point = [0, 1].map(|k| a[k] + way * (b[k] - a[k]));
            assert!(((point[0] - at[0]).hypot(point[1] - at[1]) - least).abs() < 1e-5);
        }
    }
}
