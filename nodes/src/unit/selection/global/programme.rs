//! The best of all paths, by dynamic programming in O(n m) time and O(m sqrt n) memory.

use super::path::{GlobalParams, MAX_SWITCH_COST};
use super::row::{self, Target, WORD};
use super::table::Table;
use crate::impl_state;
use fearless_simd::Level;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Units that are worth a thread of their own in one row.
const SHARE: usize = 8192;

/// Costs of all columns after a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Front {
    /// Infinity, then for each column its cost over the least of the row before; infinite if no unit follows.
    pub values: Vec<f32>,
    /// The least of them.
    pub least: f32,
    /// First column that has it.
    pub best: usize,
}

impl Front {
    /// Costs before the first row: every column costs nothing.
    pub fn start(columns: usize) -> Self {
        Self { values: vec![0.0; columns + 1], least: 0.0, best: 0 }
    }

    /// The costs of a row from those before it; `before` holds the row before afterwards.
    pub fn advance(
        &mut self,
        before: &mut Self,
        table: &Table,
        price: Price,
        features: &[f32],
        surcharges: &[(usize, f32)],
        threads: usize,
    ) {
        std::mem::swap(self, before);
        let (count, level) = (table.count(), price.level);
        let target = Target {
            columns: &table.columns,
            count,
            features,
            least: before.least,
            switch: price.switch,
            cap: price.cap,
        };
        let own = &mut self.values[1..];
        let least = if threads < 2 || count < 2 * SHARE {
            row::step(level, target, 0, &before.values, own)
        } else {
            let part = count.div_ceil(threads.min(count / SHARE));
            let parts = own.par_chunks_mut(part).zip(before.values.par_chunks(part)).enumerate();
            parts
                .map(|(k, (own, before))| row::step(level, target, k * part, before, own))
                .reduce(|| f32::INFINITY, f32::min)
        };
        self.least = least;
        if !surcharges.is_empty() {
            for &(column, cost) in surcharges {
                own[column] += cost;
            }
            self.least = row::row_minimum(level, own);
        }
    }

    /// Finds the best column, before those without a following unit are closed.
    pub fn find(&mut self, level: Level) {
        self.best = row::first(level, &self.values[1..], self.least);
    }

    /// Closes the columns at the ends of recordings.
    pub fn close(&mut self, table: &Table) {
        self.values[0] = f32::INFINITY;
        for &end in &table.ends {
            self.values[end + 1] = f32::INFINITY;
        }
    }
}

/// Costs of rows in addition to features.
#[derive(Clone, Copy, Debug)]
pub(super) struct Price {
    pub switch: f32,
    pub cap: f32,
    pub level: Level,
}

impl Price {
    pub fn new(params: &GlobalParams) -> Self {
        let switch = params.switch_cost.clamp(0.0, MAX_SWITCH_COST) as f32;
        Self { switch, cap: params.cap.max(0.0) as f32, level: Level::new() }
    }
}

/// Predecessor of each column of some rows.
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
    pub fn new(columns: usize, rows: usize) -> Self {
        let words = columns.div_ceil(WORD);
        Self { words, bits: vec![0; words * rows], sources: vec![0; rows] }
    }

    /// Stores how the row after `before` is reached.
    pub fn record(&mut self, row: usize, before: &Front, price: Price) {
        let bits = &mut self.bits[row * self.words..][..self.words];
        let columns = before.values.len() - 1;
        row::runs(price.level, &before.values[..columns], before.least, price.switch, bits);
        self.sources[row] = before.best;
    }

    /// The column before `column` of `row`.
    pub fn before(&self, row: usize, column: usize) -> usize {
        let word = self.bits[row * self.words + column / WORD];
        if column > 0 && word >> (column % WORD) & 1 == 1 { column - 1 } else { self.sources[row] }
    }
}

/// The programme over a target, with the data for computing parts of it again.
pub(super) struct Programme<'a> {
    pub table: &'a Table,
    pub target: &'a [f32],
    price: Price,
    /// Rows of a block.
    pub block: usize,
    /// The front before each block, and the last.
    fronts: Vec<Front>,
    /// The best path, in columns.
    pub path: Vec<usize>,
    /// Surcharges of cells, by row.
    pub surcharges: BTreeMap<usize, Vec<(usize, f32)>>,
}

impl<'a> Programme<'a> {
    pub fn new(table: &'a Table, target: &'a [f32], params: &GlobalParams, block: Option<usize>) -> Self {
        let rows = target.len() / table.dims();
        let block = block.unwrap_or_else(|| (rows as f64).sqrt().ceil() as usize).clamp(1, rows);
        Self {
            table,
            target,
            price: Price::new(params),
            block,
            fronts: Vec::with_capacity(rows.div_ceil(block) + 1),
            path: vec![0; rows],
            surcharges: BTreeMap::new(),
        }
    }

    pub fn blocks(&self) -> usize {
        self.path.len().div_ceil(self.block)
    }

    /// Features of a target.
    pub fn row(&self, row: usize) -> &'a [f32] {
        &self.target[row * self.table.dims()..][..self.table.dims()]
    }

    /// Finds the best path again after the costs of some blocks have changed.
    pub fn solve(&mut self, changed: &[bool]) {
        let stale = self.forward(changed);
        self.trace_back(stale);
    }

    /// Computes the rows of a block, and stores `decisions` on request.
    fn run_block(&self, b: usize, threads: usize, mut decisions: Option<&mut Decisions>) -> Front {
        let mut front = self.fronts.get(b).cloned().unwrap_or_else(|| Front::start(self.table.count()));
        let mut before = front.clone();
        let rows = b * self.block..((b + 1) * self.block).min(self.path.len());
        let last = rows.end - 1;
        for (k, i) in rows.enumerate() {
            if let Some(decisions) = &mut decisions {
                decisions.record(k, &front, self.price);
            }
            let surcharges = self.surcharges.get(&i).map_or(&[][..], Vec::as_slice);
            front.advance(&mut before, self.table, self.price, self.row(i), surcharges, threads);
            // The best of every row is needed only to trace back; the next block needs that of the last row.
            if decisions.is_some() || i == last {
                front.find(self.price.level);
            }
            front.close(self.table);
        }
        front
    }

    /// Computes the fronts again from the first change on, as far as they differ; returns the computed blocks.
    fn forward(&mut self, changed: &[bool]) -> Vec<bool> {
        let threads = rayon::current_num_threads().max(2);
        let mut stale = vec![false; changed.len()];
        if self.fronts.is_empty() {
            self.fronts.push(Front::start(self.table.count()));
        }
        let mut differs = false;
        for (b, stale) in stale.iter_mut().enumerate() {
            if !changed[b] && !differs {
                continue;
            }
            *stale = true;
            let front = self.run_block(b, threads, None);
            // Costs are over the least of each row, so that a detour is soon forgotten.
            differs = self.fronts.get(b + 1) != Some(&front);
            match self.fronts.get_mut(b + 1) {
                Some(old) => *old = front,
                None => self.fronts.push(front),
            }
        }
        stale
    }

    fn decide(&self, b: usize) -> Decisions {
        let rows = self.block.min(self.path.len() - b * self.block);
        let mut decisions = Decisions::new(self.table.count(), rows);
        self.run_block(b, 1, Some(&mut decisions));
        decisions
    }

    /// Walks back from the best end, through the blocks whose decisions or whose end have changed.
    fn trace_back(&mut self, stale: Vec<bool>) {
        let mut ready: BTreeMap<usize, Decisions> = BTreeMap::new();
        let mut end = self.fronts.last().map_or(0, |front| front.best);
        for b in (0..stale.len()).rev() {
            let rows = b * self.block..((b + 1) * self.block).min(self.path.len());
            let same = !stale[b] && self.path[rows.end - 1] == end;
            if !same {
                if !ready.contains_key(&b) {
                    // Blocks depend on each other only by their ends: as many at once as there are threads.
                    let mut group: Vec<usize> = (0..b).rev().filter(|&b| stale[b]).collect();
                    group.truncate(rayon::current_num_threads() - 1);
                    group.push(b);
                    let decided: Vec<_> = group.par_iter().map(|&b| (b, self.decide(b))).collect();
                    ready.extend(decided);
                }
                let Some(decisions) = ready.remove(&b) else { return };
                for (k, i) in rows.clone().enumerate().rev() {
                    self.path[i] = end;
                    end = decisions.before(k, end);
                }
            } else if let Some(before) = rows.start.checked_sub(1) {
                end = self.path[before];
            }
        }
    }
}
