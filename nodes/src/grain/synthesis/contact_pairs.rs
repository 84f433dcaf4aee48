//! Pairs of bodies in contact, each with its chains of grains.

use super::chain::{Chain, ChainRules};
use super::repertoire::ContactSound;
use crate::core::random::Random;
use crate::core::time::{Rate, Tick};
use crate::core::unmatched::Unmatched;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::Component;
use crate::rigid::{ContactState, State};
use serde::{Deserialize, Serialize};

/// Kinds of contact that have chains.
pub const KINDS: usize = 2;
/// Components of a sound that have chains.
pub const COMPONENTS: [Component; 3] = [Component::Whole, Component::Steady, Component::Transient];

/// The contact of two bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Pair {
    bodies: [u32; 2],
    /// Sums over the frames at `latest`, for sliding and for rolling: squared gains, squared gains times speeds, and normal forces.
    power: [f64; KINDS],
    speed: [f64; KINDS],
    load: [f64; KINDS],
    /// Time of the frames that are summed, and the time until the next.
    latest: Tick,
    interval: Tick,
    /// True once the level of these frames is set.
    is_set: bool,
    chains: [[Option<Chain>; COMPONENTS.len()]; KINDS],
    /// Number of the pair, for random numbers.
    id: u32,
}

/// Change of level when a contact ends or changes its state, s.
const RELEASE: f64 = 0.03;
/// Frames without which a contact has ended.
const MISSING: i64 = 3;

/// The pairs of bodies that are in contact, with their sounds.
#[derive(Debug)]
pub struct ContactPairs {
    pairs: Vec<Pair>,
    room: usize,
    object: Option<u32>,
    /// Sounds of sliding and of rolling, by component.
    sounds: [Vec<ContactSound>; KINDS],
    /// First sound and number of sounds of each component.
    ranges: [[[u32; 2]; COMPONENTS.len()]; KINDS],
    /// Frames of contacts that sounded.
    pub frames: u64,
    /// Pairs so far.
    pub count: u64,
    /// Frames that are not finite.
    pub not_finite: u64,
    /// Frames of pairs for which there was no room.
    pub dropped: u64,
    /// Frames of other objects.
    pub others: Unmatched<[u32; 2]>,
}
crate::impl_state!(ContactPairs { pairs, frames, count, not_finite, dropped, others });

impl ContactPairs {
    /// Up to `room` pairs at a time that contain the body `object`, with the sounds of sliding and of rolling.
    #[must_use]
    pub fn new(room: usize, object: Option<u32>, mut sounds: [Vec<ContactSound>; KINDS]) -> Self {
        let ranges = sounds.each_mut().map(|sounds| {
            sounds.sort_by_key(|sound| sound.component);
            COMPONENTS.map(|component| {
                let first = sounds.partition_point(|s| s.component < component);
                let end = sounds.partition_point(|s| s.component <= component);
                [first as u32, (end - first) as u32]
            })
        });
        let pairs = Vec::with_capacity(room);
        let others = Unmatched::default();
        Self { pairs, room, object, sounds, ranges, frames: 0, count: 0, not_finite: 0, dropped: 0, others }
    }

    /// Copies the pairs of others with the same sounds.
    pub fn take_state(&mut self, old: &Self) {
        if self.ranges != old.ranges {
            return;
        }
        self.pairs.clear();
        self.pairs.extend(old.pairs.iter().take(self.room).copied());
        (self.frames, self.count) = (old.frames, old.count);
        (self.not_finite, self.dropped, self.others) = (old.not_finite, old.dropped, old.others);
    }

    /// Sets the levels of a pair from the frames that were summed.
    fn settle(&mut self, index: usize, rate: Rate) {
        let Some(pair) = self.pairs.get_mut(index).filter(|pair| !pair.is_set) else { return };
        pair.is_set = true;
        let now = rate.first_at(pair.latest);
        let frames = rate.first_at(pair.latest + pair.interval) - now;
        for kind in 0..KINDS {
            let level = pair.power[kind].sqrt();
            let speed = pair.speed[kind] / pair.power[kind].max(1e-30);
            for (component, chain) in pair.chains[kind].iter_mut().enumerate() {
                let range = self.ranges[kind][component];
                // A chain that has faded out begins anew.
                *chain = chain.filter(|chain| !chain.has_ended(now));
                if chain.is_none() && level > 0.0 && range[1] > 0 {
                    let id = pair.id * 8 + (kind * COMPONENTS.len() + component) as u32;
                    *chain = Some(Chain::new(id, range, now));
                }
                if let Some(chain) = chain {
                    let release = (RELEASE * rate.as_f64()) as i64;
                    let frames = if level > 0.0 { frames } else { frames.max(release) };
                    chain.set(level, [speed, pair.load[kind]], now, frames);
                }
            }
        }
    }

    /// Adds a frame of a contact to its pair.
    pub fn take(&mut self, tick: Tick, state: &ContactState, rate: Rate) {
        let numbers = [state.gain, state.slip, state.sliding, state.rolling, state.frame.force];
        if !numbers.iter().all(|x| x.is_finite()) {
            self.not_finite += 1;
            return;
        }
        let bodies = state.frame.bodies;
        if self.object.is_some_and(|object| !bodies.contains(&object)) {
            self.others.add(bodies);
            return;
        }
        let shares = match state.state {
            State::Sliding => [1.0, 0.0],
            State::Rolling => [0.0, 1.0],
            State::Mixed => [f64::from(state.slip), 1.0 - f64::from(state.slip)],
            State::Static | State::Unsteady => [0.0, 0.0],
        };
        let gain = f64::from(state.gain).max(0.0).powi(2);
        let is_silent = state.frame.ends || gain == 0.0 || shares == [0.0; KINDS];
        let index = match self.pairs.iter().position(|pair| pair.bodies == bodies) {
            Some(index) => index,
            None if is_silent => return,
            None if self.has_room(rate.first_at(tick)) => {
                let id = bodies[0].wrapping_mul(0x9e37).wrapping_add(bodies[1]) & 0x0fff_ffff;
                self.pairs.push(Pair { bodies, latest: Tick::MIN, is_set: true, id, ..Pair::default() });
                self.count += 1;
                self.pairs.len() - 1
            }
            None => {
                self.dropped += 1;
                return;
            }
        };
        if self.pairs[index].latest != tick {
            self.settle(index, rate);
            let pair = &mut self.pairs[index];
            (pair.power, pair.speed, pair.load, pair.latest) =
                ([0.0; KINDS], [0.0; KINDS], [0.0; KINDS], tick);
            (pair.interval, pair.is_set) = (state.frame.interval, false);
        }
        if is_silent {
            return;
        }
        let pair = &mut self.pairs[index];
        for (kind, speed) in [state.sliding, state.rolling].into_iter().enumerate() {
            pair.power[kind] += shares[kind] * gain;
            pair.speed[kind] += shares[kind] * gain * f64::from(speed);
            pair.load[kind] += shares[kind] * f64::from(state.frame.force).max(0.0);
        }
        self.frames += 1;
    }

    /// Ends the contacts without frames, and sets the levels of frames before `now`.
    pub fn advance(&mut self, now: Tick, rate: Rate) {
        for index in 0..self.pairs.len() {
            if self.pairs[index].latest < now {
                self.settle(index, rate);
            }
            let pair = &mut self.pairs[index];
            if pair.latest > Tick::MIN
                && pair.latest + MISSING * pair.interval.max(1) < now
                && pair.power != [0.0; KINDS]
            {
                // As if a frame without contacts had come.
                let interval = pair.interval;
                (pair.power, pair.latest) = ([0.0; KINDS], pair.latest + MISSING * interval);
                pair.is_set = false;
                self.settle(index, rate);
            }
        }
    }

    /// Removes the pairs that are apart and silent, and returns true if there is room for another.
    fn has_room(&mut self, now: i64) -> bool {
        self.pairs.retain(|pair| {
            let sounds = pair.chains.iter().flatten().flatten().any(|chain| !chain.has_ended(now));
            pair.power != [0.0; KINDS] || !pair.is_set || sounds
        });
        self.pairs.len() < self.room
    }

    /// Adds the frames from `first` on; `scratch` is at least as long as `out`.
    ///
    /// # Shapes
    /// `out: [T * channels]`, interleaved.
    pub fn add(
        &mut self,
        dictionary: &GrainDictionary,
        rules: &ChainRules,
        random: &Random,
        [first, channels]: [i64; 2],
        scratch: &mut [f32],
        out: &mut [f32],
    ) {
        let end = first + out.len() as i64 / channels.max(1);
        for pair in &mut self.pairs {
            for (chains, sounds) in pair.chains.iter_mut().zip(&self.sounds) {
                for slot in chains {
                    let Some(chain) = slot else { continue };
                    chain.add(dictionary, sounds, rules, random, [first, channels], scratch, out);
                    if chain.has_ended(end) {
                        *slot = None;
                    }
                }
            }
        }
    }
}
