//! The node `PairMatcher`.

use super::level_matcher::bands;
use super::matching::{
    StrokeParams, TuningParams, by_speed, factor, fastest, loudness, rendered, rms, share, sum,
};
use super::standard_stroke::{RATE, StandardStroke, exponents};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::modal::Modes;
use crate::scrape::crossing::crossing_force::{CrossingForce, CrossingVoice};
use crate::scrape::force::motion::Heading;
use crate::scrape::force::speed_curve::SpeedCurve;
use crate::scrape::force::strength::Strength;
use crate::scrape::isophote::isophote_excitation;
use crate::scrape::map::padded_map::check_grid;
use crate::scrape::noise::bands::NoiseBands;
use crate::scrape::relief::heights::{Relief, heights};
use crate::scrape::relief::pair_force::PairForce;
use crate::scrape::relief::two_textures::check;
use crate::texture::sobel::gradient;
use crate::texture::{Isophotes, Luma, NoiseMap, NoiseProfile};
use crate::{params, ports};
use rayon::prelude::*;

/// Samples per second of the compared forces.
const FS: f64 = RATE as f64;
/// Share of the noise without noise maps.
const HALF: f64 = 0.5;
/// Slowest speed around which a strength is computed, m/s.
const SLOWEST: f64 = 1e-6;

params! {
    /// Finds the strengths at which all excitations of two surfaces on each other, so all levels of detail, are equally loud.
    ///
    /// As LevelMatcher for one surface: before the sound starts, the reliefs of TwoTextures move over each other along circles in all
    /// directions, at `speed` over the first surface and at `other` times that over the second one. TwoTextures has the strength
    /// `kappa`. The other outputs are the strengths at which the force, or with a link to `modes` the sound, has the same RMS: of
    /// FeatureCrossings together with the noise of both surfaces, of both noises alone, and of both noises from their spectra. Link them
    /// to the `kappa` of the excitations. An output without the input that it needs is 0.
    ///
    /// Reliefs end at half of the pixels of their images per metre. The slopes of `detail_a` and `detail_b` continue them, and all together
    /// are the reference. A NoiseExcitation of detail needs the exponents `a` of `relief_law` and `b: 1`, since a relief acts by the speed at
    /// which its heights change.
    ///
    /// Within a level the forces have the ratio that they have on the surfaces: noises the slopes of their maps, in metres of height per
    /// second of motion, and crossings the rest of the power of the reliefs, after the share of these slopes in the slopes of the whole
    /// reliefs, or one half without a noise map.
    ///
    /// A strength is found for each quarter of an octave up to two octaves below and above `speed`, and read at the speed of the contact;
    /// without `by_speed` for `speed` only. A relief of twice the size is twice as high, and strengths follow that: all levels are equally
    /// loud at any `scale` of the excitations, if it is the same for all. Set `radius`, `taps`, `reach`, `width` and the exponents as in
    /// the excitations.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2, for the levels of
    /// detail; section 6 leaves two textures to future work, and equal power is a choice.
    pub struct PairMatcherParams {
        /// Force in N at 1 N where the surfaces part at 1 m/s.
        kappa: f64 = 1.0, unit "N", range 0.0..=1_000_000.0;
        /// Speed of the stroke over the first surface.
        speed: f64 = 1.0, unit "m/s", range 0.001..=100.0;
        /// Distance travelled on the second surface per distance on the first.
        other: f64 = 1.0, unit "", range -100.0..=100.0;
        /// Comparison by strokes.
        [group] stroke: StrokeParams;
        /// Common radius of curvature at the contact.
        radius: f64 = 0.02, unit "m", range 0.0001..=10.0;
        /// Points of the line of contact; an odd number.
        taps: u16 = 33, unit "points", range 3..=129_u16;
        /// Half the length of the line of contact.
        reach: f64 = 0.002, unit "m", range 0.00001..=0.1;
        /// Distance over which a pulse extends, in pixels of the first surface.
        width: f64 = 1.0, unit "px", range 0.01..=100.0;
        /// Exponent of force of reliefs.
        relief_law: f64 = 1.0, unit "", range 0.0..=2.0;
        /// Exponents of force and speed of crossings.
        crossing_law: [f64; 2] = [1.0, 0.0], unit "", range 0.0..=2.0;
        /// Exponents of force and speed of noise.
        noise_law: [f64; 2] = [0.5, 0.5], unit "", range 0.0..=2.0;
        /// Tuning of `modes`.
        [group] tuning: TuningParams;
    }
}
ports! {
    pub struct PairMatcherPorts / PairMatcherIo {
        in {
            /// Relief of the first surface: with `b` the reference for all levels.
            a: Value<Luma>,
            /// Relief of the second surface.
            b: Value<Luma>,
            /// Lines of the first surface.
            lines_a: Option<Value<Isophotes>>,
            /// Lines of the second surface.
            lines_b: Option<Value<Isophotes>>,
            /// Noise map of the first surface, for the share of its noise.
            rest_a: Option<Value<NoiseMap>>,
            /// Noise map of the second surface.
            rest_b: Option<Value<NoiseMap>>,
            /// Noise profile of the first surface.
            noise_a: Option<Value<NoiseProfile>>,
            /// Noise profile of the second surface.
            noise_b: Option<Value<NoiseProfile>>,
            /// Noise of the first surface from a spectrum.
            spectrum_a: Option<Value<NoiseProfile>>,
            /// Noise of the second surface from a spectrum.
            spectrum_b: Option<Value<NoiseProfile>>,
            /// Detail of the first surface finer than its image, beside the reliefs: a NoiseProfile with `part: Detail`.
            detail_a: Option<Value<NoiseProfile>>,
            /// Detail of the second surface.
            detail_b: Option<Value<NoiseProfile>>,
            /// Modes of the scraped object.
            modes: Option<Value<Modes>>,
        }
        out {
            /// Strength of the reliefs.
            full: Value<Strength>,
            /// Strength of the crossings, together with both noises.
            split_crossings: Value<Strength>,
            /// Strength of the first noise, together with crossings.
            split_noise_a: Value<Strength>,
            /// Strength of the second noise, together with crossings.
            split_noise_b: Value<Strength>,
            /// Strength of the first noise, together with the second noise only.
            only_noise_a: Value<Strength>,
            /// Strength of the second noise, together with the first noise only.
            only_noise_b: Value<Strength>,
            /// Strength of the first noise from a spectrum, together with the second noise only.
            only_spectrum_a: Value<Strength>,
            /// Strength of the second noise from a spectrum, together with the first noise only.
            only_spectrum_b: Value<Strength>,
            /// Strength of the detail of the first surface beside the reliefs.
            full_detail_a: Value<Strength>,
            /// Strength of the detail of the second surface beside the reliefs.
            full_detail_b: Value<Strength>,
        }
    }
}

/// The node `PairMatcher`.
#[derive(Debug)]
pub struct PairMatcher;

/// Data of two surfaces that is prepared before strokes.
struct Pair<'a> {
    p: PairMatcherParams,
    a: &'a Luma,
    modes: Option<&'a Modes>,
    reliefs: [Relief; 2],
    lines: Option<CrossingForce>,
    noises: [Option<NoiseBands>; 2],
    alike: [Option<NoiseBands>; 2],
    details: [Option<NoiseBands>; 2],
    /// Slopes of the surfaces in m per m for changes of luminance of 1 per pixel.
    steepness: [f64; 2],
    /// Share of the noises in the power of crossings and noises, and of the second noise in that of both.
    shares: [f64; 2],
}

/// Strengths at one speed, in the order of the outputs.
type Found = [f64; 10];

/// Mean square of the slopes of a relief in m per m, and the share that its noise has in it.
fn slopes(luma: &Luma, rest: Option<&NoiseMap>, field: &'static str) -> Result<[f64; 2], Reject> {
    let heights = heights(luma);
    let of_heights = gradient(&heights, luma.surface.wrap);
    let power = |axis: usize| {
        let squares = of_heights[axis].samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        squares * luma.surface.density[axis].powi(2) / heights.samples.len().max(1) as f64
    };
    let Some(rest) = rest else { return Ok([power(0) + power(1), HALF]) };
    check_grid(field, &rest.grid, &rest.surface)?;
    let whole = gradient(&luma.grid, luma.surface.wrap);
    let [x, y] = gradient(&rest.grid, rest.surface.wrap);
    Ok([power(0) + power(1), share([&whole[0], &whole[1]], [&x, &y])])
}

impl<'a> Pair<'a> {
    fn new(p: &PairMatcherParams, io: &PairMatcherIo<'a>) -> Result<Self, Reject> {
        check("a", io.a)?;
        check("b", io.b)?;
        let lines = |(a, b): (&Isophotes, &Isophotes)| {
            isophote_excitation::check("lines_a", a)?;
            isophote_excitation::check("lines_b", b)?;
            let mut force = CrossingForce::new([a, b], exponents(p.crossing_law), FS, 2);
            (force.reach, force.width) = (p.reach, p.width);
            Ok::<_, Reject>(force)
        };
        let lines = io.lines_a.zip(io.lines_b).map(lines).transpose()?;
        let [first, own_first] = slopes(io.a, io.rest_a, "rest_a")?;
        let [second, own_second] = slopes(io.b, io.rest_b, "rest_b")?;
        // A pattern that passes faster changes faster.
        let second = second * p.other.powi(2);
        let noise = [first * own_first, second * own_second];
        let fastest = fastest(p.speed, p.stroke.by_speed);
        let first_bands = |profile| bands(profile, p.stroke.noise_value, fastest);
        let second_bands = |profile| bands(profile, p.stroke.noise_value, fastest * p.other.abs());
        let part = |x: f64, of: f64| if of > 0.0 { x / of } else { HALF };
        Ok(Self {
            p: p.clone(),
            a: io.a,
            modes: io.modes,
            reliefs: [io.a, io.b].map(|luma| Relief::new(&heights(luma), &luma.surface)),
            lines,
            noises: [io.noise_a.map(first_bands).transpose()?, io.noise_b.map(second_bands).transpose()?],
            alike: [
                io.spectrum_a.map(first_bands).transpose()?,
                io.spectrum_b.map(second_bands).transpose()?,
            ],
            details: [io.detail_a.map(first_bands).transpose()?, io.detail_b.map(second_bands).transpose()?],
            steepness: [io.a, io.b].map(|luma| {
                let [x, y] = luma.surface.density;
                luma.surface.depth / f64::from(luma.kind.max()) * (x * y).sqrt()
            }),
            shares: [part(noise[0] + noise[1], first + second), part(noise[1], noise[0] + noise[1])],
        })
    }

    fn rendered(&self, force: Vec<f32>) -> Result<Vec<f32>, Fault> {
        rendered(force, self.modes, [self.p.tuning.damping, self.p.tuning.pitch])
            .map_err(|e| Reject::new("F078", e.to_string()).at("modes").into())
    }

    fn reliefs(&self, stroke: &StandardStroke) -> Vec<f32> {
        let [a, b] = &self.reliefs;
        let law = exponents([self.p.relief_law, 0.0]);
        let mut force = PairForce::new(law, self.p.taps.into(), self.p.radius, a.range() + b.range());
        stroke.draw(
            &mut force,
            |_| Heading::default(),
            |force, heading, segment, out| force.add([a, b], heading, segment, out),
            |_, _, _| {},
        )
    }

    fn crossings(&self, stroke: &StandardStroke) -> Vec<f32> {
        let Some(mut force) = self.lines.clone() else { return Vec::new() };
        stroke.draw(&mut force, |_| CrossingVoice::default(), CrossingForce::add, CrossingForce::ring_out)
    }

    /// Loudness of the sound of forces, each times its factor.
    fn loud(&self, forces: &[&[f32]], factors: &[f64]) -> Result<f64, Fault> {
        let all = forces.iter().zip(factors).fold(Vec::new(), |all, (x, by)| sum([&all, x], [1.0, *by]));
        Ok(loudness(&self.rendered(all)?, self.p.stroke.weighting))
    }

    /// Finds the strength of each excitation at a speed over the first surface, m/s.
    fn at(&self, speed: f64) -> Result<Found, Fault> {
        let (p, full) = (&self.p, self.p.kappa);
        let size = [self.a.grid.width, self.a.grid.height];
        let stroke = StandardStroke::new(&self.a.surface, size, speed, p.stroke.force);
        let stroke = stroke.over_both(p.other);
        let strokes = [&stroke, &stroke.on_other()];
        let forces = |bands: &[Option<NoiseBands>; 2], law: [f64; 2]| {
            [0, 1].map(|k| bands[k].as_ref().map(|bands| strokes[k].noise(bands, law)).unwrap_or_default())
        };
        let reliefs = self.reliefs(&stroke);
        let [c, d] = forces(&self.details, [p.relief_law, 1.0]);
        let beside = self.steepness.map(|steep| full * steep);
        let wanted = self.loud(&[&reliefs, &c, &d], &[full, beside[0], beside[1]])?;
        // Factors of forces in a ratio with which all together are as loud as the reference.
        let together = |forces: [&[f32]; 3], ratio: [f64; 3]| -> Result<[f64; 3], Fault> {
            let all = factor(wanted, self.loud(&forces, &ratio)?);
            let strengths: [f64; 3] =
                std::array::from_fn(|k| if forces[k].is_empty() { 0.0 } else { ratio[k] });
            Ok(strengths.map(|x| x * all))
        };
        // Noise has its own law, and the strength of the reliefs under the force and at the speed of the stroke.
        let own: [f64; 2] = std::array::from_fn(|k| {
            let speed = if k == 0 { speed } else { speed * p.other.abs() };
            let [a, b] = [p.relief_law - p.noise_law[0], 1.0 - p.noise_law[1]];
            beside[k] * p.stroke.force.powf(a) * speed.powf(b)
        });
        let crossings = self.crossings(&stroke);
        let [a, b] = forces(&self.noises, p.noise_law);
        let share = if a.is_empty() && b.is_empty() { 0.0 } else { self.shares[0] };
        let lines = full * factor(rms(&reliefs) * (1.0 - share).sqrt(), rms(&crossings));
        let [lines, split_a, split_b] = together([&crossings, &a, &b], [lines, own[0], own[1]])?;
        let [_, only_a, only_b] = together([&[], &a, &b], [0.0, own[0], own[1]])?;
        let [a, b] = forces(&self.alike, p.noise_law);
        let [_, alike_a, alike_b] = together([&[], &a, &b], [0.0, own[0], own[1]])?;
        let details = [0, 1].map(|k| if self.details[k].is_some() { beside[k] } else { 0.0 });
        Ok([full, lines, split_a, split_b, only_a, only_b, alike_a, alike_b, details[0], details[1]])
    }
}

fn strength(speed: f64, found: &[Found], level: usize) -> Strength {
    let (kappa, factors) = by_speed(|k| found[k][level], found.len());
    Strength { kappa, curve: Some(SpeedCurve::new(speed.max(SLOWEST), factors).of_relief()) }
}

impl Func for PairMatcher {
    type Params = PairMatcherParams;
    type Ports = PairMatcherPorts;
    const NAME: &'static str = "PairMatcher";
    const VERSION: u32 = 3;

    fn eval(p: &PairMatcherParams, _: &Build<'_>, mut io: PairMatcherIo<'_>) -> Result<Summary, Fault> {
        let pair = Pair::new(p, &io)?;
        let all: Vec<Found> = if p.stroke.by_speed {
            SpeedCurve::speeds(p.speed)
                .into_par_iter()
                .map(|speed| pair.at(speed))
                .collect::<Result<_, _>>()?
        } else {
            vec![pair.at(p.speed)?]
        };
        let mut summary: Summary =
            vec![("noise_share", pair.shares[0].into()), ("second_noise_share", pair.shares[1].into())];
        // The speed at which each is read: its own; for crossings, that at which lines approach each other.
        let (first, second) = (p.speed, p.speed * p.other.abs());
        let meeting = p.speed * (1.0 + p.other).abs();
        for (level, (key, slot, speed)) in [
            ("full", &mut io.full, first),
            ("split_crossings", &mut io.split_crossings, meeting),
            ("split_noise_a", &mut io.split_noise_a, first),
            ("split_noise_b", &mut io.split_noise_b, second),
            ("only_noise_a", &mut io.only_noise_a, first),
            ("only_noise_b", &mut io.only_noise_b, second),
            ("only_spectrum_a", &mut io.only_spectrum_a, first),
            ("only_spectrum_b", &mut io.only_spectrum_b, second),
            ("full_detail_a", &mut io.full_detail_a, first),
            ("full_detail_b", &mut io.full_detail_b, second),
        ]
        .into_iter()
        .enumerate()
        {
            let value = strength(speed, &all, level);
            slot.set(value);
            summary.push((key, value.kappa.into()));
        }
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (PairMatcherParams, MemoryFiles) {
        // Fast strokes, which are short, and mostly one.
        let (speed, by_speed) = (rng.between(50.0, 100.0), rng.below(32) == 0);
        // A short line of contact, on which few lines of the surfaces meet.
        let (taps, reach) = (3 + 2 * rng.below(8) as u16, rng.between(0.00001, 0.001));
        let mut p = PairMatcherParams::trial(rng);
        (p.speed, p.stroke.by_speed) = (speed, by_speed);
        (p.taps, p.reach) = (taps, reach);
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
