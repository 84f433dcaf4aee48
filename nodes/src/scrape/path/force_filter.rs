//! The normal force of a contact as it presses on its path: the mean over one frame of 60 Hz, without the part of an impact.
//!
//! # Source
//! A choice. Solvers alternate between too much and too little force from frame to frame; at 240 frames a second that noise is audible,
//! at 60 it is not.

use crate::core::time::{Tick, seconds, ticks};
use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Number of frames of a contact that are stored; shorter ones are merged.
const CAPACITY: usize = 32;
/// Acceleration of gravity, m/s^2.
const GRAVITY: f64 = 9.81;
/// Speed of approach below which a first frame is no impact, m/s.
const SOFT: f64 = 0.01;
/// Speeds before and after an impact over the speed before it, where the mass follows from the impulse.
const REBOUND: f64 = 1.5;
/// Time without frames after which a contact begins again, s.
const FORGOTTEN: f64 = 0.25;

/// Rules for the force of contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceRules {
    /// Time of the running mean, s; 0 for none.
    pub smooth: f64,
    /// Time of the running median, s; 0 for no limit.
    pub median: f64,
    /// Largest force over the larger of median and weight.
    pub limit: f64,
    /// The same of an unsteady contact.
    pub unsteady_limit: f64,
}

/// State of a contact in one frame, besides its path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameForce {
    /// Length of the frame, s.
    pub step: f64,
    /// Speed of approach, m/s.
    pub approach: f64,
    /// Speed of slip, m/s.
    pub slip: f64,
    /// True of a contact that neither slides, rolls nor rests.
    pub unsteady: bool,
}

/// The latest values of a quantity with their durations, s.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Recent {
    values: [[f64; 2]; CAPACITY],
    count: usize,
}

impl Recent {
    /// Adds a value that lasts `time`. Values that cover `window` are stored.
    fn push(&mut self, time: f64, value: f64, window: f64) {
        let shortest = window / (CAPACITY - 2) as f64;
        let newest = self.count.checked_sub(1).and_then(|k| self.values.get_mut(k % CAPACITY));
        if let Some([old_time, old]) = newest.filter(|[time, _]| *time < shortest * (1.0 - 1e-6)) {
            *old += (value - *old) * time / (*old_time + time);
            *old_time += time;
            return;
        }
        self.values[self.count % CAPACITY] = [time, value];
        self.count += 1;
    }

    /// The value that was added last.
    fn newest(&self) -> Option<f64> {
        self.count.checked_sub(1).map(|k| self.values[k % CAPACITY][1])
    }

    /// Durations and values within a window, the newest first.
    fn within(&self, window: f64) -> impl Iterator<Item = [f64; 2]> {
        let mut left = window;
        (0..self.count.min(CAPACITY)).map_while(move |age| {
            let [time, value] = self.values[(self.count - 1 - age) % CAPACITY];
            let part = time.min(left);
            left -= part;
            (part > 0.0).then_some([part, value])
        })
    }

    /// Mean over a window; before the contact began the value was 0.
    fn mean(&self, window: f64) -> f64 {
        self.within(window).map(|[time, value]| time * value).sum::<f64>() / window
    }

    /// Mean over the available part of a window.
    fn mean_since_begin(&self, window: f64) -> f64 {
        let sums =
            self.within(window).fold([0.0; 2], |[t, sum], [time, value]| [t + time, sum + time * value]);
        if sums[0] > 0.0 { sums[1] / sums[0] } else { 0.0 }
    }

    /// Median over a window; before the contact began the value was 0.
    fn median(&self, window: f64) -> f64 {
        let mut all = [[0.0; 2]; CAPACITY];
        let mut n = 0;
        for (slot, entry) in all.iter_mut().zip(self.within(window)) {
            *slot = entry;
            n += 1;
        }
        let all = &mut all[..n];
        all.sort_unstable_by(|a, b| b[1].total_cmp(&a[1]));
        let mut above = 0.0;
        for [time, value] in all {
            above += *time;
            if above > 0.5 * window {
                return *value;
            }
        }
        0.0
    }
}

/// The force of one contact.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct ContactForce {
    contact: u64,
    last: Tick,
    raw: Recent,
    smooth: Recent,
    /// Weight of the body that touches, by its mass or by its first impact, N.
    weight: f64,
}

/// Friction work over the friction coefficient, N m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrictionWork {
    /// Work in all frames.
    pub all: f64,
    /// Work in the frames that sound.
    pub heard: f64,
    /// Work of the smoothed force in the frames that sound.
    pub smoothed: f64,
    /// Work of the part of it that the limit leaves.
    pub limited: f64,
}

/// Smooths and limits the forces of all contacts.
#[derive(Clone, Debug)]
pub struct ForceFilter {
    rules: ForceRules,
    contacts: Vec<ContactForce>,
    room: usize,
    /// Work so far.
    pub work: FrictionWork,
    /// Changes of forces from frame to frame.
    pub jitter: Jitter,
}
impl_state!(ForceFilter { contacts, work, jitter });

/// Changes of a force from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Jitter {
    frames: u64,
    force: f64,
    change: f64,
}

/// Minimum number of frames for a warning about jitter.
const FEW_FRAMES: u64 = 20;
/// Ratio of mean change to mean force above which a force jumps.
const JUMPS: f64 = 0.5;

impl Jitter {
    fn count(&mut self, before: f64, now: f64) {
        self.frames += 1;
        self.force += 0.5 * (before + now);
        self.change += (now - before).abs();
    }

    /// Warning about forces that jump in each frame, which are audible.
    #[must_use]
    pub fn warning(&self, smooth: f64) -> Option<String> {
        let share = self.change / self.force;
        (self.frames >= FEW_FRAMES && share > JUMPS).then(|| {
            format!(
                "the force of contacts changes by {:.0} % of its mean from frame to frame: means over `force_smooth`, {smooth:.4} s, are audible; a longer one smooths more",
                100.0 * share
            )
        })
    }
}

impl ForceFilter {
    /// Room for `room` contacts at once.
    #[must_use]
    pub fn new(rules: ForceRules, room: usize) -> Self {
        Self {
            rules,
            contacts: Vec::with_capacity(room),
            room,
            work: FrictionWork::default(),
            jitter: Jitter::default(),
        }
    }

    /// Changes the rules from the next frame on.
    pub fn set_rules(&mut self, rules: ForceRules) {
        self.rules = rules;
    }

    /// Returns the force in N with which a frame presses on its path, and counts its friction work.
    pub fn take(&mut self, sample: &super::sample::ContactSample, frame: &FrameForce) -> f32 {
        let (force, step) = (f64::from(sample.force), frame.step.clamp(1e-6, 1.0));
        let found = self.contacts.iter().position(|c| c.contact == sample.contact);
        let old = found.map(|k| self.contacts.swap_remove(k));
        let goes_on =
            |c: &ContactForce| !sample.begins && sample.tick - c.last <= ticks(FORGOTTEN.max(3.0 * step));
        let mut contact = old.filter(goes_on).unwrap_or_else(|| {
            let mass = force * step / (REBOUND * frame.approach.max(SOFT));
            let weight = GRAVITY * mass.max(f64::from(sample.mass.unwrap_or(0.0)));
            let blank = Recent::default();
            ContactForce { contact: sample.contact, last: sample.tick, raw: blank, smooth: blank, weight }
        });
        let ForceRules { smooth, median, limit, unsteady_limit } = self.rules;
        let limit = if frame.unsteady { unsteady_limit } else { limit };
        contact.last = sample.tick;
        if let Some(before) = contact.raw.newest() {
            self.jitter.count(before, force);
        }
        contact.raw.push(step, force, smooth);
        // A frame longer than the window counts alone. Frames of 1/60 s are means that are joined by straight lines; shorter ones are
        // averaged twice, which leaves as little of the noise at high frequencies.
        let mean = if step >= smooth { force } else { contact.raw.mean(smooth) };
        contact.smooth.push(step, mean, median.max(smooth));
        let smoothed = if step >= smooth { force } else { contact.smooth.mean_since_begin(smooth) };
        let limited = if step >= median {
            smoothed
        } else {
            smoothed.min(limit * contact.smooth.median(median).max(contact.weight))
        };
        let work = &mut self.work;
        work.all += force * frame.slip * step;
        if sample.gain != 0.0 && limited > 0.0 {
            work.heard += force * frame.slip * step;
            work.smoothed += smoothed * frame.slip * step;
            work.limited += limited * frame.slip * step;
        }
        if !sample.ends {
            if self.contacts.len() >= self.room {
                let oldest = self.contacts.iter().enumerate().min_by_key(|(_, c)| (c.last, c.contact));
                oldest.map(|(k, _)| k).map(|k| self.contacts.swap_remove(k));
            }
            self.contacts.push(contact);
        }
        limited as f32
    }

    /// Takes over the contacts of another filter.
    pub fn take_state(&mut self, old: &Self) {
        self.contacts.clear();
        self.contacts.extend(old.contacts.iter().take(self.room).copied());
        (self.work, self.jitter) = (old.work, old.jitter);
    }
}

/// Share of `part` in `all`; 1 of nothing.
pub(super) fn share(part: f64, all: f64) -> f64 {
    if all > 0.0 { part / all } else { 1.0 }
}

/// Length of a frame, s.
pub(super) fn step(interval: Tick) -> f64 {
    seconds(interval.max(1))
}

#[cfg(test)]
mod tests {
    use super::super::sample::ContactSample;
    use super::*;

    const RULES: ForceRules = ForceRules { smooth: 1.0 / 60.0, median: 0.1, limit: 2.0, unsteady_limit: 1.0 };

    /// Forces over frames of a rate, as they leave the filter; the first has a speed of approach.
    fn filtered(
        rate: f64,
        approach: f64,
        force: impl Fn(usize) -> f64,
        count: usize,
    ) -> (Vec<f64>, FrictionWork) {
        let mut filter = ForceFilter::new(RULES, 4);
        let frame = |k: usize| {
            let sample = ContactSample {
                contact: 1,
                tick: ticks(k as f64 / rate),
                position: [0.0; 2],
                velocity: None,
                other: None,
                force: force(k) as f32,
                gain: 1.0,
                mass: None,
                begins: k == 0,
                ends: k + 1 == count,
            };
            f64::from(
                filter.take(&sample, &FrameForce { step: 1.0 / rate, approach, slip: 1.0, unsteady: false }),
            )
        };
        let out = (0..count).map(frame).collect();
        (out, filter.work)
    }

    #[test]
    fn the_noise_of_a_solver_is_averaged_over_one_frame_of_60_hz() {
        // All of the force in every fourth frame of 240 Hz.
        let (out, work) = filtered(240.0, 0.0, |k| if k % 4 == 0 { 40.0 } else { 0.0 }, 100);
        assert!(out[60..].iter().all(|f| (f - 10.0).abs() < 1e-6), "{out:?}");
        assert!(
            (work.all - work.heard).abs() < 1e-9 && (share(work.limited, work.smoothed) - 1.0).abs() < 0.1
        );
        for rate in [30.0, 60.0] {
            let (out, _) = filtered(rate, 0.0, |k| 10.0 + (k % 2) as f64, 100);
            assert!(
                out[20..].iter().enumerate().all(|(k, f)| (f - 10.0 - (k % 2) as f64).abs() < 1e-3),
                "{rate}"
            );
        }
        // 1200 frames a second: half of the frames without force.
        let (out, _) = filtered(1200.0, 0.0, |k| if k % 2 == 0 { 20.0 } else { 0.0 }, 600);
        assert!(out[200..].iter().all(|f| (f - 10.0).abs() < 0.6), "{out:?}");
    }

    #[test]
    fn forces_that_jump_in_each_frame_have_a_warning() {
        let jitter = |force: fn(usize) -> f64| {
            let mut jitter = Jitter::default();
            (1..100).for_each(|k| jitter.count(force(k - 1), force(k)));
            jitter.warning(1.0 / 60.0)
        };
        assert_eq!(jitter(|k| 10.0 + (k as f64 * 0.3).sin()), None);
        let text = jitter(|k| if k % 2 == 0 { 20.0 } else { 0.0 }).unwrap();
        assert!(text.contains("200 %") && text.contains("0.0167 s"), "{text}");
    }

    #[test]
    fn an_impact_is_limited_to_the_weight_and_the_slip_after_it_is_not() {
        // 1 kg at 2 m/s: 3 N s in the first frame, then its weight.
        for rate in [60.0, 240.0, 1200.0] {
            let force = |k: usize| if k == 0 { 3.0 * rate } else { 9.81 };
            let (out, work) = filtered(rate, 2.0, force, rate as usize);
            let peak = out.iter().fold(0.0_f64, |m, f| m.max(*f));
            assert!(peak < 2.0 * 9.81 + 1e-3, "{rate}: {peak}");
            assert!(out[rate as usize / 4..].iter().all(|f| (f - 9.81).abs() < 0.01), "{rate}");
            assert!(work.heard == work.all && share(work.limited, work.smoothed) < 0.95);
        }
    }
}
