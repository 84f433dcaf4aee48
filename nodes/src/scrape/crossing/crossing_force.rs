//! Force between two surfaces from their lines alone: a pulse where a line of one crosses a line of the other.
//!
//! Along the path, the lines of both surfaces are points that approach each other. A line `x` of the first surface and
//! a line `y` of the second lie at the same position when the contact has come `a` over the one and `b` over the other
//! with
//! `a + b = x + y`. The crossings of two even gratings therefore occur at the sum of their frequencies, as in their
//! joint envelope.

use crate::impl_state;
use crate::scrape::force::law::Law;
use crate::scrape::force::motion::AT_REST;
use crate::scrape::force::pulses::{LONGEST, PULSE, Pulses};
use crate::scrape::force::ramp::Ramp;
use crate::scrape::force::segment::{CELL, Segment};
use crate::scrape::isophote::curve_piece::{CurvePiece, across};
use crate::scrape::isophote::index::IsophoteIndex;
use crate::scrape::path::piece::{position, velocity};
use crate::texture::Isophotes;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Maximum number of lines of one surface within reach, and of crossings in a cell of samples.
const MAX_COUNT: usize = 32;
/// Minimum capacity for pulses: at low sample rates many contacts begin within one cell.
const ROOM: usize = 8192;
/// Maximum length in pixels of one search for lines.
const LONG: usize = 256;

/// State of one contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CrossingVoice {
    /// Cell of samples, and crossings in it.
    quota: (i64, usize),
}

/// Two lines that cross.
#[derive(Clone, Copy, Debug)]
struct LineCrossing {
    /// Samples since the anchor.
    time: f64,
    pieces: [u32; 2],
    sample: usize,
    /// Product of both slopes.
    slopes: f64,
    /// Speed at which they approach each other, m/s.
    speed: f64,
}

/// A line that crosses the line of contact.
#[derive(Clone, Copy, Debug)]
struct CrossedLine {
    /// Position along it, m from the middle of the cell.
    at: f64,
    /// Its slope along the path, per pixel.
    slope: f64,
    piece: u32,
}

/// Two surfaces by their lines, and how contacts between them sound.
///
/// # Complexity
/// Per 64 samples: the cells of an index along the line of contact, and the pairs of the lines that cross it. Cheaper than the
/// reliefs of [`PairForce`](crate::scrape::PairForce) as long as lines are few.
///
/// # Source
/// Picard, Tsingos and Faure (VRIPHYS 2008), section 6, leave two textures to future work; the joint envelope, and its lines in place of
/// it, are a choice.
#[derive(Clone, Debug)]
pub struct CrossingForce {
    /// Lines and their density; copies share them.
    surfaces: [(Arc<IsophoteIndex>, [f64; 2]); 2],
    rate: f64,
    /// Law of force and speed.
    pub law: Law,
    /// Size of both surfaces.
    pub scale: Ramp,
    /// Half the length of the line of contact on surfaces of size 1, m.
    pub reach: f64,
    /// Distance over which a pulse extends, px of the first surface.
    pub width: f64,
    /// Crossings so far.
    pub crossings: u64,
    /// Crossings beyond the maximum, and samples that are too fast for lines to be resolved.
    pub left_out: u64,
    pulses: Pulses,
    found: [Vec<CrossedLine>; 2],
    pending: Vec<LineCrossing>,
    /// Distance travelled over both surfaces at each sample, m from the middle of the cell.
    travel: [[f64; CELL + 1]; 2],
}
impl_state!(CrossingForce { crossings, left_out, pulses });

impl CrossingForce {
    /// Creates the force for at most `contacts` simultaneous contacts at a sample rate.
    #[must_use]
    pub fn new(surfaces: [&Isophotes; 2], law: Law, rate: f64, contacts: usize) -> Self {
        let cells = (LONGEST * rate / CELL as f64).ceil() as usize + 2;
        Self {
            surfaces: surfaces.map(|all| (Arc::new(IsophoteIndex::new(all)), all.surface.density)),
            rate,
            law,
            scale: Ramp::new(1.0, rate),
            reach: 0.002,
            width: 1.0,
            crossings: 0,
            left_out: 0,
            pulses: Pulses::new((contacts * MAX_COUNT * cells).max(ROOM), rate),
            found: [(); 2].map(|()| Vec::with_capacity(MAX_COUNT)),
            pending: Vec::with_capacity(MAX_COUNT + 1),
            travel: [[0.0; CELL + 1]; 2],
        }
    }

    /// Adds the crossings of one contact over a segment; [`ring_out`](Self::ring_out) writes their pulses.
    pub fn add(&mut self, voice: &mut CrossingVoice, segment: &Segment, _: &mut [f32]) {
        let paths = [segment.path(), segment.other_path().unwrap_or([[0.0; 2]; 4])];
        let Some(direction) = direction(&paths, self.rate) else { return };
        let middle = CELL as f64 / 2.0;
        let bases = paths.map(|path| position(&path, middle));
        for (side, path) in paths.iter().enumerate() {
            for (n, travel) in self.travel[side].iter_mut().enumerate() {
                let at = position(path, n as f64);
                *travel = (at[0] - bases[side][0]) * direction[0] + (at[1] - bases[side][1]) * direction[1];
            }
        }
        let size = self.scale.at(segment.anchor);
        let reach = self.reach * size;
        let mut near = true;
        for (side, base) in bases.into_iter().enumerate() {
            let ends =
                self.travel[side].iter().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
            near &= self.cross(side, base, direction, [ends.0 - reach, ends.1 + reach], size);
        }
        if !near {
            // Too fast for lines to be resolved.
            self.left_out += (segment.to - segment.from) as u64;
            return;
        }
        self.find_crossings(segment, reach);
        for k in 0..self.pending.len() {
            let crossing = self.pending[k];
            self.sound(voice, segment, &crossing, size);
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

    /// Finds the lines of one surface that cross the straight line through `base`, between two positions on it in m.
    /// Returns true if these positions are near enough.
    fn cross(
        &mut self,
        side: usize,
        base: [f64; 2],
        direction: [f64; 2],
        [low, high]: [f64; 2],
        size: f64,
    ) -> bool {
        let (index, density) = &self.surfaces[side];
        let found = &mut self.found[side];
        found.clear();
        let pixels = [0, 1].map(|k| direction[k] * density[k] / size);
        let per_metre = pixels[0].hypot(pixels[1]);
        let steps = ((high - low) * per_metre).ceil().max(1.0);
        if steps > LONG as f64 {
            return false;
        }
        let at = |k: f64| {
            let distance = low + (high - low) * k / steps;
            [0, 1].map(|axis| base[axis] * density[axis] / size + distance * pixels[axis])
        };
        for k in 0..steps as usize {
            let ends = [at(k as f64), at(k as f64 + 1.0)];
            // In steps of a pixel each lies on one tile, or as near to it as lines continue.
            let tile = index.tile(at(k as f64 + 0.5));
            let [(a, steps_on), (b, _)] = ends.map(|p| index.on_image(&tile, p));
            let (from, to) = ([a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]);
            let slope =
                |g: [f64; 2]| (g[0] * steps_on[0] * pixels[0] + g[1] * steps_on[1] * pixels[1]) / per_metre;
            index.near(from, to, |piece| {
                let Some((part, along)) = intersection(&piece, [a, b]) else { return };
                let one = CrossedLine {
                    at: low + (high - low) * (k as f64 + part) / steps,
                    slope: slope(index.gradient(&piece, along)),
                    piece: piece.number,
                };
                let same =
                    |old: &CrossedLine| old.piece == one.piece && (old.at - one.at).abs() * per_metre < 1e-6;
                if !found.iter().any(same) && found.len() < MAX_COUNT {
                    found.push(one);
                }
            });
        }
        found.sort_by(|a, b| {
            (a.at, a.piece).partial_cmp(&(b.at, b.piece)).unwrap_or(std::cmp::Ordering::Equal)
        });
        true
    }

    /// Finds the pairs of lines that cross within a segment, the earliest first.
    ///
    /// Pairs that make no sound do not count, so that the division into cells has no effect.
    fn find_crossings(&mut self, segment: &Segment, reach: f64) {
        let mut force = [0.0; CELL];
        segment.force(&mut force);
        let Self { travel, found: [found_a, found_b], pending, .. } = self;
        let sum: [f64; CELL + 1] = std::array::from_fn(|n| travel[0][n] + travel[1][n]);
        pending.clear();
        for (a, b) in found_a.iter().flat_map(|a| found_b.iter().map(move |b| (a, b))) {
            let wanted = a.at + b.at;
            for n in segment.from..segment.to.min(CELL) {
                let (before, after) = (sum[n] - wanted, sum[n + 1] - wanted);
                if (before >= 0.0) == (after >= 0.0) {
                    continue;
                }
                let part = before / (before - after);
                let off = a.at - travel[0][n] - part * (travel[0][n + 1] - travel[0][n]);
                let speed = (after - before).abs() * self.rate;
                let sounds = speed >= f64::from(AT_REST) && force[n] > 0.0;
                if sounds && off.abs() <= reach {
                    let pieces = [a.piece, b.piece];
                    let time = n as f64 + part;
                    self.left_out += u64::from(pending.len() == MAX_COUNT);
                    put(pending, LineCrossing { time, pieces, sample: n, slopes: a.slope * b.slope, speed });
                }
            }
        }
    }

    /// Adds the pulse of a meeting.
    fn sound(&mut self, voice: &mut CrossingVoice, segment: &Segment, crossing: &LineCrossing, size: f64) {
        let (mut force, mut gain) = ([0.0; CELL], [0.0; CELL]);
        segment.force(&mut force);
        segment.gain(&mut gain);
        let [force, gain] = [force, gain].map(|x| f64::from(x[crossing.sample]));
        let LineCrossing { speed, .. } = *crossing;
        let sample = segment.anchor + crossing.sample as i64;
        let cell = sample.div_euclid(CELL as i64);
        let count = if voice.quota.0 == cell { voice.quota.1 } else { 0 };
        if count == MAX_COUNT {
            self.left_out += 1;
            return;
        }
        voice.quota = (cell, count + 1);
        self.crossings += 1;
        let [kappa, a, b] = [self.law.kappa, self.law.a, self.law.b].map(|ramp| ramp.at(sample));
        let strength = libm::pow(force, a) * libm::pow(speed, b) * gain;
        let density = self.surfaces[0].1;
        let time = self.width * size / (density[0] * density[1]).sqrt() / speed;
        let bend = f64::from(self.law.bend(speed as f32, size, sample));
        let area = PULSE * kappa * bend * strength * crossing.slopes;
        self.pulses.add(
            segment.anchor,
            crossing.time,
            time,
            area,
            (segment.piece.contact, segment.piece.jump),
        );
    }
}

/// Inserts a crossing in the order of time; beyond the capacity the latest ones are dropped.
fn put(pending: &mut Vec<LineCrossing>, new: LineCrossing) {
    let position = pending.partition_point(|old| (old.time, old.pieces) <= (new.time, new.pieces));
    if position < MAX_COUNT {
        pending.truncate(MAX_COUNT - 1);
        pending.insert(position, new);
    }
}

/// Unit vector of the slip in the middle of a cell, from the first surface that moves.
fn direction(paths: &[[[f64; 2]; 4]; 2], rate: f64) -> Option<[f64; 2]> {
    let n = CELL as f64 / 2.0;
    paths.iter().find_map(|c| {
        let v = velocity(c, n, rate);
        let speed = v[0].hypot(v[1]);
        (speed >= f64::from(AT_REST)).then(|| v.map(|v| v / speed))
    })
}

/// Intersection of a piece with a chord, as fractions of the chord and of the piece.
fn intersection(piece: &CurvePiece, chord: [[f64; 2]; 2]) -> Option<(f64, f64)> {
    let [before, after] = chord.map(|p| across(&piece.ends, p));
    let [low, high] = piece.ends.map(|p| across(&chord, p));
    let crosses = (before >= 0.0) != (after >= 0.0) && (low >= 0.0) != (high >= 0.0);
    crosses.then(|| (before / (before - after), low / (low - high)))
}
