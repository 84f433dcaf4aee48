//! Classification of contacts frame by frame.

use super::history::Sample;
use super::impacts::{ImpactDetector, MAX_IMPACTS};
use super::rules::Rules;
use super::tracked_contact::TrackedContact;
use crate::contact::vector::{Vec3, dot, norm, scale, sub, widen};
use crate::core::time::{Tick, seconds, ticks};
use crate::impl_state;
use crate::modal::Impact;
use crate::rigid::item::{ContactFrame, ContactState, State};
use std::collections::VecDeque;

/// Classifier of contacts: impacts, and static, sliding, rolling or mixed contact.
///
/// # Complexity
/// Per frame of a contact linear in the frames of the last quarter second, at most 64; no allocation.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.2:
/// impacts are peaks of force and of relative speed, rolling is continuous contact without relative speed. The thresholds are
/// choices of this project, and so is the power of sliding and rolling: the paper's force times velocity vanishes for both.
#[derive(Debug)]
pub struct Classifier {
    rules: Rules,
    contacts: Vec<TrackedContact>,
    /// Contacts that have ended within `impact_median` or before, about in the order of their ends.
    ended: VecDeque<TrackedContact>,
    max_contacts: usize,
    /// Impacts not read yet, with their contacts, in the order of time.
    impacts: Vec<(Tick, u64, Impact)>,
    /// Number of impacts so far.
    pub impact_count: u64,
    /// Number of frames that are not finite.
    pub not_finite: u64,
    /// Number of contacts and impacts beyond the capacity.
    pub dropped: u64,
    /// Number of frames in each state.
    pub frames: [u64; 5],
}
impl_state!(Classifier { contacts, ended, impacts, impact_count, not_finite, dropped, frames });

/// Coefficient of variation of the force above which a contact that lands twice rattles.
const LANDING_VARIATION: f64 = 1.0;
/// Speed below which a contact that moves comes to rest, relative to that below which one at rest stays so.
const REST_SHARE: f64 = 0.5;
/// Smallest cosine of the angle between the normals of a contact and of an earlier one that it continues.
const MIN_COSINE: f64 = 0.7;

/// Slip along the surface, and speed along the normal, m/s.
fn split_velocity(frame: &ContactFrame) -> (Vec3, f64) {
    let (v, n) = (widen(frame.velocity), widen(frame.normal));
    let normal_speed = dot(v, n);
    (sub(v, scale(n, normal_speed)), normal_speed)
}

/// Time from the landing in a frame to its end, s, if the depth is known.
///
/// A gap opens at the speed of separation, or closes at that of approach after the frame.
fn landing_age(frame: &ContactFrame, approach: f64, separation: f64, step: f64) -> Option<f64> {
    let depth = f64::from(frame.depth?);
    let known_approach = frame.approach.map(f64::from).filter(|v| *v > 0.0).unwrap_or(approach);
    let is_opening = depth < 0.0 && separation > 0.0;
    let age = if is_opening { -depth / separation } else { depth / known_approach.max(1e-9) };
    Some(age.clamp(-0.5 * step, step))
}

fn is_finite(frame: &ContactFrame) -> bool {
    let known = |x: Option<f32>| x.unwrap_or(0.0);
    let numbers = [frame.force, known(frame.approach), known(frame.depth), known(frame.mass)];
    let vectors = frame.normal.iter().chain(&frame.velocity).chain(frame.travel.iter().flatten().flatten());
    let vectors = vectors.chain(frame.friction.iter().flatten());
    numbers.iter().chain(vectors).all(|x| x.is_finite()) && frame.point.iter().all(|x| x.is_finite())
}

impl Classifier {
    /// A classifier of at most `max_contacts` contacts at a time.
    #[must_use]
    pub fn new(rules: Rules, max_contacts: usize) -> Self {
        Self {
            rules,
            contacts: Vec::with_capacity(max_contacts),
            ended: VecDeque::with_capacity(max_contacts),
            max_contacts,
            impacts: Vec::with_capacity(MAX_IMPACTS),
            impact_count: 0,
            not_finite: 0,
            dropped: 0,
            frames: [0; 5],
        }
    }

    /// Sets the rules for the next frames.
    pub fn set_rules(&mut self, rules: &Rules) {
        self.rules.clone_from(rules);
    }

    /// Copies the state of another classifier; allocates nothing.
    pub fn take_state(&mut self, old: &Self) {
        self.contacts.clear();
        self.contacts.extend(old.contacts.iter().take(self.max_contacts).copied());
        self.ended.clear();
        self.ended.extend(old.ended.iter().take(self.max_contacts).copied());
        self.impacts.clear();
        self.impacts.extend_from_slice(&old.impacts);
        (self.impact_count, self.not_finite, self.dropped, self.frames) =
            (old.impact_count, old.not_finite, old.dropped, old.frames);
    }

    /// Classifies the next frame of a contact; frames come in the order of time. Returns `None` for one that is not finite.
    pub fn take(&mut self, tick: Tick, frame: &ContactFrame) -> Option<ContactState> {
        if !is_finite(frame) {
            self.not_finite += 1;
            return None;
        }
        // Pending frames are tested here, so that results do not depend on the length of windows.
        self.advance_to(tick);
        let index = self.contacts.iter().position(|c| c.id == frame.contact);
        let mut contact = match index.map(|k| self.contacts.swap_remove(k)) {
            Some(contact) if !frame.begins => contact,
            previous => {
                if let Some(mut previous) = previous {
                    self.finish_impact(&mut previous);
                    self.remember(previous);
                }
                self.begin(tick, frame)
            }
        };
        let state = self.classify(&mut contact, tick, frame);
        if frame.ends {
            self.finish_impact(&mut contact);
            self.remember(contact);
            return Some(state);
        }
        if self.contacts.len() >= self.max_contacts {
            self.drop_oldest();
        }
        if self.contacts.len() < self.max_contacts {
            self.contacts.push(contact);
        }
        Some(state)
    }

    /// Stores a contact that has ended.
    fn remember(&mut self, contact: TrackedContact) {
        if self.ended.len() >= self.max_contacts {
            self.ended.pop_front();
        }
        if self.ended.len() < self.max_contacts {
            self.ended.push_back(contact);
        }
    }

    /// A contact that begins with a frame; it continues the history of one of the same bodies that has just ended.
    fn begin(&mut self, tick: Tick, frame: &ContactFrame) -> TrackedContact {
        let oldest = tick - ticks(self.rules.impact_median);
        while self.ended.front().is_some_and(|c| c.last_tick < oldest) {
            self.ended.pop_front();
        }
        let normal = widen(frame.normal);
        let continues = |c: &TrackedContact| {
            c.latest.bodies == frame.bodies
                && (oldest..tick).contains(&c.last_tick)
                && dot(widen(c.latest.normal), normal) > MIN_COSINE
        };
        let earlier = self.ended.iter().rposition(continues).and_then(|k| self.ended.swap_remove_back(k));
        let mut contact = TrackedContact::new(tick, frame);
        if let Some(earlier) = earlier {
            contact.history = earlier.history.continued(tick - frame.interval);
        }
        contact
    }

    /// Drops the contact whose latest frame is the oldest.
    fn drop_oldest(&mut self) {
        let oldest = self.contacts.iter().enumerate().min_by_key(|(_, c)| (c.last_tick, c.id));
        if let Some(k) = oldest.map(|(k, _)| k) {
            self.contacts.swap_remove(k);
            self.dropped += 1;
        }
    }

    /// Declares that all frames before a time have been taken.
    pub fn advance_to(&mut self, now: Tick) {
        let (end_time, pulse) = (self.rules.end_time(), ticks(self.rules.pulse));
        let mut k = 0;
        while let Some(contact) = self.contacts.get(k) {
            let overdue_time = self.rules.overdue_time(contact.latest.depth.is_some());
            let is_overdue = contact.pending && contact.last_tick + overdue_time < now;
            let has_ended = contact.last_tick + end_time < now;
            let is_over = contact.open.is_some_and(|open| open.found + pulse < now);
            if is_overdue || has_ended || is_over {
                self.finish_last_impact(k);
            }
            if has_ended {
                let contact = self.contacts.swap_remove(k);
                self.remember(contact);
            } else {
                k += 1;
            }
        }
    }

    fn impact_detector(&mut self) -> ImpactDetector<'_> {
        ImpactDetector {
            rules: &self.rules,
            contacts: &self.contacts,
            ended: &self.ended,
            impacts: &mut self.impacts,
            count: &mut self.impact_count,
            dropped: &mut self.dropped,
        }
    }

    /// Closes the open impact of a contact, or tests its latest frame for an impact without a next frame.
    fn finish_impact(&mut self, contact: &mut TrackedContact) {
        if contact.open.is_some() {
            self.impact_detector().close(contact);
        } else if contact.pending {
            self.impact_detector().detect(contact, None);
        }
    }

    /// The same for contact `k`.
    fn finish_last_impact(&mut self, k: usize) {
        let Some(mut contact) = self.contacts.get(k).copied() else { return };
        self.finish_impact(&mut contact);
        if let Some(slot) = self.contacts.get_mut(k) {
            *slot = contact;
        }
    }

    /// Removes and returns the next impact before a time.
    pub fn next_impact(&mut self, before: Tick) -> Option<(Tick, Impact)> {
        let (tick, _, impact) = *self.impacts.first().filter(|(tick, ..)| *tick < before)?;
        self.impacts.remove(0);
        Some((tick, impact))
    }

    fn classify(&mut self, contact: &mut TrackedContact, tick: Tick, frame: &ContactFrame) -> ContactState {
        let step = seconds(frame.interval).clamp(1e-6, 1.0);
        let (slip, normal_speed) = split_velocity(frame);
        let sliding = norm(slip);
        let [rolling, fastest] = contact.update_travel_speeds(frame, slip, step);
        let mass = frame.mass.filter(|m| *m > 0.0).map(f64::from);
        // An engine that does not report the speed of approach reports the velocity after the impact.
        let approach = match (frame.approach, frame.begins) {
            (Some(v), _) => f64::from(v).max(0.0),
            (None, false) => (-normal_speed).max(0.0),
            (None, true) => {
                let impulse = f64::from(frame.force) * step;
                let from_impulse = mass.map_or(0.0, |m| impulse / (m * (1.0 + self.rules.restitution)));
                normal_speed.abs().max(from_impulse)
            }
        };
        let sample = Sample {
            tick,
            step,
            force: f64::from(frame.force).max(0.0),
            mean_force: 0.0,
            approach,
            reports_approach: frame.approach.is_some(),
            landing_age: landing_age(frame, approach, normal_speed, step),
            normal_speed: approach.max(normal_speed.abs()),
            speed: norm(widen(frame.velocity)).max(approach),
            sliding,
            rolling,
            surface_speed: sliding.max(fastest),
        };
        let sample = contact.history.push(sample, self.rules.blend);
        let mean_force = sample.mean_force;
        let belongs = if contact.open.is_some() {
            self.impact_detector().extend(contact, sample)
        } else {
            contact.pending && self.impact_detector().detect(contact, Some(sample))
        };
        contact.latest = *frame;
        contact.last_tick = tick;
        // A frame that belongs to an impact is not another one.
        contact.pending = !belongs;
        let variation = self.update_state(contact, tick, sliding, rolling);
        let min_force = contact.history.min_force(0, self.rules.impact_memory);
        let min_force = min_force.filter(|_| !contact.is_new(tick, &self.rules));
        ContactState {
            variation: variation.unwrap_or_default().map(|x| x as f32),
            prominence: (mean_force - min_force.unwrap_or_default().1) as f32,
            median: contact.history.median_force(0, self.rules.impact_median).unwrap_or(0.0) as f32,
            ..self.contact_state(contact, frame, slip, rolling)
        }
    }

    /// Updates the state of a contact after its latest frame; returns the variation of force and speed, if defined.
    fn update_state(
        &mut self,
        contact: &mut TrackedContact,
        tick: Tick,
        sliding: f64,
        rolling: f64,
    ) -> Option<[f64; 2]> {
        let rules = &self.rules;
        let lands = contact.history.back(0).is_some_and(|s| s.approach >= rules.impact_approach);
        let limits = [rules.steady_leave, LANDING_VARIATION];
        let rattles = contact.history.lands_repeatedly(
            lands,
            rules.refractory,
            rules.impact_median,
            limits,
            rules.impact_force,
        ) || contact.history.is_often_free(rules.impact_median);
        let is_held = tick - contact.first_tick >= ticks(rules.held)
            && contact.history.count >= rules.held_frames
            && !rattles;
        let limit = if contact.steady { rules.steady_leave } else { rules.steady_enter };
        // A contact with hardly any force or speed is steady, whatever its noise.
        let min_means = [rules.impact_force, rules.static_speed];
        let variation = contact.history.variation(rules.steady_window, min_means);
        contact.steady = is_held && variation.is_some_and(|v| v.iter().all(|v| *v < limit));
        let recent = contact.history.max_speeds(rules.steady_window);
        let next = if is_held {
            self.held_state(contact.state, [sliding, rolling], recent)
        } else {
            State::Unsteady
        };
        let can_change = contact.last_change.is_none_or(|at| tick - at >= ticks(self.rules.dwell));
        if next != contact.state && can_change {
            contact.state = next;
            contact.last_change = Some(tick);
        }
        if let Some(count) = self.frames.get_mut(contact.state as usize) {
            *count += 1;
        }
        variation
    }

    /// State of a held contact after a previous state, with its speeds of slip and of rolling, now and the largest recent ones.
    ///
    /// A state is entered by the speeds of the moment. It is left for rest by the largest recent ones: a body that slides or rolls
    /// to and fro stops at its turning points for less than that time.
    fn held_state(&self, previous: State, now: [f64; 2], recent: [f64; 2]) -> State {
        let rules = &self.rules;
        let ([sliding, rolling], [recent_sliding, recent_rolling]) = (now, recent);
        let max_slip = rules.rolling_slip.max(rules.rolling_share * rolling);
        let starts_to_roll = sliding <= max_slip && rolling >= rules.rolling_speed;
        let rolls = match previous {
            State::Rolling => sliding <= 2.0 * max_slip && recent_rolling >= rules.rolling_leave,
            State::Sliding => starts_to_roll && sliding < rules.sliding_leave,
            _ => starts_to_roll,
        };
        let slides = match previous {
            State::Sliding => recent_sliding >= rules.sliding_leave,
            _ => sliding >= rules.sliding_speed,
        };
        // Rest has hysteresis too: at a low rate the fastest moments of a motion to and fro are seen now and then.
        let is_slow = matches!(previous, State::Static | State::Unsteady);
        let rest = rules.static_speed * if is_slow { 1.0 } else { REST_SHARE };
        let rests = recent_sliding < rest && recent_rolling < rest;
        match previous {
            State::Rolling | State::Sliding if rolls => State::Rolling,
            State::Sliding if slides => State::Sliding,
            _ if rests => State::Static,
            _ if rolls => State::Rolling,
            _ if slides => State::Sliding,
            State::Unsteady | State::Static => State::Mixed,
            other => other,
        }
    }

    /// State with slip ratio, power and gain.
    fn contact_state(
        &self,
        contact: &TrackedContact,
        frame: &ContactFrame,
        slip: Vec3,
        rolling: f64,
    ) -> ContactState {
        let sliding = norm(slip);
        let slip_ratio = match contact.state {
            State::Sliding => 1.0,
            State::Rolling | State::Static => 0.0,
            State::Mixed | State::Unsteady if sliding > 0.0 => sliding / (sliding + rolling),
            State::Mixed | State::Unsteady => 0.0,
        };
        let force = f64::from(frame.force);
        let coulomb_power = self.rules.friction * force * sliding;
        let friction_power = frame.friction.map_or(coulomb_power, |f| dot(widen(f), slip).abs());
        let rolling_power = self.rules.rolling_resistance * force * rolling;
        let power = match contact.state {
            State::Static => 0.0,
            _ => slip_ratio * friction_power + (1.0 - slip_ratio) * rolling_power,
        };
        let is_audible = matches!(contact.state, State::Sliding | State::Rolling | State::Mixed);
        ContactState {
            frame: *frame,
            state: contact.state,
            slip: slip_ratio as f32,
            power: power as f32,
            gain: if is_audible { self.rules.gain(power) as f32 } else { 0.0 },
            sliding: sliding as f32,
            rolling: rolling as f32,
            variation: [0.0; 2],
            prominence: 0.0,
            median: 0.0,
        }
    }
}

#[cfg(test)]
mod rate_tests;
#[cfg(test)]
mod tests;
