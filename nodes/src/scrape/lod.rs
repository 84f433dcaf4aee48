//! How much is made of a contact, by how far away it is and what there is time for.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2, use two levels, the coarser for what is far; five levels, their
//! distances and the budget are choices.

use super::item::PathPiece;
use super::queue::Queue;
use crate::core::time::{Tick, ticks};
use crate::dsp::FadeLaw;
use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Levels that sound.
pub const LEVELS: usize = 4;
/// Cross-fade from one level to another, s.
pub const FADE: f64 = 0.05;
/// Shortest time between two changes that a budget asks for, s.
pub const STABLE: f64 = 0.5;
/// Parts of a cross-fade, in each of which the gain is a straight line.
const PARTS: i64 = 8;

/// What decides between levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LodRules {
    /// Distances at which the next level begins, m, rising; beyond the last there is silence.
    pub distances: [f64; LEVELS],
    /// Share of a distance by which it has to be passed before a level changes.
    pub hysteresis: f64,
    /// Cost of a contact on each level.
    pub costs: [f64; LEVELS],
    /// What all may cost together; `None` for no end.
    pub budget: Option<f64>,
}

impl LodRules {
    /// The level (`LEVELS` is silence) for a distance, from a level that has been there.
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
struct Chosen {
    contact: u64,
    distance: f64,
    /// By distance alone.
    own: usize,
    /// Steps down for the budget.
    down: usize,
    /// When these last changed.
    since: Tick,
    /// When it is surely over.
    until: Tick,
    /// Levels it comes from and goes to, and when it set off.
    from: usize,
    to: usize,
    turned: Tick,
}

impl Chosen {
    fn level(&self) -> usize {
        (self.own + self.down).min(LEVELS)
    }

    /// Gain of a level at a time.
    fn gain(&self, level: usize, tick: Tick) -> f64 {
        if self.from == self.to {
            return if level == self.to { 1.0 } else { 0.0 };
        }
        let way = (tick - self.turned) as f64 / ticks(FADE) as f64;
        let (out, into) = FadeLaw::EqualPower.gains(way);
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
pub struct Chooser {
    rules: LodRules,
    chosen: Vec<Chosen>,
    room: usize,
    /// When the order of levels was last looked after.
    ordered: Tick,
    /// Changes of level so far.
    pub changes: u64,
    /// Contacts for which there was no room.
    pub left_out: u64,
    /// Highest cost so far.
    pub peak: f64,
}
impl_state!(Chooser { chosen, ordered, changes, left_out, peak });

impl Chooser {
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

    /// Takes a piece of a contact at a distance in m, and gives its parts to the queues of the levels.
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
                self.chosen.push(Chosen {
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

    /// Steps the farthest contacts down until all can be paid, and back up where there is room, each at rest for half a second.
    fn keep_budget(&mut self, tick: Tick) {
        let rules = self.rules;
        let total = |all: &[Chosen]| {
            all.iter().filter(|c| c.until > tick).map(|c| rules.cost(c.level())).sum::<f64>()
        };
        let Some(budget) = rules.budget else {
            self.chosen.iter_mut().for_each(|c| c.down = 0);
            self.peak = self.peak.max(total(&self.chosen));
            return;
        };
        let rested = |c: &Chosen| c.until > tick && tick - c.since >= ticks(STABLE);
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
        let rested = |c: &Chosen| c.until > tick && tick - c.since >= ticks(STABLE);
        let coarser = |far: &Chosen| {
            let nearer = |c: &&Chosen| rested(c) && c.down > 0 && c.distance < far.distance;
            self.chosen.iter().filter(nearer).any(|c| c.level() > far.level())
        };
        let finer = self.chosen.iter().enumerate().filter(|(_, c)| rested(c) && coarser(c));
        let farthest = finer.max_by(|a, b| a.1.distance.total_cmp(&b.1.distance)).map(|(k, _)| k);
        if let Some(c) = farthest.and_then(|k| self.chosen.get_mut(k)) {
            c.down += 1;
            c.since = tick;
        }
    }

    /// Takes over what another one of the same size holds.
    pub fn take_state(&mut self, old: &Self) {
        if self.room == old.room {
            self.chosen.clone_from(&old.chosen);
            self.ordered = old.ordered;
        }
        (self.changes, self.left_out, self.peak) = (old.changes, old.left_out, old.peak);
    }
}

/// The parts of a piece on the levels where any of it sounds.
fn split(chosen: &Chosen, tick: Tick, piece: &PathPiece, out: &mut [Queue; LEVELS]) {
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
mod tests {
    use super::*;
    use crate::scrape::testing::piece;

    fn rules(budget: Option<f64>) -> LodRules {
        let distances = [5.0, 15.0, 40.0, 100.0];
        LodRules { distances, hysteresis: 0.1, costs: [25.0, 20.0, 10.0, 8.0], budget }
    }

    type Parts = [Vec<(Tick, PathPiece)>; LEVELS];

    /// What pieces at distances give on each level.
    fn parts(rules: LodRules, pieces: &[(Tick, PathPiece, f64)]) -> (Parts, Chooser) {
        let mut chooser = Chooser::new(rules, 64);
        let mut queues = [(); LEVELS].map(|()| Queue::new(2000));
        let mut all: Parts = Default::default();
        for (tick, piece, distance) in pieces {
            chooser.take(*tick, piece, *distance, &mut queues);
            for (all, queue) in all.iter_mut().zip(&mut queues) {
                queue.give(tick + 1, |tick, piece| all.push((tick, piece)));
            }
        }
        for (all, queue) in all.iter_mut().zip(&mut queues) {
            queue.give(Tick::MAX, |tick, piece| all.push((tick, piece)));
        }
        (all, chooser)
    }

    fn gain(parts: &[(Tick, PathPiece)], tick: Tick) -> f64 {
        let now = parts.iter().filter(|(from, p)| (*from..from + p.duration).contains(&tick));
        now.map(|(from, p)| p.gain_at((tick - from) as f64 / p.duration as f64)).sum()
    }

    #[test]
    fn a_level_changes_only_where_a_distance_is_well_passed() {
        let rules = rules(None);
        let mut level = None;
        let mut walk = |distance: f64| {
            level = Some(rules.level(distance, level));
            level.unwrap()
        };
        assert_eq!([4.0, 5.4, 5.6, 4.6, 4.4].map(&mut walk), [0, 0, 1, 1, 0]);
        assert_eq!([200.0, 95.0, 89.0, 3.0].map(&mut walk), [4, 4, 3, 0]);
    }

    #[test]
    fn who_walks_away_hears_no_step_and_costs_less_and_less() {
        // From 2 m to 150 m at 50 m/s, in frames of 1/60 s.
        let frame = 1.0 / 60.0;
        let way: Vec<_> = (0..180)
            .map(|k| {
                let t = f64::from(k) * frame;
                (ticks(t), piece([t, 0.0], [1.0, 0.0], frame), 2.0 + 50.0 * t)
            })
            .collect();
        let (parts, chooser) = parts(rules(None), &way);
        assert_eq!(chooser.changes, 4);
        let mut before: Option<[f64; LEVELS]> = None;
        let (mut cost, mut fading) = (f64::INFINITY, false);
        for k in 0..2_900 {
            let tick = ticks(f64::from(k) * 0.001);
            let now: [f64; LEVELS] = std::array::from_fn(|level| gain(&parts[level], tick));
            let power: f64 = now.iter().map(|g| g * g).sum();
            if k < 2000 {
                assert!((power - 1.0).abs() < 0.02, "{k} ms: {power}");
            }
            // What sounds costs; in a cross-fade both levels do, for 50 ms.
            let paid = (0..LEVELS).filter(|level| now[*level] > 0.0);
            let both = paid.clone().count() > 1;
            let paid: f64 = paid.map(|level| chooser.rules.costs[level]).sum();
            if !both {
                assert!(paid <= cost, "{k} ms: {paid} after {cost}");
                cost = paid;
            }
            fading |= both;
            if let Some(before) = before {
                let step = now.iter().zip(before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(step < 0.05, "{k} ms: {step}");
            }
            before = Some(now);
        }
        assert!(parts.iter().all(|p| !p.is_empty()) && before == Some([0.0; LEVELS]));
        assert!(fading && cost == 0.0);
    }

    #[test]
    fn a_budget_takes_from_the_farthest_first_and_each_rests_for_half_a_second() {
        let (frame, count) = (1.0 / 60.0, 8_u64);
        // Contact k is 1 + k / 2 m away and ends after 4 + k / 10 s, but for the last; all are near enough for the finest level.
        let distance = |k: u64| 1.0 + 0.5 * k as f64;
        let mut chooser = Chooser::new(rules(Some(130.0)), 64);
        let mut queues = [(); LEVELS].map(|()| Queue::new(2000));
        let mut steps = vec![(Tick::MIN / 2, 0); count as usize];
        let (mut most, mut fell, mut rose) = (0.0_f64, 0, 0);
        for n in 0..420 {
            let t = f64::from(n) * frame;
            // A smaller budget for a while.
            let budget = if (1.5..2.8).contains(&t) { 90.0 } else { 130.0 };
            chooser.set_rules(rules(Some(budget)));
            for k in (0..count).filter(|k| t < 4.0 + 0.1 * *k as f64 || *k == count - 1) {
                let piece = PathPiece { contact: k, ..piece([t, 0.0], [1.0, 0.0], frame) };
                chooser.take(ticks(t), &piece, distance(k), &mut queues);
                let live: Vec<Chosen> =
                    chooser.chosen.iter().filter(|c| c.until > ticks(t)).copied().collect();
                let total: f64 = live.iter().map(|c| chooser.rules.cost(c.level())).sum();
                let rested = |c: &&Chosen| ticks(t) - c.since >= ticks(STABLE) && c.level() < LEVELS;
                assert!(total <= budget || live.iter().filter(rested).count() == 0, "{t}: {total}");
                // After three rests at most it fits, however much has to go.
                let settled = (1.2..1.5).contains(&t) || (2.6..2.8).contains(&t) || t > 3.8;
                assert!(!settled || total <= budget, "{t}: {total} of {budget}");
                for c in &live {
                    let (since, down) = &mut steps[c.contact as usize];
                    if *down != c.down {
                        let rest = seconds_of(ticks(t) - *since);
                        assert!(c.down.abs_diff(*down) == 1, "{t}: one step at a time");
                        assert!(rest >= STABLE - 1e-9, "{t}: contact {} after {rest} s", c.contact);
                        (fell, rose) =
                            (fell + usize::from(c.down > *down), rose + usize::from(c.down < *down));
                        (*since, *down) = (ticks(t), c.down);
                    }
                    // Whoever is nearer is no coarser for longer than it takes both to rest.
                    for far in live.iter().filter(|far| far.distance > c.distance) {
                        let rests = |c: &Chosen| ticks(t) - c.since < ticks(STABLE + 0.1);
                        let order = far.level() >= c.level() || rests(c) || rests(far);
                        assert!(order, "{t}: {c:?} {far:?}");
                    }
                }
                most = most.max(total);
            }
        }
        assert!(fell >= 4 && rose >= 2 && most > 130.0, "{fell} down, {rose} up, {most}");
        let last = chooser.chosen.iter().find(|c| c.contact == count - 1).map(Chosen::level);
        assert_eq!(last, Some(0), "what is left can be paid in full");
    }

    fn seconds_of(time: Tick) -> f64 {
        crate::core::time::seconds(time)
    }
}
