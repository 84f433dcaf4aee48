//! Repair of an exact path in which units come back before the end of their cool-off.

use super::cool_off::CoolOff;
use super::path::GlobalParams;
use super::programme::Programme;

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

/// Rows at which a column recurs before the end of its cool-off.
fn repeats(path: &[usize], columns: usize, cool_off: usize) -> Vec<usize> {
    let mut cool_off = CoolOff::new(columns, cool_off);
    let mut found = Vec::new();
    for (row, &column) in path.iter().enumerate() {
        if cool_off.barred(row, column) {
            found.push(row);
        }
        cool_off.record(row, column);
    }
    found
}

/// Adds a cost to units that recur too early, twice as much each time, and searches the blocks around them again; then
/// replaces those that remain. If replacing alone is cheaper, as among few units, that result is used.
pub(super) fn repair(programme: &mut Programme<'_>, params: &GlobalParams) -> Repair {
    let columns = programme.table.count();
    let mut found = repeats(&programme.path, columns, params.cool_off);
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
        found = repeats(&programme.path, columns, params.cool_off);
        repair.rounds += 1;
        surcharge *= 2.0;
    }
    (programme.path, repair.replaced) = enforce(programme, params);
    if substituted_cost < programme.table.cost(programme.target, &programme.path, params) {
        (programme.path, repair.replaced) = (substituted, replaced);
    }
    repair
}

/// The path with each unit replaced that recurs too early, and the number of replaced units.
fn enforce(programme: &Programme<'_>, params: &GlobalParams) -> (Vec<usize>, usize) {
    let mut cool_off = CoolOff::new(programme.table.count(), params.cool_off);
    let mut path: Vec<usize> = Vec::with_capacity(programme.path.len());
    let mut replaced = 0;
    for (row, &wanted) in programme.path.iter().enumerate() {
        let features = programme.row(row);
        let column =
            cool_off.substitute(programme.table, features, row, wanted, path.last().copied(), params);
        replaced += usize::from(column != wanted);
        cool_off.record(row, column);
        path.push(column);
    }
    (path, replaced)
}
