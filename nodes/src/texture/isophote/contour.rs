//! Marching squares: contour lines of a grid of numbers.
//!
//! The grid is divided into strips, which are marched in parallel, two rows at a time and all levels at once. Then the segments of
//! each level are joined by the numbers of their vertices. The division does not change the result: vertices are numbered in the
//! order of the cells.

use rayon::prelude::*;

/// Rows of cells in a strip.
const STRIP: usize = 64;
/// Maximum number of levels.
pub const MAX_LEVELS: usize = 250;
/// Class of a sample that is missing.
const MISSING: u8 = 255;
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

/// Edges at which lines enter and leave a cell, by its high corners: 1 top left, 2 top right, 4 bottom right, 8 bottom left. The high
/// side is on the left of the line, with y pointing down.
fn segments(case: u8, joins_high: impl Fn() -> bool) -> &'static [[u8; 2]] {
    match case {
        1 => &[[L, T]],
        2 => &[[T, R]],
        4 => &[[R, B]],
        8 => &[[B, L]],
        14 => &[[T, L]],
        13 => &[[R, T]],
        11 => &[[B, R]],
        7 => &[[L, B]],
        3 => &[[L, R]],
        12 => &[[R, L]],
        6 => &[[T, B]],
        9 => &[[B, T]],
        5 if joins_high() => &[[R, T], [L, B]],
        5 => &[[L, T], [R, B]],
        10 if joins_high() => &[[T, L], [B, R]],
        10 => &[[T, R], [B, L]],
        _ => &[],
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

/// Segments of one level in one strip.
struct Part {
    level: f64,
    points: Vec<[f64; 2]>,
    /// First and last vertex of each segment.
    links: Vec<[u32; 2]>,
    /// For each column of cells, row and vertex of the last crossed horizontal edge.
    horizontal: Vec<(usize, u32)>,
    /// Row, column and vertex of the last crossed vertical edge.
    vertical: (usize, usize, u32),
    /// Row and vertex of the last crossed vertical edge in column 0.
    seam: (usize, u32),
}

/// A cell that a line crosses.
struct Cell {
    x: usize,
    y: usize,
    /// Top left, top right, bottom right, bottom left.
    corners: [f64; 4],
    /// True if the vertex on the top edge is in the strip above.
    above: bool,
    /// Column of the samples on the right, and row of those at the bottom.
    next: [usize; 2],
}

impl Part {
    fn new(level: f32, width: usize) -> Self {
        Self {
            level: level.into(),
            points: Vec::new(),
            links: Vec::new(),
            horizontal: vec![(usize::MAX, NONE); width],
            vertical: (usize::MAX, 0, NONE),
            seam: (usize::MAX, NONE),
        }
    }

    fn vertex(&mut self, point: [f64; 2]) -> u32 {
        self.points.push(point);
        self.points.len() as u32 - 1
    }

    /// Fraction of the distance between two samples at which the level is crossed.
    fn fraction(&self, a: f64, b: f64) -> f64 {
        (self.level - a) / (b - a)
    }

    /// The vertex on an edge of a cell, which is created unless an earlier cell has done so.
    fn on_edge(&mut self, edge: u8, cell: &Cell) -> u32 {
        let [a, b, c, d] = cell.corners;
        let (x, y) = (cell.x, cell.y);
        match edge {
            T => match self.horizontal[x] {
                (row, vertex) if row == y => vertex,
                _ if cell.above => ABOVE | x as u32,
                _ => {
                    let t = self.fraction(a, b);
                    self.vertex([x as f64 + t, y as f64])
                }
            },
            B => {
                let t = self.fraction(d, c);
                let vertex = self.vertex([x as f64 + t, cell.next[1] as f64]);
                self.horizontal[x] = (y + 1, vertex);
                vertex
            }
            L => match self.vertical {
                (row, column, vertex) if (row, column) == (y, x) => vertex,
                _ => {
                    let t = self.fraction(a, d);
                    let vertex = self.vertex([x as f64, y as f64 + t]);
                    if x == 0 {
                        self.seam = (y, vertex);
                    }
                    vertex
                }
            },
            _ => match self.seam {
                (row, vertex) if row == y && cell.next[0] == 0 => vertex,
                _ => {
                    let t = self.fraction(b, c);
                    let vertex = self.vertex([cell.next[0] as f64, y as f64 + t]);
                    self.vertical = (y, x + 1, vertex);
                    vertex
                }
            },
        }
    }

    fn cross(&mut self, case: u8, cell: &Cell, saddle: Saddle) {
        let segments = segments(case, || joins_high(saddle, cell.corners, self.level));
        // The top edge before the bottom one, whose vertex replaces it.
        let mut on = [NONE; 4];
        for edge in [T, L, R, B] {
            if segments.iter().any(|segment| segment.contains(&edge)) {
                on[usize::from(edge)] = self.on_edge(edge, cell);
            }
        }
        self.links.extend(segments.iter().map(|[from, to]| [on[usize::from(*from)], on[usize::from(*to)]]));
    }
}

/// Sets the class of each sample of a row: the number of levels below it.
fn classify(row: &[f32], levels: &[f32], classes: &mut [u8]) {
    for (x, class) in row.iter().zip(classes.iter_mut()) {
        *class = levels.iter().map(|level| u8::from(x > level)).sum();
    }
    for (x, class) in row.iter().zip(classes) {
        if !x.is_finite() {
            *class = MISSING;
        }
    }
}

/// Marches the rows `[from, to)` of cells.
fn march_strip(field: &Field<'_>, levels: &[f32], saddle: Saddle, [from, to]: [usize; 2]) -> Vec<Part> {
    let (w, [columns, _]) = (field.width, field.cells());
    let mut parts: Vec<Part> = levels.iter().map(|level| Part::new(*level, columns)).collect();
    let (mut upper, mut lower, mut over) = (vec![0; w], vec![0; w], vec![MISSING; w]);
    classify(field.row(from), levels, &mut upper);
    let outer = from > 0 || field.is_torus();
    if outer {
        classify(field.row(from + field.height() - 1), levels, &mut over);
    }
    for y in from..to {
        let (a, b) = (field.row(y), field.row(y + 1));
        classify(b, levels, &mut lower);
        for x in 0..columns {
            let right = if x + 1 == w { 0 } else { x + 1 };
            let classes = [upper[x], upper[right], lower[right], lower[x]];
            if classes == [classes[0]; 4] || classes.contains(&MISSING) {
                continue;
            }
            let cell = Cell {
                x,
                y,
                corners: [a[x], a[right], b[right], b[x]].map(f64::from),
                above: outer && y == from && over[x] != MISSING && over[right] != MISSING,
                next: [right, if y + 1 == field.height() { 0 } else { y + 1 }],
            };
            let (low, high) = classes.iter().fold((MISSING, 0), |(a, b), c| (a.min(*c), b.max(*c)));
            for (part, k) in parts[low.into()..high.into()].iter_mut().zip(low..) {
                let case = (0..4).map(|i| u8::from(classes[i] > k) << i).sum();
                part.cross(case, &cell, saddle);
            }
        }
        std::mem::swap(&mut upper, &mut lower);
    }
    parts
}

/// Joins the strips of one level, and frees each. Returns the vertices, the next vertex of each, and true for each that has a
/// previous one.
fn join(mut parts: Vec<Part>, ends: &[usize]) -> (Vec<[f64; 2]>, Vec<u32>, Vec<bool>) {
    let count = parts.iter().map(|part| part.points.len()).sum();
    let (mut points, mut next, mut has_previous) =
        (Vec::with_capacity(count), vec![NONE; count], vec![false; count]);
    // On a torus the strip above the first is the last.
    let starts: Vec<u32> = parts
        .iter()
        .scan(0, |start, part| Some(std::mem::replace(start, *start + part.points.len() as u32)))
        .collect();
    for k in 0..parts.len() {
        points.append(&mut std::mem::take(&mut parts[k].points));
        let links = std::mem::take(&mut parts[k].links);
        let above = if k == 0 { parts.len() - 1 } else { k - 1 };
        let number = |vertex: u32| match vertex & ABOVE {
            0 => vertex + starts[k],
            _ => match parts[above].horizontal[(vertex ^ ABOVE) as usize] {
                (row, found) if row == ends[above] => found + starts[above],
                _ => NONE,
            },
        };
        for [from, to] in links.iter().map(|link| link.map(number)) {
            if let Some(next) = next.get_mut(from as usize) {
                *next = to;
            }
            if let Some(has_previous) = has_previous.get_mut(to as usize) {
                *has_previous = true;
            }
        }
    }
    (points, next, has_previous)
}

/// Traces the lines of one level from vertex to vertex; `period` is the size of a torus.
fn trace(points: &[[f64; 2]], next: &mut [u32], has_previous: &[bool], period: Option<[f64; 2]>) -> Lines {
    let mut out = Lines { points: Vec::with_capacity(points.len() + 64), lines: Vec::new() };
    for closed in [false, true] {
        for start in 0..points.len() {
            if next[start] == NONE || (!closed && has_previous[start]) {
                continue;
            }
            let from = out.points.len();
            let (mut vertex, mut previous, mut offset) = (start, points[start], [0.0; 2]);
            loop {
                let stored = points[vertex];
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
                match std::mem::replace(&mut next[vertex], NONE) {
                    NONE => break,
                    to => vertex = to as usize,
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
    let ends: Vec<usize> = starts.iter().map(|from| (from + strip.max(1)).min(rows)).collect();
    let spans: Vec<[usize; 2]> = starts.iter().zip(&ends).map(|(from, to)| [*from, *to]).collect();
    let strips: Vec<Vec<Part>> =
        spans.par_iter().map(|span| march_strip(field, levels, saddle, *span)).collect();
    let period = field.is_torus().then(|| [field.width, field.height()].map(|n| n as f64));
    let mut by_level: Vec<Vec<Part>> = levels.iter().map(|_| Vec::with_capacity(strips.len())).collect();
    for strip in strips {
        by_level.iter_mut().zip(strip).for_each(|(parts, part)| parts.push(part));
    }
    by_level
        .into_par_iter()
        .map(|parts| {
            let (points, mut next, has_previous) = join(parts, &ends);
            trace(&points, &mut next, &has_previous, period)
        })
        .collect()
}

#[cfg(test)]
mod tests;
