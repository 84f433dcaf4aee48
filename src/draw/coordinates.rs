//! Coordinates of boxes and links.

use super::Drawing;
use super::layers::{Cell, Layers};

/// Height of the line of one port.
pub(super) const PORT_HEIGHT: f64 = 18.0;
/// Height of the lines with id and type.
pub(super) const HEAD_HEIGHT: f64 = 42.0;
/// Space around the drawing.
pub(super) const MARGIN: f64 = 24.0;
/// Space between two boxes of a layer.
const BOX_GAP: f64 = 26.0;
/// Space beside a bend.
const BEND_GAP: f64 = 12.0;
/// Width between two layers, in which links change height.
const LANE_WIDTH: f64 = 64.0;
/// Maximum number of characters of a name.
pub(super) const MAX_CHARS: usize = 44;

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

/// The coordinates of a drawing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coordinates {
    /// Rectangle of each box.
    pub boxes: Vec<Rect>,
    /// Points of each link; from one to the next it is horizontal or changes height, in turns.
    pub wires: Vec<Vec<Point>>,
    /// Right edge of the drawing.
    pub width: f64,
    /// Bottom edge of the drawing.
    pub height: f64,
}

/// Estimated width of a text; fonts differ, so the estimate is generous.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let one = |c: char| if c.is_ascii() { 0.62 } else { 1.0 };
    text.chars().take(MAX_CHARS).map(one).sum::<f64>() * size
}

/// Height of a port below the top of its box.
pub(super) fn port_y(port: usize) -> f64 {
    HEAD_HEIGHT + PORT_HEIGHT * (port as f64 + 0.5)
}

fn size(drawing: &Drawing, b: usize) -> (f64, f64) {
    let node = &drawing.boxes[b];
    let rows = node.inputs.len().max(node.outputs.len());
    let side = |texts: &mut dyn Iterator<Item = &str>| texts.map(|t| text_width(t, 11.0)).fold(0.0, f64::max);
    let ports = side(&mut node.inputs.iter().map(|(n, _)| n.as_str()))
        + side(&mut node.outputs.iter().map(|o| o.name.as_str()))
        + 20.0;
    let head = text_width(&node.id, 13.5).max(text_width(&node.type_name, 11.0));
    ((ports.max(head) + 24.0).max(96.0).ceil(), HEAD_HEIGHT + PORT_HEIGHT * rows as f64 + 6.0)
}

/// Computes the coordinates of a drawing.
///
/// # Complexity
/// O(rounds * (boxes + links * layers)), with a fixed number of rounds.
#[must_use]
pub fn assign_coordinates(drawing: &Drawing) -> Coordinates {
    let layers = Layers::of(drawing);
    let sizes: Vec<(f64, f64)> = (0..drawing.boxes.len()).map(|b| size(drawing, b)).collect();
    let height = |cell: usize| match layers.cells[cell] {
        Cell::Box(b) => sizes[b].1,
        Cell::Bend => 0.0,
    };
    let y = cell_tops(&layers, &height);
    // A column holds boxes, the labels of their outputs, and the lane.
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
        left[k + 1] = lane[k] + LANE_WIDTH;
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
    for (wire, segments) in drawing.wires.iter().zip(&layers.of_wire) {
        let (from, to) = (&boxes[wire.from.0], &boxes[wire.to.0]);
        let start = (from.x + from.w, from.y + port_y(wire.from.1));
        let end = (to.x, to.y + port_y(wire.to.1));
        let mut points = vec![start];
        for &segment in segments {
            let segment = &layers.segments[segment];
            let height = points.last().map_or(0.0, |p| p.1);
            points.push((lane[row_of[segment.from]], height));
            match layers.cells[segment.to] {
                Cell::Box(_) => points.push(end),
                Cell::Bend => points.push((left[row_of[segment.to]], top + y[segment.to])),
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
        // Only links that close a loop use the lane of the last column.
        Some(lane) => lane + MARGIN,
        None => 2.0 * MARGIN,
    };
    Coordinates { boxes, wires, width: width.max(520.0), height: bottom + MARGIN }
}

/// Tops of all cells: each cell is attracted by its neighbours, without overlaps and in the order of the list.
fn cell_tops(layers: &Layers, height: &dyn Fn(usize) -> f64) -> Vec<f64> {
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
    let mut neighbours: Vec<Vec<(usize, f64, bool)>> = vec![Vec::new(); layers.cells.len()];
    let port = |cell: usize, port: usize| match layers.cells[cell] {
        Cell::Box(_) => port_y(port),
        Cell::Bend => 0.0,
    };
    for segment in &layers.segments {
        let shift = port(segment.from, segment.out_port) - port(segment.to, segment.in_port);
        neighbours[segment.to].push((segment.from, shift, true));
        neighbours[segment.from].push((segment.to, -shift, false));
    }
    let rounds = 20;
    for round in 0..rounds {
        let down = round % 2 == 0;
        // In the last rounds, neighbours on both sides count.
        let both = round >= rounds - 4;
        for k in 0..layers.rows.len() {
            let row = &layers.rows[if down { k } else { layers.rows.len() - 1 - k }];
            let wanted: Vec<(f64, f64)> = row
                .iter()
                .map(|&cell| {
                    let near = neighbours[cell].iter().filter(|(_, _, before)| both || *before == down);
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
            let distances: Vec<f64> =
                row.iter().zip(row.iter().skip(1)).map(|(&a, &b)| height(a) + gap(a, b)).collect();
            for (&cell, at) in row.iter().zip(nearest_positions(&wanted, &distances)) {
                y[cell] = at;
            }
        }
    }
    let top = y.iter().copied().fold(f64::INFINITY, f64::min);
    y.iter_mut().for_each(|y| *y = (*y - top).round());
    y
}

/// Positions with minimum distances that are nearest to the wanted ones, by weighted least squares.
///
/// Pool adjacent violators: items that would overlap move as one block to the weighted mean of their wanted positions.
fn nearest_positions(wanted: &[(f64, f64)], distances: &[f64]) -> Vec<f64> {
    // With the distances before it subtracted, each position only has to be in order.
    let mut offset = 0.0;
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for (k, (want, weight)) in wanted.iter().enumerate() {
        if k > 0 {
            offset += distances[k - 1];
        }
        let mut block = (want - offset, *weight, 1);
        while let Some(last) = blocks.pop_if(|last| last.0 > block.0) {
            let weight = last.1 + block.1;
            block = ((last.0 * last.1 + block.0 * block.1) / weight, weight, last.2 + block.2);
        }
        blocks.push(block);
    }
    let mut out = Vec::with_capacity(wanted.len());
    let mut offset = 0.0;
    for (at, _, count) in blocks {
        for _ in 0..count {
            if !out.is_empty() {
                offset += distances[out.len() - 1];
            }
            // Rounded before the offset is added, so that rounding causes no overlap.
            out.push(at.round() + offset);
        }
    }
    out
}
