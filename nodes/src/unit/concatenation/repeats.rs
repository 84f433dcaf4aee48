//! Stretches of picks that were played shortly before, counted one by one.

use std::collections::VecDeque;

use crate::impl_state;

/// Length of a stretch that counts as a repeat, s: that of a frame in which a repeat is heard.
const FRAME: f64 = 0.025;
/// Time within which a repeat is heard, s.
pub(super) const MEMORY: f64 = 2.0;

/// Counts the picks of one channel that belong to stretches of at least 25 ms that were played, in the same order, in the two
/// seconds before.
///
/// # Complexity
/// O(memory) per pick, without allocation.
#[derive(Clone, Debug)]
pub(super) struct RepeatCounter {
    /// Picks of a stretch.
    frame: usize,
    /// The last picks, the latest first.
    last: VecDeque<u32>,
    /// For each lag, the number of consecutive picks that equal those of that many picks before.
    runs: Vec<u32>,
    /// Picks since the last that was counted.
    uncounted: usize,
    pub repeated: u64,
    pub picks: u64,
}
impl_state!(RepeatCounter { last, runs, uncounted, repeated, picks });

impl RepeatCounter {
    /// Creates a counter for units at a rate in hertz.
    pub fn new(rate: f64) -> Self {
        let memory = ((MEMORY * rate).round() as usize).max(1);
        Self {
            frame: ((FRAME * rate).ceil() as usize).max(1),
            last: VecDeque::with_capacity(memory + 1),
            runs: vec![0; memory],
            uncounted: 0,
            repeated: 0,
            picks: 0,
        }
    }

    /// Adds the next pick; `None` where nothing is played, which interrupts a repeat.
    pub fn add(&mut self, unit: Option<u32>) {
        let Some(unit) = unit else {
            self.last.clear();
            self.runs.fill(0);
            self.uncounted = 0;
            return;
        };
        let mut longest = 0;
        for (run, earlier) in self.runs.iter_mut().zip(&self.last) {
            *run = if *earlier == unit { *run + 1 } else { 0 };
            longest = longest.max(*run as usize);
        }
        self.picks += 1;
        self.uncounted = self.uncounted.saturating_add(1);
        if longest >= self.frame {
            self.repeated += self.uncounted.min(self.frame) as u64;
            self.uncounted = 0;
        }
        if self.last.len() == self.runs.len() {
            self.last.pop_back();
        }
        self.last.push_front(unit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn count(picks: &[u32], rate: f64) -> u64 {
        let mut counter = RepeatCounter::new(rate);
        picks.iter().for_each(|unit| counter.add(Some(*unit)));
        counter.repeated
    }

    #[test]
    fn repeated_stretches_of_six_units_are_counted_and_shorter_ones_not() {
        let first: Vec<u32> = (0..40).collect();
        let with = |again: &[u32]| [&first[..], again, &[99]].concat();
        assert_eq!(count(&with(&[]), 240.0), 0);
        assert_eq!(count(&with(&first[5..10]), 240.0), 0);
        assert_eq!(count(&with(&first[5..11]), 240.0), 6);
        assert_eq!(count(&with(&first[5..25]), 240.0), 20);
        // More than two seconds ago.
        let apart: Vec<u32> = [(0..40).collect::<Vec<_>>(), (100..600).collect(), (0..40).collect()].concat();
        assert_eq!(count(&apart, 240.0), 0);
        assert_eq!(count(&apart, 300.0), 40);
    }

    #[test]
    fn counts_equal_a_search_of_all_earlier_stretches() {
        let mut rng = Rng::new(6);
        for _ in 0..40 {
            let picks: Vec<u32> = (0..60).map(|_| rng.below(3) as u32).collect();
            let (mut repeated, frame) = (vec![false; picks.len()], 2);
            for end in frame..=picks.len() {
                let now = &picks[end - frame..end];
                let lags = 1..=end - frame;
                if lags.into_iter().any(|lag| &picks[end - frame - lag..end - lag] == now) {
                    repeated[end - frame..end].fill(true);
                }
            }
            let expected = repeated.iter().filter(|r| **r).count() as u64;
            assert_eq!(count(&picks, 60.0), expected, "{picks:?}");
        }
    }
}
