//! The force that a contact draws from isophotes.
//!
//! The way of a contact is cut into chords from one sample to the next, whose ends are computed once and belong to both
//! chords that meet there; a curve is crossed where its ends lie on both sides of a chord, and the chord's on both sides of the
//! curve. So each crossing counts once, also at the points of curves and of chords. A chord leaves the cubic by less than a
//! hundred thousandth of a pixel at any speed that is heard.

use super::isophote_index::{IsophoteIndex, Piece, Tile};
use super::isophote_near::Near;
use super::law::{AT_REST, Heading, Law, Moves};
use super::past::Past;
use super::pulses::{LONGEST, Pulses};
use super::slew::Slew;
use super::voices::{CELL, Stretch};
use crate::texture::Isophotes;
use fearless_simd::{Level, dispatch};

/// Area of a pulse over its amplitude, s: a crossing of 1 per pixel is 1 N for 1 ms.
pub const PULSE: f64 = 1e-3;
/// Most crossings that a contact has in a cell of samples.
const MOST: usize = 32;
/// Longest box of a stretch that is asked for at once, and longest chord, px.
const BOX: f64 = 8.0;
/// How far the place of a contact may jump between two pieces that touch, px.
const JOINT: f64 = 0.5;

/// What of isophotes is turned into force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// A pulse for each curve that is crossed.
    Crossing,
    /// The nearness of the next curve.
    Proximity,
}

/// What is remembered of one contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IsophoteVoice {
    heading: Heading,
    /// Where it was at a sample, px.
    trace: Option<(i64, [f64; 2])>,
    /// Slope at the last curve that it crossed.
    met: Option<f64>,
    /// Cell of samples, and crossings in it.
    quota: (i64, usize),
    past: Past,
}

/// A curve that is crossed.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// Samples since the anchor.
    time: f64,
    chord: usize,
    piece: Piece,
    /// Where on the piece, 0 to 1.
    along: f64,
    /// What steps along the axes count on the image.
    steps: [f64; 2],
}

/// Isophotes that contacts move over, and how they answer.
#[derive(Clone, Debug)]
pub struct IsophoteForce {
    simd: Level,
    index: IsophoteIndex,
    density: [f64; 2],
    rate: f64,
    reading: Reading,
    /// Law of force and speed.
    pub law: Law,
    /// Size of the surface.
    pub scale: Slew,
    /// Way over which a crossing is felt, px.
    pub width: f64,
    /// Distance from which a curve is felt, px.
    pub radius: Slew,
    /// Crossings so far.
    pub crossings: u64,
    /// Crossings too many for their time, and chords too long.
    pub left_out: u64,
    pulses: Pulses,
    places: [[f64; 2]; CELL + 1],
    found: Vec<Crossing>,
    near: Near,
    moves: Moves,
}

impl IsophoteForce {
    /// Isophotes read by at most `contacts` contacts at once at a sample rate.
    #[must_use]
    pub fn new(all: &Isophotes, reading: Reading, law: Law, rate: f64, contacts: usize) -> Self {
        let cells = (LONGEST * rate / CELL as f64).ceil() as usize + 2;
        let room = if reading == Reading::Crossing { contacts * MOST * cells } else { 0 };
        Self {
            simd: Level::new(),
            index: IsophoteIndex::new(all),
            density: all.surface.density,
            rate,
            reading,
            law,
            scale: Slew::new(1.0, rate),
            width: 1.0,
            radius: Slew::new(2.0, rate),
            crossings: 0,
            left_out: 0,
            pulses: Pulses::new(room, rate),
            places: [[0.0; 2]; CELL + 1],
            found: Vec::with_capacity(MOST + 1),
            near: Near::new(),
            moves: Moves::new(),
        }
    }

    /// Sets width and radius of curves in pixels, and the size of the surface, before anything sounds.
    pub fn set(&mut self, width: f64, radius: f64, scale: f64) {
        self.width = width;
        (self.radius, self.scale) = (Slew::new(radius, self.rate), Slew::new(scale, self.rate));
    }

    /// Adds what one contact draws over a stretch; `out` holds the samples of the stretch.
    pub fn add(&mut self, voice: &mut IsophoteVoice, stretch: &Stretch, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, _simd => self.stretch(voice, stretch, out));
    }

    #[inline(always)]
    fn stretch(&mut self, voice: &mut IsophoteVoice, stretch: &Stretch, out: &mut [f32]) {
        self.walk(voice, stretch);
        match self.reading {
            Reading::Crossing => self.each_box(
                stretch,
                #[inline(always)]
                |force, from, to| force.cross(voice, stretch, from, to),
            ),
            Reading::Proximity => self.feel(voice, stretch, out),
        }
        if let Some(place) = self.places.get(stretch.to) {
            voice.trace = Some((stretch.anchor + stretch.to as i64, *place));
        }
    }

    /// Adds what is left of pulses to the samples from `first` on.
    pub fn ring_out(&mut self, first: i64, out: &mut [f32]) {
        self.pulses.read(first, out);
    }

    /// Takes over the pulses and counts of another one.
    pub fn take_state(&mut self, old: &Self) {
        self.pulses.take_state(&old.pulses);
        (self.crossings, self.left_out) = (old.crossings, old.left_out);
    }

    /// All that was left out.
    #[must_use]
    pub fn all_left_out(&self) -> u64 {
        self.left_out + self.pulses.left_out
    }

    /// The places at the samples of a stretch and at the one after, px.
    #[inline(always)]
    fn walk(&mut self, voice: &IsophoteVoice, stretch: &Stretch) {
        let [a, b, c, d] = stretch.way();
        let settled = self.scale.settled(stretch.anchor);
        for n in stretch.from..=stretch.to.min(CELL) {
            let t = n as f64;
            let scale = settled.unwrap_or_else(|| self.scale.at(stretch.anchor + n as i64));
            self.places[n] =
                [0, 1].map(|k| (a[k] + t * (b[k] + t * (c[k] + t * d[k]))) * (self.density[k] / scale));
        }
        // A chord begins where the one before has ended, to the bit.
        let first = &mut self.places[stretch.from.min(CELL)];
        if let Some((sample, place)) = voice.trace
            && sample == stretch.anchor + stretch.from as i64
            && (place[0] - first[0]).hypot(place[1] - first[1]) < JOINT
        {
            *first = place;
        }
    }

    /// Cuts a stretch into parts that lie in small boxes on one tile.
    #[inline(always)]
    fn each_box(&mut self, stretch: &Stretch, mut take: impl FnMut(&mut Self, usize, usize)) {
        let (mut from, end) = (stretch.from, stretch.to.min(CELL));
        while from < end {
            let tile = self.index.tile(self.places[from]);
            let (mut low, mut high) = (self.places[from], self.places[from]);
            let mut to = from;
            while to < end {
                let next = self.places[to + 1];
                let wide = |k: usize| next[k].max(high[k]) - next[k].min(low[k]) > BOX;
                if to > from && (wide(0) || wide(1) || !self.index.holds(&tile, self.places[to])) {
                    break;
                }
                for k in 0..2 {
                    (low[k], high[k]) = (low[k].min(next[k]), high[k].max(next[k]));
                }
                to += 1;
            }
            if (0..2).any(|k| high[k] - low[k] > BOX) {
                // Faster than anything that could be told apart.
                self.left_out += 1;
            } else {
                take(self, from, to);
            }
            from = to;
        }
    }

    /// The box of the places `[from, to]` on the image.
    #[inline(always)]
    fn bounds(&self, tile: &[Tile; 2], from: usize, to: usize, margin: f64) -> [[f64; 2]; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in &self.places[from..=to] {
            let (local, _) = self.index.on_image(tile, *place);
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(local[k] - margin), high[k].max(local[k] + margin));
            }
        }
        [low, high]
    }

    /// Finds the curves that the chords `[from, to)` cross, and adds a pulse for each.
    #[inline(always)]
    fn cross(&mut self, voice: &mut IsophoteVoice, stretch: &Stretch, from: usize, to: usize) {
        let tile = self.index.tile(self.places[from]);
        let [low, high] = self.bounds(&tile, from, to, 0.0);
        let (index, places, found) = (&self.index, &self.places, &mut self.found);
        found.clear();
        index.near(
            low,
            high,
            #[inline(always)]
            |piece| {
                let mut before = index.on_image(&tile, places[from]).0;
                let mut side = across(&piece.ends, before);
                for n in from..to {
                    let (next, steps) = index.on_image(&tile, places[n + 1]);
                    let other = across(&piece.ends, next);
                    if (side >= 0.0) != (other >= 0.0) {
                        let [a, b] = piece.ends.map(|p| across(&[before, next], p));
                        if (a >= 0.0) != (b >= 0.0) {
                            let time = n as f64 + side / (side - other);
                            put(found, Crossing { time, chord: n, piece, along: a / (a - b), steps });
                        }
                    }
                    (before, side) = (next, other);
                }
            },
        );
        if found.is_empty() {
            return;
        }
        let (mut force, mut gain) = ([0.0; CELL], [0.0; CELL]);
        stretch.force(&mut force);
        stretch.gain(&mut gain);
        for k in 0..self.found.len() {
            let crossing = self.found[k];
            let n = crossing.chord;
            self.sound(voice, stretch, &crossing, [force[n], gain[n]].map(f64::from));
        }
    }

    /// Adds the pulse of a crossing.
    fn sound(
        &mut self,
        voice: &mut IsophoteVoice,
        stretch: &Stretch,
        crossing: &Crossing,
        [f, gain]: [f64; 2],
    ) {
        let n = crossing.chord;
        let sample = stretch.anchor + n as i64;
        let step = [0, 1].map(|k| self.places[n + 1][k] - self.places[n][k]);
        let long = step[0].hypot(step[1]);
        let g = self.index.gradient(&crossing.piece, crossing.along);
        let slope = (g[0] * crossing.steps[0] * step[0] + g[1] * crossing.steps[1] * step[1]) / long;
        let amplitude = slope - voice.met.unwrap_or(0.0);
        voice.met = Some(slope);
        let scale = self.scale.at(sample);
        let speed = (step[0] / self.density[0]).hypot(step[1] / self.density[1]) * scale * self.rate;
        if speed < f64::from(AT_REST) || f <= 0.0 {
            return;
        }
        let cell = sample.div_euclid(CELL as i64);
        let count = if voice.quota.0 == cell { voice.quota.1 } else { 0 };
        if count == MOST {
            self.left_out += 1;
            return;
        }
        voice.quota = (cell, count + 1);
        self.crossings += 1;
        let [kappa, a, b] = [self.law.kappa, self.law.a, self.law.b].map(|slew| slew.at(sample));
        let area = PULSE * kappa * gain * libm::pow(f, a) * libm::pow(speed, b) * amplitude;
        let owner = (stretch.piece.contact, stretch.piece.jump);
        self.pulses.add(stretch.anchor, crossing.time, self.width / (long * self.rate), area, owner);
    }

    /// Finds the nearest point of all curves within reach for the samples `[from, to)`.
    #[inline(always)]
    fn approach(&mut self, stretch: &Stretch, from: usize, to: usize) {
        let reach = self.radius.at(stretch.anchor).max(self.radius.at(stretch.anchor + CELL as i64));
        let tile = self.index.tile(self.places[from]);
        let bounds = self.bounds(&tile, from, to, reach);
        // Counted from the anchor, whatever the windows, places need no double precision.
        let scale = self.scale.at(stretch.anchor);
        let start = stretch.way()[0];
        let anchor = [0, 1].map(|k| start[k] * (self.density[k] / scale));
        let (origin, _) = self.index.on_image(&tile, anchor);
        self.near.place(origin, [from, to], |n| self.index.on_image(&tile, self.places[n]));
        self.near.find(&self.index, bounds, reach);
    }

    /// The force of the nearest curve over a stretch.
    #[inline(always)]
    fn feel(&mut self, voice: &mut IsophoteVoice, stretch: &Stretch, out: &mut [f32]) {
        self.near.clear();
        self.each_box(
            stretch,
            #[inline(always)]
            |force, from, to| force.approach(stretch, from, to),
        );
        let most = self.density[0].max(self.density[1]);
        let aspect = self.density.map(|d| (d / most) as f32);
        self.moves.follow(stretch, &stretch.way(), aspect, &mut voice.heading);
        let settled = self.radius.settled(stretch.anchor);
        let mut cell = [0.0; CELL];
        for (n, made) in cell.iter_mut().enumerate().take(stretch.to).skip(stretch.from) {
            let (from, to) = (self.places[n], self.places[n + 1]);
            let radius = settled.unwrap_or_else(|| self.radius.at(stretch.anchor + n as i64));
            let nearest = self.near.at(n);
            let near = nearest.map_or(0.0, |(square, _)| (1.0 - square / (radius * radius)).max(0.0));
            let t = [self.moves.tx[n], self.moves.ty[n]].map(f64::from);
            let slope = nearest.map_or(voice.past.last(), |(_, g)| g[0] * t[0] + g[1] * t[1]);
            let step = [to[0] - from[0], to[1] - from[1]];
            let before = voice.past.go((step[0] * step[0] + step[1] * step[1]).sqrt(), slope);
            *made = (near * near * (slope - before)) as f32;
        }
        self.law.apply(stretch, &self.moves, &mut cell);
        out.iter_mut().zip(stretch.part(&mut cell)).for_each(|(out, x)| *out += *x);
    }
}

/// On which side of a line a place lies: 0 on it.
pub(super) fn across([a, b]: &[[f64; 2]; 2], p: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// Sorts a crossing in by its time, once; of more than there may be the earliest stay.
fn put(found: &mut Vec<Crossing>, new: Crossing) {
    // A piece that lies in several cells comes several times.
    let same = |old: &Crossing| {
        (old.chord, old.piece.number) == (new.chord, new.piece.number) && (old.time - new.time).abs() < 1e-6
    };
    if found.iter().any(same) {
        return;
    }
    let later = |old: &Crossing| (old.time, old.piece.number) <= (new.time, new.piece.number);
    let place = found.partition_point(later);
    if place < MOST {
        found.truncate(MOST - 1);
        found.insert(place, new);
    }
}

#[cfg(test)]
#[path = "isophote_tests.rs"]
mod tests;
