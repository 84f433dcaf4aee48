//! Past picks: units in their cool-off, and units that repeat the last picks.

use std::collections::VecDeque;

use crate::impl_state;
use crate::unit::selection::selector::SelectorParams;

/// The choices so far.
#[derive(Clone)]
pub(super) struct History {
    /// One more than the target for which a unit was last chosen; 0 where it never was.
    pub used: Vec<u64>,
    /// Targets so far.
    now: u64,
    /// The last picks, the latest first.
    pub picks: VecDeque<u32>,
    /// Units that would repeat the last picks.
    pub guarded: Vec<u32>,
    cool_off: u64,
    loop_guard: usize,
}
impl_state!(History { used, now, picks });

impl History {
    pub fn new(units: usize, params: &SelectorParams) -> Self {
        Self {
            used: vec![0; units],
            now: 0,
            picks: VecDeque::with_capacity(params.loop_guard + 5),
            guarded: Vec::new(),
            cool_off: params.cool_off as u64,
            loop_guard: params.loop_guard,
        }
    }

    /// Returns true if a unit was chosen for one of the last targets.
    pub fn in_cool_off(&self, unit: usize) -> bool {
        let used = self.used[unit];
        used > 0 && self.now + 1 - used <= self.cool_off
    }

    pub fn barred(&self, unit: usize) -> bool {
        self.in_cool_off(unit) || self.guarded.contains(&(unit as u32))
    }

    /// Finds the units that would continue with an exact repeat of the last picks.
    pub fn guard(&mut self) {
        self.guarded.clear();
        let picks = &self.picks;
        // `picks[k - 1]` was chosen k targets ago.
        for lag in 1..=self.loop_guard.min(picks.len().saturating_sub(3)) {
            if (0..3).all(|k| picks.get(lag + k) == picks.get(k)) {
                self.guarded.extend(picks.get(lag - 1));
            }
        }
    }

    /// Ends the cool-off of all units.
    pub fn release_all(&mut self) {
        self.now += self.cool_off + 1;
        self.picks.clear();
    }

    pub fn record(&mut self, unit: u32) {
        self.now += 1;
        self.used[unit as usize] = self.now;
        if self.picks.len() == self.loop_guard + 4 {
            self.picks.pop_back();
        }
        self.picks.push_front(unit);
    }
}
