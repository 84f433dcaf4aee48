//! The force that a contact draws from a line of noise.

use super::bands::NoiseBands;
use super::law::{Heading, Law, Moves};
use super::slew::Slew;
use super::voices::{CELL, Stretch};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

/// What one contact leaves behind in a [`NoiseForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
        // Where each sample is read, one after the other; then all are read, which need not wait for each other.
        let mut spots = [(0.0, 0.0); CELL];
        for (n, spot) in spots.iter_mut().enumerate().take(to).skip(from) {
            let size = settled.unwrap_or_else(|| self.scale.at(stretch.anchor + n as i64));
            let step = f64::from(self.moves.speed[n]) * dense / size;
            *spot = (voice.place, step as f32);
            let next = voice.place + f64::from(self.moves.sign[n]) * step;
            voice.place = if next >= 0.0 && next < round { next } else { wrapped(next, round) };
        }
        let mut made = [0.0; CELL];
        for (made, (place, step)) in made.iter_mut().zip(spots).take(to).skip(from) {
            *made = noise.read(simd, place, step);
        }
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
