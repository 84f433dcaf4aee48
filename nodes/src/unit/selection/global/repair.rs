//! Repair of an exact path in which units recur too early: before the end of their cool-off, or in a repeat of the last picks.

use super::path::GlobalParams;
use super::programme::Programme;
use super::table::Table;
use crate::unit::selection::history::History;

/// Rounds of a repair.
const ROUNDS: usize = 20;

/// Result of a repair.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Repair {
    /// Units that recurred too early at first.
    pub repeats: usize,
    /// Times that blocks were searched again.
    pub rounds: usize,
    /// Units that were replaced in the end.
    pub replaced: usize,
}

/// The history before the first pick of columns.
pub(super) fn new_history(table: &Table, params: &GlobalParams) -> History {
    History::new(table.count(), &table.same, params.cool_off, params.loop_guard)
}

/// Rows at which a column recurs too early.
fn repeats(path: &[usize], table: &Table, params: &GlobalParams) -> Vec<usize> {
    let mut history = new_history(table, params);
    let mut found = Vec::new();
    for (row, &column) in path.iter().enumerate() {
        if history.barred(column) {
            found.push(row);
        }
        history.record(column as u32);
    }
    found
}

/// `wanted` if it may be chosen, else the cheaper of the column that continues and the nearest; if all are barred, one that only
/// repeats, and else the one that was chosen longest ago.
pub(super) fn substitute(
    history: &History,
    table: &Table,
    features: &[f32],
    wanted: usize,
    params: &GlobalParams,
) -> usize {
    if !history.barred(wanted) {
        return wanted;
    }
    let next = history.picks.front().and_then(|&last| table.next(last as usize));
    let distance = |j: usize| table.distance(features, j).min(params.cap);
    let cheapest = |barred: &dyn Fn(usize) -> bool| {
        let nearest = table.nearest(features, barred).map(|j| (distance(j), j));
        let jump = match nearest {
            // All are as far that are at least as far as the cap.
            Some((cap, _)) if cap >= params.cap => {
                (0..table.count()).find(|&j| !barred(j)).map(|j| (params.cap, j))
            }
            nearest => nearest,
        };
        let run = next.filter(|&j| !barred(j)).map(|j| (distance(j), j));
        let jump = jump.map(|(distance, j)| (distance + params.switch_cost, j));
        run.into_iter().chain(jump).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, j)| j)
    };
    let longest_unused = || (0..table.count()).min_by_key(|&j| history.last_used(j));
    let best = cheapest(&|j| history.barred(j)).or_else(|| cheapest(&|j| history.in_cool_off(j)));
    best.or_else(longest_unused).unwrap_or(wanted)
}

/// Adds a cost to units that recur too early, twice as much each time, and searches the blocks around them again; then
/// replaces those that remain. If replacing alone is cheaper, as among few units, that result is used.
pub(super) fn repair(programme: &mut Programme<'_>, params: &GlobalParams) -> Repair {
    let columns = programme.table.count();
    let mut found = repeats(&programme.path, programme.table, params);
    let mut repair = Repair { repeats: found.len(), ..Repair::default() };
    if found.is_empty() {
        return repair;
    }
    let (substituted, replaced) = enforce(programme, params);
    let cost = |path: &[usize]| programme.table.cost(programme.target, path, params);
    let (substituted_cost, mean) = (cost(&substituted), cost(&programme.path) / substituted.len() as f64);
    // Enough to be felt at once, little enough not to chase the path from where it is good.
    let mut surcharge = (0.5 * params.switch_cost).max(0.1 * mean).max(1e-3) as f32;
    // With too few units no price helps.
    while !found.is_empty() && repair.rounds < ROUNDS && columns > params.cool_off {
        let mut changed = vec![false; programme.blocks()];
        for &row in &found {
            let cell = (programme.path[row], surcharge);
            programme.surcharges.entry(row).or_default().push(cell);
            changed[row / programme.block] = true;
        }
        programme.solve(&changed);
        found = repeats(&programme.path, programme.table, params);
        repair.rounds += 1;
        surcharge *= 2.0;
    }
    (programme.path, repair.replaced) = enforce(programme, params);
    if substituted_cost < programme.table.cost(programme.target, &programme.path, params) {
        (programme.path, repair.replaced) = (substituted, replaced);
    }
    repair
}

/// The path with each unit replaced that recurs too early, and the number of replacements.
fn enforce(programme: &Programme<'_>, params: &GlobalParams) -> (Vec<usize>, usize) {
    let mut history = new_history(programme.table, params);
    let mut path: Vec<usize> = Vec::with_capacity(programme.path.len());
    let mut replaced = 0;
    for (row, &wanted) in programme.path.iter().enumerate() {
        let features = programme.row(row);
        let column = substitute(&history, programme.table, features, wanted, params);
        replaced += usize::from(column != wanted);
        history.record(column as u32);
        path.push(column);
    }
    (path, replaced)
}
