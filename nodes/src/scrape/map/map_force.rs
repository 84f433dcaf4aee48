//! The force of a map of a surface on a contact.

use super::padded_map::Interp;
use super::surface_map::{Positions, SurfaceMap};
use crate::scrape::force::law::Law;
use crate::scrape::force::motion::{Heading, Motion};
use crate::scrape::force::ramp::Ramp;
use crate::scrape::force::segment::{CELL, Cell, Segment};
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Corner of the high-pass that removes the mean of a map that is never negative, Hz.
const CORNER: f64 = 20.0;

/// State of one contact in a [`MapForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapVoice {
    heading: Heading,
    /// Last input and output of the high-pass.
    high: Option<[f32; 2]>,
}

/// The force of contacts that move over a map: `kappa (f/f_ref)^a (v/v_ref)^b m(t)`.
///
/// # Complexity
/// 16 pixels per sample and contact; 32 at speeds at which more than half a pixel is passed from one sample to the next.
#[derive(Clone, Debug)]
pub struct MapForce {
    simd: Level,
    /// Strength.
    pub law: Law,
    /// Size of the surface: 2 makes everything on it twice as large.
    pub scale: Ramp,
    interp: Interp,
    /// Feedback of the high-pass.
    feedback: f32,
    motion: Motion,
    x: Cell,
    y: Cell,
}

impl MapForce {
    /// A force at a sample rate.
    #[must_use]
    pub fn new(law: Law, scale: f64, interp: Interp, rate: f64) -> Self {
        let feedback = (-TAU * CORNER / rate).exp() as f32;
        let (simd, scale) = (Level::new(), Ramp::new(scale, rate));
        Self { simd, law, scale, interp, feedback, motion: Motion::new(), x: [0.0; CELL], y: [0.0; CELL] }
    }

    /// Adds the force of one contact over one segment, N.
    pub fn add(&mut self, map: &SurfaceMap, voice: &mut MapVoice, segment: &Segment, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, _simd => self.segment(map, voice, segment, out));
    }

    #[inline(always)]
    fn segment(&mut self, map: &SurfaceMap, voice: &mut MapVoice, segment: &Segment, out: &mut [f32]) {
        let path = segment.path();
        let [dx, dy] = map.surface.density;
        // Directions are those of pixels where changes are per pixel.
        let aspect =
            if map.per_metre.is_some() { [1.0; 2] } else { [dx / dy, dy / dx].map(|r| r.sqrt() as f32) };
        self.motion.follow(segment, &path, aspect, &mut voice.heading);
        let base = self.position(segment, &path, [dx, dy]);
        let range = [segment.from, segment.to];
        let size = self.scale.at(segment.anchor);
        let dense = (dx.max(dy) / size / segment.rate) as f32;
        let mut footprints = self.motion.speed;
        footprints.iter_mut().for_each(|v| *v *= dense);
        let far = segment.part(&mut footprints).iter().any(|x| *x > 0.5);
        let Self { motion, x, y, .. } = &*self;
        let positions = Positions { base, x, y, tx: &motion.tx, ty: &motion.ty };
        let mut made = [0.0; CELL];
        map.read(self.interp, &positions, far.then_some(&footprints), range, &mut made);
        if !map.directional() {
            high_pass(self.feedback, &mut voice.high, segment.part(&mut made));
        }
        let sizes = self.scale.ends(segment.anchor);
        self.law.apply(segment, &self.motion, sizes, &mut made);
        out.iter_mut().zip(segment.part(&mut made)).for_each(|(out, x)| *out += *x);
    }

    /// The positions of a segment in pixels from a pixel that is returned.
    #[inline(always)]
    fn position(&mut self, segment: &Segment, path: &[[f64; 2]; 4], density: [f64; 2]) -> [i64; 2] {
        let size = self.scale.at(segment.anchor);
        let start = [0, 1].map(|k| path[0][k] * density[k] / size);
        let whole = start.map(f64::floor);
        let part = [0, 1].map(|k| start[k] - whole[k]);
        if self.scale.settled(segment.anchor).is_some() {
            let [dx, dy] = density.map(|d| (d / size) as f32);
            let [px, py] = part.map(|p| p as f32);
            for n in 0..CELL {
                self.x[n] = px + dx * self.motion.x[n];
                self.y[n] = py + dy * self.motion.y[n];
            }
        } else {
            // All positions move while the size does.
            for n in segment.from..segment.to.min(CELL) {
                let size = self.scale.at(segment.anchor + n as i64);
                let at = |k: usize, local: f32| {
                    ((path[0][k] + f64::from(local)) * density[k] / size - whole[k]) as f32
                };
                self.x[n] = at(0, self.motion.x[n]);
                self.y[n] = at(1, self.motion.y[n]);
            }
        }
        whole.map(|x| x as i64)
    }
}

#[inline(always)]
fn high_pass(feedback: f32, state: &mut Option<[f32; 2]>, samples: &mut [f32]) {
    let Some(first) = samples.first() else { return };
    // A contact begins without a step.
    let [mut before, mut y] = state.unwrap_or([*first, 0.0]);
    for x in samples {
        y = feedback * (y + *x - before);
        before = *x;
        *x = y;
    }
    *state = Some([before, if y.abs() < 1e-20 { 0.0 } else { y }]);
}
