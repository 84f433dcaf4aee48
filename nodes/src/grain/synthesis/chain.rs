//! Chains of grains: contact that lasts.

use super::repertoire::ContactSound;
use super::segment::{GrainSegment, GrainStep, single};
use super::segment_queue::SegmentQueue;
use crate::core::random::Random;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::Component;
use serde::{Deserialize, Serialize};

/// Time constant that smooths the level, s.
const SMOOTHING: f64 = 0.01;
/// Level below which a chain that ends is silent: -120 dB.
const SILENT: f64 = 1e-6;
/// Largest change of the frequency of the steady part, octaves a second.
const SLEW: f64 = 2.0;
/// Grains that are not repeated.
const AVOIDED: usize = 8;

/// A linear change of a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Ramp {
    from: f64,
    to: f64,
    /// Its first and its last frame.
    frames: [i64; 2],
}

impl Ramp {
    fn at(&self, frame: i64) -> f64 {
        let [first, last] = self.frames;
        if frame >= last {
            return self.to;
        }
        let part = (frame - first).max(0) as f64 / (last - first).max(1) as f64;
        self.from + part * (self.to - self.from)
    }
}

/// A level that changes linearly, and is then smoothed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Level {
    ramp: Ramp,
    /// The ramp until the first frame of the latest one.
    before: Ramp,
    smooth: f64,
}

impl Level {
    fn at(&self, frame: i64) -> f64 {
        if frame < self.ramp.frames[0] { self.before.at(frame) } else { self.ramp.at(frame) }
    }

    fn set(&mut self, to: f64, now: i64, duration: i64) {
        let ramp = Ramp { from: self.at(now), to, frames: [now, now + duration.max(1)] };
        *self = Self { before: self.ramp, ramp, ..*self };
    }
}

/// Rules of the succession of grains in a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainRules {
    /// Probability that a grain is followed by a grain of another time, rather than by the next.
    pub jump: f64,
    /// Exponent of the speed in the frequency of the steady part.
    pub gamma: f64,
    /// Speed of recordings without one of their own, m/s.
    pub speed: f64,
    /// Greatest random shift of the frequency of a steady grain at a load of 1 N, octaves.
    pub width: f64,
    /// Factors of the level of the steady and of the transient part.
    pub levels: [f32; 2],
}

/// Successive grains of the sounds of one component, under a level that follows a contact.
///
/// The next grain is chosen when the one before begins, so that blocks of any length give the same samples. Nothing is allocated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    /// Number of the chain and its first frame, for random numbers.
    id: u32,
    begun: i64,
    /// Index of its first sound and number of its sounds, all of one component.
    sounds: [u32; 2],
    level: Level,
    /// Speed of the motion, m/s, and normal force, N.
    speed: f64,
    load: f64,
    /// Octaves by which the steady part is shifted, and the frame of the latest change.
    octaves: f64,
    changed: i64,
    /// Sound and step of the last segment.
    position: [u32; 2],
    recent: [u32; AVOIDED],
    picks: u64,
    queue: SegmentQueue,
}

impl Chain {
    /// A chain over some sounds that begins at a frame.
    #[must_use]
    pub fn new(id: u32, sounds: [u32; 2], begun: i64) -> Self {
        Self { id, sounds, begun, recent: [u32::MAX; AVOIDED], ..Self::default() }
    }

    /// Lets the level change to a value within a number of frames, for a motion at a speed under a load.
    pub fn set(&mut self, level: f64, [speed, load]: [f64; 2], now: i64, frames: i64) {
        self.level.set(level, now, frames);
        if level > 0.0 {
            (self.speed, self.load) = (speed, load);
        }
    }

    /// Returns true if it is silent, and stays so.
    #[must_use]
    pub fn has_ended(&self, now: i64) -> bool {
        let Ramp { to, frames, .. } = self.level.ramp;
        to == 0.0 && now >= frames[1] && self.level.smooth < SILENT
    }

    /// A random number of the next grain, in [0, 1).
    fn uniform(&self, random: &Random, lane: u32) -> f64 {
        random.uniform(self.id, (self.begun as u64) << 24 | self.picks, lane)
    }

    /// Shift of the frequency of a sound, octaves, from `now` on.
    fn shift(
        &mut self,
        sound: &ContactSound,
        rules: &ChainRules,
        random: &Random,
        rate: f64,
        now: i64,
    ) -> f64 {
        if sound.component != Component::Steady {
            return 0.0;
        }
        let recorded = sound.speed.unwrap_or(rules.speed).max(1e-6);
        let wanted = (rules.gamma * (self.speed.max(1e-6) / recorded).log2()).clamp(-1.0, 1.0);
        if self.picks == 0 {
            self.octaves = wanted;
        } else {
            let most = SLEW * (now - self.changed).max(0) as f64 / rate;
            self.octaves += (wanted - self.octaves).clamp(-most, most);
        }
        self.changed = now;
        let width = (rules.width * self.load.max(0.0)).min(1.0);
        self.octaves + width * (2.0 * self.uniform(random, 2) - 1.0)
    }

    /// Chooses the grain after the last one; `now` is the frame at which it is chosen.
    fn choose(&mut self, sounds: &[ContactSound], rules: &ChainRules, random: &Random) -> (u32, u32, bool) {
        let of_chain = sounds.get(self.sounds[0] as usize..(self.sounds[0] + self.sounds[1]) as usize);
        let of_chain = of_chain.unwrap_or_default();
        let uniform = |lane| self.uniform(random, lane);
        let [sound, step] = self.position;
        let steps = |k: u32| of_chain.get(k as usize).map_or(0, |s| s.steps.len() as u32);
        if self.picks > 0 && uniform(0) >= rules.jump && step + 1 < steps(sound) {
            return (sound, step + 1, true);
        }
        // Any grain of any sound, but none of the latest.
        let total: u32 = (0..of_chain.len() as u32).map(steps).sum();
        let room = total.saturating_sub(1).min(AVOIDED as u32) as usize;
        let mut index = (uniform(1) * f64::from(total)) as u32;
        for _ in 0..=AVOIDED {
            let (mut k, mut rest) = (0, index);
            while rest >= steps(k).max(1) && k + 1 < of_chain.len() as u32 {
                rest -= steps(k);
                k += 1;
            }
            let grain = of_chain.get(k as usize).and_then(|s| s.steps.get(rest as usize)).map(|s| s.grain);
            if grain.is_none_or(|grain| !self.recent[..room].contains(&grain)) {
                return (k, rest, false);
            }
            index = (index + 1) % total.max(1);
        }
        (0, 0, false)
    }

    /// The segment after the last one; `now` is the frame at which it is chosen.
    fn next(
        &mut self,
        dictionary: &GrainDictionary,
        sounds: &[ContactSound],
        rules: &ChainRules,
        random: &Random,
        last: Option<&GrainSegment>,
        now: i64,
    ) -> Option<GrainSegment> {
        let (k, step, follows) = self.choose(sounds, rules, random);
        let sound = sounds.get((self.sounds[0] + k) as usize)?;
        let next = sound.steps.get(step as usize)?;
        let octaves = self.shift(sound, rules, random, dictionary.rate, now);
        let before = self.position;
        let t = match last {
            None => now,
            Some(last) => {
                let grain = dictionary.grains.get(last.grain as usize);
                let whole = grain.map_or(1, |g| g.window_len() as i64 - i64::from(g.taper[1])).max(1);
                let own = sound.steps.get(before[1] as usize).filter(|_| follows);
                // Distances within a recording remain, unless they leave a gap.
                let apart = own.map_or(whole, |own| (next.t - own.t).clamp(1, whole));
                let window = grain.map_or(0, |g| g.span().start as i64 - i64::from(last.from));
                last.start + ((apart + window) as f64 / f64::from(last.ratio.max(1e-3))).round() as i64
            }
        };
        let level = match sound.component {
            Component::Whole => 1.0,
            Component::Steady => rules.levels[0],
            Component::Transient => rules.levels[1],
        };
        let mut segment = single(dictionary, &GrainStep { t, gain: level * next.gain, ..*next })?;
        if dictionary.tracks.as_ref().is_some_and(|tracks| tracks.has(next.grain)) {
            segment.octaves = octaves as f32;
        } else {
            let ratio = octaves.exp2();
            segment.ratio = ratio as f32;
            segment.len = ((f64::from(segment.len) / ratio).round() as u32).max(1);
            segment.fades.iter_mut().for_each(|fade| fade.len = (f64::from(fade.len) / ratio).round() as u32);
        }
        self.position = [k, step];
        self.recent.rotate_right(1);
        self.recent[0] = next.grain;
        self.picks += 1;
        Some(segment)
    }

    /// Adds the frames from `first` on to the output. `scratch` has room for one frame of all channels a frame of the output.
    ///
    /// # Shapes
    /// `out: [T * channels]`, interleaved; `scratch` likewise.
    pub fn add(
        &mut self,
        dictionary: &GrainDictionary,
        sounds: &[ContactSound],
        rules: &ChainRules,
        random: &Random,
        [first, channels]: [i64; 2],
        scratch: &mut [f32],
        out: &mut [f32],
    ) {
        let width = channels.max(1) as usize;
        let scratch = &mut scratch[..out.len()];
        scratch.fill(0.0);
        let mut queue = self.queue;
        queue.add(dictionary, [first, channels], scratch, |last, now| {
            self.next(dictionary, sounds, rules, random, last, now)
        });
        self.queue = queue;
        let step = 1.0 - (-1.0 / (SMOOTHING * dictionary.rate)).exp();
        for (k, (out, x)) in out.chunks_exact_mut(width).zip(scratch.chunks_exact(width)).enumerate() {
            self.level.smooth += step * (self.level.at(first + k as i64) - self.level.smooth);
            let gain = if self.level.smooth < SILENT { 0.0 } else { self.level.smooth as f32 };
            out.iter_mut().zip(x).for_each(|(y, x)| *y += gain * x);
        }
    }
}
