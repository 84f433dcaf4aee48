//! The node `LevelMatcher`.

use super::bands::NoiseBands;
use super::isophote::{IsophoteForce, IsophoteVoice, Reading};
use super::law::Law;
use super::levels::{StandardStroke, factor, heard, parts, rms, share, sum};
use super::map::{MapForce, MapVoice, SurfaceMap};
use super::map_node::{MapValue, check_grid};
use super::noise::{NoiseForce, NoiseVoice};
use super::plane::Interp;
use super::{isophote_node, noise_node};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Draw;
use crate::core::shape::Build;
use crate::modal::Modes;
use crate::texture::histogram::{Class, TextureClass};
use crate::texture::sobel::gradient;
use crate::texture::{DiscontinuityMap, FeatureMap, Isophotes, NoiseMap, NoiseProfile};
use crate::{params, ports};

/// Share of the noise where there is no noise map to tell it.
const HALF: f64 = 0.5;

params! {
    /// Finds how strong the excitations of one surface have to be, so that all levels of detail are equally loud.
    ///
    /// Before anything sounds, each excitation is moved along one and the same way over the surface: circles in all directions, at
    /// `speed` and under `force`. The map of the whole surface has the strength `kappa`; the other outputs are the strengths with
    /// which the force has the same root of the mean square: of isophotes, of features and the noise beside them (both
    /// together), of the noise alone and of noise from its spectrum. Link them to the `kappa` of the excitations. An output
    /// whose input has no link is 0.
    ///
    /// Of the power of features and noise together the noise has the share that the slopes of its map `rest` have in those of the whole
    /// map, or one half where `rest` has no link; `gain` of the excitations changes that by ear.
    ///
    /// Simple surfaces sound best by their map from near, complex ones by their isophotes: with a link to `class` that of `full` and
    /// `full_isophotes` which does not suit is 0, and an excitation whose `kappa` is linked to 0 costs nothing.
    ///
    /// A map holds low tones and fine noise holds high ones: equal forces ring high modes differently. With a link to `modes`
    /// what is compared is the sound of these modes at `pitch` and `damping`, in place of the force.
    ///
    /// Excitations follow force and speed by their own exponents, `map_law` and `noise_law` here, so levels are equally loud where
    /// force and speed are those of the stroke; with the same exponents for all, everywhere.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2, add features
    /// and noise when they are rendered and do not say how strong; equal power is a choice.
    pub struct LevelMatcherParams {
        /// Force in N that a whole map of 1 gives at 1 N and 1 m/s.
        kappa: f64 = 1.0, unit "N", range 0.0..=1_000_000.0;
        /// Speed of the stroke.
        speed: f64 = 1.0, unit "m/s", range 0.001..=100.0;
        /// Normal force of the stroke.
        force: f64 = 1.0, unit "N", range 0.001..=100_000.0;
        /// Exponents of force and speed of maps, features and isophotes.
        map_law: [f64; 2] = [1.0, 0.0], unit "", range 0.0..=2.0;
        /// Exponents of force and speed of noise.
        noise_law: [f64; 2] = [0.5, 0.5], unit "", range 0.0..=2.0;
        /// What of maps and features is turned into force.
        value: MapValue = MapValue::Directional;
        /// What of the isophotes is turned into force.
        reading: Reading = Reading::Crossing;
        /// Way over which the crossing of an isophote is felt.
        width: f64 = 1.0, unit "px", range 0.01..=100.0;
        /// Distance from which an isophote is felt, with `Proximity`.
        radius: f64 = 2.0, unit "px", range 0.1..=8.0;
        /// Factor of the frequencies of `modes`.
        pitch: f64 = 1.0, unit "", range 0.01..=100.0;
        /// Factor of the dampings of `modes`.
        damping: f64 = 1.0, unit "", range 0.001..=1000.0;
    }
}
ports! {
    pub struct LevelMatcherPorts / LevelMatcherIo {
        in {
            /// Where the whole surface changes: what all others are compared with.
            map: Value<DiscontinuityMap>,
            /// Whether it is simple or complex: only the finest level of its class is then above 0.
            class: Option<Value<TextureClass>>,
            /// Its isophotes.
            isophotes: Option<Value<Isophotes>>,
            /// Its features.
            features: Option<Value<FeatureMap>>,
            /// Its noise map, which tells the share of the noise.
            rest: Option<Value<NoiseMap>>,
            /// Its noise as a line.
            noise: Option<Value<NoiseProfile>>,
            /// Its noise from a spectrum.
            spectrum: Option<Value<NoiseProfile>>,
            /// How what is scraped rings.
            modes: Option<Value<Modes>>,
        }
        out {
            /// Strength of the whole map.
            full: Value<f64>,
            /// Strength of the isophotes in place of it.
            full_isophotes: Value<f64>,
            /// Strength of the features, with noise beside them.
            split_features: Value<f64>,
            /// Strength of the noise beside features.
            split_noise: Value<f64>,
            /// Strength of the noise alone.
            only_noise: Value<f64>,
            /// Strength of noise from a spectrum alone.
            only_spectrum: Value<f64>,
        }
    }
}

/// The node `LevelMatcher`.
#[derive(Debug)]
pub struct LevelMatcher;

/// What is drawn from a stroke, and by which laws.
struct Trial<'a> {
    p: &'a LevelMatcherParams,
    stroke: StandardStroke,
    modes: Option<&'a Modes>,
}

impl Trial<'_> {
    fn rate(&self) -> f64 {
        self.stroke.rate().as_f64()
    }

    fn law(&self, [a, b]: [f64; 2]) -> Law {
        Law::new([1.0, a, b], self.rate())
    }

    fn heard(&self, force: Vec<f32>) -> Result<Vec<f32>, Fault> {
        heard(force, self.modes, [self.p.damping, self.p.pitch])
            .map_err(|e| Reject::new("F078", e.to_string()).at("modes").into())
    }

    fn map(&self, map: &SurfaceMap) -> Result<Vec<f32>, Fault> {
        let mut force = MapForce::new(self.law(self.p.map_law), 1.0, Interp::Bspline3, self.rate());
        self.heard(self.stroke.draw(
            &mut force,
            |_| MapVoice::default(),
            |force, voice, stretch, out| force.add(map, voice, stretch, out),
            |_, _, _| {},
        ))
    }

    fn noise(&self, profile: &NoiseProfile) -> Result<Vec<f32>, Fault> {
        noise_node::check(profile)?;
        let bands = NoiseBands::new(profile);
        let mut force = NoiseForce::new(self.law(self.p.noise_law), 1.0, self.rate());
        self.heard(self.stroke.draw(
            &mut force,
            // Each circle begins elsewhere on the loop.
            |k| NoiseVoice::at(bands.round() * (k as f64 * 0.618_034).fract()),
            |force, voice, stretch, out| force.add(&bands, voice, stretch, out),
            |_, _, _| {},
        ))
    }

    fn isophotes(&self, all: &Isophotes) -> Result<Vec<f32>, Fault> {
        isophote_node::check("isophotes", all)?;
        let law = self.law(self.p.map_law);
        let mut force = IsophoteForce::new(all, self.p.reading, law, self.rate(), 2);
        force.set(self.p.width, self.p.radius, 1.0);
        self.heard(self.stroke.draw(
            &mut force,
            |_| IsophoteVoice::default(),
            IsophoteForce::add,
            IsophoteForce::ring_out,
        ))
    }
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
    const VERSION: u32 = 3;

    fn eval(p: &LevelMatcherParams, _: &Build<'_>, mut io: LevelMatcherIo<'_>) -> Result<Summary, Fault> {
        let map = whole(p, io.map)?;
        let size = [io.map.gx.width, io.map.gx.height];
        let stroke = StandardStroke::new(&io.map.surface, size, p.speed, p.force);
        let trial = Trial { p, stroke, modes: io.modes };
        let wanted = p.kappa * rms(&trial.map(&map)?);
        let lines = io.features.map(|f| trial.map(&features(p, f)?)).transpose()?.unwrap_or_default();
        let noise = io.noise.map(|profile| trial.noise(profile)).transpose()?.unwrap_or_default();
        let curves = io.isophotes.map(|all| trial.isophotes(all)).transpose()?.unwrap_or_default();
        let alike = io.spectrum.map(|profile| trial.noise(profile)).transpose()?.unwrap_or_default();
        let alone = |drawn: &[f32]| factor(wanted, rms(drawn));
        // A complex surface without isophotes has only its map.
        let finest = match io.class.map(|found| found.class) {
            Some(Class::Simple) => [p.kappa, 0.0],
            Some(Class::Complex) if !curves.is_empty() => [0.0, alone(&curves)],
            _ => [p.kappa, alone(&curves)],
        };
        let split = if lines.is_empty() || noise.is_empty() {
            [alone(&lines), alone(&noise)]
        } else {
            parts(wanted, [&lines, &noise], share_of(io.map, io.rest)?)
        };
        let power = [split[0] * rms(&lines), split[1] * rms(&noise)].map(|x| x * x);
        let mut told: Summary = vec![
            ("rms", wanted.into()),
            ("split_rms", rms(&sum([&lines, &noise], split)).into()),
            ("noise_share", (power[1] / (power[0] + power[1]).max(f64::MIN_POSITIVE)).into()),
        ];
        for (key, slot, value) in [
            ("full", &mut io.full, finest[0]),
            ("full_isophotes", &mut io.full_isophotes, finest[1]),
            ("split_features", &mut io.split_features, split[0]),
            ("split_noise", &mut io.split_noise, split[1]),
            ("only_noise", &mut io.only_noise, alone(&noise)),
            ("only_spectrum", &mut io.only_spectrum, alone(&alike)),
        ] {
            slot.set(value);
            told.push((key, value.into()));
        }
        Ok(told)
    }

    fn trial(draw: &mut Draw) -> (LevelMatcherParams, MemoryFiles) {
        // Fast strokes, which are short.
        let p = LevelMatcherParams { speed: draw.between(50.0, 100.0), ..LevelMatcherParams::trial(draw) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
#[path = "levels_node_tests.rs"]
mod tests;
