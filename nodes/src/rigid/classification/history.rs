//! Recent frames of one contact, and their statistics.

use crate::core::state::long;
use crate::core::time::{Tick, seconds, ticks};
use serde::{Deserialize, Serialize};

/// Capacity of a history: frames, and slots of at least [`SLOT`].
pub(super) const CAPACITY: usize = 64;
/// Length of a slot, s: shorter frames are joined, so that 64 of them span a quarter second at any rate.
const SLOT: f64 = 1.0 / 240.0;
/// Largest force of bodies that do not touch, relative to the mean; and of a contact with hardly any, relative to the median.
const FREE_FORCE: [f64; 2] = [0.01, 0.25];
/// Part of the time with hardly any force in which a contact rattles.
const FREE_SHARE: f64 = 0.2;
/// Shortest time over which the force of landings is compared, s.
const MIN_LANDING_TIME: f64 = 0.06;
/// Smallest number of slots in a window.
const MIN_SLOTS: usize = 4;

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
    /// True if it is that of the frame, and not of an instant after an impact.
    pub reports_approach: bool,
    /// Time from the landing in this frame to its end, s, if it is known; negative after the end.
    pub landing_age: Option<f64>,
    /// Largest absolute speed along the normal.
    pub normal_speed: f64,
    /// Relative speed.
    pub speed: f64,
    /// Speed of slip.
    pub sliding: f64,
    /// Speed of the contact point over both surfaces.
    pub rolling: f64,
    /// The largest of the slip and the speeds over the surfaces.
    pub surface_speed: f64,
}

/// Joined frames: means over time, and the smallest forces.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Slot {
    /// Time of the latest frame.
    tick: Tick,
    /// Length, s.
    length: f64,
    mean_force: f64,
    min_force: f64,
    min_mean_force: f64,
    sliding: f64,
    rolling: f64,
    surface_speed: f64,
}

impl Slot {
    fn add(&mut self, sample: &Sample) {
        let length = self.length + sample.step;
        let part = sample.step / length.max(1e-9);
        for (mean, value) in [
            (&mut self.mean_force, sample.mean_force),
            (&mut self.sliding, sample.sliding),
            (&mut self.rolling, sample.rolling),
            (&mut self.surface_speed, sample.surface_speed),
        ] {
            *mean += part * (value - *mean);
        }
        let is_first = self.length <= 0.0;
        for (min, value) in
            [(&mut self.min_force, sample.force), (&mut self.min_mean_force, sample.mean_force)]
        {
            *min = if is_first { value } else { min.min(value) };
        }
        (self.tick, self.length) = (sample.tick, length);
    }
}

/// The latest frames of a contact, at most [`CAPACITY`], and the latest slots.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct History {
    #[serde(with = "long")]
    samples: [Sample; CAPACITY],
    /// Frames so far.
    pub count: usize,
    #[serde(with = "long")]
    slots: [Slot; CAPACITY],
    /// Slots so far.
    slot_count: usize,
    /// Slots before the contact began: those of an earlier contact of the same bodies, and the gap after it.
    earlier_slots: usize,
    /// Times of the latest two landings, the latest first; negative if there was none.
    landings: [Tick; 2],
    /// True while the contact lands again and again.
    is_landing: bool,
}

impl History {
    pub fn new() -> Self {
        Self {
            samples: [Sample::default(); CAPACITY],
            count: 0,
            slots: [Slot::default(); CAPACITY],
            slot_count: 0,
            earlier_slots: 0,
            landings: [Tick::MIN; 2],
            is_landing: false,
        }
    }

    /// History of a contact of the same bodies that begins at a time: without force since the end of this one.
    pub fn continued(&self, begin: Tick) -> Self {
        let mut next = Self { samples: [Sample::default(); CAPACITY], count: 0, ..*self };
        let end = self.slot(0).map_or(begin, |s| s.tick);
        let gap = (begin - end).max(0);
        let pieces = (seconds(gap) / SLOT).ceil().min(CAPACITY as f64) as i64;
        for k in 1..=pieces {
            let slot =
                Slot { tick: end + gap * k / pieces, length: seconds(gap / pieces), ..Slot::default() };
            next.slots[next.slot_count % CAPACITY] = slot;
            next.slot_count += 1;
        }
        next.earlier_slots = next.slot_count;
        next
    }

    /// Adds a frame; its mean force over `blend` seconds is computed here.
    pub fn push(&mut self, sample: Sample, blend: f64) -> Sample {
        self.samples[self.count % CAPACITY] = sample;
        self.count += 1;
        let sample = Sample { mean_force: self.mean_force(blend), ..sample };
        self.samples[(self.count - 1) % CAPACITY] = sample;
        // Half a frame of tolerance, so that frames of 240 Hz with jitter are slots of their own.
        let is_full = self.own_slot(0).is_none_or(|slot| slot.length + 0.5 * sample.step >= SLOT);
        if is_full {
            self.slots[self.slot_count % CAPACITY] = Slot::default();
            self.slot_count += 1;
        }
        self.slots[(self.slot_count - 1) % CAPACITY].add(&sample);
        sample
    }

    /// The sample `age` frames before the latest.
    pub fn back(&self, age: usize) -> Option<Sample> {
        (age < self.count.min(CAPACITY)).then(|| self.samples[(self.count - 1 - age) % CAPACITY])
    }

    /// The slot `age` slots before the latest, of this contact.
    fn own_slot(&self, age: usize) -> Option<Slot> {
        self.slot(age).filter(|_| age < self.slot_count - self.earlier_slots)
    }

    /// The slot `age` slots before the latest, of this contact or an earlier one.
    fn slot(&self, age: usize) -> Option<Slot> {
        (age < self.slot_count.min(CAPACITY)).then(|| self.slots[(self.slot_count - 1 - age) % CAPACITY])
    }

    /// Samples from `age` frames ago backwards, within a time of that frame.
    pub fn within(&self, age: usize, time: f64) -> impl Iterator<Item = Sample> {
        let from = self.back(age).map_or(0, |s| s.tick) - ticks(time);
        (age..).map_while(|k| self.back(k)).take_while(move |s| s.tick >= from)
    }

    /// Slots before the frame `age` frames ago, within a time of it and without it.
    fn slots_before(&self, age: usize, time: f64) -> impl Iterator<Item = Slot> {
        let at = self.back(age).map_or(0, |s| s.tick);
        let from = at - ticks(time);
        let before = (0..).map_while(|k| self.own_slot(k)).skip_while(move |s| s.tick >= at);
        before.take_while(move |s| s.tick >= from)
    }

    /// The latest slots within a time, at least four; fewer if there are none before them.
    fn window(&self, time: f64) -> impl Iterator<Item = Slot> {
        let from = self.own_slot(0).map_or(0, |s| s.tick) - ticks(time);
        (0..)
            .map_while(|k| Some((k, self.own_slot(k)?)))
            .take_while(move |(k, s)| *k < MIN_SLOTS || s.tick >= from)
            .map(|(_, slot)| slot)
    }

    /// Mean force over a time that ends with the latest frame; before the contact began the force is 0.
    fn mean_force(&self, time: f64) -> f64 {
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

    /// Smallest force and smallest mean force within a time before a frame, without that frame.
    pub fn min_force(&self, age: usize, time: f64) -> Option<(f64, f64)> {
        let forces = self.slots_before(age, time).map(|s| (s.min_force, s.min_mean_force));
        forces.reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
    }

    /// Median of the mean force within a time before a frame, without that frame.
    pub fn median_force(&self, age: usize, time: f64) -> Option<f64> {
        let mut forces = [0.0; CAPACITY];
        let mut n = 0;
        for (force, slot) in forces.iter_mut().zip(self.slots_before(age, time)) {
            *force = slot.mean_force;
            n += 1;
        }
        let forces = &mut forces[..n];
        forces.sort_unstable_by(f64::total_cmp);
        forces.get(n / 2).copied()
    }

    /// Slots of this contact and of earlier ones within a time that ends with the latest frame, with their length and mean force.
    fn recent_slots(&self, time: f64) -> (impl Iterator<Item = Slot>, f64, f64) {
        let from = self.slot(0).map_or(0, |s| s.tick) - ticks(time);
        let slots = move || (0..).map_while(move |k| self.slot(k)).take_while(move |s| s.tick >= from);
        let length: f64 = slots().map(|s| s.length).sum();
        let mean = slots().map(|s| s.mean_force * s.length).sum::<f64>() / length.max(1e-9);
        (slots(), length, mean)
    }

    /// Returns true if the bodies had hardly any contact for a part of a time that ends with the latest frame: they rattle.
    ///
    /// The force is compared with the median of the force while the bodies touch, which a single hard landing does not change.
    pub fn is_often_free(&self, time: f64) -> bool {
        let (slots, length, mean) = self.recent_slots(time);
        let mut forces = [0.0; CAPACITY];
        let mut n = 0;
        for (force, slot) in forces.iter_mut().zip(slots.filter(|s| s.mean_force > FREE_FORCE[0] * mean)) {
            *force = slot.mean_force;
            n += 1;
        }
        let forces = &mut forces[..n];
        forces.sort_unstable_by(f64::total_cmp);
        let median = forces.get(n / 2).copied().unwrap_or(0.0);
        let is_free = |s: &Slot| s.mean_force <= FREE_FORCE[1] * median;
        let (slots, ..) = self.recent_slots(time);
        slots.filter(is_free).map(|s| s.length).sum::<f64>() > FREE_SHARE * length
    }

    /// Notes a landing in the latest frame, `refractory` seconds after the one before or later, and returns true while the
    /// bodies land again and again: twice within a time, with a coefficient of variation of the force above `limits[1]`, until
    /// there is no landing for that time or it is below `limits[0]`. A gap shorter than a frame is seen in this way alone.
    ///
    /// A mean force below `min_force` counts as that.
    pub fn lands_repeatedly(
        &mut self,
        lands: bool,
        refractory: f64,
        time: f64,
        limits: [f64; 2],
        min_force: f64,
    ) -> bool {
        let now = self.slot(0).map_or(0, |s| s.tick);
        if lands && now.saturating_sub(self.landings[0]) >= ticks(refractory) {
            self.landings = [now, self.landings[0]];
        }
        let (slots, length, mean) = self.recent_slots(time);
        let variance =
            slots.map(|s| s.length * (s.mean_force - mean).powi(2)).sum::<f64>() / length.max(1e-9);
        let variation = if length < MIN_LANDING_TIME { 0.0 } else { variance.sqrt() / mean.max(min_force) };
        let [latest, before] = self.landings.map(|at| now.saturating_sub(at) <= ticks(time));
        self.is_landing =
            if self.is_landing { latest && variation > limits[0] } else { before && variation > limits[1] };
        self.is_landing
    }

    /// Coefficients of variation of force and of surface speed within a time, over at least four slots; means below `min_means`
    /// count as these.
    pub fn variation(&self, time: f64, min_means: [f64; 2]) -> Option<[f64; 2]> {
        let n = self.window(time).count();
        if n < MIN_SLOTS {
            return None;
        }
        let coefficient = |value: fn(&Slot) -> f64, min_mean: f64| {
            let values = || self.window(time).map(|s| value(&s));
            let mean = values().sum::<f64>() / n as f64;
            let variance = values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64;
            variance.sqrt() / mean.max(min_mean)
        };
        Some([coefficient(|s| s.mean_force, min_means[0]), coefficient(|s| s.surface_speed, min_means[1])])
    }

    /// Largest slip and largest speed of rolling within a time, over at least four slots.
    pub fn max_speeds(&self, time: f64) -> [f64; 2] {
        self.window(time).fold([0.0; 2], |[a, b], s| [s.sliding.max(a), s.rolling.max(b)])
    }

    /// The frame with the largest speed of approach within a time before the frame `age` frames ago, at least of that and the previous
    /// frame; the latest of equal ones.
    pub fn landing(&self, age: usize, time: f64) -> Option<Sample> {
        let count = self.within(age, time).count().max(2);
        let frames = (age..age + count).map_while(|k| self.back(k));
        frames.reduce(|a, b| if b.approach > a.approach { b } else { a })
    }

    /// Returns true if the speed along the normal or the relative speed peaks in the frame `age` frames ago or next to it, or
    /// within a time before it.
    pub fn has_speed_peak(&self, age: usize, time: f64) -> bool {
        let is_peak = |age: usize, value: fn(&Sample) -> f64| {
            let at = |age: Option<usize>| age.and_then(|k| self.back(k)).map_or(0.0, |s| value(&s));
            let (before, here, after) = (at(Some(age + 1)), at(Some(age)), at(age.checked_sub(1)));
            here > 0.0 && here >= before && here >= after && (here > before || here > after)
        };
        let last = age + self.within(age, time).count().saturating_sub(1).max(1);
        (age.saturating_sub(1)..=last).any(|k| is_peak(k, |s| s.normal_speed) || is_peak(k, |s| s.speed))
    }

    /// Impulse above a force of the frames before the frame `age` frames ago that belong to its peak: consecutive frames with at
    /// least `min_force`, within a time, and always the previous frame.
    pub fn impulse_before(&self, age: usize, time: f64, base: f64, min_force: f64) -> f64 {
        let at = self.back(age).map_or(0, |s| s.tick);
        let frames = (age + 1..).map_while(|k| self.back(k)).enumerate();
        let near = frames.take_while(|(k, s)| *k == 0 || seconds(at - s.tick) < time);
        near.take_while(|(_, s)| s.force >= min_force).map(|(_, s)| (s.force - base).max(0.0) * s.step).sum()
    }
}
