//! Cuts of a flux whose end is not known yet.

use super::segments::{Gaussian, InflectionFinder, SegmentRules, SmoothFlux, join_short, split_long};
use crate::feature::flux::reflected;
use crate::impl_state;
use std::collections::VecDeque;

/// Frames by which the smoothed flux is known beyond the item whose curvature is examined: slopes at its inflection need them.
const MARGIN: i64 = 3;

/// Finds the cuts of a flux item by item, with a bounded look-ahead.
///
/// Inflection points between two segments of at least `min` samples each remain. Those around shorter ones form groups that are independent
/// of each other, and are joined as soon as they are complete. So the cuts are those of [`cuts`](super::segments::cuts), except
/// - where a group of short segments spans more than half of `max`: its part so far is joined by itself,
/// - where no inflection follows within twice `max`, as in silence: the steepest frame within `max` is cut, of equal ones the last,
/// - where the flux is flat for longer than a quarter of `max` between opposite curvatures: there is no cut in the middle of it.
///
/// # Complexity
/// O(`max` / hop) memory.
pub struct CutStream {
    rules: SegmentRules,
    /// Lowest slope of an onset, per frame.
    onset_slope: f64,
    gaussian: Gaussian,
    /// Items from number `history` on, and smoothed ones from `smooth_first` on.
    flux: VecDeque<f64>,
    history: i64,
    smooth: Vec<f64>,
    smooth_first: i64,
    finder: InflectionFinder,
    /// The next item whose curvature is examined.
    examined: i64,
    /// The latest cut that no rule of short segments removes.
    left: usize,
    /// Candidates after it: sample, and slope.
    candidates: Vec<(usize, f64)>,
    /// Cuts that are left of joined groups.
    joined: VecDeque<usize>,
    /// The latest cut.
    start: usize,
    cuts: Vec<usize>,
    onsets: Vec<usize>,
    /// Groups that were joined before they were complete.
    pub early_joins: u64,
    /// Cuts that were made before the end of their segment was known.
    pub early_splits: u64,
}

impl_state!(CutStream {
    flux,
    history,
    smooth,
    smooth_first,
    finder,
    examined,
    left,
    candidates,
    joined,
    start,
    cuts,
    onsets,
    early_joins,
    early_splits
});

impl CutStream {
    /// A stream before its first item.
    #[must_use]
    pub fn new(rules: SegmentRules, onset_slope: f64) -> Self {
        Self {
            gaussian: Gaussian::new(rules.sigma),
            rules,
            onset_slope,
            flux: VecDeque::new(),
            history: 0,
            smooth: Vec::new(),
            smooth_first: 0,
            finder: InflectionFinder::default(),
            examined: 1,
            left: 0,
            candidates: Vec::new(),
            joined: VecDeque::new(),
            start: 0,
            cuts: vec![0],
            onsets: Vec::new(),
            early_joins: 0,
            early_splits: 0,
        }
    }

    /// Samples by which the latest item must be ahead of a sample for all cuts before it to be known.
    #[must_use]
    pub fn latency(rules: &SegmentRules) -> usize {
        let (hop, max) = (rules.frames.hop.max(1), rules.max.max(2));
        let frames = Gaussian::new(rules.sigma).radius() + MARGIN + 3;
        2 * max - rules.min.min(max) + max / 2 + max / 8 + frames as usize * hop
    }

    fn hop(&self) -> usize {
        self.rules.frames.hop.max(1)
    }

    fn max(&self) -> usize {
        self.rules.max.max(2)
    }

    /// Takes the next item.
    pub fn next(&mut self, flux: f32) {
        self.flux.push_back(f64::from(flux));
        self.advance(None);
    }

    /// Ends the flux of a sound of `len` samples.
    pub fn finish(&mut self, len: usize) {
        self.advance(Some(len));
        self.cuts.push(len);
    }

    /// Moves the cuts and the onsets so far to the ends of two lists.
    pub fn take(&mut self, cuts: &mut VecDeque<usize>, onsets: &mut VecDeque<usize>) {
        cuts.extend(self.cuts.drain(..));
        onsets.extend(self.onsets.drain(..));
    }

    fn advance(&mut self, end: Option<usize>) {
        let received = self.history + self.flux.len() as i64;
        let len = end.map(|_| received);
        let known = if end.is_some() { received } else { received - self.gaussian.radius() };
        for k in self.smooth_first + self.smooth.len() as i64..known {
            let item = |i: i64| self.flux[(reflected(i, len) - self.history) as usize];
            self.smooth.push(self.gaussian.mean(k, item));
        }
        let until = if end.is_some() { received - 1 } else { known - MARGIN };
        while self.examined < until {
            self.examine(self.examined, end);
            self.examined += 1;
        }
        let horizon = if end.is_some() { usize::MAX } else { self.horizon() };
        self.join(horizon, end);
        self.split(self.candidates.first().map_or(horizon, |cut| cut.0), end);
        self.forget(known);
    }

    /// Finds the inflection at an item.
    fn examine(&mut self, k: i64, end: Option<usize>) {
        let at = (k - 1 - self.smooth_first) as usize;
        let s = [self.smooth[at], self.smooth[at + 1], self.smooth[at + 2]];
        let found = self.finder.next(k, s);
        let longest_flat = (self.max() / (4 * self.hop())) as i64;
        if self.finder.latest.is_some_and(|(j, _)| k - j >= longest_flat.max(1)) {
            self.finder.latest = None;
        }
        let Some(inflection) = found else { return };
        let slope = SmoothFlux { first: self.smooth_first, items: &self.smooth }.slope(inflection.position);
        let sample = inflection.sample(self.hop());
        if sample == 0 || end.is_some_and(|len| sample >= len) {
            return;
        }
        if inflection.rising && slope >= self.onset_slope {
            self.onsets.push(sample);
        }
        if self.rules.kind.takes(&inflection) && self.candidates.last().is_none_or(|cut| cut.0 != sample) {
            self.candidates.push((sample, slope));
        }
    }

    /// The first sample at which an inflection can still be found.
    fn horizon(&self) -> usize {
        let k = self.examined - 1;
        // The next one lies in the middle of a flat run.
        let position = match self.finder.latest {
            Some((j, _)) if j < k => 0.5 * (j + k) as f64,
            _ => k as f64,
        };
        ((position - 0.5) * self.hop() as f64).floor().max(0.0) as usize
    }

    /// Joins the groups of short segments that are complete.
    fn join(&mut self, horizon: usize, end: Option<usize>) {
        let min = self.rules.min.max(1);
        while let Some((first, last)) = self.candidates.first().zip(self.candidates.last()) {
            let gap = self.candidates.windows(2).position(|pair| pair[1].0 - pair[0].0 >= min);
            let follows = end.unwrap_or(horizon).saturating_sub(last.0) >= min;
            let complete = gap.map(|k| k + 1).or((follows || end.is_some()).then_some(self.candidates.len()));
            let too_long = horizon.saturating_sub(first.0) > (self.max() / 2).max(min);
            let Some(count) = complete.or(too_long.then_some(self.candidates.len())) else { break };
            self.early_joins += u64::from(complete.is_none());
            let group: Vec<(usize, f64)> =
                self.candidates.drain(..count).map(|(at, slope)| (at - self.left, slope)).collect();
            // What follows is long enough, unless it is the end.
            let next = group[count - 1].0 + min;
            let stop = match end {
                Some(len) if self.candidates.is_empty() => len - self.left,
                _ => next,
            };
            let left = self.left;
            self.joined.extend(join_short(stop, &group, min).into_iter().map(|at| left + at));
            self.left = self.joined.back().copied().unwrap_or(left).max(left);
        }
    }

    /// Adds the cuts up to `decided`, and those within long segments.
    fn split(&mut self, decided: usize, end: Option<usize>) {
        loop {
            let s = SmoothFlux { first: self.smooth_first, items: &self.smooth };
            if let Some(next) = self.joined.pop_front() {
                split_long(s, [self.start, next], &self.rules, &mut self.cuts);
                self.cuts.push(next);
                self.start = next;
            } else if let Some(len) = end {
                split_long(s, [self.start, len], &self.rules, &mut self.cuts);
                return;
            } else if decided > self.start + 2 * self.max() {
                let last = self.start + self.max();
                let cut = s.steepest([self.start + self.rules.min, last], last, self.hop()).unwrap_or(last);
                self.cuts.push(cut);
                self.start = cut;
                self.early_splits += 1;
            } else {
                return;
            }
        }
    }

    /// Discards items that nothing needs.
    fn forget(&mut self, known: i64) {
        let needed = known - self.gaussian.radius() - 1;
        let old = (needed - self.history).clamp(0, self.flux.len() as i64);
        self.flux.drain(..old as usize);
        self.history += old;
        let needed = ((self.start / self.hop()) as i64 - MARGIN).min(self.examined - MARGIN);
        let old = needed - self.smooth_first;
        // Moving the rest pays off only after many.
        if old > 256 {
            self.smooth.drain(..old as usize);
            self.smooth_first += old;
        }
    }
}
