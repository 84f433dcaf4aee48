//! Beam search for paths with costs of their joins, among the likeliest paths.

use super::path::{GlobalParams, Path};
use super::table::Table;
use crate::unit::selection::kdtree::{Search, squared};
use crate::unit::selection::selector::NotFinite;
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use std::collections::BinaryHeap;

/// Number of targets whose nearest units are looked up together.
const AHEAD: usize = 4096;

/// Costs of joins in addition to that of a jump, and the number of candidates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamParams {
    /// Costs of all paths.
    pub path: GlobalParams,
    /// Number of nearest units that are tried for each target, and of paths that are followed.
    pub candidates: usize,
    /// Price of a feature distance of 1 between the unit that would follow and the one that follows.
    pub feature: f64,
    /// Price of a step of level by a factor of e.
    pub level: f64,
    /// Price of a join without a zero crossing near it on one side.
    pub crossing: f64,
}

/// Data for the costs of joins, by column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Joins {
    /// Natural logarithm of the level of a unit.
    pub levels: Vec<f32>,
    /// True if the sound crosses zero soon after the end of a unit.
    pub leaves: Vec<bool>,
    /// True if the sound crosses zero shortly before the start of a unit.
    pub enters: Vec<bool>,
}

impl Joins {
    /// Returns the cost of a join of two columns.
    #[must_use]
    pub fn cost(&self, table: &Table, a: usize, b: usize, p: &BeamParams) -> f64 {
        if table.follows(a, b) {
            return 0.0;
        }
        // At the end of a recording no unit follows: the last unit stands for it.
        let natural = table.next(a).unwrap_or(a);
        let mut cost = p.path.switch_cost;
        if p.feature > 0.0 {
            cost += p.feature * squared(table.features(natural), table.features(b)).sqrt();
        }
        if let (Some(x), Some(y)) = (self.levels.get(natural), self.levels.get(b)) {
            cost += p.level * f64::from((x - y).abs());
        }
        let blind = self.leaves.get(a) == Some(&false) || self.enters.get(b) == Some(&false);
        cost + if blind { p.crossing } else { 0.0 }
    }

    /// Returns the total cost of a path of units, infinite if one of them is not allowed.
    ///
    /// # Shapes
    /// `target`: `[units.len() * dims]`.
    #[must_use]
    pub fn path_cost(&self, table: &Table, target: &[f32], units: &[u32], p: &BeamParams) -> f64 {
        let columns: Option<Vec<usize>> = units.iter().map(|&unit| table.column(unit)).collect();
        let Some(columns) = columns else { return f64::INFINITY };
        let free = GlobalParams { switch_cost: 0.0, ..p.path };
        let joins: f64 = columns.windows(2).map(|w| self.cost(table, w[0], w[1], p)).sum();
        table.cost(target, &columns, &free) + joins
    }
}

/// One path that is followed: its last column, its cost, and the path of the row before that it continues.
#[derive(Clone, Copy, Debug)]
struct Followed {
    column: usize,
    cost: f64,
    back: usize,
}

/// The best of the paths through the nearest units, their successors and the units of `greedy`.
///
/// The `candidates` nearest units of each target are tried, with the unit that follows each followed path and the one that `greedy`
/// chose; the best paths are followed. The path of `greedy` is always among those tried, so that without `cool_off` and `loop_guard` the path
/// found never costs more. A path in which a unit would recur too early is dropped; where none remains, one continues anyway and is
/// counted.
///
/// # Shapes
/// `target`: `[n * dims]`; `greedy`: `[n]`, or empty.
///
/// # Errors
/// A feature of the target that is not finite.
///
/// # Complexity
/// O(n K²) at worst for K candidates, much less where a jump costs something: the search for a join ends once none can be cheaper.
///
/// # Source
/// Hunt and Black, "Unit selection in a concatenative speech synthesis system using a large speech database" (ICASSP 1996).
pub fn beam(
    table: &Table,
    joins: &Joins,
    target: &[f32],
    greedy: &[u32],
    params: &BeamParams,
) -> Result<Path, NotFinite> {
    table.check(target)?;
    let greedy: Vec<Option<usize>> = greedy.iter().map(|&unit| table.column(unit)).collect();
    Ok(Beam::new(table, joins, params).path(target, &greedy))
}

struct Beam<'a> {
    table: &'a Table,
    joins: &'a Joins,
    params: &'a BeamParams,
    level: Level,
    /// Column and predecessor of each followed path, row after row.
    backpointers: Vec<(u32, u32)>,
    /// Start of each row in the trail.
    rows: Vec<usize>,
    forced: usize,
}

impl<'a> Beam<'a> {
    fn new(table: &'a Table, joins: &'a Joins, params: &'a BeamParams) -> Self {
        Self {
            table,
            joins,
            params,
            level: Level::new(),
            backpointers: Vec::new(),
            rows: Vec::new(),
            forced: 0,
        }
    }

    /// The nearest columns of a target, in no order; of equally near ones the first.
    fn nearest(&self, target: &[f32], search: &mut Search) -> Vec<u32> {
        let most = self.params.candidates.max(1);
        // Squares are not negative, so that their bits sort as they do.
        let mut found: BinaryHeap<(u64, u32)> = BinaryHeap::with_capacity(most + 1);
        dispatch!(self.level, simd => self.table.near.within(simd, target, f64::INFINITY, search, |label| {
            found.push((squared(self.table.features(label as usize), target).to_bits(), label));
            if found.len() > most {
                found.pop();
            }
            let furthest = found.peek().filter(|_| found.len() == most)?;
            Some(f64::from_bits(furthest.0).sqrt() * (1.0 + 1e-9))
        }));
        found.into_iter().map(|(_, label)| label).collect()
    }

    fn path(&mut self, target: &[f32], greedy: &[Option<usize>]) -> Path {
        let dims = self.table.dims();
        let mut paths: Vec<Followed> = Vec::new();
        let mut row = 0;
        for part in target.chunks(AHEAD * dims) {
            let rows: Vec<&[f32]> = part.chunks_exact(dims).collect();
            let near: Vec<Vec<u32>> =
                rows.par_iter().map_init(Search::default, |search, x| self.nearest(x, search)).collect();
            for (features, near) in rows.iter().zip(&near) {
                let greedy = greedy.get(row).copied().flatten();
                let mut tried: Vec<usize> = near.iter().map(|&j| j as usize).chain(greedy).collect();
                tried.extend(paths.iter().filter_map(|path| self.table.next(path.column)));
                tried.sort_unstable();
                tried.dedup();
                paths = self.follow(row, features, &paths, &tried, greedy);
                self.rows.push(self.backpointers.len());
                self.backpointers.extend(paths.iter().map(|path| (path.column as u32, path.back as u32)));
                row += 1;
            }
        }
        let columns = self.back();
        let units = self.table.named(&columns);
        let cost = self.joins.path_cost(self.table, target, &units, self.params);
        Path { units, cost, free_cost: cost, repeats: self.forced, ..Path::default() }
    }

    /// The best paths that end in the columns tried for a row, the cheapest first.
    fn follow(
        &mut self,
        row: usize,
        features: &[f32],
        before: &[Followed],
        tried: &[usize],
        greedy: Option<usize>,
    ) -> Vec<Followed> {
        let mut by_column: Vec<(usize, usize)> =
            before.iter().enumerate().map(|(k, path)| (path.column, k)).collect();
        by_column.sort_unstable();
        let run = |column: usize| {
            let k = by_column.binary_search_by_key(&column.checked_sub(1)?, |(column, _)| *column).ok()?;
            by_column.get(k).map(|(_, k)| *k)
        };
        let mut rested = true;
        let mut paths: Vec<Followed> = Vec::new();
        while paths.is_empty() {
            let reached = |&column: &usize| {
                let own = self.table.distance(features, column).min(self.params.path.cap);
                if row == 0 {
                    return Some(Followed { column, cost: own, back: 0 });
                }
                let (cost, back) = self.cheapest(row, before, column, run(column), rested)?;
                Some(Followed { column, cost: cost + own, back })
            };
            paths = tried.iter().filter_map(reached).collect();
            if paths.is_empty() {
                if !rested {
                    break;
                }
                rested = false;
                self.forced += 1;
            }
        }
        paths.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.column.cmp(&b.column)));
        let capacity = self.params.candidates.max(1);
        let also = paths.iter().skip(capacity).find(|path| Some(path.column) == greedy).copied();
        paths.truncate(capacity);
        paths.extend(also);
        paths
    }

    /// The cheapest path to a column: its cost and the path that it continues.
    fn cheapest(
        &self,
        row: usize,
        before: &[Followed],
        column: usize,
        run: Option<usize>,
        rested: bool,
    ) -> Option<(f64, usize)> {
        let free = |k: usize| !rested || !self.comes_back(row, k, column);
        let runs = run.filter(|&k| self.table.follows(before[k].column, column) && free(k));
        let mut best = runs.map(|k| (before[k].cost, k));
        for (k, path) in before.iter().enumerate() {
            let least = best.map_or(f64::INFINITY, |(cost, _)| cost);
            // The cheapest come first, and no join costs less than a jump.
            if path.cost + self.params.path.switch_cost >= least {
                break;
            }
            let cost = path.cost + self.joins.cost(self.table, path.column, column, self.params);
            if cost < least && free(k) {
                best = Some((cost, k));
            }
        }
        best
    }

    /// The columns of path `k` of the row before `row`, the latest first.
    fn columns(&self, row: usize, k: usize) -> impl Iterator<Item = usize> + Clone {
        let mut at = k;
        self.rows.iter().take(row).rev().map_while(move |&start| {
            let &(column, back) = self.backpointers.get(start + at)?;
            at = back as usize;
            Some(column as usize)
        })
    }

    /// Returns true if a column is in its cool-off on path `k` of the row before `row`, or would repeat its last columns.
    fn comes_back(&self, row: usize, k: usize, column: usize) -> bool {
        let GlobalParams { cool_off, loop_guard, .. } = self.params.path;
        // Columns that differ in level only are one.
        let sounds = || self.columns(row, k).map(|column| self.table.sound(column));
        let (mut earlier, column) = (sounds(), self.table.sound(column));
        for lag in 1..=cool_off.max(loop_guard) {
            let Some(chosen) = earlier.next() else { return false };
            // The three columns before it, here and now.
            let repeats = || earlier.clone().take(3).eq(sounds().take(3));
            if chosen == column && (lag <= cool_off || repeats()) {
                return true;
            }
        }
        false
    }

    /// Walks back from the cheapest end.
    fn back(&self) -> Vec<usize> {
        let mut at = 0;
        let mut columns = Vec::with_capacity(self.rows.len());
        for &start in self.rows.iter().rev() {
            let Some(&(column, back)) = self.backpointers.get(start + at) else { break };
            columns.push(column as usize);
            at = back as usize;
        }
        columns.reverse();
        columns
    }
}
