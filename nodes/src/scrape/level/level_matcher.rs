//! The node `LevelMatcher`.

use super::matching::{
    StrokeParams, TuningParams, by_speed, factor, fastest, parts, rendered, rms, share, sum,
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
use crate::texture::{DiscontinuityMap, FeatureMap, Isophotes, NoiseMap, NoiseProfile, Surface};
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
    /// under `force`. The map of the whole surface has the strength `kappa`. The other outputs are the strengths at which the force has
    /// the same RMS: of isophotes, of features and noise together, of the noise alone and of noise from its spectrum. Link them to the
    /// `kappa` of the excitations. An output without the input that it needs is 0.
    ///
    /// The share of the noise in the power of features and noise is that of the slopes of its map `rest` in those of the whole map, or
    /// one half without a link to `rest`. Adjust it by ear with the `gain` of the excitations.
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
        /// Force in N of a whole map of 1 at 1 N and 1 m/s.
        kappa: f64 = 1.0, unit "N", range 0.0..=1_000_000.0;
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
    modes: Option<&'a Modes>,
    map: SurfaceMap,
    position: Surface,
    size: [usize; 2],
    features: Option<SurfaceMap>,
    noise: Option<NoiseBands>,
    alike: Option<NoiseBands>,
    curves: Option<IsophoteForce>,
    /// Share of the noise in the power of features and noise.
    share: f64,
}

/// Results at one speed.
struct Found {
    /// RMS of the whole map.
    wanted: f64,
    /// Strengths: of the whole map, of isophotes, features, noise beside them, noise alone, noise from a spectrum alone.
    strengths: [f64; 6],
    /// Strength of features and noise together, and the share of the noise in their power.
    split: [f64; 2],
}

/// A line of noise for strokes of up to a speed, m/s.
pub(super) fn bands(profile: &NoiseProfile, fastest: f64) -> Result<NoiseBands, Reject> {
    noise_excitation::check(profile)?;
    Ok(NoiseBands::up_to(profile, fastest / (profile.spacing * FS)))
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
        let bands = |profile| bands(profile, fastest(p.speed, p.stroke.by_speed));
        Ok(Self {
            p: p.clone(),
            modes: io.modes,
            map: whole(p, io.map)?,
            position: io.map.surface,
            size: [io.map.gx.width, io.map.gx.height],
            features: io.features.map(|f| features(p, f)).transpose()?,
            noise: io.noise.map(bands).transpose()?,
            alike: io.spectrum.map(bands).transpose()?,
            curves: io.isophotes.filter(|_| !simple).map(curves).transpose()?,
            share: share_of(io.map, io.rest)?,
        })
    }

    fn rendered(&self, force: Vec<f32>) -> Result<Vec<f32>, Fault> {
        rendered(force, self.modes, [self.p.tuning.damping, self.p.tuning.pitch])
            .map_err(|e| Reject::new("F078", e.to_string()).at("modes").into())
    }

    fn map(&self, stroke: &StandardStroke, map: &SurfaceMap) -> Result<Vec<f32>, Fault> {
        let mut force = MapForce::new(exponents(self.p.map_law), 1.0, Interp::Bspline3, FS);
        self.rendered(stroke.draw(
            &mut force,
            |_| MapVoice::default(),
            |force, voice, segment, out| force.add(map, voice, segment, out),
            |_, _, _| {},
        ))
    }

    fn noise(&self, stroke: &StandardStroke, bands: &NoiseBands) -> Result<Vec<f32>, Fault> {
        self.rendered(stroke.noise(bands, self.p.noise_law))
    }

    fn isophotes(&self, stroke: &StandardStroke, curves: &IsophoteForce) -> Result<Vec<f32>, Fault> {
        self.rendered(stroke.draw(
            &mut curves.clone(),
            |_| IsophoteVoice::default(),
            IsophoteForce::add,
            IsophoteForce::ring_out,
        ))
    }

    /// Finds the strength of each excitation at a speed, m/s.
    fn at(&self, speed: f64) -> Result<Found, Fault> {
        let stroke = StandardStroke::new(&self.position, self.size, speed, self.p.stroke.force);
        let of_map = |map: &Option<SurfaceMap>| map.as_ref().map(|map| self.map(&stroke, map)).transpose();
        let of_noise =
            |noise: &Option<NoiseBands>| noise.as_ref().map(|n| self.noise(&stroke, n)).transpose();
        let wanted = self.p.kappa * rms(&self.map(&stroke, &self.map)?);
        let lines = of_map(&self.features)?.unwrap_or_default();
        let noise = of_noise(&self.noise)?.unwrap_or_default();
        let curves =
            self.curves.as_ref().map(|c| self.isophotes(&stroke, c)).transpose()?.unwrap_or_default();
        let alone = |drawn: &[f32]| factor(wanted, rms(drawn));
        let [features, beside] = if lines.is_empty() || noise.is_empty() {
            [alone(&lines), alone(&noise)]
        } else {
            parts(wanted, [&lines, &noise], self.share)
        };
        let power = [features * rms(&lines), beside * rms(&noise)].map(|x| x * x);
        let alike = alone(&of_noise(&self.alike)?.unwrap_or_default());
        Ok(Found {
            wanted,
            strengths: [self.p.kappa, alone(&curves), features, beside, alone(&noise), alike],
            split: [
                rms(&sum([&lines, &noise], [features, beside])),
                power[1] / (power[0] + power[1]).max(f64::MIN_POSITIVE),
            ],
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
    const VERSION: u32 = 5;

    fn eval(p: &LevelMatcherParams, _: &Build<'_>, mut io: LevelMatcherIo<'_>) -> Result<Summary, Fault> {
        let surfaces = Surfaces::new(p, &io)?;
        let all = if p.stroke.by_speed { surfaces.at_all()? } else { vec![surfaces.at(p.speed)?] };
        let Some(Found { wanted, split, .. }) = all.get(all.len() / 2) else { return Ok(Vec::new()) };
        let mut summary: Summary =
            vec![("rms", (*wanted).into()), ("split_rms", split[0].into()), ("noise_share", split[1].into())];
        // A complex surface without isophotes has only its map.
        let complex = io.class.is_some_and(|found| found.class == Class::Complex);
        let only_curves = complex && io.isophotes.is_some();
        for (level, (key, slot)) in [
            ("full", &mut io.full),
            ("full_isophotes", &mut io.full_isophotes),
            ("split_features", &mut io.split_features),
            ("split_noise", &mut io.split_noise),
            ("only_noise", &mut io.only_noise),
            ("only_spectrum", &mut io.only_spectrum),
        ]
        .into_iter()
        .enumerate()
        {
            let none = level == 0 && only_curves;
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
