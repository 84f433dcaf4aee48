//! Past picks: units in their cool-off, and units that repeat the last picks.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::impl_state;

/// Number of picks that are not repeated in order.
const SEQUENCE: usize = 4;

/// The choices so far.
#[derive(Clone, Debug)]
pub(super) struct History {
    /// The unit that each counts as; empty if each counts as itself.
    same: Arc<[u32]>,
    /// One more than the target for which a unit was last chosen; 0 where it never was.
    used: Vec<u64>,
    /// Targets so far.
    now: u64,
    /// The last picks, the latest first.
    pub picks: VecDeque<u32>,
    /// The units, as counted by `same`, that would repeat the last picks.
    pub guarded: Vec<u32>,
    cool_off: u64,
    loop_guard: usize,
}
impl_state!(History { used, now, picks, guarded });

impl History {
    /// Creates the history before the first pick; `same` as in [`Units`](super::selector::Units), `cool_off` and `loop_guard` as in
    /// [`SelectorParams`](super::selector::SelectorParams).
    pub fn new(units: usize, same: &[u32], cool_off: usize, loop_guard: usize) -> Self {
        Self {
            same: same.into(),
            used: vec![0; units],
            now: 0,
            picks: VecDeque::with_capacity(loop_guard + SEQUENCE + 1),
            guarded: Vec::new(),
            cool_off: cool_off as u64,
            loop_guard,
        }
    }

    /// The unit that one counts as.
    fn same(&self, unit: usize) -> u32 {
        self.same.get(unit).copied().unwrap_or(unit as u32)
    }

    /// Returns when a unit was chosen last: 0 if never, and more the later it was.
    pub fn last_used(&self, unit: usize) -> u64 {
        self.used[self.same(unit) as usize]
    }

    /// Returns true if a unit was chosen for one of the last targets.
    pub fn in_cool_off(&self, unit: usize) -> bool {
        let used = self.last_used(unit);
        used > 0 && self.now + 1 - used <= self.cool_off
    }

    /// Returns true if a unit may not be chosen next.
    pub fn barred(&self, unit: usize) -> bool {
        self.in_cool_off(unit) || self.guarded.contains(&self.same(unit))
    }

    /// Finds the units that would continue with an exact repeat of the last picks.
    fn guard(&mut self) {
        let pick = |k: usize| self.picks.get(k).map(|&unit| self.same(unit as usize));
        let before = SEQUENCE - 1;
        // `picks[k - 1]` was chosen k targets ago.
        let lags = 1..=self.loop_guard.min(self.picks.len().saturating_sub(before));
        let repeats = lags.filter(|lag| (0..before).all(|k| pick(lag + k) == pick(k)));
        self.guarded = repeats.filter_map(|lag| pick(lag - 1)).collect();
    }

    /// Ends the cool-off of all units.
    pub fn release_all(&mut self) {
        self.now += self.cool_off + 1;
        self.picks.clear();
        self.guarded.clear();
    }

    /// Adds a pick.
    pub fn record(&mut self, unit: u32) {
        let same = self.same(unit as usize) as usize;
        let used = std::mem::replace(&mut self.used[same], self.now + 1);
        self.now += 1;
        if self.picks.len() == self.loop_guard + SEQUENCE {
            self.picks.pop_back();
        }
        self.picks.push_front(unit);
        self.guarded.clear();
        // A repeat ends with a unit that was chosen within the guarded time.
        if used > 0 && self.now - used <= self.loop_guard as u64 {
            self.guard();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_barred_for_its_cool_off_and_where_it_would_repeat_four_picks() {
        let mut history = History::new(9, &[], 2, 5);
        [0, 1, 2, 3, 4].into_iter().for_each(|unit| history.record(unit));
        assert_eq!((0..9).filter(|&j| history.barred(j)).collect::<Vec<_>>(), [3, 4]);
        [0, 1, 2].into_iter().for_each(|unit| history.record(unit));
        assert_eq!((0..9).filter(|&j| history.barred(j)).collect::<Vec<_>>(), [1, 2, 3]);
        // Six targets ago is not within the guarded five.
        let mut history = History::new(9, &[], 0, 5);
        [0, 1, 2, 3, 4, 5, 0, 1, 2].into_iter().for_each(|unit| history.record(unit));
        assert!(!(0..9).any(|j| history.barred(j)));
    }

    #[test]
    fn units_with_one_sound_count_as_one() {
        // The last three sound as the first three.
        let same = [0, 1, 2, 3, 0, 1, 2];
        let mut history = History::new(7, &same, 2, 6);
        [0, 1, 2, 3].into_iter().for_each(|unit| history.record(unit));
        assert_eq!((0..7).filter(|&j| history.barred(j)).collect::<Vec<_>>(), [2, 3, 6]);
        assert_eq!(history.last_used(4), history.last_used(0));
        [4, 5, 2].into_iter().for_each(|unit| history.record(unit));
        // 3 would repeat four sounds; 1 and 2 are in their cool-off at either level.
        assert_eq!((0..7).filter(|&j| history.barred(j)).collect::<Vec<_>>(), [1, 2, 3, 5, 6]);
        assert_eq!(history.picks.front(), Some(&2), "the unit itself, which may run on");
    }

    #[test]
    fn what_is_barred_equals_a_search_of_all_picks() {
        let mut rng = crate::core::random::Rng::new(4);
        for _ in 0..50 {
            let (cool_off, guard) = (rng.below(3), rng.below(12));
            let (mut history, mut picks) = (History::new(5, &[], cool_off, guard), Vec::new());
            for _ in 0..200 {
                let last = |n: usize| &picks[picks.len().saturating_sub(n)..];
                let repeats = |unit: usize| {
                    let sequence = [last(3), &[unit]].concat();
                    let at = |lag: usize| {
                        let end = picks.len().checked_sub(lag - 1)?;
                        picks.get(end.checked_sub(4)?..end)
                    };
                    (1..=guard).any(|lag| picks.len() >= 3 && at(lag) == Some(&sequence[..]))
                };
                for unit in 0..5 {
                    let expected = last(cool_off).contains(&unit) || repeats(unit);
                    assert_eq!(history.barred(unit), expected, "{unit} after {picks:?}, {guard}");
                }
                let unit = rng.below(5);
                history.record(unit as u32);
                picks.push(unit);
            }
        }
    }
}
