//! The node `LevelMatcher`.

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
use crate::dsp::Reference;
use crate::modal::{Modes, loudness as modes_loudness};
use crate::scrape::force::speed_curve::{POINTS, SpeedCurve};
use crate::scrape::force::strength::Strength;
use crate::scrape::isophote::isophote_force::{IsophoteForce, IsophoteVoice, Reading};
use crate::scrape::map::map_excitation::MapValue;
use crate::scrape::map::map_force::{MapForce, MapVoice};
use crate::scrape::map::padded_map::{Interp, check_grid};
use crate::scrape::map::surface_map::SurfaceMap;
use crate::scrape::noise::bands::NoiseBands;
use crate::scrape::{isophote::isophote_excitation, noise::noise_excitation};
use crate::texture::histogram::{Class, TextureClass};
use crate::texture::sobel::gradient;
use crate::texture::{DiscontinuityMap, FeatureMap, Isophotes, NoiseMap, NoiseProfile, NoiseValue, Surface};
use crate::{params, ports};
use rayon::prelude::*;

/// Samples per second of the compared forces.
const FS: f64 = RATE as f64;
/// Share of the noise without a noise map.
const HALF: f64 = 0.5;

params! {
    /// Finds the strengths at which all excitations of one surface, so all levels of detail, are equally loud.
    ///
    /// Before the sound starts, each excitation moves along the same path over the surface: circles in all directions, at `speed` and
    /// under `force`. The map of the whole surface has the strength `kappa`, and so has the detail finer than the image, `detail`, whose
    /// slopes continue those of the map. Both together are the reference. The other outputs are the strengths at which the sound has the
    /// same loudness by `weighting`: of isophotes and detail, of features and noise, of the noise alone and of noise from its spectrum. Link
    /// them to the `kappa` of the excitations. An output without the input that it needs is 0.
    ///
    /// Within a level the forces have the ratio that they have on the surface: isophotes have the RMS of the map, noise and detail
    /// the slopes of the image, and features the rest of the power of the map, after the share that the slopes of the noise map `rest` have
    /// in it, or one half without a link to `rest`. Adjust it by ear with the `gain` of the excitations.
    ///
    /// Detail is a part of the map: its NoiseExcitation needs the exponents of `map_law`, by default `a: 1, b: 0`.
    ///
    /// Near simple surfaces sound best by their map, complex ones by their isophotes. With a link to `class`, the one of `full` and
    /// `full_isophotes` that does not suit is 0; an excitation whose `kappa` is linked to 0 costs nothing.
    ///
    /// A map holds low frequencies and fine noise high ones, so equal forces excite high modes differently. With a link to `modes` the
    /// sound of these modes at `pitch` and `damping` is compared in place of the force.
    ///
    /// Loudness depends on the speed, differently at each level, as the spatial frequencies of the surface pass the modes. So a strength
    /// is found for each quarter of an octave up to two octaves below and above `speed`, and the excitations use the one for the speed of
    /// the contact. All levels then follow the whole map, whatever their exponents of speed; without `by_speed` they do so at `speed`
    /// only. With the force, levels change by their own exponents, `map_law` and `noise_law` here, and are equally loud under `force`.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2, adds features
    /// and noise at rendering without stating their strengths; equal power is a choice.
    pub struct LevelMatcherParams {
        /// Force in N of a value of 1 of the whole map at 1 N and 1 m/s.
        kappa: f64 = 1.0, unit "N", range 0.0..=1_000_000.0;
        /// Scale of `kappa`: `Normalized` if it is the weighted RMS of the force of map and detail at 1 N and at `speed`; with modes, the
        /// RMS of a white force whose sound is as loud.
        reference: Reference = Reference::Normalized;
        /// Speed of the stroke.
        speed: f64 = 1.0, unit "m/s", range 0.001..=100.0;
        /// Comparison by strokes.
        [group] stroke: StrokeParams;
        /// Exponents of force and speed of maps, features and isophotes.
        map_law: [f64; 2] = [1.0, 0.0], unit "", range 0.0..=2.0;
        /// Exponents of force and speed of noise.
        noise_law: [f64; 2] = [0.5, 0.5], unit "", range 0.0..=2.0;
        /// Value of maps and features that becomes force.
        value: MapValue = MapValue::Directional;
        /// Reading of the isophotes that becomes force.
        reading: Reading = Reading::Crossing;
        /// Distance over which the pulse of a crossing extends.
        width: f64 = 1.0, unit "px", range 0.01..=100.0;
        /// Distance up to which an isophote acts, with `Proximity`.
        radius: f64 = 2.0, unit "px", range 0.1..=8.0;
        /// Tuning of `modes`.
        [group] tuning: TuningParams;
    }
}
ports! {
    pub struct LevelMatcherPorts / LevelMatcherIo {
        in {
            /// Discontinuity map of the whole surface: the reference for all levels.
            map: Value<DiscontinuityMap>,
            /// Class of the surface, simple or complex: only the finest level of its class is then above 0.
            class: Option<Value<TextureClass>>,
            /// Its isophotes.
            isophotes: Option<Value<Isophotes>>,
            /// Its features.
            features: Option<Value<FeatureMap>>,
            /// Its noise map, for the share of the noise.
            rest: Option<Value<NoiseMap>>,
            /// Its noise profile.
            noise: Option<Value<NoiseProfile>>,
            /// Detail finer than the image, beside the map or the isophotes: a NoiseProfile with `part: Detail`.
            detail: Option<Value<NoiseProfile>>,
            /// Its noise from a spectrum.
            spectrum: Option<Value<NoiseProfile>>,
            /// Modes of the scraped object.
            modes: Option<Value<Modes>>,
        }
        out {
            /// Strength of the whole map.
            full: Value<Strength>,
            /// Strength of the isophotes.
            full_isophotes: Value<Strength>,
            /// Strength of the detail beside the whole map.
            full_detail: Value<Strength>,
            /// Strength of the detail beside the isophotes.
            isophotes_detail: Value<Strength>,
            /// Strength of the features, together with noise.
            split_features: Value<Strength>,
            /// Strength of the noise, together with features.
            split_noise: Value<Strength>,
            /// Strength of the noise alone.
            only_noise: Value<Strength>,
            /// Strength of noise from a spectrum alone.
            only_spectrum: Value<Strength>,
        }
    }
}

/// The node `LevelMatcher`.
#[derive(Debug)]
pub struct LevelMatcher;

/// Data of a surface that is prepared before strokes.
struct Surfaces<'a> {
    p: LevelMatcherParams,
    /// Force in N of a value of 1 of the map at 1 N and 1 m/s.
    kappa: f64,
    modes: Option<&'a Modes>,
    map: SurfaceMap,
    position: Surface,
    size: [usize; 2],
    features: Option<SurfaceMap>,
    noise: Option<NoiseBands>,
    detail: Option<NoiseBands>,
    alike: Option<NoiseBands>,
    curves: Option<IsophoteForce>,
    /// Share of the noise in the power of features and noise.
    share: f64,
}

/// Results at one speed.
struct Found {
    /// Loudness of the whole map with its detail.
    wanted: f64,
    /// Strengths in the order of the outputs.
    strengths: [f64; OUTPUTS],
    /// Loudness of features and noise together, and the share of the noise in the power of both.
    split: [f64; 2],
}

/// Number of strengths.
const OUTPUTS: usize = 8;

/// A line of noise for strokes of up to a speed, m/s.
pub(super) fn bands(profile: &NoiseProfile, value: NoiseValue, fastest: f64) -> Result<NoiseBands, Reject> {
    noise_excitation::check(profile)?;
    let line = profile.line(value);
    Ok(NoiseBands::up_to(&line, fastest / (line.spacing * FS)))
}

impl<'a> Surfaces<'a> {
    fn new(p: &LevelMatcherParams, io: &LevelMatcherIo<'a>) -> Result<Self, Reject> {
        // The finest level of a simple surface is its map.
        let simple = io.class.is_some_and(|found| found.class == Class::Simple);
        let curves = |all: &Isophotes| {
            isophote_excitation::check("isophotes", all)?;
            let mut force = IsophoteForce::new(all, p.reading, exponents(p.map_law), FS, 2);
            force.set(p.width, p.radius, 1.0);
            Ok::<_, Reject>(force)
        };
        let bands = |profile| bands(profile, p.stroke.noise_value, fastest(p.speed, p.stroke.by_speed));
        Ok(Self {
            p: p.clone(),
            kappa: p.kappa,
            modes: io.modes,
            map: whole(p, io.map)?,
            position: io.map.surface,
            size: [io.map.gx.width, io.map.gx.height],
            features: io.features.map(|f| features(p, f)).transpose()?,
            noise: io.noise.map(bands).transpose()?,
            detail: io.detail.map(bands).transpose()?,
            alike: io.spectrum.map(bands).transpose()?,
            curves: io.isophotes.filter(|_| !simple).map(curves).transpose()?,
            share: share_of(io.map, io.rest)?,
        })
    }

    /// Loudness of the sound of a force.
    fn loudness(&self, force: Vec<f32>) -> Result<f64, Fault> {
        let sound = rendered(force, self.modes, [self.p.tuning.damping, self.p.tuning.pitch])
            .map_err(|e| Reject::new("F078", e.to_string()).at("modes"))?;
        Ok(loudness(&sound, self.p.stroke.weighting))
    }

    fn map(&self, stroke: &StandardStroke, map: &SurfaceMap) -> Vec<f32> {
        let mut force = MapForce::new(exponents(self.p.map_law), 1.0, Interp::Bspline3, FS);
        stroke.draw(
            &mut force,
            |_| MapVoice::default(),
            |force, voice, segment, out| force.add(map, voice, segment, out),
            |_, _, _| {},
        )
    }

    fn isophotes(&self, stroke: &StandardStroke, curves: &IsophoteForce) -> Vec<f32> {
        stroke.draw(
            &mut curves.clone(),
            |_| IsophoteVoice::default(),
            IsophoteForce::add,
            IsophoteForce::ring_out,
        )
    }

    /// Weighted RMS of the force of map and detail at 1 N and at the speed of the stroke, N; with modes that of a white force whose
    /// sound is as loud.
    fn reference(&self) -> Result<f64, Fault> {
        let p = &self.p;
        let stroke = StandardStroke::new(&self.position, self.size, p.speed, 1.0);
        let detail = self.detail.as_ref().map(|bands| stroke.noise(bands, p.map_law)).unwrap_or_default();
        let white = self.modes.map(modes_loudness).transpose();
        let white =
            white.map_err(|e| Reject::new("F078", e.to_string()).at("modes"))?.map_or(1.0, |x| FS * x);
        Ok(self.loudness(sum([&self.map(&stroke, &self.map), &detail], [1.0; 2]))? / white)
    }

    /// Finds the strength of each excitation at a speed, m/s.
    fn at(&self, speed: f64) -> Result<Found, Fault> {
        let (p, kappa) = (&self.p, self.kappa);
        let stroke = StandardStroke::new(&self.position, self.size, speed, p.stroke.force);
        let noise_of = |noise: &Option<NoiseBands>, law| {
            noise.as_ref().map(|bands| stroke.noise(bands, law)).unwrap_or_default()
        };
        let map = self.map(&stroke, &self.map);
        let power = rms(&map);
        let detail = noise_of(&self.detail, p.map_law);
        let wanted = self.loudness(sum([&map, &detail], [kappa; 2]))?;
        // Factors of two forces in a ratio with which both together are as loud as the reference.
        let together = |forces: [&[f32]; 2], ratio: [f64; 2]| -> Result<[f64; 2], Fault> {
            let both = factor(wanted, self.loudness(sum(forces, ratio))?);
            Ok(ratio.map(|x| x * both))
        };
        let curves = self.curves.as_ref().map(|c| self.isophotes(&stroke, c)).unwrap_or_default();
        let [curves, beside] = together([&curves, &detail], [kappa * factor(power, rms(&curves)), kappa])?;
        let lines = self.features.as_ref().map(|map| self.map(&stroke, map)).unwrap_or_default();
        let noise = noise_of(&self.noise, p.noise_law);
        // The noise has its own law, and the strength of the map under the force and at the speed of the stroke.
        let [a, b] = [0, 1].map(|k| p.map_law[k] - p.noise_law[k]);
        let own = kappa * p.stroke.force.powf(a) * speed.powf(b);
        let share = if noise.is_empty() { 0.0 } else { self.share };
        let ratio = [kappa * factor(power * (1.0 - share).sqrt(), rms(&lines)), own];
        let [features, rest] = together([&lines, &noise], ratio)?;
        let powers = [features * rms(&lines), rest * rms(&noise)].map(|x| x * x);
        let split = self.loudness(sum([&lines, &noise], [features, rest]))?;
        let alone = |force: Vec<f32>| self.loudness(force).map(|found| factor(wanted, found));
        let only_noise = alone(noise)?;
        let alike = alone(noise_of(&self.alike, p.noise_law))?;
        let none = |factor: f64, there: bool| if there { factor } else { 0.0 };
        let finer = self.detail.is_some();
        Ok(Found {
            wanted,
            strengths: [
                kappa,
                none(curves, self.curves.is_some()),
                none(kappa, finer),
                none(beside, finer && self.curves.is_some()),
                none(features, self.features.is_some()),
                none(rest, self.noise.is_some()),
                only_noise,
                alike,
            ],
            split: [split, powers[1] / (powers[0] + powers[1]).max(f64::MIN_POSITIVE)],
        })
    }

    /// The same at all speeds of a curve around that of the stroke.
    fn at_all(&self) -> Result<Vec<Found>, Fault> {
        SpeedCurve::speeds(self.p.speed).into_par_iter().map(|speed| self.at(speed)).collect()
    }
}

fn strength(speed: f64, found: &[Found], level: usize) -> Strength {
    let (kappa, factors) = by_speed(|k| found[k].strengths[level], found.len());
    let bent = factors != [1.0; POINTS];
    Strength { kappa, curve: bent.then(|| SpeedCurve::new(speed, factors)) }
}

fn whole(p: &LevelMatcherParams, map: &DiscontinuityMap) -> Result<SurfaceMap, Reject> {
    check_grid("map", &map.gx, &map.surface)?;
    check_grid("map", &map.gy, &map.surface)?;
    Ok(match p.value {
        MapValue::Directional => SurfaceMap::slope(map),
        MapValue::Magnitude => SurfaceMap::size(map),
    })
}

fn features(p: &LevelMatcherParams, features: &FeatureMap) -> Result<SurfaceMap, Reject> {
    check_grid("features", &features.grid, &features.surface)?;
    Ok(match p.value {
        MapValue::Directional => SurfaceMap::feature_change(features),
        MapValue::Magnitude => SurfaceMap::feature(features),
    })
}

fn share_of(map: &DiscontinuityMap, rest: Option<&NoiseMap>) -> Result<f64, Reject> {
    let Some(rest) = rest else { return Ok(HALF) };
    check_grid("rest", &rest.grid, &rest.surface)?;
    let [x, y] = gradient(&rest.grid, rest.surface.wrap);
    Ok(share([&map.gx, &map.gy], [&x, &y]))
}

impl Func for LevelMatcher {
    type Params = LevelMatcherParams;
    type Ports = LevelMatcherPorts;
    const NAME: &'static str = "LevelMatcher";
    const VERSION: u32 = 7;

    fn eval(p: &LevelMatcherParams, _: &Build<'_>, mut io: LevelMatcherIo<'_>) -> Result<Summary, Fault> {
        let mut surfaces = Surfaces::new(p, &io)?;
        surfaces.kappa *= p.reference.unit(surfaces.reference()?);
        let all = if p.stroke.by_speed { surfaces.at_all()? } else { vec![surfaces.at(p.speed)?] };
        let Some(Found { wanted, split, .. }) = all.get(all.len() / 2) else { return Ok(Vec::new()) };
        let mut summary: Summary = vec![
            ("loudness", (*wanted).into()),
            ("split_loudness", split[0].into()),
            ("noise_share", split[1].into()),
        ];
        // A complex surface without isophotes has only its map.
        let complex = io.class.is_some_and(|found| found.class == Class::Complex);
        let only_curves = complex && io.isophotes.is_some();
        for (level, (key, slot)) in [
            ("full", &mut io.full),
            ("full_isophotes", &mut io.full_isophotes),
            ("full_detail", &mut io.full_detail),
            ("isophotes_detail", &mut io.isophotes_detail),
            ("split_features", &mut io.split_features),
            ("split_noise", &mut io.split_noise),
            ("only_noise", &mut io.only_noise),
            ("only_spectrum", &mut io.only_spectrum),
        ]
        .into_iter()
        .enumerate()
        {
            let none = (level == 0 || level == 2) && only_curves;
            let value = if none { Strength::constant(0.0) } else { strength(p.speed, &all, level) };
            slot.set(value);
            summary.push((key, value.kappa.into()));
        }
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (LevelMatcherParams, MemoryFiles) {
        // Fast strokes, which are short, and mostly one.
        let (speed, by_speed) = (rng.between(50.0, 100.0), rng.below(32) == 0);
        let mut p = LevelMatcherParams::trial(rng);
        (p.speed, p.stroke.by_speed) = (speed, by_speed);
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
