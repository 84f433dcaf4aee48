//! The force of a line of noise on a contact.

use super::bands::NoiseBands;
use crate::scrape::force::law::Law;
use crate::scrape::force::motion::{Heading, Motion};
use crate::scrape::force::ramp::Ramp;
use crate::scrape::force::segment::{CELL, Segment};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};

/// State of one contact in a [`NoiseForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseVoice {
    heading: Heading,
    /// Position on the loop, in samples.
    #[serde(rename = "place")]
    position: f64,
}

impl NoiseVoice {
    /// A contact that begins at a position of a loop.
    #[must_use]
    pub fn at(position: f64) -> Self {
        Self { heading: Heading::default(), position }
    }
}

/// The force of contacts that pass over a loop of noise at their speed; backwards where they turn back.
///
/// # Complexity
/// As a [`NoiseBands`] per sample and contact.
#[derive(Clone, Debug)]
pub struct NoiseForce {
    simd: Level,
    /// Strength.
    pub law: Law,
    /// Size of the surface: 2 makes everything on it twice as large.
    pub scale: Ramp,
    motion: Motion,
}

impl NoiseForce {
    /// A force at a sample rate.
    #[must_use]
    pub fn new(law: Law, scale: f64, rate: f64) -> Self {
        Self { simd: Level::new(), law, scale: Ramp::new(scale, rate), motion: Motion::new() }
    }

    /// Adds the force of one contact over one segment, N.
    pub fn add(&mut self, noise: &NoiseBands, voice: &mut NoiseVoice, segment: &Segment, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, simd => self.segment(simd, noise, voice, segment, out));
    }

    #[inline(always)]
    fn segment(
        &mut self,
        simd: impl Simd,
        noise: &NoiseBands,
        voice: &mut NoiseVoice,
        segment: &Segment,
        out: &mut [f32],
    ) {
        self.motion.follow(segment, &segment.path(), [1.0; 2], &mut voice.heading);
        let dense = 1.0 / (noise.spacing() * segment.rate);
        let settled = self.scale.settled(segment.anchor);
        let round = noise.round();
        let (from, to) = (segment.from, segment.to.min(CELL));
        let mut sizes = [settled.unwrap_or(1.0); CELL];
        if settled.is_none() {
            let size = |n: usize| self.scale.at(segment.anchor + n as i64);
            sizes = std::array::from_fn(size);
        }
        let (mut steps, mut advances, mut positions) = ([0.0; CELL], [0.0; CELL], [0.0; CELL]);
        for n in 0..CELL {
            let step = f64::from(self.motion.speed[n]) * dense / sizes[n];
            steps[n] = step as f32;
            advances[n] = f64::from(self.motion.sign[n]) * step;
        }
        // Only where each sample is read has to be found one after the other.
        for n in from..to {
            positions[n] = voice.position;
            let next = voice.position + advances[n];
            voice.position = if next >= 0.0 && next < round { next } else { wrapped(next, round) };
        }
        let mut made = noise.read_cell(simd, &positions, &steps, from..to);
        let sizes = self.scale.ends(segment.anchor);
        self.law.apply(segment, &self.motion, sizes, &mut made);
        out.iter_mut().zip(segment.part(&mut made)).for_each(|(out, x)| *out += *x);
    }
}

fn wrapped(position: f64, round: f64) -> f64 {
    let position = position.rem_euclid(round);
    // A position just below 0 may round up to a whole round.
    if position < round { position } else { 0.0 }
}
