//! Peaks of an output over time, in bounded memory.

use foley_nodes::core::time::{Rate, TICKS_PER_SECOND, Tick};
use foley_nodes::dsp::db_to_linear;

/// Largest number of intervals.
const MAX_INTERVALS: usize = 4096;
/// Shortest interval: 20 ms.
const SHORTEST: Tick = TICKS_PER_SECOND / 50;
/// Level relative to the peak of an output below which it counts as silent, dB.
pub const SILENCE_DB: f64 = -80.0;

/// The largest magnitude in each of up to 4096 equal intervals of time.
///
/// Intervals last 20 ms, or one item of a slow stream; when there would be more of them, pairs are joined.
#[derive(Clone, Debug)]
pub struct Envelope {
    interval: Tick,
    peaks: Vec<f32>,
}

impl Default for Envelope {
    fn default() -> Self {
        Self { interval: SHORTEST, peaks: Vec::new() }
    }
}

impl Envelope {
    /// An envelope of a stream of this rate.
    #[must_use]
    pub fn of_rate(rate: Rate) -> Self {
        Self { interval: SHORTEST.max(rate.tick(1)), peaks: Vec::new() }
    }

    /// Adds the numbers of items from item `first` on, `width` for each; those that are not finite count as infinite.
    pub fn push(&mut self, rate: Rate, width: usize, mut first: i64, mut numbers: &[f32]) {
        let width = width.max(1);
        while numbers.len() >= width {
            let interval = rate.tick(first).max(0) / self.interval;
            let next = rate.first_at((interval + 1) * self.interval).max(first + 1);
            let count = ((next - first) as usize).min(numbers.len() / width);
            let (now, rest) = numbers.split_at(count * width);
            let magnitude = |x: &f32| if x.is_finite() { x.abs() } else { f32::INFINITY };
            self.raise(rate.tick(first), now.iter().map(magnitude).fold(0.0, f32::max));
            (first, numbers) = (first + count as i64, rest);
        }
    }

    /// Raises the peak of the interval at a time.
    pub fn raise(&mut self, at: Tick, magnitude: f32) {
        while at / self.interval >= MAX_INTERVALS as Tick {
            self.peaks = self.peaks.chunks(2).map(|pair| pair.iter().copied().fold(0.0, f32::max)).collect();
            self.interval *= 2;
        }
        let k = usize::try_from(at / self.interval).unwrap_or(0);
        if self.peaks.len() <= k {
            self.peaks.resize(k + 1, 0.0);
        }
        self.peaks[k] = self.peaks[k].max(magnitude);
    }

    /// The largest magnitude.
    #[must_use]
    pub fn peak(&self) -> f32 {
        self.peaks.iter().copied().fold(0.0, f32::max)
    }

    /// The length of an interval, ticks.
    #[must_use]
    pub fn interval(&self) -> Tick {
        self.interval
    }

    /// Magnitude above which an interval is active: 80 dB below the peak.
    fn threshold(&self) -> f32 {
        let peak = self.peak();
        if peak.is_finite() { peak * db_to_linear(SILENCE_DB) as f32 } else { 0.0 }
    }

    /// Returns true if an interval that begins in `[from, to)` is active: its peak is above -80 dB of the whole.
    #[must_use]
    pub fn is_active(&self, from: Tick, to: Tick) -> bool {
        let threshold = self.threshold();
        let interval = |tick: Tick| usize::try_from((tick + self.interval - 1) / self.interval).unwrap_or(0);
        let (from, to) = (interval(from).min(self.peaks.len()), interval(to).min(self.peaks.len()));
        self.peaks[from..to.max(from)].iter().any(|peak| *peak > threshold)
    }

    /// The share of the intervals up to `end` that are active; 0 without any.
    #[must_use]
    pub fn active_share(&self, end: Tick) -> f64 {
        let threshold = self.threshold();
        let active = self.peaks.iter().filter(|peak| **peak > threshold).count();
        let all =
            usize::try_from((end + self.interval - 1) / self.interval).unwrap_or(0).max(self.peaks.len());
        active as f64 / all.max(1) as f64
    }

    /// Start of the first and end of the last active interval, ticks.
    #[must_use]
    pub fn active_span(&self) -> Option<[Tick; 2]> {
        let threshold = self.threshold();
        let first = self.peaks.iter().position(|peak| *peak > threshold)?;
        let last = self.peaks.iter().rposition(|peak| *peak > threshold)?;
        Some([first as Tick * self.interval, (last as Tick + 1) * self.interval])
    }

    /// Stretches of at least `least` ticks up to `end` in which nothing is active.
    #[must_use]
    pub fn silent_stretches(&self, least: Tick, end: Tick) -> Vec<[Tick; 2]> {
        let threshold = self.threshold();
        let (mut stretches, mut from) = (Vec::new(), 0);
        let mut add = |from: Tick, to: Tick| {
            if to - from >= least {
                stretches.push([from, to]);
            }
        };
        for (k, _) in self.peaks.iter().enumerate().filter(|(_, peak)| **peak > threshold) {
            add(from, k as Tick * self.interval);
            from = (k as Tick + 1) * self.interval;
        }
        add(from, end);
        stretches
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::core::time::ticks;

    /// A second of 1, a second of silence, a second of 0.5, in blocks that do not fit the intervals.
    fn envelope(rate: Rate) -> Envelope {
        let second = rate.first_at(ticks(1.0)) as usize;
        let level = |k: usize| [1.0, 0.0, 0.5][k / second];
        let samples: Vec<f32> = (0..3 * second).map(level).collect();
        let mut envelope = Envelope::of_rate(rate);
        let mut first = 0;
        for block in samples.chunks(777) {
            envelope.push(rate, 1, first, block);
            first += block.len() as i64;
        }
        envelope
    }

    #[test]
    fn a_pause_is_a_silent_stretch_at_any_rate() {
        for rate in [Rate::hz(10), Rate::hz(48_000), Rate::hz(44_100)] {
            let envelope = envelope(rate);
            assert_eq!(envelope.silent_stretches(ticks(0.5), ticks(3.0)), [[ticks(1.0), ticks(2.0)]]);
            assert!((envelope.active_share(ticks(3.0)) - 2.0 / 3.0).abs() < 1e-9);
            assert_eq!(envelope.active_span(), Some([0, ticks(3.0)]));
            assert!(
                envelope.is_active(ticks(2.0), ticks(2.1)) && !envelope.is_active(ticks(1.0), ticks(2.0))
            );
            assert_eq!(envelope.silent_stretches(ticks(0.5), ticks(4.0)).len(), 2);
        }
    }

    #[test]
    fn an_hour_takes_few_intervals_and_loses_no_peak() {
        let mut envelope = Envelope::default();
        (0..36_000).for_each(|k| envelope.raise(ticks(0.1) * k, if k == 20_000 { 3.0 } else { 1e-6 }));
        assert!(envelope.peaks.len() <= MAX_INTERVALS && envelope.peak() == 3.0);
        assert!(envelope.is_active(ticks(1999.0), ticks(2001.0)));
        assert!(!envelope.is_active(0, ticks(1990.0)));
        assert_eq!(Envelope::default().active_span(), None);
    }
}
