//! The paths of contacts over a plane, from frames of a physics engine to pieces of path.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4, follow contacts at the rate of the physics; the path between
//! two frames, and that without a next frame, are choices.

use super::hermite::{central, cubic, onward, rate, turned};
use super::piece::PathPiece;
use super::queue::Queue;
use super::sample::{ContactSample, PathRules};
use crate::core::time::{Tick, seconds, ticks};
use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Cross-fade where a contact jumps, and fade at its start, s.
pub const JUMP_FADE: f64 = 0.002;
/// Fade of a contact that is lost, s.
pub const END_FADE: f64 = 0.005;
/// Maximum distance of a contact of unknown velocity in one frame, in distances of a jump.
const UNKNOWN: f64 = 16.0;

/// One contact that is followed.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct TrackedContact {
    jump: u32,
    /// The last frame.
    last: ContactSample,
    /// The position of the one before.
    before: Option<(Tick, [f64; 2])>,
    /// A frame whose velocity is not known yet.
    waiting: Option<ContactSample>,
    /// The current piece and its start.
    path: Option<(Tick, PathPiece)>,
    /// Time until which the path is known.
    known: Tick,
    /// Position, velocity, and velocity on the other surface at that time.
    at: [[f64; 2]; 2],
    other: Option<[[f64; 2]; 2]>,
    force: f32,
    gain: f32,
    /// True until it has faded in.
    fresh: bool,
    /// True if the last state was predicted.
    guessed: bool,
    /// True if the contact has been lost; its number may be used again.
    lost: bool,
    /// True if it has ever begun.
    begun: bool,
    /// Time and position of the last frame, without smoothing.
    raw: (Tick, [f64; 2]),
    /// Position and velocity in the low-pass.
    smooth: [[f64; 2]; 2],
}

/// Follows all contacts of one plane.
#[derive(Clone, Debug)]
pub struct Tracker {
    rules: PathRules,
    tracks: Vec<TrackedContact>,
    room: usize,
    /// The time of the frame, or of its absence, that is dealt with.
    now: Tick,
    /// Pieces made so far.
    pub pieces: u64,
    /// Jumps so far.
    pub jumps: u64,
    /// Frames that came after their path was needed.
    pub late: u64,
    /// Contacts that received no further frames.
    pub stalls: u64,
    /// Frames of contacts beyond the capacity.
    pub left_out: u64,
}
impl_state!(Tracker { tracks, now, pieces, jumps, late, stalls, left_out });

impl Tracker {
    /// Allocates memory for `room` simultaneous contacts.
    #[must_use]
    pub fn new(rules: PathRules, room: usize) -> Self {
        let tracks = Vec::with_capacity(room);
        Self { rules, tracks, room, now: 0, pieces: 0, jumps: 0, late: 0, stalls: 0, left_out: 0 }
    }

    /// Changes rules that do not affect the latency.
    pub fn set_rules(&mut self, rules: PathRules) {
        self.rules = rules;
    }

    /// Takes a frame; all that was due before it must have been done by [`due`](Self::due).
    pub fn frame(&mut self, sample: &ContactSample, out: &mut Queue) {
        self.now = sample.tick;
        let known = self.tracks.iter().position(|t| t.last.contact == sample.contact);
        let Some(k) = known.or_else(|| self.room_for(sample)) else {
            self.left_out += 1;
            return;
        };
        let Some(mut contact) = self.tracks.get(k).copied() else { return };
        if known.is_some() && sample.tick <= contact.raw.0 {
            // The first of two frames of one contact at one time counts.
            return;
        }
        let sample = self.smooth(&mut contact, sample, known.is_some());
        if self.rules.differences && self.rules.look_ahead {
            self.wait(&mut contact, &sample, out);
        } else {
            self.take(&mut contact, &sample, out);
        }
        self.put(k, contact);
    }

    /// The frame as the low-pass leaves it.
    fn smooth(&self, contact: &mut TrackedContact, sample: &ContactSample, known: bool) -> ContactSample {
        let time = sample.tick - contact.raw.0;
        let far = |v: [f64; 2]| self.parted(contact.raw.1, sample.position, Some(v), None, time);
        let anew = !known || contact.lost || sample.begins || sample.velocity.is_some_and(far);
        let mut smooth = *sample;
        if self.rules.smooth > 0.0 && !anew {
            let share = 1.0 - libm::exp(-seconds(time) / self.rules.smooth);
            let toward =
                |from: [f64; 2], to: [f64; 2]| std::array::from_fn(|k| from[k] + share * (to[k] - from[k]));
            smooth.position = toward(contact.smooth[0], sample.position);
            smooth.velocity = sample.velocity.map(|v| toward(contact.smooth[1], v));
        }
        contact.raw = (sample.tick, sample.position);
        contact.smooth = [smooth.position, smooth.velocity.unwrap_or_default()];
        smooth
    }

    fn room_for(&mut self, sample: &ContactSample) -> Option<usize> {
        if self.tracks.len() >= self.room {
            let lost = self.tracks.iter().position(|t| t.lost)?;
            self.tracks.swap_remove(lost);
        }
        let blank = TrackedContact {
            jump: 0,
            last: *sample,
            before: None,
            waiting: None,
            path: None,
            known: sample.tick,
            at: [sample.position, [0.0; 2]],
            other: None,
            force: 0.0,
            gain: 0.0,
            fresh: true,
            guessed: false,
            lost: true,
            begun: false,
            raw: (Tick::MIN / 2, [0.0; 2]),
            smooth: [[0.0; 2]; 2],
        };
        self.tracks.push(blank);
        Some(self.tracks.len() - 1)
    }

    fn put(&mut self, k: usize, contact: TrackedContact) {
        if let Some(position) = self.tracks.get_mut(k) {
            *position = contact;
        }
    }

    /// Stores a frame until the next determines its velocity, and returns the one before.
    fn wait(&mut self, contact: &mut TrackedContact, sample: &ContactSample, out: &mut Queue) {
        if let Some(mut waiting) = contact.waiting.take() {
            let back =
                contact.before.map(|(tick, position)| rate(position, waiting.position, waiting.tick - tick));
            let time = sample.tick - waiting.tick;
            let parted = sample.begins || self.parted(waiting.position, sample.position, back, None, time);
            waiting.velocity = if parted { back } else { Some(central(contact.before, &waiting, sample)) };
            self.take(contact, &waiting, out);
            contact.before = (!parted).then_some((waiting.tick, waiting.position));
        }
        if sample.ends {
            self.take(contact, sample, out);
            contact.before = None;
        } else {
            contact.waiting = Some(*sample);
        }
    }

    /// Processes a complete frame.
    fn take(&mut self, contact: &mut TrackedContact, sample: &ContactSample, out: &mut Queue) {
        if contact.lost {
            if !sample.ends {
                self.start(contact, sample, out);
            }
            return;
        }
        let (mut sample, last) = (*sample, contact.last);
        let time = sample.tick - last.tick;
        let velocity = contact.known_velocity();
        if sample.ends && sample.position == last.position {
            // Engines repeat what they knew last of a contact that has ended.
            let velocity = velocity.unwrap_or_default();
            sample.position = std::array::from_fn(|k| last.position[k] + velocity[k] * seconds(time));
        }
        if sample.begins || self.parted(last.position, sample.position, velocity, sample.velocity, time) {
            self.leap(contact, &sample, out);
            return;
        }
        if self.rules.look_ahead {
            self.extend(contact, &sample, out);
        } else if sample.ends {
            contact.cut(sample.tick);
        } else {
            self.predict(contact, &sample, out);
        }
        if sample.ends {
            self.lose(contact, out);
        }
        contact.last = sample;
    }

    /// Returns true if a contact is not where its velocity would have brought it; without a velocity, true only if it
    /// is very far away.
    fn parted(
        &self,
        from: [f64; 2],
        to: [f64; 2],
        velocity: Option<[f64; 2]>,
        after: Option<[f64; 2]>,
        time: Tick,
    ) -> bool {
        let step = seconds(time);
        let length = |v: [f64; 2]| v[0].hypot(v[1]);
        let gap: [f64; 2] = std::array::from_fn(|k| to[k] - from[k]);
        let Some(travel) = velocity.or(after).map(|v| v.map(|v| v * step)) else {
            return length(gap) > UNKNOWN * self.rules.teleport;
        };
        let fastest = length(travel).max(after.map_or(0.0, length) * step);
        length([gap[0] - travel[0], gap[1] - travel[1]]) > self.rules.teleport + 2.0 * fastest
    }

    /// Begins a path at a frame.
    fn start(&mut self, contact: &mut TrackedContact, sample: &ContactSample, out: &mut Queue) {
        let jump = if contact.begun { contact.jump.wrapping_add(1) } else { 0 };
        *contact = TrackedContact {
            jump,
            last: *sample,
            before: None,
            path: None,
            known: sample.tick,
            // Without a known velocity it starts at the mean speed of its first piece.
            at: [sample.position, sample.velocity.unwrap_or([f64::NAN; 2])],
            other: sample.other.map(|position| [position, [f64::NAN; 2]]),
            force: sample.force,
            gain: sample.gain,
            fresh: true,
            guessed: false,
            lost: false,
            begun: true,
            ..*contact
        };
        if !self.rules.look_ahead {
            self.predict(contact, sample, out);
        }
    }

    /// Fades the old path out and begins a new one.
    fn leap(&mut self, contact: &mut TrackedContact, sample: &ContactSample, out: &mut Queue) {
        self.jumps += 1;
        if contact.known < sample.tick {
            self.straight(contact, sample.tick, contact.gain, out);
        } else {
            contact.cut(sample.tick);
        }
        self.straight(contact, contact.known + ticks(JUMP_FADE), 0.0, out);
        contact.lost = true;
        if !sample.ends {
            self.start(contact, sample, out);
        }
    }

    /// Fades out a contact that has ended.
    fn lose(&mut self, contact: &mut TrackedContact, out: &mut Queue) {
        if contact.force > 0.0 && contact.gain != 0.0 {
            self.straight(contact, contact.known + ticks(END_FADE), 0.0, out);
        }
        contact.lost = true;
    }

    /// Continues along a straight line until a time.
    fn straight(&mut self, contact: &mut TrackedContact, to: Tick, gain: f32, out: &mut Queue) {
        let step = seconds(to - contact.known);
        let velocity = contact.known_velocity().unwrap_or_default();
        let end = ContactSample {
            tick: to,
            position: std::array::from_fn(|k| contact.at[0][k] + velocity[k] * step),
            velocity: Some(velocity),
            other: contact.other.map(|[p, v]| {
                std::array::from_fn(|k| if v[k].is_finite() { p[k] + v[k] * step } else { p[k] })
            }),
            force: contact.force,
            gain,
            ..contact.last
        };
        self.join(contact, &end, out);
    }

    /// Extends the path up to a frame that has come.
    fn extend(&mut self, contact: &mut TrackedContact, sample: &ContactSample, out: &mut Queue) {
        if contact.guessed {
            // The prediction from here on is replaced. The frame may be older than the one that revealed the delay.
            let now = self.now - self.rules.latency();
            self.late += 1;
            contact.cut(now);
            contact.guessed = false;
        }
        let end = if sample.ends { ContactSample { gain: contact.gain, ..*sample } } else { *sample };
        self.join(contact, &end, out);
    }

    /// Predicts the path: from the end of the last prediction to that from this frame, within a frame.
    fn predict(&mut self, contact: &mut TrackedContact, sample: &ContactSample, out: &mut Queue) {
        if contact.known > sample.tick {
            contact.cut(sample.tick);
        }
        let step = seconds(self.rules.frame);
        let velocity = sample.velocity.unwrap_or_else(|| {
            let time = sample.tick - contact.last.tick;
            if time > 0 { rate(contact.last.position, sample.position, time) } else { [0.0; 2] }
        });
        let turn = contact.turn(sample);
        let half = turned(velocity, turn, 0.5 * step);
        let last = turned(velocity, turn, step);
        let other = sample.other.map(|position| {
            let time = sample.tick - contact.last.tick;
            let before = contact.last.other.filter(|_| time > 0);
            let v = before.map_or([0.0; 2], |before| rate(before, position, time));
            std::array::from_fn(|k| position[k] + v[k] * step)
        });
        let end = ContactSample {
            tick: sample.tick + self.rules.frame,
            // Simpson's rule: the length of the path follows from its velocities.
            position: std::array::from_fn(|k| {
                sample.position[k] + step / 6.0 * (velocity[k] + 4.0 * half[k] + last[k])
            }),
            velocity: Some(last),
            other,
            ..*sample
        };
        self.join(contact, &end, out);
    }

    /// Makes the piece from the end of the known path to another position.
    fn join(&mut self, contact: &mut TrackedContact, end: &ContactSample, out: &mut Queue) {
        let duration = end.tick - contact.known;
        if duration <= 0 {
            return;
        }
        let time = seconds(duration);
        let velocity = end.velocity.unwrap_or_else(|| onward(contact.at, end.position, time));
        if !contact.at[1][0].is_finite() {
            contact.at[1] = end.velocity.unwrap_or_else(|| rate(contact.at[0], end.position, duration));
        }
        let position = cubic(contact.at, [end.position, velocity], time, self.rules.guard);
        let other = contact.other.zip(end.other).map(|([from, v], position)| {
            let v = if v[0].is_finite() { v } else { rate(from, position, duration) };
            let at = [from, v];
            let v = onward(at, position, time);
            (cubic(at, [position, v], time, self.rules.guard), [position, v])
        });
        let piece = PathPiece {
            contact: end.contact,
            jump: contact.jump,
            object: self.rules.object,
            duration,
            position,
            other: other.map(|o| o.0),
            force: [contact.force.max(0.0), end.force.max(0.0)],
            gain: [contact.gain, end.gain],
            mass: end.mass,
        };
        self.pieces += 1;
        contact.path = Some((contact.known, piece));
        let fade = ticks(JUMP_FADE);
        let silent = (contact.gain == 0.0 && end.gain == 0.0) || piece.force == [0.0; 2];
        if silent {
            // It is silent.
        } else if contact.fresh && duration > fade {
            let s = fade as f64 / duration as f64;
            let first = piece.part(0.0, s, fade);
            out.push(contact.known, PathPiece { gain: [0.0, first.gain[1]], ..first });
            out.push(contact.known + fade, piece.part(s, 1.0, duration - fade));
        } else {
            let from = if contact.fresh { 0.0 } else { contact.gain };
            out.push(contact.known, PathPiece { gain: [from, end.gain], ..piece });
        }
        contact.fresh = false;
        contact.known = end.tick;
        contact.at = [end.position, velocity];
        contact.other = other.map(|o| o.1).or(end.other.map(|position| [position, [f64::NAN; 2]]));
        (contact.force, contact.gain) = (end.force.max(0.0), end.gain);
    }

    /// The time at which the next contact has to continue without a frame, and its index.
    fn next_due(&self) -> Option<(Tick, usize)> {
        let live = self.tracks.iter().enumerate().filter(|(_, t)| !t.lost || t.waiting.is_some());
        live.map(|(k, contact)| (self.due_of(contact), k)).min()
    }

    fn due_of(&self, contact: &TrackedContact) -> Tick {
        let own = if contact.lost { Tick::MAX } else { contact.known + self.rules.latency() };
        contact.waiting.map_or(own, |waiting| own.min(waiting.tick + self.rules.latency() / 2))
    }

    /// Continues contacts whose next frame is missing at `until`.
    pub fn due(&mut self, until: Tick, out: &mut Queue) {
        while let Some((due, k)) = self.next_due().filter(|(due, _)| *due < until) {
            self.now = due;
            let Some(mut contact) = self.tracks.get(k).copied() else { return };
            self.overdue(&mut contact, out);
            self.put(k, contact);
        }
    }

    fn overdue(&mut self, contact: &mut TrackedContact, out: &mut Queue) {
        if let Some(mut waiting) = contact.waiting.take() {
            waiting.velocity =
                contact.before.map(|(tick, position)| rate(position, waiting.position, waiting.tick - tick));
            self.take(contact, &waiting, out);
            contact.before = Some((waiting.tick, waiting.position));
            return;
        }
        let end = contact.last.tick + self.rules.stall();
        if contact.known < end {
            contact.guessed = true;
            self.straight(contact, end, contact.gain, out);
        } else {
            self.stalls += 1;
            self.straight(contact, contact.known + ticks(END_FADE), 0.0, out);
            contact.lost = true;
        }
    }

    /// Adopts the contacts of another tracker.
    pub fn take_state(&mut self, old: &Self) {
        if old.room == self.room && old.rules.latency() == self.rules.latency() {
            self.tracks.clone_from(&old.tracks);
        }
        (self.pieces, self.jumps, self.late) = (old.pieces, old.jumps, old.late);
        (self.stalls, self.left_out) = (old.stalls, old.left_out);
    }
}

impl TrackedContact {
    fn known_velocity(&self) -> Option<[f64; 2]> {
        self.at[1].iter().all(|v| v.is_finite()).then_some(self.at[1])
    }

    /// Turn and relative growth of the velocity since the last frame, 1/s, if the change is
    /// small enough to continue.
    fn turn(&self, sample: &ContactSample) -> [f64; 2] {
        let time = sample.tick - self.last.tick;
        let (Some(v), Some(w)) = (self.last.velocity, sample.velocity) else { return [0.0; 2] };
        let small = (w[0] - v[0]).hypot(w[1] - v[1]) < 0.5 * w[0].hypot(w[1]);
        if time <= 0 || !small {
            return [0.0; 2];
        }
        let angle = libm::atan2(v[0] * w[1] - v[1] * w[0], v[0] * w[0] + v[1] * w[1]);
        let before = (v[0] * v[0] + v[1] * v[1]).sqrt() / (w[0] * w[0] + w[1] * w[1]).sqrt();
        [angle, 1.0 - before].map(|x| x / seconds(time))
    }

    /// Discards the path beyond a time.
    fn cut(&mut self, tick: Tick) {
        let Some((start, piece)) = self.path.filter(|_| tick < self.known) else { return };
        let tick = tick.max(start);
        let s = (tick - start) as f64 / piece.duration.max(1) as f64;
        self.at = [piece.position_at(s), piece.velocity_at(s)];
        if let Some(other) = piece.other {
            let path = PathPiece { position: other, ..piece };
            self.other = Some([path.position_at(s), path.velocity_at(s)]);
        }
        self.force = piece.force_at(s) as f32;
        self.gain = piece.gain_at(s) as f32;
        self.known = tick;
    }
}
