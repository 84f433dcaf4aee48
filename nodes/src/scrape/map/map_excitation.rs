//! The node around [`MapForce`].

use super::map_force::{MapForce, MapVoice};
use super::padded_map::{Interp, check_grid};
use super::surface_map::SurfaceMap;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::dsp::Reference;
use crate::scrape::force::contact_force_params::{ContactForceParams, ForceLawParams};
use crate::scrape::force::strength::{self, Strength, linked, silent};
use crate::scrape::force::voices::Voices;
use crate::scrape::path::piece::PathPiece;
use crate::texture::code::{CodedMap, Coding};
use crate::texture::{DiscontinuityMap, FeatureMap};
use crate::{archive_state, choices, params, ports};

choices! {
    /// Value of a map that becomes force.
    pub enum MapValue {
        /// The slope along the path, whose sign depends on the direction.
        Directional,
        /// The size of the gradient, or the strength of a feature, without its mean (high-pass at 20 Hz).
        Magnitude,
    }
}

choices! { @param Interp {
    /// Linear: images at -25 dB.
    Linear,
    /// A cubic through the pixels: -43 dB.
    Catmull,
    /// A cubic B-spline: -52 dB; the finest detail is halved.
    Bspline3,
} }

params! {
    /// Excites an object with the force that contacts meet on a map of a surface.
    ///
    /// The map is a discontinuity map, a feature map or the code of a map: link exactly one of them. Among the codes
    /// only signed pairs retain directions; of bytes and bits the change along the path is read, as of features. With
    /// the value `m` read under a contact, divided by its RMS over the whole map by default, the force is `gain kappa (f/1 N)^a (v/1 m/s)^b m`, summed over all contacts.
    /// A contact at rest fades out in 5 ms. Where a contact passes more than half a pixel per sample, coarser levels of
    /// an image pyramid are read against aliasing.
    ///
    /// `gain`, `kappa`, `a`, `b` and `scale` can change while the node runs and ramp over 20 ms. A link to `kappa` replaces the number.
    /// The summary holds the peak and the RMS of the force and the largest number of simultaneous contacts. The input is not audio, so
    /// the node has a sample rate of its own.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.1. The paper
    /// interpolates "the closest pixel values"; the cubic B-spline, the exponents and the slope along the path are choices.
    pub struct MapExcitationParams {
        /// Value of the map that becomes force.
        value: MapValue = MapValue::Directional;
        /// Scale of the value: `Normalized` for an RMS of 1 over the whole map. A linked strength has a scale of its own.
        reference: Reference = Reference::Normalized;
        /// Interpolation between the pixels of the map.
        interp: Interp = Interp::Bspline3;
        /// Force per value.
        [group] law: ForceLawParams;
        /// Force and contacts.
        [group] contact: ContactForceParams;
    }
}
ports! {
    pub struct MapExcitationPorts / MapExcitationIo {
        in {
            /// Paths of the contacts over the surface.
            paths: Events<PathPiece>,
            /// Discontinuities of the surface.
            map: Option<Value<DiscontinuityMap>>,
            /// The features of the surface, in place of that.
            features: Option<Value<FeatureMap>>,
            /// The code of a map, in place of both.
            coded: Option<Value<CodedMap>>,
            /// Strength that replaces the number, from LevelMatcher.
            kappa: Option<Value<Strength>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// The node `MapExcitation`.
#[derive(Debug)]
pub struct MapExcitation {
    params: MapExcitationParams,
    /// The linked strength.
    kappa: Option<Strength>,
    map: SurfaceMap,
    force: MapForce,
    voices: Voices<MapVoice>,
}

/// Map or features that a contact reads; a code is decoded to one of them.
enum Source<'a> {
    Map(&'a DiscontinuityMap),
    Features(&'a FeatureMap),
}

impl Source<'_> {
    fn read(&self, value: MapValue, field: &'static str) -> Result<SurfaceMap, Reject> {
        match self {
            Source::Map(map) => {
                check_grid(field, &map.gx, &map.surface)?;
                check_grid(field, &map.gy, &map.surface)?;
                Ok(match value {
                    MapValue::Directional => SurfaceMap::slope(map),
                    MapValue::Magnitude => SurfaceMap::size(map),
                })
            }
            Source::Features(features) => {
                check_grid(field, &features.grid, &features.surface)?;
                Ok(match value {
                    MapValue::Directional => SurfaceMap::feature_change(features),
                    MapValue::Magnitude => SurfaceMap::feature(features),
                })
            }
        }
    }
}

/// Decoded map: signed pairs hold directions, bytes the length of the gradient, bits the positions of edges.
fn coded_map(value: MapValue, coded: &CodedMap) -> Result<SurfaceMap, Reject> {
    if let Some(map) = coded.gradient() {
        return Source::Map(&map).read(value, "coded");
    }
    let mut grid = coded.magnitude();
    if coded.coding == Coding::Byte {
        grid.samples.iter_mut().for_each(|x| *x *= coded.scale);
    }
    Source::Features(&FeatureMap { grid, surface: coded.surface }).read(value, "coded")
}

fn surface_map(
    value: MapValue,
    map: Option<&DiscontinuityMap>,
    features: Option<&FeatureMap>,
    coded: Option<&CodedMap>,
) -> Result<SurfaceMap, Reject> {
    match (map, features, coded) {
        (Some(map), None, None) => Source::Map(map).read(value, "map"),
        (None, Some(features), None) => Source::Features(features).read(value, "features"),
        (None, None, Some(coded)) => coded_map(value, coded),
        _ => Err(one_of([map.is_some(), features.is_some(), coded.is_some()])),
    }
}

/// Refuses none of the maps, and more than one.
fn one_of(linked: [bool; 3]) -> Reject {
    let names = ["`map`", "`features`", "`coded`"];
    let given: Vec<&str> =
        names.into_iter().zip(linked).filter(|(_, on)| *on).map(|(name, _)| name).collect();
    let message = if given.is_empty() {
        "neither `map` nor `features` nor `coded` is linked".into()
    } else {
        format!("{} are linked at once", given.join(" and "))
    };
    Reject::new("F128", message).at("map").help(
        "link one of them: `map` takes the output of SobelMap, `features` that of DogFeatures, `coded` that of MapCoder or MapFile",
    )
}

/// The law of the parameters; a linked strength replaces the number.
fn law(p: &MapExcitationParams, kappa: Option<Strength>, rms: f64) -> [f64; 3] {
    [kappa.map_or(p.law.kappa * p.reference.unit(rms), |s| s.kappa) * p.contact.gain, p.law.a, p.law.b]
}

impl Node for MapExcitation {
    type Params = MapExcitationParams;
    type Ports = MapExcitationPorts;
    const NAME: &'static str = "MapExcitation";
    const VERSION: u32 = 5;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 15.0;

    fn shape(p: &MapExcitationParams, s: &mut Shape<'_, '_, MapExcitationPorts>) -> Result<(), Reject> {
        let linked = [
            s.linked(MapExcitationPorts::map),
            s.linked(MapExcitationPorts::features),
            s.linked(MapExcitationPorts::coded),
        ];
        if linked.iter().filter(|on| **on).count() != 1 {
            return Err(one_of(linked));
        }
        s.output(MapExcitationPorts::force, p.contact.rate, Channels(1));
        Ok(())
    }

    fn build(p: &MapExcitationParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (map, features) =
            (cx.optional_value(MapExcitationPorts::map), cx.optional_value(MapExcitationPorts::features));
        let coded = cx.optional_value(MapExcitationPorts::coded);
        let map = surface_map(p.value, map.as_deref(), features.as_deref(), coded.as_deref())?;
        let kappa = linked(cx.optional_value(MapExcitationPorts::kappa))?;
        let rate = p.contact.rate.as_f64();
        Ok(Self {
            kappa,
            force: MapForce::new(
                strength::law(law(p, kappa, map.rms()), kappa, rate),
                p.contact.scale,
                p.interp,
                rate,
            ),
            map,
            voices: Voices::new(p.contact.contacts.into(), p.contact.rate, MapVoice::default()),
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: MapExcitationIo<'_>) -> Result<(), Fault> {
        let (first, out) = (io.force.first(), io.force.items());
        if silent(self.kappa, out) {
            return Ok(());
        }
        let Self { map, force, voices, .. } = self;
        voices.play(
            io.paths.events(),
            self.params.contact.object,
            first,
            out,
            |_| MapVoice::default(),
            |voice, segment, out| force.add(map, voice, segment, out),
        );
        self.voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: MapExcitationIo<'_>) -> Result<Summary, Fault> {
        Ok(self.voices.summary())
    }

    fn silence(&self) -> Option<Silence> {
        self.voices.silence(&self.params.contact, self.params.law.kappa, self.kappa)
    }

    fn retune(&mut self, new: &MapExcitationParams) -> Retune {
        let old = &self.params;
        let fixed = |p: &MapExcitationParams| {
            (p.value, p.interp, p.contact.object, p.contact.contacts, p.contact.rate)
        };
        if fixed(new) != fixed(old) {
            return Retune::Rebuild;
        }
        self.force.law.ramp_to(law(new, self.kappa, self.map.rms()), self.voices.now());
        self.force.scale.ramp_to(new.contact.scale, self.voices.now());
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.voices.take_state(&old.voices);
    }

    archive_state!(voices);

    fn trial(rng: &mut Rng) -> (MapExcitationParams, MemoryFiles) {
        let params = MapExcitationParams::trial(rng);
        let object = params.contact.object.map(|_| rng.below(2) as u32);
        let contacts = 1 + rng.below(5) as u16;
        (
            MapExcitationParams {
                contact: ContactForceParams { object, contacts, ..params.contact },
                ..params
            },
            MemoryFiles::default(),
        )
    }
}
