//! Marching squares: contour lines of a grid of numbers.
//!
//! The grid is divided into strips, which are marched in parallel, two rows at a time. Each sample becomes one bit for each level, so
//! that cells without a line are passed 64 at a time. Then the segments of each level are joined by the numbers of their vertices. The
//! division does not change the result: vertices are numbered in the order of the cells.

mod bits;

use bits::{RowBits, WORD, corners};
use fearless_simd::Level;
use rayon::prelude::*;

/// Rows of cells in a strip.
const STRIP: usize = 64;
/// Maximum number of levels.
pub const MAX_LEVELS: usize = 250;
/// No vertex.
const NONE: u32 = u32::MAX;
/// Flag of a vertex of the strip above; the lower bits are its column.
const ABOVE: u32 = 1 << 31;

/// Corners that are connected in a cell with two opposite high corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saddle {
    /// As on the bilinear surface through the corners: lines of different levels never cross.
    Decider,
    /// The low corners.
    Low,
    /// The high corners.
    High,
}

/// Numbers on a grid, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// Columns.
    pub width: usize,
    /// `width` numbers in each row; one that is not finite is missing.
    pub samples: &'a [f32],
    /// True if the grid is periodic; ignored below 3 by 3 samples.
    pub torus: bool,
}

/// One contour line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Index of its first point.
    pub from: usize,
    /// Index after its last point.
    pub to: usize,
    /// True for a closed line, whose last point equals the first (on a torus up to whole periods).
    pub closed: bool,
}

/// All contour lines of one level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Points of all lines, x and y, with samples at integers.
    pub points: Vec<[f64; 2]>,
    /// The lines, open lines first.
    pub lines: Vec<Line>,
}

impl Field<'_> {
    fn height(&self) -> usize {
        self.samples.len() / self.width.max(1)
    }

    fn is_torus(&self) -> bool {
        self.torus && self.width >= 3 && self.height() >= 3
    }

    /// Columns and rows of cells.
    fn cells(&self) -> [usize; 2] {
        let open = usize::from(!self.is_torus());
        [self.width.saturating_sub(open), self.height().saturating_sub(open)]
    }

    fn row(&self, y: usize) -> &[f32] {
        let start = y % self.height().max(1) * self.width;
        self.samples.get(start..start + self.width).unwrap_or_default()
    }
}

/// Edges of a cell: top, right, bottom, left.
const T: u8 = 0;
const R: u8 = 1;
const B: u8 = 2;
const L: u8 = 3;

/// Edges at which the line of a cell enters and leaves, by its high corners: 1 top left, 2 top right, 4 bottom right, 8 bottom left.
/// The high side is on the left of the line, with y pointing down. Cells without one line have none here.
const LINE: [[u8; 2]; 16] = [
    [T, T],
    [L, T],
    [T, R],
    [L, R],
    [R, B],
    [T, T],
    [T, B],
    [L, B],
    [B, L],
    [B, T],
    [T, T],
    [B, R],
    [R, L],
    [R, T],
    [T, L],
    [T, T],
];

/// Edges at which the two lines of a cell with two opposite high corners enter and leave.
fn two_lines(case: usize, joins_high: bool) -> [[u8; 2]; 2] {
    match (case, joins_high) {
        (5, true) => [[R, T], [L, B]],
        (5, false) => [[L, T], [R, B]],
        (_, true) => [[T, L], [B, R]],
        (_, false) => [[T, R], [B, L]],
    }
}

/// Returns true if the two high corners are connected; `corners` are top left, top right, bottom right, bottom left.
fn joins_high(saddle: Saddle, corners: [f64; 4], level: f64) -> bool {
    let [a, b, c, d] = corners;
    match saddle {
        Saddle::Low => false,
        Saddle::High => true,
        // The height of the bilinear surface at its saddle point.
        Saddle::Decider => (a * c - b * d) / (a + c - b - d) > level,
    }
}

/// A row of cells.
struct CellRow<'a> {
    y: usize,
    /// Row of the samples at the bottom.
    below: usize,
    /// Samples at the top and at the bottom.
    samples: [&'a [f32]; 2],
    /// One bit for each cell without a missing corner.
    whole: &'a [u64],
    /// The same of the row of cells above, with no bit at a border.
    whole_above: &'a [u64],
    /// True if the row above is in another strip.
    first: bool,
    saddle: Saddle,
}

/// Segments of one level in one strip.
struct Part {
    level: f64,
    points: Vec<[f64; 2]>,
    /// First and last vertex of each segment.
    links: Vec<[u32; 2]>,
    /// For each column of cells, the vertex of the last crossed horizontal edge.
    horizontal: Vec<u32>,
    /// Column and vertex of the last crossed vertical edge of the row.
    vertical: (usize, u32),
    /// Vertex of the crossed vertical edge in column 0 of the row.
    seam: u32,
}

impl Part {
    fn new(level: f32, columns: usize) -> Self {
        Self {
            level: level.into(),
            points: Vec::new(),
            links: Vec::new(),
            horizontal: vec![NONE; columns],
            vertical: (usize::MAX, NONE),
            seam: NONE,
        }
    }

    /// Fraction of the distance between two samples at which the level is crossed.
    fn fraction(&self, a: f64, b: f64) -> f64 {
        (self.level - a) / (b - a)
    }

    /// Adds the segments of a row of cells; `upper` and `lower` are the bits of its samples.
    fn march(&mut self, row: &CellRow<'_>, upper: &[u64], lower: &[u64]) {
        (self.vertical, self.seam) = ((usize::MAX, NONE), NONE);
        for (word, (whole, above)) in row.whole.iter().zip(row.whole_above).enumerate() {
            let [a, b, c, d] = corners(upper, lower, word);
            let mut crossed = ((a | b | c | d) & !(a & b & c & d)) & whole;
            if crossed == 0 {
                continue;
            }
            // Space for all vertices and segments, so that the cells need no branches.
            let cells = crossed.count_ones() as usize;
            let mut counts = [self.points.len(), self.links.len()];
            self.points.resize(counts[0] + 4 * cells, [0.0; 2]);
            self.links.resize(counts[1] + 2 * cells, [NONE; 2]);
            while crossed != 0 {
                let bit = crossed.trailing_zeros();
                crossed &= crossed - 1;
                let case =
                    [a, b, c, d].iter().rev().fold(0, |case, bits| case << 1 | (bits >> bit & 1) as usize);
                self.cross(row, word * WORD + bit as usize, case, above >> bit & 1 == 1, &mut counts);
            }
            self.points.truncate(counts[0]);
            self.links.truncate(counts[1]);
        }
    }

    /// Adds the segments of the cell in column `x`, after the vertices and segments that `counts` counts.
    ///
    /// Vertices on the right and at the bottom are new, others only without a cell beyond their edge.
    #[inline(always)]
    fn cross(
        &mut self,
        row: &CellRow<'_>,
        x: usize,
        case: usize,
        above: bool,
        [points, links]: &mut [usize; 2],
    ) {
        let [upper, lower] = row.samples;
        let right = if x + 1 == upper.len() { 0 } else { x + 1 };
        let corners @ [a, b, c, d] = [upper[x], upper[right], lower[right], lower[x]].map(f64::from);
        let (left, y) = (x as f64, row.y as f64);
        // Bits of the edges between corners that differ.
        let edges = case ^ (case >> 1 | (case & 1) << 3);
        let crossed = |edge: u8| edges >> edge & 1;
        let mut on = [NONE; 4];
        on[usize::from(T)] = if row.first { ABOVE | x as u32 } else { self.horizontal[x] };
        if crossed(T) == 1 && !above {
            on[usize::from(T)] = *points as u32;
            self.points[*points] = [left + self.fraction(a, b), y];
            *points += 1;
        }
        on[usize::from(L)] = self.vertical.1;
        if crossed(L) == 1 && self.vertical.0 != x {
            on[usize::from(L)] = *points as u32;
            self.points[*points] = [left, y + self.fraction(a, d)];
            self.seam = if x == 0 { *points as u32 } else { self.seam };
            *points += 1;
        }
        if right == 0 && self.seam != NONE {
            on[usize::from(R)] = self.seam;
        } else {
            on[usize::from(R)] = *points as u32;
            self.points[*points] = [right as f64, y + self.fraction(b, c)];
            *points += crossed(R);
        }
        on[usize::from(B)] = *points as u32;
        self.points[*points] = [left + self.fraction(d, c), row.below as f64];
        *points += crossed(B);
        self.vertical = (x + 1, on[usize::from(R)]);
        self.horizontal[x] = on[usize::from(B)];
        let link = |[from, to]: [u8; 2]| [on[usize::from(from)], on[usize::from(to)]];
        if case == 5 || case == 10 {
            let lines = two_lines(case, joins_high(row.saddle, corners, self.level));
            self.links[*links..*links + 2].copy_from_slice(&lines.map(link));
            *links += 2;
        } else {
            self.links[*links] = link(LINE[case]);
            *links += 1;
        }
    }
}

/// Sets the bits of the cells between two rows of samples that have no missing corner.
fn set_whole(columns: usize, upper: &RowBits, lower: &RowBits, whole: &mut [u64]) {
    for (word, bits) in whole.iter_mut().enumerate() {
        let [a, b, c, d] = corners(&upper.missing, &lower.missing, word);
        let rest = columns - word * WORD;
        let inside = if rest < WORD { (1 << rest) - 1 } else { u64::MAX };
        *bits = !(a | b | c | d) & inside;
    }
}

/// Marches the rows `[from, to)` of cells.
fn march_strip(field: &Field<'_>, levels: &[f32], saddle: Saddle, [from, to]: [usize; 2]) -> Vec<Part> {
    let (simd, [columns, _]) = (Level::new(), field.cells());
    let mut parts: Vec<Part> = levels.iter().map(|level| Part::new(*level, columns)).collect();
    let [mut upper, mut lower] = [(); 2].map(|()| RowBits::new(field.width, levels.len()));
    let [mut whole, mut whole_above] = [(); 2].map(|()| vec![0; columns.div_ceil(WORD)]);
    upper.read(simd, field.row(from), levels);
    if from > 0 || field.is_torus() {
        lower.read(simd, field.row(from + field.height() - 1), levels);
        set_whole(columns, &lower, &upper, &mut whole_above);
    }
    for y in from..to {
        let below = if y + 1 == field.height() { 0 } else { y + 1 };
        let samples = [field.row(y), field.row(below)];
        lower.read(simd, samples[1], levels);
        set_whole(columns, &upper, &lower, &mut whole);
        let row =
            CellRow { y, below, samples, whole: &whole, whole_above: &whole_above, first: y == from, saddle };
        for (part, (upper, lower)) in parts.iter_mut().zip(upper.high.iter().zip(&lower.high)) {
            part.march(&row, upper, lower);
        }
        std::mem::swap(&mut upper, &mut lower);
        std::mem::swap(&mut whole, &mut whole_above);
    }
    parts
}

/// Vertices of one level by their numbers over all strips.
struct Vertices<'a> {
    parts: &'a [Part],
    /// Number of the first vertex of each strip.
    starts: &'a [u32],
    /// Points of the strip of the last vertex, and the number of the first one.
    last: (&'a [[f64; 2]], u32),
}

impl<'a> Vertices<'a> {
    fn new(parts: &'a [Part], starts: &'a [u32]) -> Self {
        Self { parts, starts, last: (&[], 0) }
    }

    /// Returns a vertex. A vertex in the strip of the one before is found at once.
    #[inline]
    fn get(&mut self, vertex: u32) -> [f64; 2] {
        let (points, start) = self.last;
        match points.get(vertex.wrapping_sub(start) as usize) {
            Some(point) => *point,
            None => self.find(vertex),
        }
    }

    #[inline(never)]
    fn find(&mut self, vertex: u32) -> [f64; 2] {
        let k = self.starts.partition_point(|start| *start <= vertex) - 1;
        self.last = (&self.parts[k].points, self.starts[k]);
        self.last.0[(vertex - self.starts[k]) as usize]
    }
}

/// Joins the strips of one level. Returns the number of the first vertex of each strip, the next vertex of each vertex, and true for
/// each that has a previous one.
fn join(parts: &mut [Part]) -> (Vec<u32>, Vec<u32>, Vec<bool>) {
    let count = parts.iter().map(|part| part.points.len()).sum();
    let (mut next, mut has_previous) = (vec![NONE; count], vec![false; count]);
    let starts: Vec<u32> = parts
        .iter()
        .scan(0, |start, part| Some(std::mem::replace(start, *start + part.points.len() as u32)))
        .collect();
    for k in 0..parts.len() {
        let links = std::mem::take(&mut parts[k].links);
        // On a torus the strip above the first is the last.
        let above = if k == 0 { parts.len() - 1 } else { k - 1 };
        let number = |vertex: u32| match vertex & ABOVE {
            0 => vertex + starts[k],
            _ => parts[above].horizontal[(vertex ^ ABOVE) as usize] + starts[above],
        };
        for [from, to] in links.iter().map(|link| link.map(number)) {
            next[from as usize] = to;
            has_previous[to as usize] = true;
        }
    }
    (starts, next, has_previous)
}

/// Traces the lines of one level from vertex to vertex; `period` is the size of a torus.
fn trace(
    mut vertices: Vertices<'_>,
    next: &mut [u32],
    has_previous: &[bool],
    period: Option<[f64; 2]>,
) -> Lines {
    let mut out = Lines { points: Vec::with_capacity(next.len() + 64), lines: Vec::new() };
    for closed in [false, true] {
        for start in 0..next.len() {
            if next[start] == NONE || (!closed && has_previous[start]) {
                continue;
            }
            let from = out.points.len();
            let mut vertex = start as u32;
            let (mut previous, mut offset) = (vertices.get(vertex), [0.0; 2]);
            loop {
                let stored = vertices.get(vertex);
                for (axis, offset) in offset.iter_mut().enumerate() {
                    let Some(period) = period else { break };
                    let step = stored[axis] - previous[axis];
                    // A segment is at most one cell long, and a period has at least three cells.
                    *offset -= f64::from(step > 0.5 * period[axis]) * period[axis];
                    *offset += f64::from(step < -0.5 * period[axis]) * period[axis];
                }
                previous = stored;
                let point = [stored[0] + offset[0], stored[1] + offset[1]];
                // A sample exactly on the level yields the same point on several edges.
                if out.points[from..].last() != Some(&point) {
                    out.points.push(point);
                }
                match std::mem::replace(&mut next[vertex as usize], NONE) {
                    NONE => break,
                    to => vertex = to,
                }
            }
            if out.points.len() > from + 1 {
                out.lines.push(Line { from, to: out.points.len(), closed });
            } else {
                out.points.truncate(from);
            }
        }
    }
    out
}

/// Computes the contour lines of each level, with the high side on their left if y points down.
///
/// A sample is high if it is strictly above the level. Cells with a corner that is not finite are skipped. A line is closed, or ends
/// at the border or at such a cell. On a torus, points continue beyond its size. Levels must be in rising order, at most 250 of them;
/// otherwise there are no lines.
///
/// # Complexity
/// O(samples x levels) comparisons, and O(width) memory per strip of 64 rows in addition to the output. Strips and levels run in
/// parallel.
///
/// # Source
/// Lorensen and Cline, "Marching cubes" (SIGGRAPH 1987), in two dimensions; Nielson and Hamann, "The asymptotic decider" (Visualization
/// 1991).
#[must_use]
pub fn contours(field: &Field<'_>, levels: &[f32], saddle: Saddle) -> Vec<Lines> {
    contours_by(field, levels, saddle, STRIP)
}

/// As [`contours`], with strips of `strip` rows.
fn contours_by(field: &Field<'_>, levels: &[f32], saddle: Saddle, strip: usize) -> Vec<Lines> {
    let [columns, rows] = field.cells();
    let sorted = levels.is_sorted_by(|a, b| a < b) && levels.len() <= MAX_LEVELS;
    if columns == 0 || rows == 0 || !sorted {
        return vec![Lines::default(); levels.len()];
    }
    let starts: Vec<usize> = (0..rows).step_by(strip.max(1)).collect();
    let march = |from: &usize| march_strip(field, levels, saddle, [*from, (from + strip.max(1)).min(rows)]);
    let strips: Vec<Vec<Part>> = starts.par_iter().map(march).collect();
    let period = field.is_torus().then(|| [field.width, field.height()].map(|n| n as f64));
    let mut by_level: Vec<Vec<Part>> = levels.iter().map(|_| Vec::with_capacity(strips.len())).collect();
    for strip in strips {
        by_level.iter_mut().zip(strip).for_each(|(parts, part)| parts.push(part));
    }
    by_level
        .into_par_iter()
        .map(|mut parts| {
            let (starts, mut next, has_previous) = join(&mut parts);
            trace(Vertices::new(&parts, &starts), &mut next, &has_previous, period)
        })
        .collect()
}

#[cfg(test)]
mod tests;
