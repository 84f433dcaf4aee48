//! Detection of impacts: peaks of the normal force with a fast approach.

use super::history::Sample;
use super::rules::{ImpactObjects, Rules};
use super::tracked_contact::{OpenImpact, TrackedContact};
use crate::core::time::{Tick, ticks};
use crate::modal::Impact;
use crate::rigid::item::ContactFrame;
use std::collections::VecDeque;

/// Time before a peak of the force within which the speed of approach is the largest, s: at the peak itself it is 0.
const APPROACH_TIME: f64 = 0.02;
/// Force of a frame that belongs to an impact, relative to the largest; less while the force falls.
const PULSE_SHARE: f64 = 0.25;

/// Speed of approach of a frame after an impact, relative to its own, from which it is another impact: one edge of a plate touches
/// before the other lands.
const HARDER: f64 = 1.2;

/// Capacity of the queue of impacts.
pub(super) const MAX_IMPACTS: usize = 1024;

/// Detector of impacts in the frames of contacts, and their queue.
pub(super) struct ImpactDetector<'a> {
    pub rules: &'a Rules,
    /// Other contacts, and those that have ended.
    pub contacts: &'a [TrackedContact],
    pub ended: &'a VecDeque<TrackedContact>,
    /// Impacts not read yet, with their contacts, in the order of time.
    pub impacts: &'a mut Vec<(Tick, u64, Impact)>,
    /// Number of impacts so far.
    pub count: &'a mut u64,
    /// Number of impacts beyond the capacity.
    pub dropped: &'a mut u64,
}

impl ImpactDetector<'_> {
    /// Tests the pending frame of a contact for an impact, with the next frame or without one; returns true if the next frame belongs to it.
    pub fn detect(&mut self, contact: &mut TrackedContact, next: Option<Sample>) -> bool {
        contact.pending = false;
        let age = usize::from(next.is_some());
        let Some(here) = contact.history.back(age) else { return false };
        let before = contact.history.back(age + 1);
        let rules = self.rules;
        let landing = contact.history.landing(age, APPROACH_TIME).unwrap_or(here);
        let approach = landing.approach;
        let is_weak = approach < rules.impact_approach || here.force <= 0.0;
        if is_weak || self.is_refractory(contact, landing) {
            return false;
        }
        let (force_before, force_next) = (before.map_or(0.0, |s| s.force), next.map_or(0.0, |s| s.force));
        let is_force_peak = here.force >= force_next && contact.history.has_speed_peak(age, APPROACH_TIME);
        // The bodies land in the frame of the fastest approach; the force may go on to rise.
        let is_landing = here.reports_approach
            && here.approach >= approach
            && next.is_none_or(|s| s.approach <= here.approach);
        if before.is_some() && !(here.force > force_before && (is_force_peak || is_landing)) {
            return false;
        }
        // Before the contact began the force was 0.
        let min_force = contact.history.min_force(age, rules.impact_memory);
        let (base, _) = min_force.filter(|_| !contact.is_new(here.tick, rules)).unwrap_or_default();
        let median = contact.history.median_force(age, rules.impact_median).unwrap_or(0.0);
        let min_impulse = match before {
            Some(_) => rules.impact_force.max(median) * rules.blend.max(here.step),
            None => 0.0,
        };
        // Neighbouring frames with a large force belong to the same impact.
        let least = PULSE_SHARE * here.force;
        let earlier = contact.history.impulse_before(age, rules.pulse, base, least);
        let is_tail =
            |s: &Sample| s.force > base && s.force < here.force && s.tick - here.tick <= ticks(rules.pulse);
        let is_softer = |s: &Sample| s.approach < HARDER * approach;
        let later = next.filter(|s| is_softer(s) && (s.force >= least || is_tail(s)));
        let impulse = (here.force - base) * here.step
            + earlier
            + later.map_or(0.0, |s| (s.force - base).max(0.0) * s.step);
        if !is_force_peak && impulse < min_impulse {
            // The peak of the force may be in the next frame.
            return false;
        }
        let open = OpenImpact {
            found: here.tick,
            landed: landing.tick,
            at: self.impact_time([landing, here], is_force_peak.then_some([force_before, force_next])),
            approach,
            peak: here.force.max(later.map_or(0.0, |s| s.force)),
            last: later.map_or(0.0, |s| s.force),
            base,
            impulse,
            min_impulse,
            frame: contact.latest,
        };
        contact.open = Some(open);
        if later.is_none_or(|s| s.tick - here.tick > ticks(self.rules.pulse)) {
            self.close(contact);
        }
        later.is_some()
    }

    /// Time of an impact found in the frame `here` after a landing, by the forces of the frames before and after it if it is a peak of
    /// the force.
    fn impact_time(&self, [landing, here]: [Sample; 2], around: Option<[f64; 2]>) -> Tick {
        let rules = self.rules;
        let known = [landing, here].iter().find_map(|s| Some(s.tick - ticks(s.landing_age?)));
        let at = known.unwrap_or_else(|| {
            // Vertex of the parabola through the three forces, in frames.
            let vertex = around.map_or(0.0, |[before, next]| {
                let curvature = before - 2.0 * here.force + next;
                if curvature < 0.0 { (0.5 * (before - next) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
            });
            let offset = (rules.moment - 1.0 + vertex).clamp(-1.0, 0.5) * here.step;
            let latest = if landing.reports_approach { landing.tick } else { Tick::MAX };
            (here.tick + ticks(offset)).min(latest)
        });
        // Within the latency also if the next frame is overdue.
        let age = if here.landing_age.is_some() { rules.begin_time() } else { ticks(rules.frame) / 2 };
        at.max(here.tick - age).max(0)
    }

    /// Returns true if the same bodies landed shortly before and not much more softly, with an impact: the contact within `refractory`, or
    /// another one within a frame, since bodies that land with several faces at once have one energy.
    fn is_refractory(&self, contact: &TrackedContact, landing: Sample) -> bool {
        let is_near = |(at, speed): (Tick, f64), time: Tick| {
            (landing.tick - at).abs() < time && landing.approach < HARDER * speed
        };
        let time = self.rules.begin_time();
        let is_near_other = |c: &TrackedContact| {
            let open = c.open.map(|open| (open.landed, open.approach));
            [open, c.last_impact].into_iter().flatten().any(|impact| is_near(impact, time))
        };
        let is_other = |c: &TrackedContact| c.latest.bodies == contact.latest.bodies && c.id != contact.id;
        contact.last_impact.is_some_and(|impact| is_near(impact, ticks(self.rules.refractory)))
            || self.contacts.iter().chain(self.ended).any(|c| is_other(c) && is_near_other(c))
    }

    /// Adds a frame to the open impact of a contact and returns true, or closes it.
    pub fn extend(&mut self, contact: &mut TrackedContact, sample: Sample) -> bool {
        let Some(open) = &mut contact.open else { return false };
        let is_tail = sample.force > open.base && sample.force < open.last;
        let belongs = sample.force >= PULSE_SHARE * open.peak || is_tail;
        let is_harder = sample.approach >= HARDER * open.approach;
        if !belongs || is_harder || sample.tick - open.found > ticks(self.rules.pulse) {
            self.close(contact);
            return false;
        }
        open.impulse += (sample.force - open.base).max(0.0) * sample.step;
        (open.peak, open.last) = (open.peak.max(sample.force), sample.force);
        true
    }

    /// Queues the open impact of a contact, unless it is too weak for the recent forces or these are steady.
    pub fn close(&mut self, contact: &mut TrackedContact) {
        let Some(open) = contact.open.take() else { return };
        if open.min_impulse > 0.0 && (open.impulse < open.min_impulse || contact.steady) {
            return;
        }
        contact.last_impact = Some((open.landed, open.approach));
        let impact = self.impact(&open);
        self.queue_impact(open.at, contact.id, impact, &open.frame);
    }

    /// The energy is that of the effective mass at the speed of approach; it does not depend on the frame rate, unlike the power.
    fn impact(&self, open: &OpenImpact) -> Impact {
        let OpenImpact { impulse, approach, frame, .. } = open;
        let known_mass = frame.mass.filter(|m| *m > 0.0).map(f64::from);
        let mass = known_mass.unwrap_or(impulse / (approach * (1.0 + self.rules.restitution)));
        Impact {
            impulse: *impulse as f32,
            energy: (0.5 * mass * approach * approach) as f32,
            hardness: self.rules.hardness as f32,
            duration: 0.0,
            object: 0,
            point: 0,
            position: frame.point.map(|x| x as f32),
            local: [0.0; 3],
        }
    }

    /// Queues an impact for each body that sounds, in the order of time, contact and body.
    fn queue_impact(&mut self, at: Tick, contact: u64, impact: Impact, frame: &ContactFrame) {
        let sides: &[usize] = match self.rules.struck {
            ImpactObjects::Both => &[0, 1],
            ImpactObjects::A => &[0],
            ImpactObjects::B => &[1],
        };
        *self.count += 1;
        for &side in sides {
            let (object, local) = (frame.bodies[side], frame.local[side].map(|x| x as f32));
            if self.impacts.len() == MAX_IMPACTS {
                *self.dropped += 1;
                return;
            }
            let key = (at, contact, object);
            let index = self.impacts.partition_point(|(t, c, i)| (*t, *c, i.object) <= key);
            self.impacts.insert(index, (at, contact, Impact { object, local, ..impact }));
        }
    }
}
