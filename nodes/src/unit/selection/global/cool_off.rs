//! Cool-off of units in an exact programme, which does not include it.

use super::path::GlobalParams;
use super::table::Table;
use crate::impl_state;

/// Target at which each column was last chosen.
#[derive(Clone, Debug)]
pub(super) struct CoolOff {
    /// One more than the row; 0 for never.
    used: Vec<usize>,
    cool_off: usize,
}
impl_state!(CoolOff { used });

impl CoolOff {
    pub fn new(columns: usize, cool_off: usize) -> Self {
        Self { used: vec![0; columns], cool_off }
    }

    /// Returns true if a column is in its cool-off at a row.
    pub fn barred(&self, row: usize, column: usize) -> bool {
        let used = self.used[column];
        used > 0 && row + 1 - used <= self.cool_off
    }

    pub fn record(&mut self, row: usize, column: usize) {
        self.used[column] = row + 1;
    }

    /// `wanted` if it may be chosen, else the cheaper of the column that runs on and the nearest; if all are in their
    /// cool-off, the one that was chosen longest ago.
    pub fn substitute(
        &self,
        table: &Table,
        features: &[f32],
        row: usize,
        wanted: usize,
        last: Option<usize>,
        params: &GlobalParams,
    ) -> usize {
        if !self.barred(row, wanted) {
            return wanted;
        }
        let next = last.and_then(|last| table.next(last));
        let cost = |j: usize| {
            let jump = if next == Some(j) { 0.0 } else { params.switch_cost };
            table.distance(features, j).min(params.cap) + jump
        };
        let free = (0..table.count()).filter(|&j| !self.barred(row, j));
        let best = free.map(|j| (cost(j), j)).min_by(|a, b| a.0.total_cmp(&b.0));
        let longest_unused = || (0..table.count()).min_by_key(|&j| self.used[j]);
        best.map(|(_, j)| j).or_else(longest_unused).unwrap_or(wanted)
    }
}
