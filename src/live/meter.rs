//! Times of many calls, counted without locks.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// Buckets per doubling of the time.
const FINE: usize = 8;
/// Doublings from 1 ns on.
const DOUBLINGS: usize = 34;

/// A histogram of durations, in steps of 9 %; anybody may read while one thread counts.
pub struct Histogram {
    buckets: [AtomicU32; FINE * DOUBLINGS],
    worst: AtomicU64,
    calls: AtomicU64,
    total: AtomicU64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            buckets: [const { AtomicU32::new(0) }; FINE * DOUBLINGS],
            worst: AtomicU64::new(0),
            calls: AtomicU64::new(0),
            total: AtomicU64::new(0),
        }
    }
}

impl Histogram {
    /// Counts one call.
    pub fn count(&self, time: Duration) {
        let ns = time.as_nanos().min(u128::from(u64::MAX)) as u64;
        let bucket = ((ns.max(1) as f64).log2() * FINE as f64) as usize;
        self.buckets[bucket.min(FINE * DOUBLINGS - 1)].fetch_add(1, Relaxed);
        self.worst.fetch_max(ns, Relaxed);
        self.calls.fetch_add(1, Relaxed);
        self.total.fetch_add(ns, Relaxed);
    }

    /// Calls counted.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.calls.load(Relaxed)
    }

    /// All of them together.
    #[must_use]
    pub fn total(&self) -> Duration {
        Duration::from_nanos(self.total.load(Relaxed))
    }

    /// The longest.
    #[must_use]
    pub fn worst(&self) -> Duration {
        Duration::from_nanos(self.worst.load(Relaxed))
    }

    /// The time that a share of the calls stayed below, to 9 %.
    #[must_use]
    pub fn quantile(&self, share: f64) -> Duration {
        let counts = self.buckets.iter().map(|b| u64::from(b.load(Relaxed)));
        let total: u64 = counts.clone().sum();
        let wanted = (total as f64 * share).ceil() as u64;
        let mut passed = 0;
        for (bucket, count) in counts.enumerate() {
            passed += count;
            if passed >= wanted && count > 0 {
                let upper = Duration::from_nanos(((bucket + 1) as f64 / FINE as f64).exp2() as u64);
                return upper.min(self.worst());
            }
        }
        Duration::ZERO
    }

    /// Forgets all.
    pub fn clear(&self) {
        self.buckets.iter().for_each(|b| b.store(0, Relaxed));
        self.worst.store(0, Relaxed);
        self.calls.store(0, Relaxed);
        self.total.store(0, Relaxed);
    }
}

/// What is counted while a graph plays.
#[derive(Default)]
pub struct Meter {
    /// Time in the callback per window.
    pub callback: Histogram,
    /// Windows of workers that had not arrived in time.
    pub missed: AtomicU64,
    /// Callbacks that took longer than the sound they made.
    pub overruns: AtomicU64,
    /// Swaps that came too late and were tried again.
    pub late_swaps: AtomicU64,
    /// Samples that were not finite and became silence.
    pub broken: AtomicU64,
    /// Greatest magnitude of any sample since the last look, as bits.
    pub peak: AtomicU32,
}

impl Meter {
    /// The greatest magnitude since the last look.
    pub fn take_peak(&self) -> f32 {
        f32::from_bits(self.peak.swap(0, Relaxed))
    }

    pub(super) fn note_peak(&self, peak: f32) {
        // Bits of floats that are not negative are in the order of the floats.
        self.peak.fetch_max(peak.to_bits(), Relaxed);
    }
}

/// Times of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeMeter {
    /// The node.
    pub id: String,
    /// Windows that it ran.
    pub calls: u64,
    /// Median.
    pub median: Duration,
    /// What 99 of 100 calls stayed below.
    pub p99: Duration,
    /// The longest.
    pub worst: Duration,
    /// All calls together.
    pub total: Duration,
}

impl NodeMeter {
    /// Reads a histogram.
    #[must_use]
    pub fn of(id: &str, times: &Histogram) -> Self {
        Self {
            id: id.to_owned(),
            calls: times.calls(),
            median: times.quantile(0.5),
            p99: times.quantile(0.99),
            worst: times.worst(),
            total: times.total(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_a_step() {
        let times = Histogram::default();
        (1..=1000).for_each(|k| times.count(Duration::from_nanos(k * 100)));
        let near = |a: Duration, b: f64| (a.as_nanos() as f64 / b - 1.0).abs() < 0.1;
        assert!(near(times.quantile(0.5), 50_000.0), "{:?}", times.quantile(0.5));
        assert!(near(times.quantile(0.99), 99_000.0));
        assert_eq!((times.worst(), times.calls()), (Duration::from_nanos(100_000), 1000));
        assert_eq!(times.total(), Duration::from_nanos(100 * 500_500));
        times.clear();
        assert_eq!((times.quantile(0.5), times.calls()), (Duration::ZERO, 0));
    }
}
