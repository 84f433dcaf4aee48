//! Exact search, in bounded memory, of the unit that sounds most like each unit of a target.

use std::sync::Arc;

use super::unit_index::{Index, mean, padded};
use crate::archive_state;
use crate::unit::selection::history::History;
use crate::unit::selection::kdtree::{Search, squared};
use crate::unit::selection::selector::{Choice, MAX_DIMS, NotFinite, Selector, SelectorParams, Units};

/// A selector for vectors of `units.dims` dimensions; `None` where they are more than [`MAX_DIMS`] or no unit is allowed.
#[must_use]
pub fn selector(units: &Units<'_>, params: SelectorParams) -> Option<Box<dyn Selector>> {
    if units.dims == 0 || !units.allowed.contains(&true) {
        return None;
    }
    Some(match units.dims {
        // Zeros in place of missing dimensions change no distance.
        1..=4 => Box::new(Exact::<4>::new(units, params)),
        5..=8 => Box::new(Exact::<8>::new(units, params)),
        9..=16 => Box::new(Exact::<16>::new(units, params)),
        17..=MAX_DIMS => Box::new(Exact::<MAX_DIMS>::new(units, params)),
        _ => return None,
    })
}

#[derive(Clone)]
struct Exact<const P: usize> {
    params: SelectorParams,
    index: Arc<Index<P>>,
    search: Search,
    window: Vec<[f64; P]>,
    history: History,
    costs: Costs,
}

/// An order in which units are examined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    /// By the distance of the means of the windows, which bounds the distance of the windows.
    Bound,
    /// By their own distance, which `d_max` limits.
    Distance,
}

/// Nodes and points that a search of little promise looks at before the other order has its turn.
const FIRST_TRY: f64 = 64.0;

/// Nodes and points of the first look for the nearest unit.
const FIRST_LOOK: usize = 64;

/// Recent costs of a search in each order, in nodes and points. They decide which one is tried first, and never what is found.
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

/// Number of nearest units that are examined before those of a low bound.
const SEEDS: usize = 16;

/// One search for the unit of one target.
struct SearchState<const P: usize> {
    /// The unit that may be chosen in spite of its cool-off.
    rested: Option<usize>,
    /// The unit after the last pick.
    next: Option<usize>,
    /// Mean of the target's window.
    mean: [f64; P],
    best: Option<Candidate>,
}

/// A unit that may be chosen.
#[derive(Clone, Copy)]
struct Candidate {
    choice: Choice,
    continues: bool,
    /// Squared distance of the means.
    bound: f64,
}

impl Candidate {
    /// Sort key, the lesser first.
    fn key(&self) -> (f64, bool, f64, u32) {
        (self.choice.d2, !self.continues, self.bound, self.choice.unit)
    }
}

impl<const P: usize> Exact<P> {
    fn new(units: &Units<'_>, params: SelectorParams) -> Self {
        let index = Arc::new(Index::new(units, &params));
        Self {
            history: History::new(index.features.len(), params.cool_off, params.loop_guard),
            window: Vec::with_capacity(params.look + 1),
            search: Search::default(),
            costs: Costs { bound: 0.0, distance: 0.0 },
            index,
            params,
        }
    }

    /// The unit after the last pick, in the same segment.
    fn continuation(&self) -> Option<usize> {
        let last = *self.history.picks.front()? as usize;
        let next = last + 1;
        (next < self.index.segment[last].1 as usize && self.index.allowed[next]).then_some(next)
    }

    fn present(&self) -> &[f64; P] {
        if self.params.causal { &self.window[self.window.len() - 1] } else { &self.window[0] }
    }

    /// Distance between the target and unit `j`.
    fn d1(&self, j: usize) -> f64 {
        squared(&self.index.features[j], self.present()).sqrt()
    }

    /// Unit `j` as a choice, if it may be chosen and is better than `best`.
    fn better(&self, j: usize, bound: Option<f64>, search: &SearchState<P>) -> Option<Candidate> {
        if search.rested != Some(j) && self.history.barred(j) {
            return None;
        }
        let start = self.index.start(j, self.window.len() - 1, self.params.causal)?;
        let d1 = self.d1(j);
        if d1 > self.params.d_max {
            return None;
        }
        let best = search.best.as_ref().map_or(f64::INFINITY, |best| best.choice.d2);
        let mut d2 = 0.0;
        let units = &self.index.features[start..start + self.window.len()];
        for (target, unit) in self.window.iter().zip(units) {
            d2 += squared(target, unit).sqrt();
            if d2 > best {
                return None;
            }
        }
        let bound = bound.unwrap_or_else(|| squared(&mean(units), &search.mean));
        let choice = Choice { unit: j as u32, d1, d2, ..Choice::default() };
        let found = Candidate { choice, continues: search.next == Some(j), bound };
        (search.best.as_ref().is_none_or(|best| found.key() < best.key())).then_some(found)
    }

    /// The best admissible unit.
    fn best(&mut self, rested: Option<usize>) -> Option<Choice> {
        let mut state =
            SearchState { rested, next: self.continuation(), mean: mean(&self.window), best: None };
        if self.window.len() <= self.params.look {
            // Windows that an end of the target cuts short have no tree of means.
            let limit = self.params.effort.unwrap_or(usize::MAX);
            if self.index.features.len() > limit {
                self.search.left = Some(0);
            }
            for j in 0..self.index.features.len().min(limit) {
                let found = if self.index.allowed[j] { self.better(j, None, &state) } else { None };
                state.best = found.or(state.best);
            }
            return state.best.map(|found| found.choice);
        }
        if let Some(j) = state.next {
            state.best = self.better(j, None, &state);
        }
        let mut scratch = std::mem::take(&mut self.search);
        // Nothing is better than no distance at all.
        if state.best.is_none_or(|best| best.choice.d2 > 0.0) {
            // With a limit of the effort, the order in which units are seen decides which of them are.
            match self.params.effort {
                Some(_) => self.by_seeds_and_bound(&mut state, &mut scratch),
                None => self.by_cheaper_order(&mut state, &mut scratch),
            }
        }
        self.search = scratch;
        state.best.map(|found| found.choice)
    }

    /// Examines the nearest units until one is allowed and some more have been seen; returns true if all within `d_max` have been seen.
    fn seed(&self, state: &mut SearchState<P>, scratch: &mut Search) -> bool {
        let (mut seen, mut all) = (0, true);
        // The distance as compared with `d_max` is rounded once more.
        let within = (self.params.d_max * (1.0 + 1e-9)).powi(2);
        self.index.by_features.nearest(self.present(), within, scratch, |_, label| {
            state.best = self.better(label as usize, None, state).or(state.best);
            seen += 1;
            all = state.best.is_none() || seen < SEEDS;
            if all { within } else { -1.0 }
        });
        all
    }

    /// Examines units in the order that has less to look at. Which one that is shows only on the way: both are tried in turn, with limits that grow, so
    /// that no search costs much more than the cheaper one.
    fn by_cheaper_order(&mut self, state: &mut SearchState<P>, scratch: &mut Search) {
        let (mut order, mut limit) = self.costs.first();
        let first = order;
        loop {
            scratch.left = Some(limit);
            match order {
                Order::Bound => self.by_seeds_and_bound(state, scratch),
                Order::Distance => self.by_distance(state, scratch),
            }
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

    /// Examines the nearest units if none is known, and then units until no bound is low enough.
    fn by_seeds_and_bound(&self, state: &mut SearchState<P>, scratch: &mut Search) {
        if state.best.is_none() {
            let all = self.seed(state, scratch);
            // The first unit without a distance that the seeds met is the one to choose. In silence, where thousands of units are alike, their
            // bounds alone would not rule out one of them.
            if all || state.best.is_some_and(|best| best.choice.d2 == 0.0) {
                return;
            }
        }
        self.by_bound(state, scratch);
    }

    /// Examines units within `d_max` until none is near enough: the window contains the unit, and is no nearer.
    fn by_distance(&self, state: &mut SearchState<P>, scratch: &mut Search) {
        let d_max = self.params.d_max;
        let radius = |best: &Option<Candidate>| {
            let d2 = best.as_ref().map_or(f64::INFINITY, |best| best.choice.d2);
            (d_max.min(d2) * (1.0 + 1e-9)).powi(2)
        };
        self.index.by_features.within(self.present(), radius(&state.best), scratch, |_, label| {
            state.best = self.better(label as usize, None, state).or(state.best);
            radius(&state.best)
        });
    }

    /// Examines units until no bound is low enough.
    fn by_bound(&self, state: &mut SearchState<P>, scratch: &mut Search) {
        let units = self.window.len() as f64;
        // No window whose mean is further away than this can sum to less.
        let radius = |best: &Option<Candidate>| {
            best.as_ref().map_or(f64::INFINITY, |best| (best.choice.d2 / units / (1.0 - 1e-9)).powi(2))
        };
        let mean = state.mean;
        self.index.by_mean.within(&mean, radius(&state.best), scratch, |bound, label| {
            // Among units with equal windows the first that may be chosen is as good as any: only those in their
            // cool-off lie before it.
            let mut equal_windows = std::iter::successors(Some(label), |j| self.index.next_equal_window(*j));
            let free = |j: &u32| state.rested == Some(*j as usize) || !self.history.barred(*j as usize);
            if let Some(j) = equal_windows.find(free) {
                state.best = self.better(j as usize, Some(bound), state).or(state.best);
            }
            radius(&state.best)
        });
    }

    /// The unit after the last pick, whatever it sounds like, unless it is barred.
    fn continue_run(&self) -> Option<Choice> {
        let next = self.continuation().filter(|next| !self.history.barred(*next))?;
        let d1 = self.d1(next);
        Some(Choice { unit: next as u32, fallback: d1 > self.params.d_max, d1, ..Choice::default() })
    }

    /// The nearest unit that is not barred, whatever follows it.
    fn nearest(&mut self, least_recent: Option<usize>) -> Option<Choice> {
        let present = *self.present();
        let free = |j: usize| least_recent == Some(j) || !self.history.barred(j);
        let mut found: Option<(f64, u32)> = None;
        let mut search = std::mem::take(&mut self.search);
        // A first look limits the search in order, which has to queue all that is as near.
        let (left, mut limit) = (search.left, f64::INFINITY);
        let first_look = left.map_or(FIRST_LOOK, |left| left.min(FIRST_LOOK));
        search.left = Some(first_look);
        self.index.by_features.within(&present, limit, &mut search, |distance, label| {
            if distance < limit && free(label as usize) {
                limit = distance;
            }
            limit
        });
        search.left = left.map(|left| left - (first_look - search.left.unwrap_or(0)));
        self.index.by_features.nearest(&present, limit, &mut search, |distance, label| {
            found = free(label as usize).then_some((distance, label));
            if found.is_some() { -1.0 } else { limit }
        });
        // Among equally near ones, the one that follows the last pick.
        if let Some(next) = self.continuation().filter(|next| free(*next)) {
            let distance = squared(&self.index.features[next], &present);
            found = found.filter(|(least, _)| *least < distance).or(Some((distance, next as u32)));
        }
        self.search = search;
        found.map(|(distance, unit)| Choice {
            unit,
            fallback: true,
            d1: distance.sqrt(),
            ..Choice::default()
        })
    }

    /// Returns the least recently used unit, if all are in their cool-off.
    fn least_recent(&mut self) -> Option<usize> {
        let free =
            |history: &History| (0..history.used.len()).any(|j| self.index.allowed[j] && !history.barred(j));
        // No more units are barred than targets bar one each.
        if self.index.allowed_count > self.params.cool_off + self.history.guarded.len() || free(&self.history)
        {
            return None;
        }
        self.history.guarded.clear();
        if free_without_guard(&self.history, &self.index.allowed) {
            return None;
        }
        (0..self.history.used.len()).filter(|&j| self.index.allowed[j]).min_by_key(|&j| self.history.used[j])
    }
}

fn free_without_guard(history: &History, allowed: &[bool]) -> bool {
    (0..history.used.len()).any(|j| allowed[j] && !history.in_cool_off(j))
}

impl<const P: usize> Selector for Exact<P> {
    fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite> {
        NotFinite::check(window, self.index.dims)?;
        self.window.clear();
        self.window.extend(window.chunks_exact(self.index.dims).map(padded::<P>));
        let rested = self.least_recent();
        self.search.left = self.params.effort;
        let mut chosen = self.best(rested);
        let cut = self.search.left == Some(0);
        if cut {
            chosen = self.continue_run().or(chosen);
        }
        // No more units lie before the nearest free one than are barred: that search is short without a limit.
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
