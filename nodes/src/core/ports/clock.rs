//! The window arithmetic: the positions that a window of the run covers on each clock of a node.

use super::Clock;
use crate::core::time::{Rate, Tick};

impl Clock {
    /// The clock of a node over inputs that end at `end`; its outputs end `lag` later, and so does the node.
    #[must_use]
    pub fn of_node(delay: Tick, lag: Tick, end: Option<Tick>, from: Tick) -> Self {
        Self { rate: None, delay, end: end.map(|end| end.saturating_add(lag)), from }
    }

    /// The clock on which the node of [`Clock::of_node`] writes an output.
    #[must_use]
    pub fn of_output(rate: Option<Rate>, delay: Tick, lag: Tick, end: Option<Tick>, from: Tick) -> Self {
        Self { rate, delay: delay + lag, end, from: (from - lag).max(0) }
    }

    /// This clock in items of a stream.
    #[must_use]
    pub fn at_rate(self, rate: Option<Rate>) -> Self {
        Self { rate, ..self }
    }

    /// The first position.
    #[must_use]
    pub fn first_position(&self) -> i64 {
        self.position(self.from)
    }

    /// The tick of the clock at `tick` of the run.
    pub(in crate::core) fn local(&self, tick: Tick) -> Tick {
        tick.saturating_sub(self.delay).max(self.from)
    }

    /// The end position of a window that ends at `tick` of the clock: within the stream, and with its end ignored.
    pub(in crate::core) fn ends(&self, tick: Tick) -> (i64, i64) {
        let full = self.position(tick);
        (self.end.map_or(full, |end| self.position(tick.min(end))), full)
    }
}

/// The largest number of items in any span of `ticks`.
///
/// The bound is exact: [`Rate::first_at`] rounds up, and a sum that is rounded up is never more than the sum of its terms rounded up.
#[must_use]
pub fn max_items(rate: Rate, ticks: Tick) -> usize {
    rate.first_at(ticks.max(0)) as usize
}
