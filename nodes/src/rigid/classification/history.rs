//! Recent frames of one contact, and their statistics.

use crate::core::state::long;
use crate::core::time::{Tick, ticks};
use serde::{Deserialize, Serialize};

/// Capacity of a history, frames.
pub(super) const CAPACITY: usize = 64;

/// Quantities of one frame of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Sample {
    pub tick: Tick,
    /// Length of the frame, s.
    pub step: f64,
    pub force: f64,
    /// Mean force over the averaging time, which does not depend on the frame rate.
    pub mean_force: f64,
    /// Speed of approach, m/s.
    pub approach: f64,
    /// Largest absolute speed along the normal.
    pub normal_speed: f64,
    /// Relative speed.
    pub speed: f64,
    /// The larger of the slip and the speed over the surface.
    pub surface_speed: f64,
}

/// The latest frames of a contact, at most [`CAPACITY`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct History {
    #[serde(with = "long")]
    samples: [Sample; CAPACITY],
    /// Frames so far.
    pub count: usize,
}

impl History {
    pub fn new() -> Self {
        Self { samples: [Sample::default(); CAPACITY], count: 0 }
    }

    pub fn push(&mut self, sample: Sample) {
        self.samples[self.count % CAPACITY] = sample;
        self.count += 1;
    }

    /// The sample `age` frames before the latest.
    pub fn back(&self, age: usize) -> Option<Sample> {
        (age < self.count.min(CAPACITY)).then(|| self.samples[(self.count - 1 - age) % CAPACITY])
    }

    /// Samples from `age` frames ago backwards, within a time of that frame.
    fn within(&self, age: usize, time: f64) -> impl Iterator<Item = Sample> {
        let from = self.back(age).map_or(0, |s| s.tick) - ticks(time);
        (age..).map_while(|k| self.back(k)).take_while(move |s| s.tick >= from)
    }

    /// Mean force over a time that ends with the latest frame; before the contact began the force is 0.
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
        // A frame longer than the time counts alone.
        if step >= time { self.back(0).map_or(0.0, |s| s.force) } else { sum / time }
    }

    /// Sets the mean force of the latest frame.
    pub fn set_mean_force(&mut self, mean: f64) {
        if let Some(last) = self.count.checked_sub(1) {
            self.samples[last % CAPACITY].mean_force = mean;
        }
    }

    /// Smallest force and smallest mean force within a time before a frame, without that frame.
    pub fn min_force(&self, age: usize, time: f64) -> Option<(f64, f64)> {
        let before = self.within(age, time).skip(1);
        before.map(|s| (s.force, s.mean_force)).reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
    }

    /// Median of the mean force within a time before a frame, without that frame.
    pub fn median_force(&self, age: usize, time: f64) -> Option<f64> {
        let mut forces = [0.0; CAPACITY];
        let mut n = 0;
        for (force, sample) in forces.iter_mut().zip(self.within(age, time).skip(1)) {
            *force = sample.mean_force;
            n += 1;
        }
        let forces = &mut forces[..n];
        forces.sort_unstable_by(f64::total_cmp);
        forces.get(n / 2).copied()
    }

    /// Coefficients of variation of force and of surface speed within a time, over at least four frames; means below `min_means`
    /// count as these.
    pub fn variation(&self, time: f64, min_means: [f64; 2]) -> Option<[f64; 2]> {
        let n = self.within(0, time).count().max(4);
        if self.count < n {
            return None;
        }
        let coefficient = |value: fn(&Sample) -> f64, min_mean: f64| {
            let values = || (0..n).filter_map(|k| self.back(k)).map(|s| value(&s));
            let mean = values().sum::<f64>() / n as f64;
            let variance = values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64;
            variance.sqrt() / mean.max(min_mean)
        };
        Some([coefficient(|s| s.mean_force, min_means[0]), coefficient(|s| s.surface_speed, min_means[1])])
    }

    /// Returns true if the speed along the normal or the relative speed peaks in the frame `age` frames ago or next to it.
    pub fn has_speed_peak(&self, age: usize) -> bool {
        let is_peak = |age: usize, value: fn(&Sample) -> f64| {
            let at = |age: Option<usize>| age.and_then(|k| self.back(k)).map_or(0.0, |s| value(&s));
            let (before, here, after) = (at(Some(age + 1)), at(Some(age)), at(age.checked_sub(1)));
            here > 0.0 && here >= before && here >= after && (here > before || here > after)
        };
        (age.saturating_sub(1)..=age + 1).any(|k| is_peak(k, |s| s.normal_speed) || is_peak(k, |s| s.speed))
    }
}
