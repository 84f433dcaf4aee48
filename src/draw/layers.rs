//! Which layer each box stands in, and the order within a layer that crosses few links.
//!
//! # Source
//! Sugiyama, Tagawa, Toda, *Methods for visual understanding of hierarchical system structures*, 1981: layers by
//! longest path, bends where a link passes a layer, barycentre sweeps.

use super::Drawing;

/// What stands in a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// A box of the drawing.
    Box(usize),
    /// Where a link passes the layer.
    Bend,
}

/// A stretch of a link from one layer to the next: cells, and the ports where they are boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
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
    pub pieces: Vec<Piece>,
    /// Pieces of each wire in order; none for those that close a loop.
    pub of_wire: Vec<Vec<usize>>,
    /// Layer of each box.
    pub layer: Vec<usize>,
}

/// Rounds of sweeps over the layers; few graphs get better after the first handful.
const SWEEPS: usize = 24;

impl Layers {
    pub fn of(drawing: &Drawing) -> Self {
        let layer = assign(drawing);
        let count = layer.iter().max().map_or(0, |m| m + 1);
        let mut layers = Self { layer, ..Self::default() };
        layers.rows = vec![Vec::new(); count];
        for (b, &layer) in layers.layer.iter().enumerate() {
            layers.cells.push(Cell::Box(b));
            layers.rows[layer].push(b);
        }
        for wire in &drawing.wires {
            let mut way = Vec::new();
            if !wire.back {
                let mut from = wire.from.0;
                for layer in layers.layer[wire.from.0] + 1..layers.layer[wire.to.0] {
                    layers.cells.push(Cell::Bend);
                    let bend = layers.cells.len() - 1;
                    layers.rows[layer].push(bend);
                    way.push(layers.piece(from, bend, wire.from.1, 0));
                    from = bend;
                }
                way.push(layers.piece(from, wire.to.0, wire.from.1, wire.to.1));
            }
            layers.of_wire.push(way);
        }
        layers.untangle();
        layers
    }

    fn piece(&mut self, from: usize, to: usize, out_port: usize, in_port: usize) -> usize {
        self.pieces.push(Piece { from, to, out_port, in_port });
        self.pieces.len() - 1
    }

    /// Sweeps over the layers until the order gets no better, and keeps the best.
    fn untangle(&mut self) {
        let mut above: Vec<Vec<usize>> = vec![Vec::new(); self.cells.len()];
        let mut below = above.clone();
        for (k, piece) in self.pieces.iter().enumerate() {
            below[piece.from].push(k);
            above[piece.to].push(k);
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
                    let pieces = if down { &above[cell] } else { &below[cell] };
                    let end = |k: &usize| {
                        let piece = &self.pieces[*k];
                        if down {
                            at[piece.from] as f64 + place(piece.out_port)
                        } else {
                            at[piece.to] as f64 + place(piece.in_port)
                        }
                    };
                    // What has no neighbour on this side stays where it is.
                    if pieces.is_empty() {
                        at[cell] as f64
                    } else {
                        pieces.iter().map(end).sum::<f64>() / pieces.len() as f64
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

    /// Pairs of pieces that cross.
    ///
    /// # Complexity
    /// O(pieces * log pieces).
    pub fn crossings(&self) -> usize {
        let at = self.positions();
        let mut by_row: Vec<Vec<(End, End)>> = vec![Vec::new(); self.rows.len()];
        let mut row_of = vec![0; self.cells.len()];
        for (k, row) in self.rows.iter().enumerate() {
            row.iter().for_each(|&c| row_of[c] = k);
        }
        for p in &self.pieces {
            by_row[row_of[p.from]].push(((at[p.from], p.out_port), (at[p.to], p.in_port)));
        }
        let count = |mut ends: Vec<(End, End)>| {
            ends.sort_unstable();
            inversions(&mut ends.into_iter().map(|(_, to)| to).collect::<Vec<_>>())
        };
        by_row.into_iter().map(count).sum()
    }
}

/// One end of a piece: place in its row, and port.
type End = (usize, usize);

/// Where a port stands between its box and the next one.
fn place(port: usize) -> f64 {
    1.0 - 1.0 / (port as f64 + 1.5)
}

/// Pairs in the wrong order; sorts on the way.
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

/// Layers by longest path; a node that gives more than it takes then moves towards those that read it.
fn assign(drawing: &Drawing) -> Vec<usize> {
    let count = drawing.boxes.len();
    let wires = || drawing.wires.iter().filter(|w| !w.back);
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); count];
    let mut waiting = vec![0_usize; count];
    for wire in wires() {
        below[wire.from.0].push(wire.to.0);
        waiting[wire.to.0] += 1;
    }
    let takes = waiting.clone();
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
            && below[b].len() > takes[b]
        {
            layer[b] = first - 1;
        }
    }
    layer
}
