//! The recent past of one contact.

use crate::core::state::long;
use crate::core::time::{Tick, ticks};
use serde::{Deserialize, Serialize};

/// Frames that are remembered.
pub(super) const DEPTH: usize = 64;

/// What is remembered of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Sample {
    pub tick: Tick,
    /// Length of the frame, s.
    pub step: f64,
    pub force: f64,
    /// Mean force over the last while, which is the same at any rate of frames.
    pub mean: f64,
    /// Speed of approach, m/s.
    pub approach: f64,
    /// Largest speed along the normal, either way.
    pub normal: f64,
    /// Relative speed.
    pub speed: f64,
    /// The faster of slip and of the way over the surface.
    pub along: f64,
}

/// The latest frames of a contact, at most [`DEPTH`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct History {
    #[serde(with = "long")]
    samples: [Sample; DEPTH],
    /// Frames so far.
    pub count: usize,
}

impl History {
    pub fn new() -> Self {
        Self { samples: [Sample::default(); DEPTH], count: 0 }
    }

    pub fn push(&mut self, sample: Sample) {
        self.samples[self.count % DEPTH] = sample;
        self.count += 1;
    }

    /// The frame `age` frames before the latest.
    pub fn back(&self, age: usize) -> Option<Sample> {
        (age < self.count.min(DEPTH)).then(|| self.samples[(self.count - 1 - age) % DEPTH])
    }

    /// Frames from `age` frames ago on backwards, within a time of it.
    fn since(&self, age: usize, time: f64) -> impl Iterator<Item = Sample> {
        let from = self.back(age).map_or(0, |s| s.tick) - ticks(time);
        (age..).map_while(|k| self.back(k)).take_while(move |s| s.tick >= from)
    }

    /// Mean force over a time that ends with the latest frame; before the contact began it is 0.
    pub fn mean_force(&self, time: f64) -> f64 {
        let (mut left, mut sum) = (time, 0.0);
        for sample in (0..).map_while(|k| self.back(k)) {
            let part = sample.step.min(left);
            sum += sample.force * part;
            left -= part;
            if left <= 0.0 {
                break;
            }
        }
        let step = self.back(0).map_or(time, |s| s.step);
        // A frame that is longer counts whole.
        if step >= time { self.back(0).map_or(0.0, |s| s.force) } else { sum / time }
    }

    /// Tells the latest frame its mean force.
    pub fn set_mean(&mut self, mean: f64) {
        if let Some(last) = self.count.checked_sub(1) {
            self.samples[last % DEPTH].mean = mean;
        }
    }

    /// Least force and least mean force within a time before a frame, that frame left out.
    pub fn least_force(&self, age: usize, time: f64) -> Option<(f64, f64)> {
        let before = self.since(age, time).skip(1);
        before.map(|s| (s.force, s.mean)).reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
    }

    /// Median of the mean force within a time before a frame, that frame left out.
    pub fn median_force(&self, age: usize, time: f64) -> Option<f64> {
        let mut forces = [0.0; DEPTH];
        let mut n = 0;
        for (place, sample) in forces.iter_mut().zip(self.since(age, time).skip(1)) {
            *place = sample.mean;
            n += 1;
        }
        let forces = &mut forces[..n];
        forces.sort_unstable_by(f64::total_cmp);
        forces.get(n / 2).copied()
    }

    /// Standard deviation over mean of force and of speed within a time, at least four frames; a mean counts as no less than `least`.
    pub fn variation(&self, time: f64, least: [f64; 2]) -> Option<[f64; 2]> {
        let n = self.since(0, time).count().max(4);
        if self.count < n {
            return None;
        }
        let of = |value: fn(&Sample) -> f64, least: f64| {
            let values = || (0..n).filter_map(|k| self.back(k)).map(|s| value(&s));
            let mean = values().sum::<f64>() / n as f64;
            let square = values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64;
            square.sqrt() / mean.max(least)
        };
        Some([of(|s| s.mean, least[0]), of(|s| s.along, least[1])])
    }

    /// Whether speed, along the normal or at all, is at a peak in the frame `age` frames ago or next to it.
    pub fn speed_peaks(&self, age: usize) -> bool {
        let peak = |age: usize, of: fn(&Sample) -> f64| {
            let at = |age: Option<usize>| age.and_then(|k| self.back(k)).map_or(0.0, |s| of(&s));
            let (before, here, after) = (at(Some(age + 1)), at(Some(age)), at(age.checked_sub(1)));
            here > 0.0 && here >= before && here >= after && (here > before || here > after)
        };
        (age.saturating_sub(1)..=age + 1).any(|k| peak(k, |s| s.normal) || peak(k, |s| s.speed))
    }
}
