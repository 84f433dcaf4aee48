//! The force of isophotes on a contact.
//!
//! The path of a contact is cut into chords from one sample to the next, whose ends are computed once and belong to
//! both chords that meet there; a curve is crossed where its ends lie on both sides of a chord, and the chord's on both
//! sides of the curve. So each crossing counts once, also at the points of curves and of chords. A chord leaves the
//! cubic by less than a hundred thousandth of a pixel at any audible speed.

use super::chords::{Chords, SegmentPart, norm};
use super::curve_piece::{CurvePiece, across};
use super::end_points::LINE;
use super::history::SlopeHistory;
use super::index::IsophoteIndex;
use super::nearest::NearestCurve;
use crate::impl_state;
use crate::scrape::force::law::Law;
use crate::scrape::force::motion::{AT_REST, Heading, Motion};
use crate::scrape::force::pulses::{LONGEST, PULSE, Pulses};
use crate::scrape::force::ramp::Ramp;
use crate::scrape::force::segment::{CELL, Segment};
use crate::texture::Isophotes;
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Maximum number of crossings of a contact in a cell of samples.
const MAX_COUNT: usize = 32;

/// Reading of isophotes that becomes force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// A pulse for each crossed curve.
    Crossing,
    /// The proximity of the nearest curve.
    Proximity,
}

/// State of one contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IsophoteVoice {
    heading: Heading,
    /// Its position at a sample, px.
    trace: Option<(i64, [f64; 2])>,
    /// Slope at the last curve that it crossed.
    met: Option<f64>,
    /// Cell of samples, and crossings in it.
    quota: (i64, usize),
    #[serde(rename = "past")]
    history: SlopeHistory,
}

/// A curve that is crossed.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// Samples since the anchor.
    time: f64,
    chord: usize,
    piece: CurvePiece,
    /// Position on the piece, 0 to 1.
    along: f64,
}

/// Isophotes that contacts move over, and their force.
#[derive(Clone, Debug)]
pub struct IsophoteForce {
    simd: Level,
    /// Copies share it.
    index: Arc<IsophoteIndex>,
    density: [f64; 2],
    rate: f64,
    reading: Reading,
    /// Law of force and speed.
    pub law: Law,
    /// Size of the surface.
    pub scale: Ramp,
    /// Distance over which a pulse extends, px.
    pub width: f64,
    /// Distance up to which a curve acts, px.
    pub radius: Ramp,
    /// Crossings so far.
    pub crossings: u64,
    /// Crossings beyond the maximum per time, and chords that are too long.
    pub left_out: u64,
    pulses: Pulses,
    chords: Chords,
    found: Vec<Crossing>,
    near: NearestCurve,
    motion: Motion,
}
impl_state!(IsophoteForce { crossings, left_out, pulses });

impl IsophoteForce {
    /// Creates the force for at most `contacts` simultaneous contacts at a sample rate.
    #[must_use]
    pub fn new(all: &Isophotes, reading: Reading, law: Law, rate: f64, contacts: usize) -> Self {
        let cells = (LONGEST * rate / CELL as f64).ceil() as usize + 2;
        let room = if reading == Reading::Crossing { contacts * MAX_COUNT * cells } else { 0 };
        Self {
            simd: Level::new(),
            index: Arc::new(IsophoteIndex::new(all)),
            density: all.surface.density,
            rate,
            reading,
            law,
            scale: Ramp::new(1.0, rate),
            width: 1.0,
            radius: Ramp::new(2.0, rate),
            crossings: 0,
            left_out: 0,
            pulses: Pulses::new(room, rate),
            chords: Chords::new(),
            found: Vec::with_capacity(MAX_COUNT + 1),
            near: NearestCurve::new(),
            motion: Motion::new(),
        }
    }

    /// Sets width and radius of curves in pixels, and the size of the surface, before anything sounds.
    pub fn set(&mut self, width: f64, radius: f64, scale: f64) {
        self.width = width;
        (self.radius, self.scale) = (Ramp::new(radius, self.rate), Ramp::new(scale, self.rate));
    }

    /// Adds the force of one contact over a segment; `out` holds the samples of the segment.
    pub fn add(&mut self, voice: &mut IsophoteVoice, segment: &Segment, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, _simd => self.segment(voice, segment, out));
    }

    #[inline(always)]
    fn segment(&mut self, voice: &mut IsophoteVoice, segment: &Segment, out: &mut [f32]) {
        self.chords.walk(segment, self.density, &self.scale, voice.trace);
        match self.reading {
            Reading::Crossing => self.each_part(
                segment,
                #[inline(always)]
                |force, part| force.cross(voice, segment, part),
            ),
            Reading::Proximity => self.feel(voice, segment, out),
        }
        let to = segment.to.min(CELL);
        voice.trace = Some((segment.anchor + to as i64, self.chords.position(to)));
    }

    /// Cuts a segment into parts that lie in small boxes on one tile.
    #[inline(always)]
    fn each_part(&mut self, segment: &Segment, mut take: impl FnMut(&mut Self, &SegmentPart)) {
        let (mut from, end) = (segment.from, segment.to.min(CELL));
        while from < end {
            let part = self.chords.part(&self.index, from, end);
            if part.long {
                // Too fast to be resolved.
                self.left_out += 1;
            } else {
                take(self, &part);
            }
            from = part.range[1];
        }
    }

    /// Adds the rest of the pulses to the samples from `first` on.
    pub fn ring_out(&mut self, first: i64, out: &mut [f32]) {
        self.pulses.read(first, out);
    }

    /// Takes over the pulses and counts of another one.
    pub fn take_state(&mut self, old: &Self) {
        self.pulses.take_state(&old.pulses);
        (self.crossings, self.left_out) = (old.crossings, old.left_out);
    }

    /// Returns the number of omitted pulses.
    #[must_use]
    pub fn all_left_out(&self) -> u64 {
        self.left_out + self.pulses.left_out
    }

    /// Finds the curves that the chords of a part cross, and adds a pulse for each.
    #[inline(always)]
    fn cross(&mut self, voice: &mut IsophoteVoice, segment: &Segment, part: &SegmentPart) {
        let Self { index, chords, found, .. } = self;
        found.clear();
        let strip = chords.strip(part);
        let mut sides = [0.0; LINE];
        let mut turns = [0_u8; CELL];
        let [from, to] = part.range;
        index.beside(
            part.bounds,
            &strip,
            #[inline(always)]
            |piece| {
                for (n, side) in sides.iter_mut().enumerate() {
                    *side = across(&piece.ends, chords.on_image(n));
                }
                for n in 0..CELL {
                    turns[n] = u8::from((sides[n] >= 0.0) != (sides[n + 1] >= 0.0));
                }
                // Most chords pass by.
                for (word, turns) in turns.chunks_exact(8).enumerate() {
                    if turns.iter().fold(0, |any, x| any | x) == 0 {
                        continue;
                    }
                    for n in (8 * word).max(from)..(8 * word + 8).min(to) {
                        if turns[n % 8] == 0 {
                            continue;
                        }
                        let chord = [chords.on_image(n), chords.on_image(n + 1)];
                        let (a, b) = (across(&chord, piece.ends[0]), across(&chord, piece.ends[1]));
                        if (a >= 0.0) != (b >= 0.0) {
                            let time = n as f64 + sides[n] / (sides[n] - sides[n + 1]);
                            put(found, Crossing { time, chord: n, piece, along: a / (a - b) });
                        }
                    }
                }
            },
        );
        if found.is_empty() {
            return;
        }
        let (mut force, mut gain) = ([0.0; CELL], [0.0; CELL]);
        segment.force(&mut force);
        segment.gain(&mut gain);
        for k in 0..self.found.len() {
            let crossing = self.found[k];
            let n = crossing.chord;
            self.sound(voice, segment, part, &crossing, [force[n], gain[n]].map(f64::from));
        }
    }

    /// Adds the pulse of a crossing.
    fn sound(
        &mut self,
        voice: &mut IsophoteVoice,
        segment: &Segment,
        part: &SegmentPart,
        crossing: &Crossing,
        [f, gain]: [f64; 2],
    ) {
        let n = crossing.chord;
        let sample = segment.anchor + n as i64;
        let step = self.chords.step(n);
        let (_, steps) = self.index.on_image(&part.tile, self.chords.position(n + 1));
        let long = norm(step);
        let g = self.index.gradient(&crossing.piece, crossing.along);
        let slope = (g[0] * steps[0] * step[0] + g[1] * steps[1] * step[1]) / long;
        let amplitude = slope - voice.met.unwrap_or(0.0);
        voice.met = Some(slope);
        let scale = self.scale.at(sample);
        let speed = norm([step[0] / self.density[0], step[1] / self.density[1]]) * scale * self.rate;
        if speed < f64::from(AT_REST) || f <= 0.0 {
            return;
        }
        let cell = sample.div_euclid(CELL as i64);
        let count = if voice.quota.0 == cell { voice.quota.1 } else { 0 };
        if count == MAX_COUNT {
            self.left_out += 1;
            return;
        }
        voice.quota = (cell, count + 1);
        self.crossings += 1;
        let [kappa, a, b] = [self.law.kappa, self.law.a, self.law.b].map(|ramp| ramp.at(sample));
        let bend = f64::from(self.law.bend(speed as f32, scale, sample));
        let area = PULSE * kappa * bend * gain * libm::pow(f, a) * libm::pow(speed, b) * amplitude;
        let owner = (segment.piece.contact, segment.piece.jump);
        self.pulses.add(segment.anchor, crossing.time, self.width / (long * self.rate), area, owner);
    }

    /// Finds the nearest point of all curves within reach for the samples of a part.
    #[inline(always)]
    fn approach(&mut self, segment: &Segment, part: &SegmentPart) {
        let reach = self.radius.at(segment.anchor).max(self.radius.at(segment.anchor + CELL as i64));
        // Counted from the anchor, whatever the windows, positions need no double precision.
        let scale = self.scale.at(segment.anchor);
        let start = segment.path()[0];
        let anchor = [start[0] * (self.density[0] / scale), start[1] * (self.density[1] / scale)];
        let (origin, _) = self.index.on_image(&part.tile, anchor);
        self.near.find(&self.index, &self.chords, part, origin, reach);
    }

    /// The force of the nearest curve over a segment.
    #[inline(always)]
    fn feel(&mut self, voice: &mut IsophoteVoice, segment: &Segment, out: &mut [f32]) {
        self.near.clear();
        self.each_part(
            segment,
            #[inline(always)]
            |force, part| force.approach(segment, part),
        );
        let most = self.density[0].max(self.density[1]);
        let aspect = self.density.map(|d| (d / most) as f32);
        self.motion.follow(segment, &segment.path(), aspect, &mut voice.heading);
        let Self { near, motion, chords, .. } = self;
        let (mut lengths, mut slopes, mut cell) = ([0.0; CELL], [0.0; CELL], [0.0; CELL]);
        for n in 0..CELL {
            lengths[n] = norm(chords.step(n));
            slopes[n] = near.x[n] * f64::from(motion.tx[n]) + near.y[n] * f64::from(motion.ty[n]);
        }
        let settled = self.radius.settled(segment.anchor);
        for n in segment.from..segment.to.min(CELL) {
            let slope = if near.found[n] { slopes[n] } else { voice.history.last() };
            slopes[n] = slope - voice.history.go(lengths[n], slope);
        }
        for n in 0..CELL {
            let radius = settled.unwrap_or_else(|| self.radius.at(segment.anchor + n as i64));
            let close = 1.0 - f64::from(near.squares[n]) / (radius * radius);
            let close = if close > 0.0 && near.found[n] { close } else { 0.0 };
            cell[n] = (close * close * slopes[n]) as f32;
        }
        let sizes = self.scale.ends(segment.anchor);
        self.law.apply(segment, &self.motion, sizes, &mut cell);
        out.iter_mut().zip(segment.part(&mut cell)).for_each(|(out, x)| *out += *x);
    }
}

/// Inserts a crossing in the order of time; beyond the capacity the latest ones are dropped.
fn put(found: &mut Vec<Crossing>, new: Crossing) {
    let later = |old: &Crossing| (old.time, old.piece.number) <= (new.time, new.piece.number);
    let position = found.partition_point(later);
    if position < MAX_COUNT {
        found.truncate(MAX_COUNT - 1);
        found.insert(position, new);
    }
}
