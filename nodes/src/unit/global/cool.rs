//! The rest of units in an exact programme, which cannot know of it.

use super::exact::Programme;
use super::{GlobalParams, Table};
use crate::impl_state;

/// Rounds of a repair.
const ROUNDS: usize = 20;

/// What a repair did.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Repair {
    /// Units that came back too early at first.
    pub repeats: usize,
    /// Times that blocks were searched again.
    pub rounds: usize,
    /// Units that were replaced in the end.
    pub replaced: usize,
}

/// When each column was last chosen.
#[derive(Clone, Debug)]
pub(super) struct Rest {
    /// One more than the row; 0 for never.
    used: Vec<usize>,
    cool_off: usize,
}
impl_state!(Rest { used });

impl Rest {
    pub fn new(columns: usize, cool_off: usize) -> Self {
        Self { used: vec![0; columns], cool_off }
    }

    /// Whether a column rests at a row.
    pub fn barred(&self, row: usize, column: usize) -> bool {
        let used = self.used[column];
        used > 0 && row + 1 - used <= self.cool_off
    }

    pub fn note(&mut self, row: usize, column: usize) {
        self.used[column] = row + 1;
    }

    /// `wanted` where it may be chosen, else the cheaper of the column that runs on and the nearest; where all rest, the one
    /// that has rested longest.
    pub fn instead(
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
        let rested = || (0..table.count()).min_by_key(|&j| self.used[j]);
        best.map(|(_, j)| j).or_else(rested).unwrap_or(wanted)
    }
}

/// Rows at which a column comes back before its rest is over.
fn repeats(path: &[usize], columns: usize, cool_off: usize) -> Vec<usize> {
    let mut rest = Rest::new(columns, cool_off);
    let mut found = Vec::new();
    for (row, &column) in path.iter().enumerate() {
        if rest.barred(row, column) {
            found.push(row);
        }
        rest.note(row, column);
    }
    found
}

/// Makes what comes back too early dearer, twice as much each time, and searches the blocks around it again; then replaces what is
/// left. Where replacing alone is cheaper, as among few units, that stands.
pub(super) fn repair(programme: &mut Programme<'_>, params: &GlobalParams) -> Repair {
    let columns = programme.table.count();
    let mut found = repeats(&programme.path, columns, params.cool_off);
    let mut repair = Repair { repeats: found.len(), ..Repair::default() };
    if found.is_empty() {
        return repair;
    }
    let (alone, replaced) = enforce(programme, params);
    let cost = |path: &[usize]| programme.table.cost(programme.target, path, params);
    let (alone_costs, mean) = (cost(&alone), cost(&programme.path) / alone.len() as f64);
    // Enough to be felt at once, little enough not to chase the path from where it is good.
    let mut dearer = (0.5 * params.switch_cost).max(0.1 * mean).max(1e-3) as f32;
    // Where there are too few units to go round, no price helps.
    while !found.is_empty() && repair.rounds < ROUNDS && columns > params.cool_off {
        let mut changed = vec![false; programme.blocks()];
        for &row in &found {
            let cell = (programme.path[row], dearer);
            programme.extra.entry(row).or_default().push(cell);
            changed[row / programme.block] = true;
        }
        programme.solve(&changed);
        found = repeats(&programme.path, columns, params.cool_off);
        repair.rounds += 1;
        dearer *= 2.0;
    }
    (programme.path, repair.replaced) = enforce(programme, params);
    if alone_costs < programme.table.cost(programme.target, &programme.path, params) {
        (programme.path, repair.replaced) = (alone, replaced);
    }
    repair
}

/// The path with each unit replaced that comes back too early, and how many were.
fn enforce(programme: &Programme<'_>, params: &GlobalParams) -> (Vec<usize>, usize) {
    let mut rest = Rest::new(programme.table.count(), params.cool_off);
    let mut path: Vec<usize> = Vec::with_capacity(programme.path.len());
    let mut replaced = 0;
    for (row, &wanted) in programme.path.iter().enumerate() {
        let features = programme.row(row);
        let column = rest.instead(programme.table, features, row, wanted, path.last().copied(), params);
        replaced += usize::from(column != wanted);
        rest.note(row, column);
        path.push(column);
    }
    (path, replaced)
}
