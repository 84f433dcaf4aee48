//! The costs of a row of the programme, only of the units from which a path may continue.

use super::path::{GlobalParams, MAX_SWITCH_COST};
use super::row::{self, Target, WORD};
use super::table::Table;
use crate::impl_state;
use crate::unit::selection::kdtree::Search;
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};

/// A row is computed over all columns where more than one in this many is active: a look-up of them takes longer.
const DENSE: usize = 8;

/// Costs after a row, each over the least of the row before.
///
/// A jump costs the same from everywhere. A path that continues from a column costs no less than one that jumps from the best column if the two
/// costs differ by more than the price of a jump: such columns are not active, and are not stored. A column that becomes active by a jump is
/// nearer to the target than the least cost of the row, and is found by a look-up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Front {
    /// Active columns and their costs; empty if `all` is not.
    active: Vec<(u32, f32)>,
    /// Where many columns are active, the cost of the one that each column follows, infinite if it follows none; otherwise empty.
    all: Vec<f32>,
    /// The least cost.
    least: f32,
    /// First column that has it.
    pub best: usize,
}

/// Costs of rows in addition to features.
#[derive(Clone, Copy, Debug)]
pub(super) struct Price {
    switch: f32,
    cap: f32,
    level: Level,
}

impl Price {
    pub fn new(params: &GlobalParams) -> Self {
        let switch = params.switch_cost.clamp(0.0, MAX_SWITCH_COST) as f32;
        Self { switch, cap: params.cap.max(0.0) as f32, level: Level::new() }
    }
}

/// Reusable memory of rows.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    active: Vec<(u32, f32)>,
    all: Vec<f32>,
    /// For each column the last row in which a path continued to it, counted by `row`.
    run_at: Vec<u64>,
    row: u64,
    search: Search,
}

impl Scratch {
    /// Memory for all columns of a table.
    pub fn new(columns: usize) -> Self {
        Self {
            active: Vec::with_capacity(columns),
            all: Vec::with_capacity(columns + 1),
            run_at: vec![0; columns + 1],
            row: 0,
            search: Search::default(),
        }
    }
}

impl Front {
    /// Costs before the first row: every column costs nothing.
    pub fn start(columns: usize) -> Self {
        Self { active: Vec::with_capacity(columns), all: vec![0.0; columns + 1], least: 0.0, best: 0 }
    }

    /// Number of columns whose costs are stored.
    pub fn len(&self) -> usize {
        self.active.len().max(self.all.len())
    }

    /// Sorts the columns, so that equal costs are equal fronts.
    pub fn sort(&mut self) {
        self.active.sort_unstable_by_key(|(column, _)| *column);
    }

    /// Computes the costs of a row from those of the row before. `surcharges` are added to the costs of columns. With `decisions`, the predecessors of
    /// the columns are stored in the row of that number.
    pub fn advance(
        &mut self,
        table: &Table,
        price: Price,
        features: &[f32],
        surcharges: &[(usize, f32)],
        scratch: &mut Scratch,
        decisions: Option<(&mut Decisions, usize)>,
    ) {
        scratch.row += 1;
        let (row, source) = (Row { table, price, features, surcharges, before: self.least }, self.best);
        if !self.all.is_empty() {
            std::mem::swap(&mut self.all, &mut scratch.all);
        } else if let Some(least) = row.some(&self.active, scratch) {
            std::mem::swap(&mut self.active, &mut scratch.active);
            self.least = least;
            let best = self.active.iter().filter(|(_, cost)| *cost == least).map(|(column, _)| *column).min();
            self.best = best.unwrap_or(0) as usize;
            self.active.retain(|(_, cost)| cost - least <= price.switch);
            if let Some((decisions, k)) = decisions {
                let ran = |column: &u32| scratch.run_at[*column as usize] == scratch.row;
                decisions.record_columns(
                    k,
                    source,
                    self.active.iter().map(|(column, _)| *column).filter(ran),
                );
            }
            return;
        } else {
            row.spread(&self.active, &mut scratch.all);
        }
        if let Some((decisions, k)) = decisions {
            decisions.record_row(k, source, &scratch.all, self.least, price);
        }
        self.least = row.all(&scratch.all, &mut self.all);
        let (least, costs) = (self.least, &self.all[1..]);
        self.best = row::first(price.level, costs, least);
        let active = row::count_within(price.level, costs, least, price.switch);
        self.active.clear();
        if active * DENSE > table.count() {
            table.close(&mut self.all);
        } else {
            let near = (0..).zip(costs).filter(|(_, cost)| **cost - least <= price.switch);
            self.active.extend(near.map(|(column, cost)| (column, *cost)));
            self.all.clear();
        }
    }
}

/// One target of a programme.
struct Row<'a> {
    table: &'a Table,
    price: Price,
    features: &'a [f32],
    surcharges: &'a [(usize, f32)],
    /// The least cost of the row before.
    before: f32,
}

impl Row<'_> {
    /// Costs of the columns that may become active, in `scratch`; returns the least of them, or nothing if there are too many to examine.
    fn some(&self, active: &[(u32, f32)], scratch: &mut Scratch) -> Option<f32> {
        let Scratch { active: next, run_at, row, search, .. } = scratch;
        next.clear();
        let mut least = f32::INFINITY;
        for (column, cost) in active {
            let Some(column) = self.table.next(*column as usize) else { continue };
            let cost = self.cost(column, cost - self.before);
            run_at[column] = *row;
            next.push((column as u32, cost));
            least = least.min(cost);
        }
        if least >= self.price.cap {
            return None;
        }
        // What costs as much as a jump from the best but for rounding is as good.
        let radius = |least: f32| f64::from(least) + 4e-7 * f64::from(least + self.price.switch);
        search.left = Some(self.table.count() / DENSE);
        let within = radius(least);
        dispatch!(self.price.level, simd => {
            self.table.near.within(simd, self.features, within, search, #[inline(always)] |column| {
                if run_at[column as usize] == *row {
                    return None;
                }
                let cost = self.cost(column as usize, self.price.switch);
                next.push((column, cost));
                (cost < least).then(|| {
                    least = cost;
                    radius(cost)
                })
            });
        });
        (search.left != Some(0) && least < self.price.cap).then_some(least)
    }

    /// For each column the cost of the one that it follows.
    fn spread(&self, active: &[(u32, f32)], all: &mut Vec<f32>) {
        all.clear();
        all.resize(self.table.count() + 1, f32::INFINITY);
        for (column, cost) in active {
            if let Some(column) = self.table.next(*column as usize) {
                all[column] = *cost;
            }
        }
    }

    /// Costs of all columns, after a first number, from those before; returns the least of them.
    fn all(&self, before: &[f32], costs: &mut Vec<f32>) -> f32 {
        let count = self.table.count();
        costs.resize(count + 1, f32::INFINITY);
        let costs = &mut costs[1..];
        let target = Target {
            columns: &self.table.columns,
            count,
            features: self.features,
            least: self.before,
            switch: self.price.switch,
            cap: self.price.cap,
        };
        let least = row::step(self.price.level, target, &before[..count], costs);
        if self.surcharges.is_empty() {
            return least;
        }
        for &(column, cost) in self.surcharges {
            costs[column] += cost;
        }
        row::row_minimum(self.price.level, costs)
    }

    /// Cost of a column that is reached at a cost over the least before.
    #[inline(always)]
    fn cost(&self, column: usize, reached: f32) -> f32 {
        let mut squares = 0.0;
        for (x, feature) in self.table.features(column).iter().zip(self.features) {
            squares += (x - feature) * (x - feature);
        }
        let cost = squares.sqrt().min(self.price.cap) + reached;
        let own = self.surcharges.iter().filter(|(other, _)| *other == column);
        own.fold(cost, |cost, (_, surcharge)| cost + surcharge)
    }
}

/// Predecessor of each active column of some rows.
#[derive(Debug)]
pub(super) struct Decisions {
    words: usize,
    /// One bit per cell: set if it was reached from the column before it.
    bits: Vec<u64>,
    /// Per row, the column that all others jumped from.
    sources: Vec<usize>,
}
impl_state!(Decisions { bits, sources });

impl Decisions {
    /// Bytes of rows of a number of columns.
    pub fn bytes(columns: usize, rows: usize) -> usize {
        (columns.div_ceil(WORD) + 1).saturating_mul(rows).saturating_mul(size_of::<u64>())
    }

    pub fn new(columns: usize, rows: usize) -> Self {
        let words = columns.div_ceil(WORD);
        Self { words, bits: vec![0; words * rows], sources: vec![0; rows] }
    }

    /// Stores that a row was reached by continuing in some columns, and by a jump from `source` in all others.
    fn record_columns(&mut self, row: usize, source: usize, columns: impl Iterator<Item = u32>) {
        let bits = &mut self.bits[row * self.words..][..self.words];
        bits.fill(0);
        columns.for_each(|column| bits[column as usize / WORD] |= 1 << (column as usize % WORD));
        self.sources[row] = source;
    }

    /// The same for all columns, from the costs of those that they follow.
    fn record_row(&mut self, row: usize, source: usize, before: &[f32], least: f32, price: Price) {
        let bits = &mut self.bits[row * self.words..][..self.words];
        row::runs(price.level, &before[..before.len() - 1], least, price.switch, bits);
        self.sources[row] = source;
    }

    /// The column before `column` of `row`.
    pub fn before(&self, row: usize, column: usize) -> usize {
        let word = self.bits[row * self.words + column / WORD];
        if column > 0 && word >> (column % WORD) & 1 == 1 { column - 1 } else { self.sources[row] }
    }
}
