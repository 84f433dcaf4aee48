//! The force that a contact draws from a line of noise.

use super::bands::NoiseBands;
use super::law::{Heading, Law, Moves};
use super::slew::Slew;
use super::voices::{CELL, Stretch};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};

/// What one contact leaves behind in a [`NoiseForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseVoice {
    heading: Heading,
    /// Place on the loop, in samples.
    place: f64,
}

impl NoiseVoice {
    /// A contact that begins at a place of a loop.
    #[must_use]
    pub fn at(place: f64) -> Self {
        Self { heading: Heading::default(), place }
    }
}

/// The force of contacts that pass over a loop of noise at their speed; backwards where they turn back.
///
/// # Complexity
/// Those of a [`NoiseBands`] per sample and contact.
#[derive(Clone, Debug)]
pub struct NoiseForce {
    simd: Level,
    /// Strength.
    pub law: Law,
    /// Size of the surface: 2 is everything twice as large.
    pub scale: Slew,
    moves: Moves,
}

impl NoiseForce {
    /// A force at a sample rate.
    #[must_use]
    pub fn new(law: Law, scale: f64, rate: f64) -> Self {
        Self { simd: Level::new(), law, scale: Slew::new(scale, rate), moves: Moves::new() }
    }

    /// Adds the force of one contact over one stretch, N.
    pub fn add(&mut self, noise: &NoiseBands, voice: &mut NoiseVoice, stretch: &Stretch, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, simd => self.stretch(simd, noise, voice, stretch, out));
    }

    #[inline(always)]
    fn stretch(
        &mut self,
        simd: impl Simd,
        noise: &NoiseBands,
        voice: &mut NoiseVoice,
        stretch: &Stretch,
        out: &mut [f32],
    ) {
        self.moves.follow(stretch, &stretch.way(), [1.0; 2], &mut voice.heading);
        let dense = 1.0 / (noise.spacing() * stretch.rate);
        let settled = self.scale.settled(stretch.anchor);
        let round = noise.round();
        let (from, to) = (stretch.from, stretch.to.min(CELL));
        let mut sizes = [settled.unwrap_or(1.0); CELL];
        if settled.is_none() {
            let size = |n: usize| self.scale.at(stretch.anchor + n as i64);
            sizes = std::array::from_fn(size);
        }
        let (mut steps, mut ways, mut places) = ([0.0; CELL], [0.0; CELL], [0.0; CELL]);
        for n in 0..CELL {
            let step = f64::from(self.moves.speed[n]) * dense / sizes[n];
            steps[n] = step as f32;
            ways[n] = f64::from(self.moves.sign[n]) * step;
        }
        // Only where each sample is read has to be found one after the other.
        for n in from..to {
            places[n] = voice.place;
            let next = voice.place + ways[n];
            voice.place = if next >= 0.0 && next < round { next } else { wrapped(next, round) };
        }
        let mut made = noise.read_cell(simd, &places, &steps, from..to);
        let sizes = self.scale.ends(stretch.anchor);
        self.law.apply(stretch, &self.moves, sizes, &mut made);
        out.iter_mut().zip(stretch.part(&mut made)).for_each(|(out, x)| *out += *x);
    }
}

fn wrapped(place: f64, round: f64) -> f64 {
    let place = place.rem_euclid(round);
    // A place just below 0 may round up to a whole round.
    if place < round { place } else { 0.0 }
}
