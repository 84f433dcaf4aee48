//! Strengths at which the excitations of one surface are equally loud.
//!
//! All are moved along the same path, the [`StandardStroke`], and their force is compared with that of the whole map of
//! the surface.

use crate::core::time::{Rate, Tick, seconds};
use crate::scrape::force::law::Law;
use crate::scrape::force::segment::Segment;
use crate::scrape::force::voices::Voices;
use crate::scrape::noise::bands::NoiseBands;
use crate::scrape::noise::noise_force::{NoiseForce, NoiseVoice};
use crate::scrape::path::knots::{StrokeContact, circle, pieces};
use crate::scrape::path::other_surface::exchanged;
use crate::scrape::path::piece::PathPiece;
use crate::texture::{Surface, Wrap};
use std::f64::consts::{PI, TAU};

/// Samples per second of the compared forces.
pub const RATE: u32 = 44_100;
/// Number of circles of a stroke, and length of the path along each, px.
const CIRCLES: usize = 8;
const PATH_LENGTH: f64 = 512.0;
/// Shortest and longest time for a circle, samples.
const SAMPLES: [f64; 2] = [8192.0, 32_768.0];
/// Share of a circle over which it fades in, and out.
const FADE: f64 = 0.2;
/// Steps of the best even spread over a plane: powers of the plastic number.
const SPREAD: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// A path over a surface in all directions at an even speed: circles around positions that are spread over the image.
/// Each circle fades in and out so slowly that the fades are inaudible beside it.
#[derive(Clone, Debug)]
pub struct StandardStroke {
    pieces: Vec<(Tick, PathPiece)>,
    samples: usize,
    rate: Rate,
}

/// Amplitude of a circle at a share of its time.
fn window(s: f64) -> f32 {
    let edge = (s.min(1.0 - s) / FADE).clamp(0.0, 1.0);
    (0.5 - 0.5 * libm::cos(PI * edge)) as f32
}

impl StandardStroke {
    /// A stroke over an image of columns and rows, at a speed in m/s and under a normal force in N.
    #[must_use]
    pub fn new(surface: &Surface, size: [usize; 2], speed: f64, force: f64) -> Self {
        let rate = Rate::hz(RATE);
        let fs = rate.as_f64();
        let density = (surface.density[0] * surface.density[1]).sqrt();
        let time = (PATH_LENGTH / density / speed).clamp(SAMPLES[0] / fs, SAMPLES[1] / fs);
        let sides: [f64; 2] = std::array::from_fn(|k| size[k] as f64 / surface.density[k]);
        // Beyond a clamped border there is silence.
        let inside = surface.wrap == Wrap::Clamp;
        let most = if inside { 0.45 * sides[0].min(sides[1]) } else { f64::INFINITY };
        let radius = (PATH_LENGTH / density / TAU).min(most);
        let mut all = Vec::new();
        let mut start = 0.0;
        for k in 0..CIRCLES {
            let centre = std::array::from_fn(|axis| {
                let part = (0.5 + SPREAD[axis] * k as f64).fract();
                if inside { radius + part * (sides[axis] - 2.0 * radius) } else { part * sides[axis] }
            });
            let turns = speed * time / (TAU * radius);
            let contact = StrokeContact { contact: k as u64, object: 0, other: None };
            let knots = circle(centre, radius, turns, start, speed, force).unwrap_or_default();
            let mut part = pieces(&knots, contact);
            // The last one goes straight on: the next circle begins there.
            part.pop();
            for (tick, piece) in &mut part {
                let from = seconds(*tick) - start;
                piece.gain = [from, from + seconds(piece.duration)].map(|t| window(t / time));
            }
            all.extend(part);
            start += time;
        }
        Self { pieces: all, samples: (start * fs).ceil() as usize, rate }
    }

    /// The same stroke with a share of the motion on another surface.
    #[must_use]
    pub fn over_both(mut self, share: f64) -> Self {
        for (_, piece) in &mut self.pieces {
            piece.other = Some(piece.position.map(|c| c.map(|x| share * x)));
        }
        self
    }

    /// The same stroke as it moves over the other surface.
    #[must_use]
    pub fn on_other(&self) -> Self {
        let pieces = self.pieces.iter().filter_map(|(tick, piece)| Some((*tick, exchanged(piece)?)));
        Self { pieces: pieces.collect(), ..*self }
    }

    /// Force of a line of noise on the stroke, by exponents of force and speed, N.
    #[must_use]
    pub fn noise(&self, bands: &NoiseBands, law: [f64; 2]) -> Vec<f32> {
        let mut force = NoiseForce::new(exponents(law), 1.0, self.rate.as_f64());
        self.draw(
            &mut force,
            // Each circle begins elsewhere on the loop.
            |k| NoiseVoice::at(bands.round() * (k as f64 * 0.618_034).fract()),
            |force, voice, segment, out| force.add(bands, voice, segment, out),
            |_, _, _| {},
        )
    }

    /// Samples per second of the force.
    #[must_use]
    pub fn rate(&self) -> Rate {
        self.rate
    }

    /// Force of an excitation on the stroke, N. `fresh` makes the state of circle `k`, `sound` adds a segment, and
    /// `after` ends each cell of samples.
    ///
    /// # Complexity
    /// 8 times 512 pixels at the speed of the stroke, and a quarter of a million samples at most.
    pub fn draw<F, S: Clone>(
        &self,
        excitation: &mut F,
        mut fresh: impl FnMut(u64) -> S,
        sound: impl FnMut(&mut F, &mut S, &Segment, &mut [f32]),
        after: impl FnMut(&mut F, i64, &mut [f32]),
    ) -> Vec<f32> {
        let mut voices = Voices::new(2, self.rate, fresh(0));
        let mut force = vec![0.0; self.samples];
        let fresh = |piece: &PathPiece| fresh(piece.contact);
        voices.play_cells(&self.pieces, None, 0, &mut force, excitation, fresh, sound, after);
        force
    }
}

/// The law of exponents of force and speed, of strength 1.
#[must_use]
pub fn exponents([a, b]: [f64; 2]) -> Law {
    Law::new([1.0, a, b], RATE.into())
}

#[cfg(test)]
mod tests {
    use super::super::matching::{fastest, rms};
    use super::*;
    use crate::core::random::Rng;
    use crate::scrape::{Interp, Law, MapForce, MapVoice, SurfaceMap};
    use crate::texture::{DiscontinuityMap, FeatureMap, Grid};
    use foley_fft::RealFftPlanner;

    fn surface(density: f64, wrap: Wrap) -> Surface {
        Surface { density: [density; 2], wrap, ..Surface::default() }
    }

    fn drawn(stroke: &StandardStroke, map: &SurfaceMap) -> Vec<f32> {
        let rate = stroke.rate().as_f64();
        let mut force = MapForce::new(Law::new([1.0, 1.0, 0.0], rate), 1.0, Interp::Bspline3, rate);
        let blank = |_| MapVoice::default();
        stroke.draw(&mut force, blank, |f, voice, segment, out| f.add(map, voice, segment, out), |_, _, _| {})
    }

    #[test]
    fn the_stroke_goes_in_all_directions_at_its_speed_and_stays_on_a_clamped_image() {
        for (density, wrap, speed) in [
            (512.0, Wrap::Repeat, 1.0),
            (4000.0, Wrap::Clamp, 0.3),
            (512.0, Wrap::Clamp, 0.001),
            (90.0, Wrap::Mirror, 9.0),
        ] {
            let stroke = StandardStroke::new(&surface(density, wrap), [200, 300], speed, 2.0);
            let (mut along, mut across) = (0.0, 0.0);
            for (_, piece) in &stroke.pieces {
                for s in [0.0, 0.5, 1.0] {
                    let v = piece.velocity_at(s);
                    assert!((v[0].hypot(v[1]) / speed - 1.0).abs() < 0.02, "{density} {wrap:?}: {v:?}");
                    assert!(v[0].hypot(v[1]) < fastest(speed, false));
                    (along, across) = (along + v[0] * v[0], across + v[1] * v[1]);
                    let [x, y] = piece.position_at(s).map(|x| x * density);
                    let within = (-0.5..=199.5).contains(&x) && (-0.5..=299.5).contains(&y);
                    assert!(wrap != Wrap::Clamp || within, "{x} {y}");
                }
            }
            assert!((along / across - 1.0).abs() < 0.5 || speed < 0.01, "{along} {across}");
            assert!(stroke.samples <= 8 * 32_768 + 1);
        }
    }

    #[test]
    fn the_stroke_finds_the_power_of_a_map() {
        // Slopes of variance 1 in each direction: the slope along any path has it too, less the power of the fades.
        let mut rng = Rng::new(3);
        let mut soft = |_: usize, _: usize| (0..12).map(|_| rng.uniform() as f32).sum::<f32>() - 6.0;
        let (gx, gy) = (Grid::from_fn(256, 256, &mut soft), Grid::from_fn(256, 256, &mut soft));
        let map = SurfaceMap::slope(&DiscontinuityMap { gx, gy, surface: surface(512.0, Wrap::Repeat) });
        let found = [0.2, 1.0, 5.0].map(|speed| {
            let stroke = StandardStroke::new(&surface(512.0, Wrap::Repeat), [256; 2], speed, 1.0);
            rms(&drawn(&stroke, &map))
        });
        // A cubic B-spline retains (151/315)^2 of white noise in two dimensions, and the window 1 - 5/4 of its edges.
        let right = (151.0 / 315.0) * (1.0_f64 - 1.25 * FADE).sqrt();
        for found in found {
            assert!((found / right - 1.0).abs() < 0.1, "{found} for {right}");
        }
    }

    #[test]
    fn fades_are_not_heard_beside_what_they_fade() {
        // A map of slow waves has no high tones; steps at the ends of the circles would.
        let grid = Grid::from_fn(256, 256, |x, y| {
            (0.5 + 0.25 * (TAU * x as f64 / 32.0).sin() + 0.25 * (TAU * y as f64 / 64.0).cos()) as f32
        });
        let position = surface(512.0, Wrap::Repeat);
        let map = SurfaceMap::feature_change(&FeatureMap { grid, surface: position });
        let mut force: Vec<f64> = drawn(&StandardStroke::new(&position, [256; 2], 1.0, 1.0), &map)
            .into_iter()
            .map(f64::from)
            .collect();
        let fft = RealFftPlanner::new().plan_fft_forward(force.len());
        let mut bins = fft.make_output_vec();
        let n = force.len();
        fft.process(&mut force, &mut bins).unwrap();
        let power = |from: f64| {
            bins[(from * n as f64 / 44_100.0) as usize..].iter().map(|z| z.norm_sqr()).sum::<f64>()
        };
        let level = 10.0 * (power(2000.0) / power(0.0)).log10();
        assert!(level < -80.0, "{level} dB above 2 kHz");
    }
}
