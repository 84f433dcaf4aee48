//! Layers of boxes, and an order within each layer with few crossings of links.
//!
//! # Source
//! Sugiyama, Tagawa, Toda, *Methods for visual understanding of hierarchical system structures*, 1981: layers by
//! longest path, a bend for each layer that a link passes, barycentre sweeps.

use super::Drawing;

/// An item of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// A box of the drawing.
    Box(usize),
    /// A link that passes the layer.
    Bend,
}

/// The segment of a link from one layer to the next: cells, and the ports of cells that are boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub from: usize,
    pub to: usize,
    pub out_port: usize,
    pub in_port: usize,
}

/// Cells in layers.
#[derive(Debug, Default)]
pub(super) struct Layers {
    pub cells: Vec<Cell>,
    /// Cells of each layer, from top to bottom.
    pub rows: Vec<Vec<usize>>,
    pub segments: Vec<Segment>,
    /// Pieces of each wire in order; none for those that close a loop.
    pub of_wire: Vec<Vec<usize>>,
    /// Layer of each box.
    pub layer: Vec<usize>,
}

/// Sweeps over the layers; few graphs improve after the first five.
const SWEEPS: usize = 24;

impl Layers {
    pub fn of(drawing: &Drawing) -> Self {
        let layer = assign_layers(drawing);
        let count = layer.iter().max().map_or(0, |m| m + 1);
        let mut layers = Self { layer, ..Self::default() };
        layers.rows = vec![Vec::new(); count];
        for (b, &layer) in layers.layer.iter().enumerate() {
            layers.cells.push(Cell::Box(b));
            layers.rows[layer].push(b);
        }
        for wire in &drawing.wires {
            let mut own = Vec::new();
            if !wire.back {
                let mut from = wire.from.0;
                for layer in layers.layer[wire.from.0] + 1..layers.layer[wire.to.0] {
                    layers.cells.push(Cell::Bend);
                    let bend = layers.cells.len() - 1;
                    layers.rows[layer].push(bend);
                    own.push(layers.segment(from, bend, wire.from.1, 0));
                    from = bend;
                }
                own.push(layers.segment(from, wire.to.0, wire.from.1, wire.to.1));
            }
            layers.of_wire.push(own);
        }
        layers.reduce_crossings();
        layers
    }

    fn segment(&mut self, from: usize, to: usize, out_port: usize, in_port: usize) -> usize {
        self.segments.push(Segment { from, to, out_port, in_port });
        self.segments.len() - 1
    }

    /// Sweeps over the layers, and uses the order with the fewest crossings.
    fn reduce_crossings(&mut self) {
        let mut incoming: Vec<Vec<usize>> = vec![Vec::new(); self.cells.len()];
        let mut outgoing = incoming.clone();
        for (k, segment) in self.segments.iter().enumerate() {
            outgoing[segment.from].push(k);
            incoming[segment.to].push(k);
        }
        let mut best = (self.crossings(), self.rows.clone());
        for sweep in 0..SWEEPS {
            if best.0 == 0 {
                break;
            }
            let down = sweep % 2 == 0;
            let count = self.rows.len();
            for k in 1..count {
                let row = if down { k } else { count - 1 - k };
                let at = self.positions();
                let mean = |cell: usize| {
                    let segments = if down { &incoming[cell] } else { &outgoing[cell] };
                    let end = |k: &usize| {
                        let segment = &self.segments[*k];
                        if down {
                            at[segment.from] as f64 + port_offset(segment.out_port)
                        } else {
                            at[segment.to] as f64 + port_offset(segment.in_port)
                        }
                    };
                    // A cell without a neighbour on this side keeps its position.
                    if segments.is_empty() {
                        at[cell] as f64
                    } else {
                        segments.iter().map(end).sum::<f64>() / segments.len() as f64
                    }
                };
                let mut keyed: Vec<(f64, usize)> = self.rows[row].iter().map(|&c| (mean(c), c)).collect();
                keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
                self.rows[row] = keyed.into_iter().map(|(_, c)| c).collect();
            }
            let crossings = self.crossings();
            if crossings < best.0 {
                best = (crossings, self.rows.clone());
            }
        }
        self.rows = best.1;
    }

    fn positions(&self) -> Vec<usize> {
        let mut at = vec![0; self.cells.len()];
        for row in &self.rows {
            for (k, &cell) in row.iter().enumerate() {
                at[cell] = k;
            }
        }
        at
    }

    /// Pairs of segments that cross.
    ///
    /// # Complexity
    /// O(segments * log segments).
    pub fn crossings(&self) -> usize {
        let at = self.positions();
        let mut by_row: Vec<Vec<(End, End)>> = vec![Vec::new(); self.rows.len()];
        let mut row_of = vec![0; self.cells.len()];
        for (k, row) in self.rows.iter().enumerate() {
            row.iter().for_each(|&c| row_of[c] = k);
        }
        for p in &self.segments {
            by_row[row_of[p.from]].push(((at[p.from], p.out_port), (at[p.to], p.in_port)));
        }
        let count = |mut ends: Vec<(End, End)>| {
            ends.sort_unstable();
            inversions(&mut ends.into_iter().map(|(_, to)| to).collect::<Vec<_>>())
        };
        by_row.into_iter().map(count).sum()
    }
}

/// One end of a segment: index in its row, and port.
type End = (usize, usize);

/// Position of a port between its box and the next one, from 0 to 1.
fn port_offset(port: usize) -> f64 {
    1.0 - 1.0 / (port as f64 + 1.5)
}

/// Number of pairs in the wrong order, by merge sort.
fn inversions<T: Copy + Ord>(items: &mut [T]) -> usize {
    if items.len() < 2 {
        return 0;
    }
    let (left, right) = items.split_at_mut(items.len() / 2);
    let mut count = inversions(left) + inversions(right);
    let mut merged = Vec::with_capacity(left.len() + right.len());
    let (mut l, mut r) = (0, 0);
    while l < left.len() || r < right.len() {
        if r == right.len() || (l < left.len() && left[l] <= right[r]) {
            merged.push(left[l]);
            l += 1;
        } else {
            count += left.len() - l;
            merged.push(right[r]);
            r += 1;
        }
    }
    items.copy_from_slice(&merged);
    count
}

/// Layers by longest path; a box with more outgoing than incoming links then moves next to its first reader.
fn assign_layers(drawing: &Drawing) -> Vec<usize> {
    let count = drawing.boxes.len();
    let wires = || drawing.wires.iter().filter(|w| !w.back);
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); count];
    let mut waiting = vec![0_usize; count];
    for wire in wires() {
        below[wire.from.0].push(wire.to.0);
        waiting[wire.to.0] += 1;
    }
    let incoming = waiting.clone();
    let mut layer = vec![0; count];
    let mut order: Vec<usize> = (0..count).filter(|&b| waiting[b] == 0).collect();
    let mut next = 0;
    while next < order.len() {
        let from = order[next];
        next += 1;
        for &to in &below[from] {
            layer[to] = layer[to].max(layer[from] + 1);
            waiting[to] -= 1;
            if waiting[to] == 0 {
                order.push(to);
            }
        }
    }
    for &b in order.iter().rev() {
        if let Some(first) = below[b].iter().map(|&to| layer[to]).min()
            && below[b].len() > incoming[b]
        {
            layer[b] = first - 1;
        }
    }
    layer
}
