//! Level of detail of a contact, by its distance and a budget.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2, use two levels, the coarser for what is far; five levels, their
//! distances and the budget are choices.

use crate::core::time::{Tick, ticks};
use crate::dsp::FadeLaw;
use crate::impl_state;
use crate::scrape::path::piece::PathPiece;
use crate::scrape::path::queue::Queue;
use serde::{Deserialize, Serialize};

/// Levels that sound.
pub const LEVELS: usize = 4;
/// Cross-fade from one level to another, s.
pub const FADE: f64 = 0.05;
/// Shortest time between two changes that a budget requires, s.
pub const STABLE: f64 = 0.5;
/// Parts of a cross-fade, in each of which the gain is a straight line.
const PARTS: i64 = 8;

/// Rules for the choice of a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LodRules {
    /// Distances at which the next level begins, m, rising; beyond the last there is silence.
    pub distances: [f64; LEVELS],
    /// Share of a distance by which a contact has to pass it before its level changes.
    pub hysteresis: f64,
    /// Cost of a contact on each level.
    pub costs: [f64; LEVELS],
    /// Total budget; `None` for no limit.
    pub budget: Option<f64>,
}

impl LodRules {
    /// The level (`LEVELS` is silence) for a distance, from the previous level.
    #[must_use]
    pub fn level(&self, distance: f64, before: Option<usize>) -> usize {
        let plain = |factor: f64| self.distances.iter().filter(|d| distance > **d * factor).count();
        let Some(before) = before else { return plain(1.0) };
        // It takes more to go and more to come back.
        let (out, back) = (plain(1.0 + self.hysteresis), plain(1.0 - self.hysteresis));
        if out > before {
            out
        } else if back < before {
            back
        } else {
            before
        }
    }

    fn cost(&self, level: usize) -> f64 {
        self.costs.get(level).copied().unwrap_or(0.0)
    }
}

/// A contact and its level.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct ContactLevel {
    contact: u64,
    distance: f64,
    /// Level by distance alone.
    own: usize,
    /// Levels stepped down for the budget.
    down: usize,
    /// Tick at which these last changed.
    since: Tick,
    /// Tick at which it is certainly over.
    until: Tick,
    /// Start and target level of its cross-fade, and the tick at which the fade began.
    from: usize,
    to: usize,
    turned: Tick,
}

impl ContactLevel {
    fn level(&self) -> usize {
        (self.own + self.down).min(LEVELS)
    }

    /// Gain of a level at a time.
    fn gain(&self, level: usize, tick: Tick) -> f64 {
        if self.from == self.to {
            return if level == self.to { 1.0 } else { 0.0 };
        }
        let fraction = (tick - self.turned) as f64 / ticks(FADE) as f64;
        let (out, into) = FadeLaw::EqualPower.gains(fraction);
        if level == self.to {
            into
        } else if level == self.from {
            out
        } else {
            0.0
        }
    }
}

/// Chooses levels for all contacts of one link.
#[derive(Clone, Debug)]
pub struct LodSelector {
    rules: LodRules,
    chosen: Vec<ContactLevel>,
    room: usize,
    /// Tick at which the order of levels was last updated.
    ordered: Tick,
    /// Changes of level so far.
    pub changes: u64,
    /// Contacts beyond the capacity.
    pub left_out: u64,
    /// Highest cost so far.
    pub peak: f64,
}
impl_state!(LodSelector { chosen, ordered, changes, left_out, peak });

impl LodSelector {
    /// Room for `room` contacts.
    #[must_use]
    pub fn new(rules: LodRules, room: usize) -> Self {
        Self {
            rules,
            chosen: Vec::with_capacity(room),
            room,
            ordered: Tick::MIN,
            changes: 0,
            left_out: 0,
            peak: 0.0,
        }
    }

    /// Changes the rules.
    pub fn set_rules(&mut self, rules: LodRules) {
        self.rules = rules;
    }

    /// Takes a piece of a contact at a distance in m, and adds its parts to the queues of the levels.
    pub fn take(&mut self, tick: Tick, piece: &PathPiece, distance: f64, out: &mut [Queue; LEVELS]) {
        let rules = self.rules;
        self.chosen.retain(|c| c.until + ticks(STABLE) > tick || c.contact == piece.contact);
        let k = match self.chosen.iter().position(|c| c.contact == piece.contact) {
            Some(k) => k,
            None if self.chosen.len() >= self.room => {
                self.left_out += 1;
                return;
            }
            None => {
                let own = rules.level(distance, None);
                let long_ago = tick - ticks(STABLE);
                self.chosen.push(ContactLevel {
                    contact: piece.contact,
                    distance,
                    own,
                    down: 0,
                    since: long_ago,
                    until: tick,
                    from: own,
                    to: own,
                    turned: long_ago,
                });
                self.chosen.len() - 1
            }
        };
        if let Some(chosen) = self.chosen.get_mut(k) {
            chosen.distance = distance;
            chosen.own = rules.level(distance, Some(chosen.own));
            chosen.until = tick + piece.duration;
        }
        self.keep_budget(tick);
        let Some(chosen) = self.chosen.get_mut(k) else { return };
        if chosen.level() != chosen.to && tick - chosen.turned >= ticks(FADE) {
            (chosen.from, chosen.to, chosen.turned) = (chosen.to, chosen.level(), tick);
            self.changes += 1;
        }
        split(chosen, tick, piece, out);
    }

    /// Steps the farthest contacts down until the cost is within the budget, and back up where there is room. Each
    /// contact waits half a second between its steps.
    fn keep_budget(&mut self, tick: Tick) {
        let rules = self.rules;
        let total = |all: &[ContactLevel]| {
            all.iter().filter(|c| c.until > tick).map(|c| rules.cost(c.level())).sum::<f64>()
        };
        let Some(budget) = rules.budget else {
            self.chosen.iter_mut().for_each(|c| c.down = 0);
            self.peak = self.peak.max(total(&self.chosen));
            return;
        };
        let rested = |c: &ContactLevel| c.until > tick && tick - c.since >= ticks(STABLE);
        while total(&self.chosen) > budget {
            let over = self.chosen.iter_mut().filter(|c| rested(c) && c.level() < LEVELS);
            let Some(far) = over.max_by(|a, b| a.distance.total_cmp(&b.distance)) else { break };
            far.down += 1;
            far.since = tick;
        }
        if tick > self.ordered {
            self.ordered = tick;
            self.put_in_order(tick);
        }
        // The nearest of those that have been stepped down, and no other before it.
        let near = self.chosen.iter().enumerate().filter(|(_, c)| c.until > tick && c.down > 0);
        let near = near.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance)).filter(|(_, c)| rested(c));
        if let Some((k, level)) = near.map(|(k, c)| (k, c.level())) {
            let more = rules.cost(level.saturating_sub(1)) - rules.cost(level);
            if total(&self.chosen) + more <= budget
                && let Some(c) = self.chosen.get_mut(k)
            {
                c.down -= 1;
                c.since = tick;
            }
        }
        self.peak = self.peak.max(total(&self.chosen));
    }

    /// A contact that is finer than a nearer one, which was stepped down while it could not be, steps down itself and makes room.
    fn put_in_order(&mut self, tick: Tick) {
        let rested = |c: &ContactLevel| c.until > tick && tick - c.since >= ticks(STABLE);
        let coarser = |far: &ContactLevel| {
            let nearer = |c: &&ContactLevel| rested(c) && c.down > 0 && c.distance < far.distance;
            self.chosen.iter().filter(nearer).any(|c| c.level() > far.level())
        };
        let finer = self.chosen.iter().enumerate().filter(|(_, c)| rested(c) && coarser(c));
        let farthest = finer.max_by(|a, b| a.1.distance.total_cmp(&b.1.distance)).map(|(k, _)| k);
        if let Some(c) = farthest.and_then(|k| self.chosen.get_mut(k)) {
            c.down += 1;
            c.since = tick;
        }
    }

    /// Adopts the state of another one of the same size.
    pub fn take_state(&mut self, old: &Self) {
        if self.room == old.room {
            self.chosen.clone_from(&old.chosen);
            self.ordered = old.ordered;
        }
        (self.changes, self.left_out, self.peak) = (old.changes, old.left_out, old.peak);
    }
}

/// The parts of a piece on the levels where any of it sounds.
fn split(chosen: &ContactLevel, tick: Tick, piece: &PathPiece, out: &mut [Queue; LEVELS]) {
    let end = tick + piece.duration;
    let fade = ticks(FADE);
    for (level, queue) in out.iter_mut().enumerate() {
        queue.cut(tick, piece);
        let mut from = tick;
        while from < end {
            // Within a cross-fade by its eighths, after it in one.
            let part = (from - chosen.turned) * PARTS / fade;
            let next =
                if part < PARTS { chosen.turned + ((part + 1) * fade + PARTS - 1) / PARTS } else { end };
            let to = next.clamp(from + 1, end);
            let gains = [from, to].map(|t| chosen.gain(level, t) as f32);
            if gains != [0.0; 2] {
                let [s, t] = [from, to].map(|x| (x - tick) as f64 / piece.duration as f64);
                let part = if (from, to) == (tick, end) { *piece } else { piece.part(s, t, to - from) };
                let gain = [part.gain[0] * gains[0], part.gain[1] * gains[1]];
                queue.push(from, PathPiece { gain, ..part });
            }
            from = to;
        }
    }
}

#[cfg(test)]
mod tests;
