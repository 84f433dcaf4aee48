//! The impacts on the far edges of gaps: where the touching point of two surfaces jumps.

use super::creases::{CreaseVoice, Creases};
use crate::impl_state;
use crate::modal::impact::force_ring::ForceRing;
use crate::modal::impact::pulse::{LONGEST, Law, PulseShape, contact_time};
use crate::params;
use crate::scrape::force::motion::AT_REST;
use crate::scrape::force::segment::{CELL, Cell, Segment};
use crate::scrape::path::piece::velocity;

/// Maximum number of impacts in one cell of 64 samples.
const MOST: usize = 4096;

params! {
    /// Impacts where a contact lands on the far edge of a gap, by the law of ImpactForce.
    pub struct JointParams {
        /// Strength of the impacts of a ball where the slope of its path jumps; 0 for none.
        impacts: f64 = 1.0, unit "", range 0.0..=1_000_000.0;
        /// The same of two reliefs. PairMatcher has no impacts: they would make the reliefs louder than what it compares with them.
        pair_impacts: f64 = 0.0, unit "", range 0.0..=1_000_000.0;
        /// Effective mass at the contact, if the paths have none.
        mass: f64 = 0.1, unit "kg", range 0.0..=1_000_000.0;
        /// Normal speed after such an impact over that before it.
        restitution: f64 = 0.5, unit "", range 0.0..=1.0;
        /// Contact time of an impact at the reference energy.
        tau: f64 = 0.001, unit "s", range 0.0001..=0.02;
        /// Energy of the reference.
        energy_ref: f64 = 0.1, unit "J", range 0.000000001..=1_000_000.0;
        /// Stiffness of the pair relative to steel on stone.
        hardness: f64 = 1.0, unit "", range 0.000001..=1000.0;
        /// Shape of a force pulse.
        shape: PulseShape = PulseShape::Cosine;
    }
}

/// An impact that begins within the samples that are being made.
#[derive(Clone, Copy, Debug)]
struct JointImpact {
    /// Sample after its start, contact and jump: the order in which pulses are added, whatever the windows.
    key: (i64, u64, u32),
    /// Samples from `key.0` to its start, above -1 and at most 0.
    start: f64,
    impulse: f64,
    time: f64,
}

/// The force of all impacts at creases.
#[derive(Debug)]
pub struct JointForce {
    /// Parameters, which hold for impacts that have not started.
    pub params: JointParams,
    /// Factor of the force.
    pub gain: f64,
    ring: ForceRing,
    pending: Vec<JointImpact>,
    room: usize,
    /// Number of impacts so far.
    pub count: u64,
    /// Number of impacts that found no room.
    pub left_out: u64,
}
impl_state!(JointForce { ring, count, left_out });

impl JointForce {
    /// Room for the impacts of a number of contacts.
    #[must_use]
    pub fn new(params: &JointParams, gain: f64, rate: f64, contacts: usize) -> Self {
        let room = (CELL * contacts).min(MOST);
        let ring = ForceRing::new(rate, 1, LONGEST + CELL as f64 / rate);
        Self {
            params: params.clone(),
            gain,
            ring,
            pending: Vec::with_capacity(room),
            room,
            count: 0,
            left_out: 0,
        }
    }

    /// Finds the creases that a contact crosses in a segment on a surface of a size.
    ///
    /// A crease with a jump `ds` of the slope along the path is met at the normal speed `v ds`: the impulse is `m v ds (1 + e)`.
    pub fn find(&mut self, creases: &Creases, size: f64, voice: &mut CreaseVoice, segment: &Segment) {
        voice.resize(size);
        let path = segment.path();
        let (from, to) = (segment.from, segment.to.min(CELL));
        let mut positions = [[0.0; 2]; CELL];
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for (n, position) in positions.iter_mut().enumerate().take(to).skip(from) {
            *position = segment.position(n as f64).map(|x| x / size);
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(position[k]), high[k].max(position[k]));
            }
        }
        let Some(end) = to.checked_sub(1).and_then(|n| positions.get(n)).filter(|_| from < to) else {
            return;
        };
        if creases.skip(voice, low, high, *end) {
            return;
        }
        for (n, position) in positions.iter().enumerate().take(to).skip(from) {
            let Some(crossing) = creases.step(voice, *position) else { continue };
            let v = velocity(&path, n as f64, segment.rate);
            let speed = v[0] * crossing.gradient[0] + v[1] * crossing.gradient[1];
            if speed > 0.0 && v[0].hypot(v[1]) >= f64::from(AT_REST) {
                self.strike(segment, n, crossing.at, speed, self.params.impacts);
            }
        }
    }

    /// Adds an impact at a normal speed, in m/s, which begins a part `at` of a step after the sample before `n`.
    pub fn strike(&mut self, segment: &Segment, n: usize, at: f64, speed: f64, strength: f64) {
        let (mut force, mut gain): (Cell, Cell) = ([0.0; CELL], [0.0; CELL]);
        segment.force(&mut force);
        segment.gain(&mut gain);
        let p = &self.params;
        let mass = segment.piece.mass.map_or(p.mass, f64::from);
        let strength = strength * self.gain * f64::from(gain[n]);
        let impulse = strength * mass * speed * (1.0 + p.restitution);
        // What does not press on the surface does not fall into its gaps.
        if impulse == 0.0 || !impulse.is_finite() || force[n] <= 0.0 {
            return;
        }
        if self.pending.len() >= self.room {
            self.left_out += 1;
            return;
        }
        let energy = 0.5 * mass * speed * speed;
        let time = contact_time(Law::Hertz, p.tau, energy, p.energy_ref, p.hardness);
        let key = (segment.anchor + n as i64, segment.piece.contact, segment.piece.jump);
        self.pending.push(JointImpact { key, start: (at - 1.0).max(-0.999_999), impulse, time });
        self.count += 1;
    }

    /// Adds all pulses to the samples from `first` on, at most a cell.
    pub fn add(&mut self, first: i64, out: &mut [f32]) {
        self.pending.sort_unstable_by_key(|impact| impact.key);
        let (mut next, mut left) = (first, out);
        for impact in &self.pending {
            let count = usize::try_from(impact.key.0 - next).unwrap_or(0).min(left.len());
            let (now, later) = left.split_at_mut(count);
            read(&mut self.ring, now);
            (next, left) = (next + count as i64, later);
            self.ring.add(impact.start, 0, impact.impulse, impact.time, self.params.shape);
        }
        read(&mut self.ring, left);
        self.pending.clear();
    }

    /// Takes over the pulses in progress of another one.
    pub fn take_state(&mut self, old: &Self) {
        self.ring.take_state(&old.ring);
        (self.count, self.left_out) = (old.count, old.left_out);
    }
}

/// Adds the next samples of a ring.
fn read(ring: &mut ForceRing, out: &mut [f32]) {
    let mut pulses: Cell = [0.0; CELL];
    for out in out.chunks_mut(CELL) {
        let pulses = &mut pulses[..out.len()];
        ring.read(pulses);
        out.iter_mut().zip(pulses).for_each(|(out, x)| *out += *x);
    }
}

#[cfg(test)]
mod tests;
