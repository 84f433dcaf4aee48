//! Spatial index of isophotes for queries by moving contacts.

use super::curve_piece::{CurvePiece, Entry, LinearGradient};
use super::end_points::{EndPoints, LANES, LINE, Line, Strip};
use crate::texture::{Isophotes, Wrap};
use std::ops::Range;

/// Maximum side of a grid cell, and maximum length of a piece, px.
const CELL: f64 = 4.0;
/// Extension of curves beyond the border of an image that is not repeated, px.
const MARGIN: f64 = 1.0;

/// A uniform grid over isophotes, whose cells list the pieces of curves in them.
///
/// # Complexity
/// O(pieces) to make. A question looks at the cells of its box, with a few pieces each, whatever the size of the image.
#[derive(Clone, Debug)]
pub struct IsophoteIndex {
    wrap: Wrap,
    torus: bool,
    /// Columns and rows of the image.
    size: [f64; 2],
    /// Cells along each axis, and their sides.
    cells: [usize; 2],
    side: [f64; 2],
    /// First entry of each cell, and the end.
    starts: Vec<u32>,
    entries: Vec<Entry>,
    ends: EndPoints,
    gradients: Vec<[f32; 2]>,
}

/// Position on the image of a position on the endless surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Its start and end, relative to the position before the first pixel.
    start: f64,
    end: f64,
    base: f64,
    /// 1, or -1 where the image is mirrored.
    sign: f64,
}

impl IsophoteIndex {
    /// Sorts the pieces of all curves into cells.
    #[must_use]
    pub fn new(all: &Isophotes) -> Self {
        let torus = all.is_torus();
        let size = [all.width, all.height].map(|n| n.max(1) as f64);
        let extent = size.map(|n| if torus { n } else { n + 2.0 * MARGIN });
        let cells = extent.map(|n| (n / CELL).ceil().max(1.0) as usize);
        let side = [0, 1].map(|k| extent[k] / cells[k] as f64);
        let mut index = Self {
            wrap: all.surface.wrap,
            torus,
            size,
            cells,
            side,
            starts: vec![0; cells[0] * cells[1] + 1],
            entries: Vec::new(),
            ends: EndPoints::default(),
            gradients: all.gradients.clone(),
        };
        // Counted, then sorted in.
        let mut counts = vec![0_u32; cells[0] * cells[1]];
        index.each_entry(all, |cell, _| counts[cell] += 1);
        let mut sum = 0;
        for (start, count) in index.starts.iter_mut().zip(counts.iter().chain([&0])) {
            *start = sum;
            sum += count;
        }
        let mut next = index.starts.clone();
        let blank = Entry { number: 0, point: 0, part: [0, 1], ends: [[0.0; 2]; 2], again: [false; 2] };
        let mut entries = vec![blank; sum as usize];
        index.each_entry(all, |cell, entry| {
            entries[next[cell] as usize] = entry;
            next[cell] += 1;
        });
        index.ends = EndPoints::new(entries.iter().map(|entry| entry.ends));
        index.entries = entries;
        index
    }

    /// Every piece in every cell that its box touches, in order.
    fn each_entry(&self, all: &Isophotes, mut take: impl FnMut(usize, Entry)) {
        let (mut number, mut point) = (0, 0_u32);
        // Pieces of a torus stay short against it, so that none meets itself.
        let longest = if self.torus { CELL.min(self.size[0] / 4.0).min(self.size[1] / 4.0) } else { CELL };
        for (_, points, _) in all.iter() {
            for (pair, point) in points.windows(2).zip(point..) {
                let [a, b] = [pair[0], pair[1]].map(|p| p.map(f64::from));
                let parts = ((b[0] - a[0]).hypot(b[1] - a[1]) / longest).ceil().clamp(1.0, 65_535.0);
                let at = |part: f64| [0, 1].map(|k| a[k] + (b[k] - a[k]) * (part / parts));
                for part in 0..parts as u16 {
                    let end = if part + 1 == parts as u16 { b } else { at(f64::from(part) + 1.0) };
                    let part = [part, parts as u16];
                    let start = if part[0] == 0 { a } else { at(part[0].into()) };
                    self.spread([start, end], |cell, ends, again| {
                        take(cell, Entry { number, point, part, ends, again });
                    });
                    number += 1;
                }
            }
            point += points.len() as u32;
        }
    }

    /// The cells that the box of a piece touches, with the piece as it lies in each.
    fn spread(&self, ends: [[f64; 2]; 2], mut take: impl FnMut(usize, [[f32; 2]; 2], [bool; 2])) {
        let span = |k: usize| {
            let (low, high) = (ends[0][k].min(ends[1][k]), ends[0][k].max(ends[1][k]));
            [self.cell(k, low), self.cell(k, high)]
        };
        let ([left, right], [top, bottom]) = (span(0), span(1));
        // Beyond an image that is not repeated there are no cells.
        let first = |least: i64| if self.torus { least } else { least.max(0) };
        for (x, y) in (top..=bottom).flat_map(|y| (left..=right).map(move |x| (x, y))) {
            if let Some((cell, shift)) = self.wrapped([x, y]) {
                let ends = ends.map(|p| [0, 1].map(|k| (p[k] - shift[k]) as f32));
                take(cell, ends, [x > first(left), y > first(top)]);
            }
        }
    }

    /// Column or row of the endless grid in which a coordinate lies.
    #[inline(always)]
    fn cell(&self, axis: usize, x: f64) -> i64 {
        let origin = if self.torus { 0.0 } else { MARGIN };
        ((x + origin) / self.side[axis]).floor() as i64
    }

    /// The number of a cell of the endless grid, and its offset from the cell of the image; `None` beyond an image that
    /// is not repeated.
    #[inline(always)]
    fn wrapped(&self, at: [i64; 2]) -> Option<(usize, [f64; 2])> {
        let n = self.cells.map(|n| n as i64);
        let turn = [0, 1].map(|k| at[k].div_euclid(n[k]));
        if !self.torus && turn != [0, 0] {
            return None;
        }
        let inside = [0, 1].map(|k| at[k] - turn[k] * n[k]);
        Some(((inside[1] * n[0] + inside[0]) as usize, [0, 1].map(|k| turn[k] as f64 * self.size[k])))
    }

    /// The tile around a position.
    #[inline(always)]
    #[must_use]
    pub fn tile(&self, position: [f64; 2]) -> [Tile; 2] {
        [0, 1].map(|k| {
            let (x, n) = (position[k] + self.before(), self.size[k]);
            if self.wrap == Wrap::Clamp {
                return Tile { start: f64::NEG_INFINITY, end: f64::INFINITY, base: 0.0, sign: 1.0 };
            }
            let number = (x / n).floor();
            // A quotient may be rounded up to the next whole number.
            let number = if x < number * n { number - 1.0 } else { number };
            let [start, end] = [number * n, (number + 1.0) * n];
            if self.wrap == Wrap::Mirror && number.rem_euclid(2.0) == 1.0 {
                Tile { start, end, base: (number + 1.0) * n - 1.0, sign: -1.0 }
            } else {
                Tile { start, end, base: number * n, sign: 1.0 }
            }
        })
    }

    /// Position before the first pixel on its tile: mirrors are half a pixel beyond the first and the last pixel.
    #[inline(always)]
    fn before(&self) -> f64 {
        if self.wrap == Wrap::Mirror { 0.5 } else { 0.0 }
    }

    /// Returns true if a tile is that around a position.
    #[inline(always)]
    #[must_use]
    pub fn holds(&self, tile: &[Tile; 2], position: [f64; 2]) -> bool {
        (0..2).all(|k| (tile[k].start..tile[k].end).contains(&(position[k] + self.before())))
    }

    /// A position on the image, and the sign of steps along each axis there: -1 where mirrored, 0 beyond the border.
    #[inline(always)]
    #[must_use]
    pub fn on_image(&self, tile: &[Tile; 2], position: [f64; 2]) -> ([f64; 2], [f64; 2]) {
        let mut steps = tile.map(|tile| tile.sign);
        let mut local = [0, 1].map(|k| (position[k] - tile[k].base) * tile[k].sign);
        if self.wrap == Wrap::Clamp {
            for k in 0..2 {
                let inside = local[k].clamp(-0.5, self.size[k] - 0.5);
                steps[k] = if inside == local[k] { 1.0 } else { 0.0 };
                local[k] = inside;
            }
        }
        (local, steps)
    }

    /// The positions of a line along one axis, on the image.
    #[inline(always)]
    pub(super) fn line_on_image(&self, tile: &[Tile; 2], axis: usize, line: &Line, out: &mut Line) {
        let Tile { base, sign, .. } = tile[axis];
        for (x, out) in line.iter().zip(out.iter_mut()) {
            *out = (x - base) * sign;
        }
        if self.wrap == Wrap::Clamp {
            let (low, high) = (-0.5, self.size[axis] - 0.5);
            for x in out {
                *x = if *x < low { low } else { *x };
                *x = if *x > high { high } else { *x };
            }
        }
    }

    /// Signs of steps along one axis at the positions of a line.
    #[inline(always)]
    pub(super) fn line_steps(&self, tile: &[Tile; 2], axis: usize, line: &Line) -> Line {
        let mut steps = [tile[axis].sign; LINE];
        if self.wrap == Wrap::Clamp {
            for (x, step) in line.iter().zip(&mut steps) {
                *step = if *x >= -0.5 && *x <= self.size[axis] - 0.5 { 1.0 } else { 0.0 };
            }
        }
        steps
    }

    /// Passes to `take` the entries of the cells that a box on the image touches, a row of cells at a time, with their distance from
    /// those of the image, and which of them are new: those from a number on that do not lie in the cell before, and all that do
    /// not lie in the row before where there is one.
    #[inline(always)]
    fn rows(&self, [low, high]: [[f64; 2]; 2], mut take: impl FnMut(Range<usize>, [f64; 2], usize, bool)) {
        let span = |k: usize| [self.cell(k, low[k]), self.cell(k, high[k])];
        let ([left, right], [top, bottom]) = (span(0), span(1));
        for y in top..=bottom {
            let mut x = left;
            while x <= right {
                // Up to the end of this repetition of the image.
                let turn = x.div_euclid(self.cells[0] as i64);
                let last = right.min((turn + 1) * self.cells[0] as i64 - 1);
                if let Some((cell, shift)) = self.wrapped([x, y]) {
                    let start = |k: usize| self.starts.get(k).copied().unwrap_or_default() as usize;
                    let entries = start(cell)..start(cell + (last - x) as usize + 1);
                    let fresh = if x > left { entries.start } else { start(cell + 1) };
                    take(entries, shift, fresh, y > top);
                }
                x = last + 1;
            }
        }
    }

    /// Passes to `take` the entries of a box that are near enough, each once: `far` returns the distances of sixteen
    /// entries from a number on, with the repetition of the image in which they lie.
    #[inline(always)]
    fn select(
        &self,
        bounds: [[f64; 2]; 2],
        limit: f32,
        far: impl Fn(usize, [f64; 2]) -> [f32; LANES],
        mut take: impl FnMut(CurvePiece),
    ) {
        self.rows(
            bounds,
            #[inline(always)]
            |entries, shift, fresh, below| {
                for k in entries.clone().step_by(LANES) {
                    let far = far(k, shift);
                    if !far.iter().fold(false, |any, far| any | (*far <= limit)) {
                        continue;
                    }
                    for (k, far) in (k..entries.end).zip(far) {
                        if far > limit {
                            continue;
                        }
                        let Some(entry) = self.entries.get(k) else { continue };
                        let again = (entry.again[0] && k >= fresh) || (entry.again[1] && below);
                        if !again {
                            take(entry.piece(shift));
                        }
                    }
                }
            },
        );
    }

    /// Passes to `take` each piece that may touch a box on the image.
    #[inline(always)]
    pub fn near(&self, low: [f64; 2], high: [f64; 2], mut take: impl FnMut(CurvePiece)) {
        self.select(
            [low, high],
            0.0,
            |_, _| [0.0; LANES],
            |piece| {
                let [a, b] = piece.ends;
                let apart = (0..2).any(|k| a[k].max(b[k]) < low[k] || a[k].min(b[k]) > high[k]);
                if !apart {
                    take(piece);
                }
            },
        );
    }

    /// Passes to `take` each piece that may touch a strip inside a box on the image.
    #[inline(always)]
    pub fn beside(&self, bounds: [[f64; 2]; 2], strip: &Strip, take: impl FnMut(CurvePiece)) {
        // Places are rounded to single precision.
        let slack = self.slack(strip.middle);
        self.select(
            bounds,
            slack,
            #[inline(always)]
            |k, shift| self.ends.apart(k, less(strip.middle, shift), strip),
            take,
        );
    }

    /// Passes to `take` each piece in a box that is nearer to a position than `most`, and not further than the nearest by more than
    /// `wide`, about.
    #[inline(always)]
    pub fn around(
        &self,
        bounds: [[f64; 2]; 2],
        position: [f64; 2],
        [most, wide]: [f64; 2],
        take: impl FnMut(CurvePiece),
    ) {
        let mut nearest = [f32::INFINITY; LANES];
        self.rows(
            bounds,
            #[inline(always)]
            |entries, shift, _, _| {
                let position = less(position, shift);
                // Entries of the next row of cells do no harm: they are no nearer than they are.
                for k in entries.step_by(LANES) {
                    let squares = self.ends.squares(k, position);
                    for l in 0..LANES {
                        nearest[l] = if squares[l] < nearest[l] { squares[l] } else { nearest[l] };
                    }
                }
            },
        );
        let nearest = nearest.iter().fold(f32::INFINITY, |a, b| if *b < a { *b } else { a });
        let slack = f64::from(self.slack(position));
        let limit = most.min(f64::from(nearest).sqrt() + wide) + slack;
        self.select(
            bounds,
            (limit * limit) as f32,
            #[inline(always)]
            |k, shift| self.ends.squares(k, less(position, shift)),
            take,
        );
    }

    /// Maximum error of distances from a position in single precision, px.
    #[inline(always)]
    fn slack(&self, position: [f64; 2]) -> f32 {
        let far = self.size[0] + self.size[1] + position[0].abs() + position[1].abs();
        (1e-4 + 4.0 * f64::from(f32::EPSILON) * far) as f32
    }

    /// The gradient on a piece, `along` from 0 to 1 of its length.
    #[inline(always)]
    #[must_use]
    pub fn gradient(&self, piece: &CurvePiece, along: f64) -> [f64; 2] {
        self.slopes(piece).at(along)
    }

    /// Gradient along a piece.
    #[inline(always)]
    pub(super) fn slopes(&self, piece: &CurvePiece) -> LinearGradient {
        let k = piece.point as usize;
        let at = |k: usize| {
            let [x, y] = self.gradients.get(k).copied().unwrap_or_default();
            [f64::from(x), f64::from(y)]
        };
        let ([ax, ay], [bx, by]) = (at(k), at(k + 1));
        let [part, parts] = [f64::from(piece.part[0]), f64::from(piece.part[1])];
        LinearGradient { start: [ax, ay], step: [bx - ax, by - ay], part, parts }
    }
}

/// Converts a position in a repetition of the image to one on the image.
#[inline(always)]
fn less(position: [f64; 2], shift: [f64; 2]) -> [f32; 2] {
    [(position[0] - shift[0]) as f32, (position[1] - shift[1]) as f32]
}

#[cfg(test)]
mod tests;
