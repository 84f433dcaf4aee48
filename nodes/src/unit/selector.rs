//! Which unit of a database sounds most like each unit of a target: exact search in bounded memory.

use super::kdtree::{KdTree, Search, squared};
use crate::core::fault::Fault;
use crate::core::state::StateArchive;
use crate::{archive_state, impl_state};
use std::cmp::Ordering;
use std::collections::VecDeque;
use std::sync::Arc;

/// How units are chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectorParams {
    /// Units after the present one that are compared too.
    pub look: usize,
    /// Distance beyond which a unit does not sound like the target.
    pub d_max: f64,
    /// Units for which a chosen one is not chosen again.
    pub cool_off: usize,
    /// Units within which the last picks are not repeated exactly; 0 to allow it.
    pub loop_guard: usize,
    /// Whether units before the present one are compared in place of those after it.
    pub causal: bool,
    /// Most nodes of a tree and units that are looked at for one choice; `None` looks at all that matter.
    pub effort: Option<usize>,
}

/// One choice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// The unit.
    pub unit: u32,
    /// Whether nothing was near enough, and this is only the nearest.
    pub fallback: bool,
    /// Distance to the target.
    pub d1: f64,
    /// Sum of distances over the units compared; 0 for a fallback, which has none.
    pub d2: f64,
    /// Whether the search was given up before it had seen all that matter.
    pub cut: bool,
}

/// Names the first vector that is not finite, counted from 0 in what was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotFinite(pub u64);

impl NotFinite {
    /// Refuses vectors with a number that is not finite, and no vector at all.
    pub(super) fn check(window: &[f32], dims: usize) -> Result<(), Self> {
        match window.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(Self((at / dims.max(1)) as u64)),
            None if window.len() < dims => Err(Self(0)),
            None => Ok(()),
        }
    }

    /// The same vector, counted with `before` others that come first.
    #[must_use]
    pub fn after(self, before: usize) -> Self {
        Self(self.0 + before as u64)
    }
}

/// Chooses a unit of a database for each unit of a target.
///
/// # Complexity
/// O(log m) expected per target for features of few dimensions; O(m) memory.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), algorithm 1, whose table of all
/// distances is replaced by a search in the order of a lower bound: the sum of distances over a window is at least its length times
/// the distance of the means. A search that is longer than `effort` goes on with the run of units: an addition, for live use.
pub trait Selector: Send + Sync {
    /// Chooses for the next unit of the target.
    ///
    /// `window` holds the vectors that are compared, in the order of time: the present one first or, where the selector looks back,
    /// last.
    ///
    /// # Errors
    /// A feature that is not finite.
    fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite>;

    /// Goes on as if `picks`, the latest last, were all that has been chosen so far.
    fn recall(&mut self, picks: &[u32]);

    /// Saves what was chosen so far, or puts it back.
    ///
    /// # Errors
    /// When something else was saved.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault>;

    /// Another one over the same units, which share the memory of this one.
    fn another(&self) -> Box<dyn Selector>;
}

/// Features and gap-free stretches of a database.
#[derive(Clone, Debug)]
pub struct Units<'a> {
    /// `[units * dims]`.
    pub features: &'a [f32],
    /// Numbers in a vector.
    pub dims: usize,
    /// First unit and number of units of each stretch.
    pub segments: Vec<(usize, usize)>,
    /// Whether a unit may be chosen.
    pub allowed: Vec<bool>,
}

/// Most dimensions of a vector.
pub const MOST_DIMS: usize = 64;

/// A selector for vectors of `units.dims` dimensions; `None` where they are more than [`MOST_DIMS`] or no unit is allowed.
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
        17..=MOST_DIMS => Box::new(Exact::<MOST_DIMS>::new(units, params)),
        _ => return None,
    })
}

#[derive(Clone)]
struct Exact<const P: usize> {
    params: SelectorParams,
    index: Arc<Index<P>>,
    search: Search,
    window: Vec<[f64; P]>,
    past: Past,
}

/// What is known of the units, whoever chooses among them.
struct Index<const P: usize> {
    dims: usize,
    features: Vec<[f64; P]>,
    /// Segment of each unit, with its first unit and the one after its last.
    segment: Vec<(u32, u32)>,
    allowed: Vec<bool>,
    /// How many are allowed.
    choosable: usize,
    /// Every unit that may be chosen, by its features.
    near: KdTree<P>,
    /// Every unit with room for a whole window, by the mean of its window; of those whose windows are alike the first alone.
    means: KdTree<P>,
    /// The next unit whose window is like that of this one, or [`LAST`].
    twins: Vec<u32>,
}

/// Marks a unit after which no other has a window like its own.
const LAST: u32 = u32::MAX;

/// Nearest units that are looked at before those of a low bound.
const SEEDS: usize = 16;

/// One search for the unit of one target.
struct Running<const P: usize> {
    /// The unit that may be chosen although it is barred.
    rested: Option<usize>,
    /// The unit after the last pick.
    next: Option<usize>,
    /// Mean of the target's window.
    mean: [f64; P],
    best: Option<Found>,
}

/// A unit that may be chosen.
#[derive(Clone, Copy)]
struct Found {
    choice: Choice,
    continues: bool,
    /// Squared distance of the means.
    bound: f64,
}

impl Found {
    /// What decides between two, the lesser first.
    fn key(&self) -> (f64, bool, f64, u32) {
        (self.choice.d2, !self.continues, self.bound, self.choice.unit)
    }
}

/// What was chosen so far.
#[derive(Clone)]
struct Past {
    /// One more than the target for which a unit was last chosen; 0 where it never was.
    used: Vec<u64>,
    /// Targets so far.
    now: u64,
    /// The last picks, the latest first.
    picks: VecDeque<u32>,
    /// Units that would repeat the last picks.
    guarded: Vec<u32>,
    cool_off: u64,
    loop_guard: usize,
}
impl_state!(Past { used, now, picks });

impl Past {
    fn new(units: usize, params: &SelectorParams) -> Self {
        Self {
            used: vec![0; units],
            now: 0,
            picks: VecDeque::with_capacity(params.loop_guard + 5),
            guarded: Vec::new(),
            cool_off: params.cool_off as u64,
            loop_guard: params.loop_guard,
        }
    }

    /// Whether a unit was chosen for one of the last targets.
    fn cooling(&self, unit: usize) -> bool {
        let used = self.used[unit];
        used > 0 && self.now + 1 - used <= self.cool_off
    }

    fn barred(&self, unit: usize) -> bool {
        self.cooling(unit) || self.guarded.contains(&(unit as u32))
    }

    /// Finds the units that would go on with an exact repeat of the last picks.
    fn guard(&mut self) {
        self.guarded.clear();
        let picks = &self.picks;
        // `picks[k - 1]` was chosen k targets ago.
        for lag in 1..=self.loop_guard.min(picks.len().saturating_sub(3)) {
            if (0..3).all(|k| picks.get(lag + k) == picks.get(k)) {
                self.guarded.extend(picks.get(lag - 1));
            }
        }
    }

    /// Lets every unit rest for long enough.
    fn forget(&mut self) {
        self.now += self.cool_off + 1;
        self.picks.clear();
    }

    fn note(&mut self, unit: u32) {
        self.now += 1;
        self.used[unit as usize] = self.now;
        if self.picks.len() == self.loop_guard + 4 {
            self.picks.pop_back();
        }
        self.picks.push_front(unit);
    }
}

impl<const P: usize> Index<P> {
    fn new(units: &Units<'_>, params: &SelectorParams) -> Self {
        let features: Vec<[f64; P]> = units.features.chunks_exact(units.dims).map(padded).collect();
        let mut segment = vec![(0, 0); features.len()];
        for &(from, count) in &units.segments {
            segment[from..from + count].fill((from as u32, (from + count) as u32));
        }
        let all = (0..features.len()).filter(|&j| units.allowed[j]);
        let near = KdTree::new(all.clone().map(|j| (j as u32, features[j])).collect());
        let mut index = Self {
            dims: units.dims,
            features,
            segment,
            choosable: units.allowed.iter().filter(|&&a| a).count(),
            allowed: units.allowed.clone(),
            near,
            means: KdTree::new(Vec::new()),
            twins: Vec::new(),
        };
        let whole = all.filter_map(|j| {
            let start = index.start(j, params.look, params.causal)?;
            Some((j as u32, mean(&index.features[start..][..=params.look])))
        });
        let whole = whole.collect();
        (index.means, index.twins) = index.families(whole, params);
        index
    }

    /// The tree of all windows, of which those that are alike are one, and what leads from one of these to the next.
    fn families(&self, mut whole: Vec<(u32, [f64; P])>, params: &SelectorParams) -> (KdTree<P>, Vec<u32>) {
        let window = |j: u32| {
            let start = self.start(j as usize, params.look, params.causal).unwrap_or(0);
            self.features[start..][..=params.look].as_flattened()
        };
        let order = |a: &[f64], b: &[f64]| {
            let differs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
            differs.unwrap_or(Ordering::Equal)
        };
        whole.sort_unstable_by(|(j, a), (k, b)| {
            order(a, b).then_with(|| order(window(*j), window(*k))).then(j.cmp(k))
        });
        let (mut twins, mut firsts) = (vec![LAST; self.features.len()], Vec::new());
        let mut last: Option<u32> = None;
        for (j, mean) in whole {
            match last {
                Some(k) if window(k) == window(j) => twins[k as usize] = j,
                _ => firsts.push((j, mean)),
            }
            last = Some(j);
        }
        (KdTree::new(firsts), twins)
    }

    /// The next unit whose window is like that of unit `j`.
    fn twin(&self, j: u32) -> Option<u32> {
        self.twins.get(j as usize).copied().filter(|twin| *twin != LAST)
    }

    /// First unit of the window of `look + 1` units at unit `j`; `None` where it would leave the segment.
    fn start(&self, j: usize, look: usize, causal: bool) -> Option<usize> {
        let (from, to) = self.segment[j];
        if causal {
            j.checked_sub(look).filter(|&start| start >= from as usize)
        } else {
            (j + look < to as usize).then_some(j)
        }
    }
}

impl<const P: usize> Exact<P> {
    fn new(units: &Units<'_>, params: SelectorParams) -> Self {
        let index = Arc::new(Index::new(units, &params));
        Self {
            past: Past::new(index.features.len(), &params),
            window: Vec::with_capacity(params.look + 1),
            search: Search::default(),
            index,
            params,
        }
    }

    /// The unit after the last pick, in the same segment.
    fn continuation(&self) -> Option<usize> {
        let last = *self.past.picks.front()? as usize;
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

    /// Unit `j` as a choice, where it may be chosen and is better than `best`.
    fn better(&self, j: usize, bound: Option<f64>, search: &Running<P>) -> Option<Found> {
        if search.rested != Some(j) && self.past.barred(j) {
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
        let found = Found { choice, continues: search.next == Some(j), bound };
        (search.best.as_ref().is_none_or(|best| found.key() < best.key())).then_some(found)
    }

    /// The best admissible unit.
    fn best(&mut self, rested: Option<usize>) -> Option<Choice> {
        let mut running = Running { rested, next: self.continuation(), mean: mean(&self.window), best: None };
        if self.window.len() <= self.params.look {
            // Windows that an end of the target cuts short have no tree of means.
            let most = self.params.effort.unwrap_or(usize::MAX);
            if self.index.features.len() > most {
                self.search.left = Some(0);
            }
            for j in 0..self.index.features.len().min(most) {
                let found = if self.index.allowed[j] { self.better(j, None, &running) } else { None };
                running.best = found.or(running.best);
            }
            return running.best.map(|found| found.choice);
        }
        if let Some(j) = running.next {
            running.best = self.better(j, None, &running);
        }
        let mut memory = std::mem::take(&mut self.search);
        let all = running.best.is_none() && self.seed(&mut running, &mut memory);
        // Nothing is better than no distance at all: it goes on the run, or is the first such unit that the seeds met. In silence, where
        // thousands of units are alike, their bounds alone would not rule out one of them.
        let perfect = running.best.is_some_and(|best| best.choice.d2 == 0.0);
        if !all && !perfect {
            self.by_bound(&mut running, &mut memory);
        }
        self.search = memory;
        running.best.map(|found| found.choice)
    }

    /// Looks at the nearest units until one may be chosen and some more were seen; true where all within `d_max` were seen.
    fn seed(&self, running: &mut Running<P>, memory: &mut Search) -> bool {
        let (mut seen, mut all) = (0, true);
        // The distance as compared with `d_max` is rounded once more.
        let within = (self.params.d_max * (1.0 + 1e-9)).powi(2);
        self.index.near.nearest(self.present(), within, memory, |_, label| {
            running.best = self.better(label as usize, None, running).or(running.best);
            seen += 1;
            all = running.best.is_none() || seen < SEEDS;
            if all { within } else { -1.0 }
        });
        all
    }

    /// Looks at units until no bound is low enough to be better.
    fn by_bound(&self, running: &mut Running<P>, memory: &mut Search) {
        let units = self.window.len() as f64;
        // No window whose mean is further away than this can sum to less.
        let reach = |best: &Option<Found>| {
            best.as_ref().map_or(f64::INFINITY, |best| (best.choice.d2 / units / (1.0 - 1e-9)).powi(2))
        };
        let mean = running.mean;
        self.index.means.within(&mean, reach(&running.best), memory, |bound, label| {
            // Of units with windows alike, the first that may be chosen is as good as any: at most those at rest lie before it.
            let mut family = std::iter::successors(Some(label), |j| self.index.twin(*j));
            let free = |j: &u32| running.rested == Some(*j as usize) || !self.past.barred(*j as usize);
            if let Some(j) = family.find(free) {
                running.best = self.better(j as usize, Some(bound), running).or(running.best);
            }
            reach(&running.best)
        });
    }

    /// The unit after the last pick, whatever it sounds like, unless it is barred.
    fn run_on(&self) -> Option<Choice> {
        let next = self.continuation().filter(|next| !self.past.barred(*next))?;
        let d1 = self.d1(next);
        Some(Choice { unit: next as u32, fallback: d1 > self.params.d_max, d1, ..Choice::default() })
    }

    /// The nearest unit that is not barred, whatever follows it.
    fn nearest(&mut self, least_recent: Option<usize>) -> Option<Choice> {
        let present = *self.present();
        let free = |j: usize| least_recent == Some(j) || !self.past.barred(j);
        let mut found: Option<(f64, u32)> = None;
        let mut search = std::mem::take(&mut self.search);
        self.index.near.nearest(&present, f64::INFINITY, &mut search, |distance, label| {
            found = free(label as usize).then_some((distance, label));
            if found.is_some() { -1.0 } else { f64::INFINITY }
        });
        // Of those equally near, the one that follows the last pick.
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

    /// Where every unit is barred, the one that has rested longest.
    fn least_recent(&mut self) -> Option<usize> {
        let free = |past: &Past| (0..past.used.len()).any(|j| self.index.allowed[j] && !past.barred(j));
        // No more units are barred than targets bar one each.
        if self.index.choosable > self.params.cool_off + self.past.guarded.len() || free(&self.past) {
            return None;
        }
        self.past.guarded.clear();
        if free_without_guard(&self.past, &self.index.allowed) {
            return None;
        }
        (0..self.past.used.len()).filter(|&j| self.index.allowed[j]).min_by_key(|&j| self.past.used[j])
    }
}

fn free_without_guard(past: &Past, allowed: &[bool]) -> bool {
    (0..past.used.len()).any(|j| allowed[j] && !past.cooling(j))
}

impl<const P: usize> Selector for Exact<P> {
    fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite> {
        NotFinite::check(window, self.index.dims)?;
        self.window.clear();
        self.window.extend(window.chunks_exact(self.index.dims).map(padded::<P>));
        self.past.guard();
        let rested = self.least_recent();
        self.search.left = self.params.effort;
        let mut chosen = self.best(rested);
        let cut = self.search.left == Some(0);
        if cut {
            chosen = self.run_on().or(chosen);
        }
        // No more units lie before the nearest free one than are barred: that search is short without a limit.
        self.search.left = None;
        let chosen = chosen.or_else(|| self.nearest(rested)).ok_or(NotFinite(0))?;
        self.past.note(chosen.unit);
        Ok(Choice { cut, ..chosen })
    }

    fn recall(&mut self, picks: &[u32]) {
        self.past.forget();
        picks.iter().for_each(|unit| self.past.note(*unit));
    }

    archive_state!(past);

    fn another(&self) -> Box<dyn Selector> {
        Box::new(self.clone())
    }
}

fn padded<const P: usize>(vector: &[f32]) -> [f64; P] {
    let mut out = [0.0; P];
    for (out, &x) in out.iter_mut().zip(vector) {
        // Zero has one sign, so that units that are alike sort as one.
        *out = f64::from(x) + 0.0;
    }
    out
}

fn mean<const P: usize>(vectors: &[[f64; P]]) -> [f64; P] {
    let mut out = [0.0; P];
    for vector in vectors {
        for d in 0..P {
            out[d] += vector[d];
        }
    }
    out.map(|x| x / vectors.len().max(1) as f64)
}

#[cfg(test)]
mod tests;
