//! Where every box stands and every link runs.

use super::Drawing;
use super::layers::{Cell, Layers};

/// Height of the line of one port.
pub(super) const ROW: f64 = 18.0;
/// Height of the lines with id and type.
pub(super) const HEAD: f64 = 42.0;
/// Space around everything.
pub(super) const MARGIN: f64 = 24.0;
const BOX_GAP: f64 = 26.0;
const BEND_GAP: f64 = 12.0;
/// Room between two layers for links to change height.
const LANE: f64 = 64.0;
/// Most characters of a name that are drawn.
pub(super) const LONGEST: usize = 44;

/// A point.
pub type Point = (f64, f64);

/// A rectangle: left, top, width, height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Top edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

/// All places.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Rectangle of each box.
    pub boxes: Vec<Rect>,
    /// Points that each link runs through; between every two it is horizontal, then changes height, in turns.
    pub wires: Vec<Vec<Point>>,
    /// Right edge of the drawing.
    pub width: f64,
    /// Bottom edge of the drawing.
    pub height: f64,
}

/// About how wide a text is; fonts differ, so it is on the wide side.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let one = |c: char| if c.is_ascii() { 0.62 } else { 1.0 };
    text.chars().take(LONGEST).map(one).sum::<f64>() * size
}

/// Height of the middle of a port's line, from the top of its box.
pub(super) fn port_height(port: usize) -> f64 {
    HEAD + ROW * (port as f64 + 0.5)
}

fn size(drawing: &Drawing, b: usize) -> (f64, f64) {
    let node = &drawing.boxes[b];
    let rows = node.inputs.len().max(node.outputs.len());
    let side = |texts: &mut dyn Iterator<Item = &str>| texts.map(|t| text_width(t, 11.0)).fold(0.0, f64::max);
    let ports = side(&mut node.inputs.iter().map(|(n, _)| n.as_str()))
        + side(&mut node.outputs.iter().map(|o| o.name.as_str()))
        + 20.0;
    let head = text_width(&node.id, 13.5).max(text_width(&node.type_name, 11.0));
    ((ports.max(head) + 24.0).max(96.0).ceil(), HEAD + ROW * rows as f64 + 6.0)
}

/// Lays a drawing out.
///
/// # Complexity
/// O(rounds * (boxes + links * layers)), with a fixed number of rounds.
#[must_use]
pub fn layout(drawing: &Drawing) -> Layout {
    let layers = Layers::of(drawing);
    let sizes: Vec<(f64, f64)> = (0..drawing.boxes.len()).map(|b| size(drawing, b)).collect();
    let height = |cell: usize| match layers.cells[cell] {
        Cell::Box(b) => sizes[b].1,
        Cell::Bend => 0.0,
    };
    let y = heights(&layers, &height);
    // Columns: boxes, then room for the labels of their outputs, then the lane.
    let mut left = vec![MARGIN; layers.rows.len() + 1];
    let mut lane = vec![0.0; layers.rows.len()];
    for (k, row) in layers.rows.iter().enumerate() {
        let of = |cell: &usize| match layers.cells[*cell] {
            Cell::Box(b) => {
                let labels = drawing.boxes[b].outputs.iter().map(|o| text_width(&o.label, 10.0));
                sizes[b].0 + labels.fold(0.0, f64::max)
            }
            Cell::Bend => 0.0,
        };
        lane[k] = left[k] + row.iter().map(of).fold(0.0, f64::max) + 8.0;
        left[k + 1] = lane[k] + LANE;
    }
    let top = MARGIN + if drawing.title.is_empty() { 0.0 } else { 34.0 };
    let boxes: Vec<Rect> = (0..drawing.boxes.len())
        .map(|b| Rect { x: left[layers.layer[b]], y: top + y[b], w: sizes[b].0, h: sizes[b].1 })
        .collect();
    let mut row_of = vec![0; layers.cells.len()];
    for (k, row) in layers.rows.iter().enumerate() {
        row.iter().for_each(|&c| row_of[c] = k);
    }
    let mut bottom = boxes.iter().map(|r| r.y + r.h).fold(top, f64::max);
    let last = |cells: &[f64]| cells.iter().copied().fold(0.0, f64::max);
    bottom = bottom.max(top + last(&y));
    let mut wires = Vec::with_capacity(drawing.wires.len());
    for (wire, pieces) in drawing.wires.iter().zip(&layers.of_wire) {
        let (from, to) = (&boxes[wire.from.0], &boxes[wire.to.0]);
        let start = (from.x + from.w, from.y + port_height(wire.from.1));
        let end = (to.x, to.y + port_height(wire.to.1));
        let mut points = vec![start];
        for &piece in pieces {
            let piece = &layers.pieces[piece];
            let height = points.last().map_or(0.0, |p| p.1);
            points.push((lane[row_of[piece.from]], height));
            match layers.cells[piece.to] {
                Cell::Box(_) => points.push(end),
                Cell::Bend => points.push((left[row_of[piece.to]], top + y[piece.to])),
            }
        }
        if wire.back {
            bottom += 16.0;
            let out = lane[layers.layer[wire.from.0]] + 10.0;
            points.extend([
                (out, start.1),
                (out, bottom),
                (end.0 - 14.0, bottom),
                (end.0 - 14.0, end.1),
                end,
            ]);
        }
        wires.push(points);
    }
    let width = match lane.last() {
        // The last column needs its lane only for links that close a loop.
        Some(lane) => lane + MARGIN,
        None => 2.0 * MARGIN,
    };
    Layout { boxes, wires, width: width.max(520.0), height: bottom + MARGIN }
}

/// Heights of the tops of all cells: each cell is drawn to its neighbours, nothing overlaps, the order stays.
fn heights(layers: &Layers, height: &dyn Fn(usize) -> f64) -> Vec<f64> {
    let gap = |a: usize, b: usize| match (layers.cells[a], layers.cells[b]) {
        (Cell::Box(_), Cell::Box(_)) => BOX_GAP,
        _ => BEND_GAP,
    };
    let mut y = vec![0.0; layers.cells.len()];
    for row in &layers.rows {
        let mut at = 0.0;
        for (k, &cell) in row.iter().enumerate() {
            y[cell] = at;
            at += height(cell) + row.get(k + 1).map_or(0.0, |&next| gap(cell, next));
        }
    }
    let mut of: Vec<Vec<(usize, f64, bool)>> = vec![Vec::new(); layers.cells.len()];
    let port = |cell: usize, port: usize| match layers.cells[cell] {
        Cell::Box(_) => port_height(port),
        Cell::Bend => 0.0,
    };
    for piece in &layers.pieces {
        let shift = port(piece.from, piece.out_port) - port(piece.to, piece.in_port);
        of[piece.to].push((piece.from, shift, true));
        of[piece.from].push((piece.to, -shift, false));
    }
    let rounds = 20;
    for round in 0..rounds {
        let down = round % 2 == 0;
        // At the end, neighbours on both sides count.
        let both = round >= rounds - 4;
        for k in 0..layers.rows.len() {
            let row = &layers.rows[if down { k } else { layers.rows.len() - 1 - k }];
            let wanted: Vec<(f64, f64)> = row
                .iter()
                .map(|&cell| {
                    let near = of[cell].iter().filter(|(_, _, before)| both || *before == down);
                    let (mut sum, mut weight) = (0.0, 0.0);
                    for (other, shift, _) in near {
                        let straight = layers.cells[cell] == Cell::Bend && layers.cells[*other] == Cell::Bend;
                        let w = if straight { 4.0 } else { 1.0 };
                        sum += w * (y[*other] + shift);
                        weight += w;
                    }
                    if weight > 0.0 { (sum / weight, weight) } else { (y[cell], 0.1) }
                })
                .collect();
            let room: Vec<f64> =
                row.iter().zip(row.iter().skip(1)).map(|(&a, &b)| height(a) + gap(a, b)).collect();
            for (&cell, at) in row.iter().zip(spread(&wanted, &room)) {
                y[cell] = at;
            }
        }
    }
    let least = y.iter().copied().fold(f64::INFINITY, f64::min);
    y.iter_mut().for_each(|y| *y = (*y - least).round());
    y
}

/// The places nearest to the wanted ones (least weighted squares) that leave `room` from each to the next.
///
/// Pool adjacent violators: what would overlap is moved as one block to the mean of what it wants.
fn spread(wanted: &[(f64, f64)], room: &[f64]) -> Vec<f64> {
    // Without the room that the ones before take, places have only to be in order.
    let mut before = 0.0;
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for (k, (want, weight)) in wanted.iter().enumerate() {
        if k > 0 {
            before += room[k - 1];
        }
        let mut block = (want - before, *weight, 1);
        while let Some(last) = blocks.pop_if(|last| last.0 > block.0) {
            let weight = last.1 + block.1;
            block = ((last.0 * last.1 + block.0 * block.1) / weight, weight, last.2 + block.2);
        }
        blocks.push(block);
    }
    let mut out = Vec::with_capacity(wanted.len());
    let mut before = 0.0;
    for (at, _, count) in blocks {
        for _ in 0..count {
            if !out.is_empty() {
                before += room[out.len() - 1];
            }
            // Rounded up together with the room, so that nothing touches after rounding.
            out.push(at.round() + before);
        }
    }
    out
}
