//! The best of all paths, by dynamic programming over the active units of each target.

use super::front::{Decisions, Front, Price, Scratch};
use super::path::GlobalParams;
use super::table::Table;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Least rows of a block.
const SHORT: usize = 32;
/// Number of active columns for which a block is one row longer: fronts are stored at its ends, decisions for its rows.
const COLUMNS_PER_ROW: usize = 150;
/// Most bytes for the decisions of all rows. Where they take more, those of some blocks are computed again for each path.
const DECISION_BYTES: usize = 64 << 20;
/// Blocks whose decisions are then stored at once, for each thread.
const DECIDED: usize = 8;
/// Number of places at which some rows are computed to estimate the number of active columns.
const PLACES: usize = 16;
/// Rows that are computed there.
const TRIAL: usize = 8;

/// The programme over a target, with the data for computing parts of it again.
pub(super) struct Programme<'a> {
    pub table: &'a Table,
    pub target: &'a [f32],
    price: Price,
    /// Rows of a block.
    pub block: usize,
    /// The front before each block, and the last.
    fronts: Vec<Front>,
    /// Decisions of each block between its fronts; empty if they would take too much memory.
    decisions: Vec<Decisions>,
    /// The best path, in columns.
    pub path: Vec<usize>,
    /// Surcharges of cells, by row.
    pub surcharges: BTreeMap<usize, Vec<(usize, f32)>>,
}

impl<'a> Programme<'a> {
    pub fn new(table: &'a Table, target: &'a [f32], params: &GlobalParams, block: Option<usize>) -> Self {
        let rows = target.len() / table.dims();
        let mut this = Self {
            table,
            target,
            price: Price::new(params),
            block: 1,
            fronts: Vec::new(),
            decisions: Vec::new(),
            path: vec![0; rows],
            surcharges: BTreeMap::new(),
        };
        this.block = block.unwrap_or_else(|| this.block_length()).clamp(1, rows);
        if block.is_none() && Decisions::bytes(table.count(), rows) <= DECISION_BYTES {
            this.decisions = (0..this.blocks()).map(|_| Decisions::new(table.count(), 0)).collect();
        }
        this
    }

    /// Rows of a block such that fronts and decisions take little memory.
    fn block_length(&self) -> usize {
        let rows = self.path.len();
        let mut scratch = Scratch::new(self.table.count());
        let most = (rows as f64).sqrt().ceil() as usize;
        let active: Vec<usize> = (0..rows)
            .step_by(rows.div_ceil(PLACES))
            .map(|from| {
                let mut front = Front::start(self.table.count());
                for i in from..(from + TRIAL).min(rows) {
                    front.advance(self.table, self.price, self.row(i), &[], &mut scratch, None);
                }
                front.len()
            })
            .collect();
        let mean = active.iter().sum::<usize>() / active.len().max(1);
        (mean / COLUMNS_PER_ROW).max(SHORT).min(most)
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

    /// Computes the rows of a block from the costs before it, and stores `decisions` on request.
    fn run_block(
        &self,
        b: usize,
        mut front: Front,
        scratch: &mut Scratch,
        mut decisions: Option<&mut Decisions>,
    ) -> Front {
        let rows = b * self.block..((b + 1) * self.block).min(self.path.len());
        for (k, i) in rows.enumerate() {
            let surcharges = self.surcharges.get(&i).map_or(&[][..], Vec::as_slice);
            let decisions = decisions.as_deref_mut().map(|decisions| (decisions, k));
            front.advance(self.table, self.price, self.row(i), surcharges, scratch, decisions);
        }
        front.sort();
        front
    }

    /// Computes the fronts again where they differ; returns the computed blocks.
    fn forward(&mut self, changed: &[bool]) -> Vec<bool> {
        let mut computed = changed.to_vec();
        let mut stale: Vec<usize> = (0..changed.len()).filter(|b| changed[*b]).collect();
        if self.fronts.is_empty() {
            stale = self.first_fronts();
        }
        let columns = self.table.count();
        // Costs are over the least of each row, so that a detour is soon forgotten: most blocks end as they did.
        while !stale.is_empty() {
            let this = &*self;
            let ends: Vec<_> = stale
                .par_iter()
                .map_init(
                    || Scratch::new(columns),
                    |scratch, &b| (b, this.run_stored(b, this.fronts[b].clone(), scratch)),
                )
                .collect();
            stale.clear();
            for (b, (end, decisions)) in ends {
                self.store(b, decisions);
                if self.fronts[b + 1] != end {
                    self.fronts[b + 1] = end;
                    if b + 1 < computed.len() {
                        computed[b + 1] = true;
                        stale.push(b + 1);
                    }
                }
            }
        }
        computed
    }

    /// Computes all fronts, in as many parts at once as there are threads; returns the blocks at the start of a part that began with other costs.
    ///
    /// The first front of a part is computed from the block before it alone, without the rows before that.
    fn first_fronts(&mut self) -> Vec<usize> {
        let (blocks, columns) = (self.blocks(), self.table.count());
        let part = blocks.div_ceil(rayon::current_num_threads());
        let starts: Vec<usize> = (0..blocks).step_by(part).collect();
        let this = &*self;
        let parts: Vec<_> = starts
            .par_iter()
            .map(|&from| {
                let mut scratch = Scratch::new(columns);
                let mut front = Front::start(columns);
                if let Some(before) = from.checked_sub(1) {
                    front = this.run_block(before, front, &mut scratch, None);
                }
                let (mut fronts, mut decisions) = (vec![front], Vec::new());
                for b in from..(from + part).min(blocks) {
                    let (next, decided) = this.run_stored(b, fronts[fronts.len() - 1].clone(), &mut scratch);
                    fronts.push(next);
                    decisions.push(decided);
                }
                (fronts, decisions)
            })
            .collect();
        let mut stale = Vec::new();
        for (from, (mut fronts, decisions)) in starts.into_iter().zip(parts) {
            decisions.into_iter().zip(from..).for_each(|(decisions, b)| self.store(b, decisions));
            if self.fronts.last().is_some_and(|end| *end != fronts[0]) {
                stale.push(from);
            }
            let known = usize::from(!self.fronts.is_empty());
            self.fronts.extend(fronts.drain(known..));
        }
        stale
    }

    /// The rows of a block, and the decisions for them if they are stored.
    fn run_stored(&self, b: usize, front: Front, scratch: &mut Scratch) -> (Front, Option<Decisions>) {
        let mut decisions = (!self.decisions.is_empty()).then(|| self.no_decisions(b));
        (self.run_block(b, front, scratch, decisions.as_mut()), decisions)
    }

    fn store(&mut self, b: usize, decisions: Option<Decisions>) {
        if let Some((to, decisions)) = self.decisions.get_mut(b).zip(decisions) {
            *to = decisions;
        }
    }

    /// Room for the decisions of a block.
    fn no_decisions(&self, b: usize) -> Decisions {
        Decisions::new(self.table.count(), self.block.min(self.path.len() - b * self.block))
    }

    fn decide(&self, b: usize, scratch: &mut Scratch) -> Decisions {
        let mut decisions = self.no_decisions(b);
        self.run_block(b, self.fronts[b].clone(), scratch, Some(&mut decisions));
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
                if self.decisions.is_empty() && !ready.contains_key(&b) {
                    // Blocks depend on each other only by their ends: some at once for each thread.
                    let mut group: Vec<usize> = (0..b).rev().filter(|&b| stale[b]).collect();
                    group.truncate(DECIDED * rayon::current_num_threads() - 1);
                    group.push(b);
                    let scratch = || Scratch::new(self.table.count());
                    let decided: Vec<_> = group
                        .par_iter()
                        .map_init(scratch, |scratch, &b| (b, self.decide(b, scratch)))
                        .collect();
                    ready.extend(decided);
                }
                let ready = ready.remove(&b);
                let Some(decisions) = ready.as_ref().or(self.decisions.get(b)) else { return };
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
