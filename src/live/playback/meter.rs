//! Histograms of call times, and counters, without locks.

use crate::run::Loudness;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// Buckets per doubling of the time.
const BUCKETS_PER_DOUBLING: usize = 8;
/// Doublings, from 1 ns.
const DOUBLINGS: usize = 34;

/// A histogram of durations, in steps of 9 %; other threads may read while one thread counts.
pub struct Histogram {
    buckets: [AtomicU32; BUCKETS_PER_DOUBLING * DOUBLINGS],
    worst: AtomicU64,
    calls: AtomicU64,
    total: AtomicU64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            buckets: [const { AtomicU32::new(0) }; BUCKETS_PER_DOUBLING * DOUBLINGS],
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
        let bucket = ((ns.max(1) as f64).log2() * BUCKETS_PER_DOUBLING as f64) as usize;
        self.buckets[bucket.min(BUCKETS_PER_DOUBLING * DOUBLINGS - 1)].fetch_add(1, Relaxed);
        self.worst.fetch_max(ns, Relaxed);
        self.calls.fetch_add(1, Relaxed);
        self.total.fetch_add(ns, Relaxed);
    }

    /// Returns the number of calls.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.calls.load(Relaxed)
    }

    /// Returns the sum of all times.
    #[must_use]
    pub fn total(&self) -> Duration {
        Duration::from_nanos(self.total.load(Relaxed))
    }

    /// Returns the longest time.
    #[must_use]
    pub fn worst(&self) -> Duration {
        Duration::from_nanos(self.worst.load(Relaxed))
    }

    /// Returns the time below which a share of the calls stayed, to 9 %.
    #[must_use]
    pub fn quantile(&self, share: f64) -> Duration {
        let counts = self.buckets.iter().map(|b| u64::from(b.load(Relaxed)));
        let total: u64 = counts.clone().sum();
        let wanted = (total as f64 * share).ceil() as u64;
        let mut cumulative = 0;
        for (bucket, count) in counts.enumerate() {
            cumulative += count;
            if cumulative >= wanted && count > 0 {
                let upper =
                    Duration::from_nanos(((bucket + 1) as f64 / BUCKETS_PER_DOUBLING as f64).exp2() as u64);
                return upper.min(self.worst());
            }
        }
        Duration::ZERO
    }

    /// Clears all counts.
    pub fn clear(&self) {
        self.buckets.iter().for_each(|b| b.store(0, Relaxed));
        self.worst.store(0, Relaxed);
        self.calls.store(0, Relaxed);
        self.total.store(0, Relaxed);
    }
}

/// Counters of a graph that plays.
#[derive(Default)]
pub struct Meter {
    /// Time in the callback per window.
    pub callback: Histogram,
    /// Dropouts: windows of workers that did not arrive in time.
    pub missed: AtomicU64,
    /// Events of windows that did not arrive in time for which there was no room later.
    pub lost_events: AtomicU64,
    /// Consecutive windows, up to now, in which something did not arrive in time.
    pub missed_in_a_row: AtomicU64,
    /// Windows that took longer to compute than they last.
    pub overruns: AtomicU64,
    /// Swaps that came too late and were repeated.
    pub late_swaps: AtomicU64,
    /// Samples that were not finite and were set to 0.
    pub not_finite: AtomicU64,
    /// Samples that exceeded the ceiling of a device and were cut to it.
    pub cut: AtomicU64,
    /// Samples beyond full scale.
    pub over: AtomicU64,
    /// Windows up to the last one that was not silent.
    pub last_sound: AtomicU64,
    /// Peak magnitude since the last reading, as bits.
    pub peak: AtomicU32,
    /// Peak magnitude since the start, as bits.
    loudest: AtomicU32,
}

impl Meter {
    /// Takes the peak magnitude since the last reading.
    pub fn take_peak(&self) -> f32 {
        f32::from_bits(self.peak.swap(0, Relaxed))
    }

    /// Returns the level of all `samples` that were played.
    pub fn loudness(&self, samples: u64) -> Loudness {
        let over = self.over.load(Relaxed) as f64 / samples.max(1) as f64;
        Loudness { peak: self.loudest().into(), over }
    }

    /// Returns the peak magnitude since the start.
    pub fn loudest(&self) -> f32 {
        f32::from_bits(self.loudest.load(Relaxed))
    }

    /// Counts the windows of workers that one window of the callback has missed, and the late events that are lost.
    pub(super) fn count_missed(&self, missed: u64, lost_events: u64) {
        if lost_events > 0 {
            self.lost_events.fetch_add(lost_events, Relaxed);
        }
        if missed == 0 {
            self.missed_in_a_row.store(0, Relaxed);
        } else {
            self.missed.fetch_add(missed, Relaxed);
            self.missed_in_a_row.fetch_add(1, Relaxed);
        }
    }

    /// Records the peak magnitude of a window, and its samples beyond full scale.
    pub(super) fn note_level(&self, window: u64, peak: f32, over: u64) {
        if peak > 0.0 {
            self.last_sound.store(window + 1, Relaxed);
        }
        if over > 0 {
            self.over.fetch_add(over, Relaxed);
        }
        // The bits of non-negative floats are in the order of the floats.
        self.peak.fetch_max(peak.to_bits(), Relaxed);
        self.loudest.fetch_max(peak.to_bits(), Relaxed);
    }
}

/// Call times of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeMeter {
    /// The node.
    pub id: String,
    /// Number of windows.
    pub calls: u64,
    /// Median.
    pub median: Duration,
    /// 99th percentile.
    pub p99: Duration,
    /// Maximum.
    pub worst: Duration,
    /// Sum.
    pub total: Duration,
}

impl NodeMeter {
    /// Evaluates a histogram.
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
    fn quantiles_are_accurate_to_one_step() {
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
