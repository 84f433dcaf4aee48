//! Exact search, in bounded memory, for the unit that is most similar to each unit of a target.

use std::cmp::Ordering;
use std::sync::Arc;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16};

use super::unit_index::{Index, mean, squared_of_means};
use crate::archive_state;
use crate::unit::selection::history::History;
use crate::unit::selection::kdtree::{LANES, Search, squared};
use crate::unit::selection::selector::{Choice, MAX_DIMS, NotFinite, Selector, SelectorParams, Units};

/// A selector for vectors of `units.dims` dimensions; `None` where they are more than [`MAX_DIMS`] or no unit is allowed.
#[must_use]
pub fn selector(units: &Units<'_>, params: SelectorParams) -> Option<Box<dyn Selector>> {
    let possible = (1..=MAX_DIMS).contains(&units.dims) && units.allowed.contains(&true);
    possible.then(|| Box::new(Exact::new(units, params)) as Box<dyn Selector>)
}

#[derive(Clone)]
struct Exact {
    params: SelectorParams,
    index: Arc<Index>,
    search: Search,
    window: Window,
    history: History,
    costs: Costs,
    level: Level,
}

/// The vectors of a target that are compared.
#[derive(Clone, Debug, Default)]
struct Window {
    dims: usize,
    /// Vector after vector.
    rows: Vec<f32>,
    /// Dimension after dimension, each with zeros up to a multiple of [`LANES`].
    columns: Vec<f32>,
    /// 1 for each vector, and zeros up to a multiple of [`LANES`].
    compared: Vec<f32>,
    /// Mean of the vectors.
    mean: Vec<f32>,
}

/// An order in which units are examined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    /// By the distance of the means of the windows, which bounds the distance of the windows.
    Bound,
    /// By their own distance, which `d_max` limits.
    Distance,
}

/// Nodes and points that an unpromising search examines before the other order has its turn.
const FIRST_TRY: f64 = 64.0;

/// Recent costs of a search in each order, in nodes and points. They decide which one is tried first, and never affect the result.
#[derive(Clone, Copy, Debug)]
struct Costs {
    bound: f64,
    distance: f64,
}

impl Costs {
    fn of(&mut self, order: Order) -> &mut f64 {
        match order {
            Order::Bound => &mut self.bound,
            Order::Distance => &mut self.distance,
        }
    }

    /// The order that has been cheaper, and the cost within which it should end.
    fn first(&self) -> (Order, usize) {
        let order = if self.bound <= self.distance { Order::Bound } else { Order::Distance };
        (order, (2.0 * self.bound.min(self.distance) + FIRST_TRY) as usize)
    }

    /// Records that a search in an order has ended at a cost. The other order is tried again when it has not been for a while.
    fn ended(&mut self, order: Order, cost: usize) {
        let recent = self.of(order);
        *recent += 0.1 * (cost as f64 - *recent);
        *self.of(order.other()) *= 0.99;
    }

    /// Records that a search in an order costs more than this.
    fn exceeds(&mut self, order: Order, cost: usize) {
        let recent = self.of(order);
        *recent = recent.max(cost as f64);
    }
}

impl Order {
    fn other(self) -> Self {
        match self {
            Self::Bound => Self::Distance,
            Self::Distance => Self::Bound,
        }
    }
}

/// Part by which a sum of distances in single precision is at most too large: 64 dimensions and 16 vectors add 6e-6.
const ROUNDING: f64 = 1e-5;

/// One search for the unit of one target.
struct SearchState {
    /// The unit that may be chosen in spite of its cool-off.
    rested: Option<usize>,
    /// The unit after the last pick.
    next: Option<usize>,
    best: Option<Choice>,
    /// A sum of distances in single precision that is above this one is greater than that of the best.
    limit: f32,
}

impl SearchState {
    fn set_best(&mut self, best: Choice, units: usize) {
        self.best = Some(best);
        // The square root of a square that is too small for a normal number has few digits.
        self.limit = (best.d2 * (1.0 + ROUNDING)) as f32 + f32::MIN_POSITIVE.sqrt() * units as f32;
    }
}

impl Window {
    fn set(&mut self, rows: &[f32], dims: usize) {
        self.dims = dims;
        self.rows.clear();
        self.rows.extend_from_slice(rows);
        let padded = self.padded();
        self.columns.clear();
        self.columns.resize(dims * padded, 0.0);
        for (k, row) in rows.chunks_exact(dims).enumerate() {
            row.iter().enumerate().for_each(|(d, x)| self.columns[d * padded + k] = *x);
        }
        self.compared.clear();
        self.compared.resize(self.len(), 1.0);
        self.compared.resize(padded, 0.0);
        self.mean.clear();
        self.mean.extend(mean(rows, dims));
    }

    fn len(&self) -> usize {
        self.rows.len() / self.dims.max(1)
    }

    fn padded(&self) -> usize {
        self.len().next_multiple_of(LANES)
    }
}

impl Exact {
    fn new(units: &Units<'_>, params: SelectorParams) -> Self {
        let index = Arc::new(Index::new(units, &params));
        Self {
            history: History::new(index.allowed.len(), &index.same, params.cool_off, params.loop_guard),
            window: Window::default(),
            search: Search::default(),
            costs: Costs { bound: 0.0, distance: 0.0 },
            level: Level::new(),
            index,
            params,
        }
    }

    /// The unit after the last pick, in the same segment.
    fn continuation(&self) -> Option<usize> {
        let last = *self.history.picks.front()? as usize;
        let next = last + 1;
        (next < self.index.segment_end[last] as usize && self.index.allowed[next]).then_some(next)
    }

    /// The vector for which a unit is chosen.
    fn present(&self) -> &[f32] {
        let at = if self.params.causal { self.window.len() - 1 } else { 0 };
        &self.window.rows[at * self.window.dims..][..self.window.dims]
    }

    /// Distance between the target and unit `j`.
    fn d1(&self, j: usize) -> f64 {
        squared(self.index.rows(j, 1), self.present()).sqrt()
    }

    /// Returns true if the window from unit `start` on is certainly further away than the best of a search.
    #[inline(always)]
    fn is_beyond<S: Simd>(&self, simd: S, start: usize, limit: f32) -> bool {
        let (units, padded) = (self.window.len(), self.window.padded());
        // In double precision, so that a long window adds no error.
        let mut sum = 0.0_f64;
        for part in (0..units).step_by(LANES) {
            let mut squares = f32x16::splat(simd, 0.0);
            for d in 0..self.window.dims {
                let target = &self.window.columns[d * padded + part..][..LANES];
                let difference = f32x16::from_slice(simd, self.index.column(d, start + part))
                    - f32x16::from_slice(simd, target);
                squares = difference.mul_add(difference, squares);
            }
            let compared = f32x16::from_slice(simd, &self.window.compared[part..][..LANES]);
            sum += f64::from((squares.sqrt() * compared).reduce_sum());
            // A square that exceeds single precision says nothing.
            if sum > f64::from(limit) && sum.is_finite() {
                return true;
            }
        }
        false
    }

    /// Makes unit `j` the best of a search, or the first that may be chosen of those with equal windows, if it is better; returns true if it is.
    #[inline(always)]
    fn examine<S: Simd>(&self, simd: S, j: u32, state: &mut SearchState) -> bool {
        let Some(start) = self.index.start(j as usize, self.window.len() - 1) else {
            return false;
        };
        if self.is_beyond(simd, start, state.limit) {
            return false;
        }
        // Among units with equal windows the first that may be chosen is as good as any: only those in their cool-off lie before it.
        let free = |j: &usize| state.rested == Some(*j) || !self.history.barred(*j);
        let better = self.index.equal_windows(j).find(free).and_then(|j| self.better(j, state));
        better.is_some_and(|better| {
            state.set_best(better, self.window.len());
            true
        })
    }

    /// Unit `j` as a choice, if it is near enough and better than the best.
    fn better(&self, j: usize, state: &SearchState) -> Option<Choice> {
        let start = self.index.start(j, self.window.len() - 1)?;
        let d1 = self.d1(j);
        if d1 > self.params.d_max {
            return None;
        }
        let dims = self.window.dims;
        let vectors = |start: usize| self.index.rows(start, self.window.len());
        let pairs = self.window.rows.chunks_exact(dims).zip(vectors(start).chunks_exact(dims));
        let d2 = pairs.map(|(target, unit)| squared(target, unit).sqrt()).sum();
        let found = Choice { unit: j as u32, d1, d2, ..Choice::default() };
        let Some(best) = state.best else { return Some(found) };
        let breaks_run = |choice: &Choice| state.next != Some(choice.unit as usize);
        let bound = |choice: &Choice| {
            let start = self.index.start(choice.unit as usize, self.window.len() - 1);
            start.map(|start| squared_of_means(vectors(start), &self.window.rows, dims))
        };
        let order = d2
            .total_cmp(&best.d2)
            .then_with(|| breaks_run(&found).cmp(&breaks_run(&best)))
            .then_with(|| bound(&found).partial_cmp(&bound(&best)).unwrap_or(Ordering::Equal))
            .then(found.unit.cmp(&best.unit));
        order.is_lt().then_some(found)
    }

    /// The best admissible unit.
    fn best(&mut self, rested: Option<usize>) -> Option<Choice> {
        let mut state = SearchState { rested, next: self.continuation(), best: None, limit: f32::INFINITY };
        let next = state.next.filter(|j| rested == Some(*j) || !self.history.barred(*j));
        if let Some(next) = next.and_then(|j| self.better(j, &state)) {
            state.set_best(next, self.window.len());
        }
        let mut scratch = std::mem::take(&mut self.search);
        if state.best.is_none_or(|best| best.d2 > 0.0) {
            match self.params.effort {
                // Windows that an end of the target cuts short have no tree of means.
                _ if self.window.len() <= self.params.look => {
                    self.examine_by(Order::Distance, &mut state, &mut scratch);
                }
                Some(_) => self.by_distance_then_bound(&mut state, &mut scratch),
                None => self.by_cheaper_order(&mut state, &mut scratch),
            }
        }
        self.search = scratch;
        state.best
    }

    /// Examines units in the order that needs fewer. That order is not known before: both are tried in turn, with limits that grow, so
    /// that no search costs much more than the cheaper one.
    fn by_cheaper_order(&mut self, state: &mut SearchState, scratch: &mut Search) {
        let (mut order, mut limit) = self.costs.first();
        let first = order;
        loop {
            scratch.left = Some(limit);
            self.examine_by(order, state, scratch);
            let left = scratch.left.take().unwrap_or(0);
            if left > 0 {
                return self.costs.ended(order, limit - left);
            }
            self.costs.exceeds(order, limit);
            order = order.other();
            if order == first {
                limit *= 4;
            }
        }
    }

    /// Examines some units near the target, and then units by their bounds. With a limit of the effort the order in which units are seen decides
    /// which of them are, so that it may not depend on earlier searches.
    fn by_distance_then_bound(&self, state: &mut SearchState, scratch: &mut Search) {
        let effort = scratch.left.unwrap_or(usize::MAX);
        let limit = effort.min(FIRST_TRY as usize);
        scratch.left = Some(limit);
        self.examine_by(Order::Distance, state, scratch);
        if scratch.left == Some(0) {
            scratch.left = Some(effort - limit);
            self.examine_by(Order::Bound, state, scratch);
        }
    }

    /// Examines units in an order until none that is better can be left.
    fn examine_by(&self, order: Order, state: &mut SearchState, scratch: &mut Search) {
        // Room for the rounding of sums of distances.
        let (tree, query, most, share) = match order {
            // No window whose mean is further away than the mean distance of its units can sum to less.
            Order::Bound => {
                let share = (1.0 + 1e-9) / self.window.len() as f64;
                (&self.index.by_mean, &self.window.mean[..], f64::INFINITY, share)
            }
            // The window contains the unit, and is no nearer.
            Order::Distance => (&self.index.by_features, self.present(), self.params.d_max, 1.0 + 1e-9),
        };
        let radius = |best: &Option<Choice>| best.map_or(most, |best| most.min(best.d2 * share));
        dispatch!(self.level, simd => {
            tree.within(simd, query, radius(&state.best), scratch, #[inline(always)] |label| {
                self.examine(simd, label, state).then(|| radius(&state.best))
            });
        });
    }

    /// The unit after the last pick, regardless of its sound, unless it is barred.
    fn continue_run(&self) -> Option<Choice> {
        let next = self.continuation().filter(|next| !self.history.barred(*next))?;
        let d1 = self.d1(next);
        Some(Choice { unit: next as u32, fallback: d1 > self.params.d_max, d1, ..Choice::default() })
    }

    /// The nearest unit that is not barred, regardless of the unit after it.
    fn nearest(&mut self, least_recent: Option<usize>) -> Option<Choice> {
        let free = |j: &usize| least_recent == Some(*j) || !self.history.barred(*j);
        let mut search = std::mem::take(&mut self.search);
        let of = |label| self.index.equal_windows(label).find(free).map(|j| (self.d1(j), j));
        let mut found = self.index.by_features.nearest(self.level, self.present(), &mut search, of);
        // Among equally near ones, the one that follows the last pick.
        if let Some(next) = self.continuation().filter(free) {
            let distance = self.d1(next);
            found = found.filter(|(least, _)| *least < distance).or(Some((distance, next)));
        }
        self.search = search;
        found.map(|(d1, unit)| Choice { unit: unit as u32, fallback: true, d1, ..Choice::default() })
    }

    /// Returns the least recently used unit, if all are in their cool-off.
    fn least_recent(&mut self) -> Option<usize> {
        let free = |history: &History| {
            (0..self.index.allowed.len()).any(|j| self.index.allowed[j] && !history.barred(j))
        };
        // No more units are barred than targets bar one each.
        if self.index.allowed_count > self.params.cool_off + self.history.guarded.len() || free(&self.history)
        {
            return None;
        }
        self.history.guarded.clear();
        if free_without_guard(&self.history, &self.index.allowed) {
            return None;
        }
        let allowed = (0..self.index.allowed.len()).filter(|&j| self.index.allowed[j]);
        allowed.min_by_key(|&j| self.history.last_used(j))
    }
}

fn free_without_guard(history: &History, allowed: &[bool]) -> bool {
    (0..allowed.len()).any(|j| allowed[j] && !history.in_cool_off(j))
}

impl Selector for Exact {
    fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite> {
        NotFinite::check(window, self.index.dims)?;
        self.window.set(window, self.index.dims);
        let rested = self.least_recent();
        self.search.left = self.params.effort;
        let mut chosen = self.best(rested);
        let cut = self.search.left == Some(0);
        if cut {
            chosen = self.continue_run().or(chosen);
        }
        // Few units are as near as the nearest free one: that search is short without a limit.
        self.search.left = None;
        let chosen = chosen.or_else(|| self.nearest(rested)).ok_or(NotFinite(0))?;
        self.history.record(chosen.unit);
        Ok(Choice { cut, ..chosen })
    }

    fn set_history(&mut self, picks: &[u32]) {
        self.history.release_all();
        picks.iter().for_each(|unit| self.history.record(*unit));
    }

    archive_state!(history);

    fn boxed_clone(&self) -> Box<dyn Selector> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests;
