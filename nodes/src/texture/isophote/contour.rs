//! Marching squares: the lines of equal height through a grid of numbers.
//!
//! The grid is cut into strips, which are marched on their own, two rows at a time and all levels at once; then the pieces of
//! each level are joined over the numbers of the cell edges that they end on. How the grid is cut changes nothing: vertices
//! are numbered in the order of the cells.

use rayon::prelude::*;

/// Rows of cells in a strip.
const STRIP: usize = 64;
/// Most levels at once.
pub const MOST_LEVELS: usize = 250;
/// Class of a sample that is missing.
const MISSING: u8 = 255;
/// No vertex.
const NONE: u32 = u32::MAX;
/// Marks the number of a cell edge of the strip above, in place of a vertex of this one.
const ABOVE: u32 = 1 << 31;

/// Which corners belong together in a cell where two opposite ones are high.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saddle {
    /// What the bilinear surface through the corners says: lines of different levels never cross.
    Decider,
    /// The low ones.
    Low,
    /// The high ones.
    High,
}

/// Numbers on a grid, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// Columns.
    pub width: usize,
    /// `width` numbers in each row; one that is not finite is missing.
    pub samples: &'a [f32],
    /// Whether the grid goes on with its first row and column after its last; only from 3 by 3 on.
    pub torus: bool,
}

/// One line of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Its first point.
    pub from: usize,
    /// After its last point.
    pub to: usize,
    /// Whether it comes back to its first point, which then is also its last (on a torus perhaps a whole number of turns away).
    pub closed: bool,
}

/// All lines of one level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Points of all lines, x and y with centres of samples at integers.
    pub points: Vec<[f64; 2]>,
    /// The lines, those with ends first.
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
        let at = y % self.height().max(1) * self.width;
        self.samples.get(at..at + self.width).unwrap_or_default()
    }
}

/// The edges of a cell: above, right, below, left.
const T: u8 = 0;
const R: u8 = 1;
const B: u8 = 2;
const L: u8 = 3;

/// Where lines enter and leave a cell, by its high corners: 1 top left, 2 top right, 4 bottom right, 8 bottom left. The high side is on
/// the left of the line, as one sees it with y pointing down.
fn pieces(case: u8, joins_high: impl Fn() -> bool) -> &'static [[u8; 2]] {
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

/// Whether the high corners of a cell with two of them belong together: `[top left, top right, bottom right, bottom left]`.
fn joins_high(saddle: Saddle, corners: [f64; 4], level: f64) -> bool {
    let [a, b, c, d] = corners;
    match saddle {
        Saddle::Low => false,
        Saddle::High => true,
        // The height of the bilinear surface at its saddle point.
        Saddle::Decider => (a * c - b * d) / (a + c - b - d) > level,
    }
}

/// What one strip has found of one level.
struct Part {
    level: f64,
    points: Vec<[f64; 2]>,
    /// Numbers of the vertices that a piece goes from and to.
    links: Vec<[u32; 2]>,
    /// For each column of cells, the row and the vertex of the last crossed edge between two samples of a row.
    across: Vec<(usize, u32)>,
    /// Row, column and vertex of the last crossed edge between two rows, and of that of column 0.
    down: (usize, usize, u32),
    seam: (usize, u32),
}

/// A cell that is crossed.
struct Cell {
    x: usize,
    y: usize,
    /// Top left, top right, bottom right, bottom left.
    corners: [f64; 4],
    /// Whether the strip above has the vertex on the upper edge.
    above: bool,
    /// The column and row of the samples right of and below it.
    next: [usize; 2],
}

impl Part {
    fn new(level: f32, width: usize) -> Self {
        Self {
            level: level.into(),
            points: Vec::new(),
            links: Vec::new(),
            across: vec![(usize::MAX, NONE); width],
            down: (usize::MAX, 0, NONE),
            seam: (usize::MAX, NONE),
        }
    }

    fn vertex(&mut self, point: [f64; 2]) -> u32 {
        self.points.push(point);
        self.points.len() as u32 - 1
    }

    /// Place between two samples where the level is met.
    fn fraction(&self, a: f64, b: f64) -> f64 {
        (self.level - a) / (b - a)
    }

    /// The vertex on an edge of a cell, made where no cell before has made it.
    fn on_edge(&mut self, edge: u8, cell: &Cell) -> u32 {
        let [a, b, c, d] = cell.corners;
        let (x, y) = (cell.x, cell.y);
        match edge {
            T => match self.across[x] {
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
                self.across[x] = (y + 1, vertex);
                vertex
            }
            L => match self.down {
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
                    self.down = (y, x + 1, vertex);
                    vertex
                }
            },
        }
    }

    fn cross(&mut self, case: u8, cell: &Cell, saddle: Saddle) {
        let pieces = pieces(case, || joins_high(saddle, cell.corners, self.level));
        // The upper edge before the lower one, whose vertex takes its place.
        let mut on = [NONE; 4];
        for edge in [T, L, R, B] {
            if pieces.iter().any(|piece| piece.contains(&edge)) {
                on[usize::from(edge)] = self.on_edge(edge, cell);
            }
        }
        self.links.extend(pieces.iter().map(|[from, to]| [on[usize::from(*from)], on[usize::from(*to)]]));
    }
}

/// How many levels each sample of a row is above.
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

/// Marches the cell rows `[from, to)`.
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

/// Joins the strips of one level to vertices and the vertex that follows on each, and lets go of each strip on the way.
fn join(mut parts: Vec<Part>, ends: &[usize]) -> (Vec<[f64; 2]>, Vec<u32>, Vec<bool>) {
    let count = parts.iter().map(|part| part.points.len()).sum();
    let (mut points, mut next, mut led_to) =
        (Vec::with_capacity(count), vec![NONE; count], vec![false; count]);
    // The strip above the first is the last, if any.
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
            _ => match parts[above].across[(vertex ^ ABOVE) as usize] {
                (row, found) if row == ends[above] => found + starts[above],
                _ => NONE,
            },
        };
        for [from, to] in links.iter().map(|link| link.map(number)) {
            if let Some(next) = next.get_mut(from as usize) {
                *next = to;
            }
            if let Some(led_to) = led_to.get_mut(to as usize) {
                *led_to = true;
            }
        }
    }
    (points, next, led_to)
}

/// Follows the pieces of one level from vertex to vertex.
fn trace(points: &[[f64; 2]], next: &mut [u32], led_to: &[bool], turn: Option<[f64; 2]>) -> Lines {
    let mut out = Lines { points: Vec::with_capacity(points.len() + 64), lines: Vec::new() };
    for closed in [false, true] {
        for start in 0..points.len() {
            if next[start] == NONE || (!closed && led_to[start]) {
                continue;
            }
            let from = out.points.len();
            let (mut at, mut before, mut turns) = (start, points[start], [0.0; 2]);
            loop {
                let stored = points[at];
                for (axis, turns) in turns.iter_mut().enumerate() {
                    let Some(turn) = turn else { break };
                    let step = stored[axis] - before[axis];
                    // No piece is longer than one cell, and a turn has three at least.
                    *turns -= f64::from(step > 0.5 * turn[axis]) * turn[axis];
                    *turns += f64::from(step < -0.5 * turn[axis]) * turn[axis];
                }
                before = stored;
                let point = [stored[0] + turns[0], stored[1] + turns[1]];
                // A sample that lies on its level is met on several edges.
                if out.points[from..].last() != Some(&point) {
                    out.points.push(point);
                }
                match std::mem::replace(&mut next[at], NONE) {
                    NONE => break,
                    to => at = to as usize,
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

/// The lines of each level, with the high side on their left where y points down.
///
/// A sample is high where it is strictly above the level. A cell with a corner that is not finite is passed over. Lines come
/// back to their start or end at the border or at such a cell; on a torus their points go on beyond its size.
/// Levels are in rising order, at most 250 of them; there are no lines for levels out of order.
///
/// # Complexity
/// O(samples x levels) comparisons, O(width) memory for each strip of 64 rows beside the output. Strips and levels run in parallel.
///
/// # Source
/// Lorensen and Cline, "Marching cubes" (SIGGRAPH 1987), in two dimensions; Nielson and Hamann, "The asymptotic decider" (Visualization
/// 1991).
#[must_use]
pub fn contours(field: &Field<'_>, levels: &[f32], saddle: Saddle) -> Vec<Lines> {
    contours_by(field, levels, saddle, STRIP)
}

/// The same with strips of `strip` rows.
fn contours_by(field: &Field<'_>, levels: &[f32], saddle: Saddle, strip: usize) -> Vec<Lines> {
    let [columns, rows] = field.cells();
    let sorted = levels.is_sorted_by(|a, b| a < b) && levels.len() <= MOST_LEVELS;
    if columns == 0 || rows == 0 || !sorted {
        return vec![Lines::default(); levels.len()];
    }
    let starts: Vec<usize> = (0..rows).step_by(strip.max(1)).collect();
    let ends: Vec<usize> = starts.iter().map(|from| (from + strip.max(1)).min(rows)).collect();
    let spans: Vec<[usize; 2]> = starts.iter().zip(&ends).map(|(from, to)| [*from, *to]).collect();
    let strips: Vec<Vec<Part>> =
        spans.par_iter().map(|span| march_strip(field, levels, saddle, *span)).collect();
    let turn = field.is_torus().then(|| [field.width, field.height()].map(|n| n as f64));
    let mut by_level: Vec<Vec<Part>> = levels.iter().map(|_| Vec::with_capacity(strips.len())).collect();
    for strip in strips {
        by_level.iter_mut().zip(strip).for_each(|(parts, part)| parts.push(part));
    }
    by_level
        .into_par_iter()
        .map(|parts| {
            let (points, mut next, led_to) = join(parts, &ends);
            trace(&points, &mut next, &led_to, turn)
        })
        .collect()
}

#[cfg(test)]
mod tests;
