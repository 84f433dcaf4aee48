//! The windows of a graph that plays.

use foley_nodes::core::time::{Rate, Tick};
use std::time::Duration;

/// Rate and length of the windows, and the number by which workers are ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowTiming {
    /// Samples per second.
    pub rate: Rate,
    /// Frames per window.
    pub quantum: usize,
    /// Windows by which workers are ahead of the callback.
    pub depth: u64,
}

impl WindowTiming {
    /// Returns the first tick of a window.
    pub fn window_start(&self, window: u64) -> Tick {
        window_start(self.rate, self.quantum, window)
    }

    /// Returns the length of one window in ticks.
    pub fn window_ticks(&self) -> Tick {
        self.window_start(1)
    }

    /// Returns the time for which a worker sleeps: a quarter of the time by which it is ahead.
    pub fn sleep_time(&self) -> Duration {
        let ahead = self.quantum as f64 * self.depth as f64 / self.rate.as_f64();
        Duration::from_secs_f64(ahead / 4.0).max(Duration::from_millis(1))
    }
}

/// Returns the first tick of a window of `quantum` frames.
#[must_use]
pub fn window_start(rate: Rate, quantum: usize, window: u64) -> Tick {
    rate.tick(window as i64 * quantum as i64)
}
