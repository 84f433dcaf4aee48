//! Detection of impacts: peaks of the normal force with a fast approach.

use super::classifier::{Classifier, MAX_IMPACTS, TrackedContact};
use super::history::Sample;
use super::rules::ImpactObjects;
use crate::core::time::{Tick, ticks};
use crate::modal::Impact;
use crate::rigid::item::ContactFrame;

impl Classifier {
    /// Tests the pending frame of a contact for an impact, with the next frame or without one.
    pub(super) fn detect_impact(&mut self, contact: &mut TrackedContact, next: Option<Sample>) {
        contact.pending = false;
        let age = usize::from(next.is_some());
        let Some(here) = contact.history.back(age) else { return };
        let before = contact.history.back(age + 1);
        let rules = &self.rules;
        let (force_before, force_next) = (before.map_or(0.0, |s| s.force), next.map_or(0.0, |s| s.force));
        let is_refractory = contact.last_impact.is_some_and(|at| here.tick - at < ticks(rules.refractory));
        let approach = here.approach.max(before.map_or(0.0, |s| s.approach));
        if is_refractory || approach < rules.impact_approach || here.force <= 0.0 {
            return;
        }
        // Before the contact began the force was 0.
        let min_force = contact.history.min_force(age, rules.impact_memory);
        let (min_force, min_mean) =
            min_force.filter(|_| !self.is_new(contact, here.tick)).unwrap_or_default();
        if before.is_some() {
            let median = contact.history.median_force(age, rules.impact_median).unwrap_or(0.0);
            let is_peak = here.force > force_before && here.force >= force_next;
            let mean = here.mean_force.max(next.map_or(0.0, |s| s.mean_force));
            let is_prominent = mean - min_mean >= rules.impact_force.max(median);
            if !is_peak || !is_prominent || !contact.history.has_speed_peak(age) {
                return;
            }
        }
        // Vertex of the parabola through the three forces, in frames.
        let curvature = force_before - 2.0 * here.force + force_next;
        let vertex = if curvature < 0.0 {
            (0.5 * (force_before - force_next) / curvature).clamp(-0.5, 0.5)
        } else {
            0.0
        };
        let offset = (rules.moment - 1.0 + vertex).clamp(-1.0, 0.5) * here.step;
        let earliest = here.tick - ticks(rules.frame) / 2;
        let at = (here.tick + ticks(offset)).max(earliest).max(0);
        // Neighbouring frames with a large force belong to the same impact.
        let part = |s: Sample| {
            if s.force >= 0.25 * here.force { (s.force - min_force).max(0.0) * s.step } else { 0.0 }
        };
        let impulse =
            (here.force - min_force) * here.step + before.map_or(0.0, part) + next.map_or(0.0, part);
        contact.last_impact = Some(here.tick);
        let impact = self.impact(&contact.latest, impulse, approach);
        self.queue_impact(at, contact.id, impact, &contact.latest);
    }

    fn impact(&self, frame: &ContactFrame, impulse: f64, approach: f64) -> Impact {
        let known_mass = frame.mass.filter(|m| *m > 0.0).map(f64::from);
        let mass = known_mass.unwrap_or(impulse / (approach * (1.0 + self.rules.restitution)));
        Impact {
            impulse: impulse as f32,
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
        self.impact_count += 1;
        for &side in sides {
            let (object, local) = (frame.bodies[side], frame.local[side].map(|x| x as f32));
            if self.impacts.len() == MAX_IMPACTS {
                self.dropped += 1;
                return;
            }
            let key = (at, contact, object);
            let index = self.impacts.partition_point(|(t, c, i)| (*t, *c, i.object) <= key);
            self.impacts.insert(index, (at, contact, Impact { object, local, ..impact }));
        }
    }
}
