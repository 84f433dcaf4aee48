//! The node around [`PairForce`] and the map of a rolling ball.

use super::creases::{CreaseVoice, Creases, ball_map_and_creases};
use super::heights::{Relief, heights};
use super::joint_force::{JointForce, JointParams};
use super::pair_force::{PairForce, PairTouch};
use super::size_fade::SizeFade;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::core::time::ticks;
use crate::modal::impact::pulse::LONGEST;
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::force::law::Law;
use crate::scrape::force::motion::Heading;
use crate::scrape::force::strength::{self, Strength, linked};
use crate::scrape::force::voices::Voices;
use crate::scrape::map::map_force::{MapForce, MapVoice};
use crate::scrape::map::padded_map::{Interp, check_grid};
use crate::scrape::map::surface_map::SurfaceMap;
use crate::scrape::path::piece::PathPiece;
use crate::texture::Luma;
use crate::{archive_state, params, ports};
use serde::{Deserialize, Serialize};

params! {
    /// Excites an object with the force between two surfaces, both with a relief.
    ///
    /// The surfaces touch along a short line in the direction of motion, at its highest point only:
    /// `z = max over xi of hA(uA + xi t) + hB(uB - xi t) - xi^2/2R` is their distance, and the force is
    /// `gain kappa (f/1 N)^a (dz/dt)/(1 m/s)`. Heights follow from the luminance by the `depth` of each image. So the teeth of both
    /// surfaces interlock, which a sum of two forces cannot express.
    ///
    /// Without `b` the other surface is smooth: a ball or tip of radius `radius` that rolls or slides over `a`. It does
    /// not reach the bottom of gaps narrower than itself, and hits the edges of each. This is computed before the sound
    /// starts; afterwards the cost is that of MapExcitation.
    ///
    /// Where the touching point jumps, as over a joint, `dz/dt` jumps upwards by `v ds`. For a ball `ds` is the distance between both
    /// points over the radius, `g/R` for a groove of width `g`; with `b` it is the difference of the rates at both points. The contact
    /// lands on the far edge at that normal speed, an impact of `J = impacts gain m v ds (1 + restitution)` (`pair_impacts` in place of
    /// `impacts` with `b`), whose pulse follows the Hertz law of ImpactForce (`tau`, `energy_ref`, `hardness`, `shape`) and adds to the force of the slope. `m` is the effective mass of the
    /// contact, or `mass` if it has none. The impact does not depend on `kappa` or on the normal force, as long as there is one. While
    /// `scale` ramps, joints are those of the old size in the first half and of the new one in the second. With `b` a gap narrower than
    /// two points of the line of contact is none. The summary counts impacts as `impacts`.
    ///
    /// Where paths have no position on the other surface, that position is constant. `gain`, `kappa`, `a_exponent` and `scale` can change
    /// while the node runs and ramp over 20 ms. A link to `kappa` replaces the number.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 6, leaves two
    /// textures to future work; the joint envelope is a choice, and so are impacts at its creases.
    pub struct TwoTexturesParams {
        /// Common radius of curvature at the contact: 1/R = 1/R_A + 1/R_B.
        radius: f64 = 0.02, unit "m", range 0.0001..=10.0;
        /// Points of the line of contact; an odd number.
        taps: u16 = 33, unit "points", range 3..=129_u16;
        /// Force in N at 1 N where the surfaces part at 1 m/s.
        kappa: f64 = 1.0, unit "N", range -1_000_000.0..=1_000_000.0;
        /// Exponent of the normal force.
        a_exponent: f64 = 1.0, unit "", range 0.0..=2.0;
        /// Force and contacts.
        [group] contact: ContactForceParams;
        /// Impacts at joints.
        [group] joints: JointParams;
    }
}
ports! {
    pub struct TwoTexturesPorts / TwoTexturesIo {
        in {
            /// Paths of the contacts over both surfaces.
            paths: Events<PathPiece>,
            /// Relief of the first surface.
            a: Value<Luma>,
            /// Relief of the second surface.
            b: Option<Value<Luma>>,
            /// Strength that replaces the number, from LevelMatcher.
            kappa: Option<Value<Strength>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// State of one contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Contact {
    heading: Heading,
    map: MapVoice,
    crease: CreaseVoice,
    touch: PairTouch,
}

/// Method by which the force is computed.
#[derive(Debug)]
enum Method {
    Ball(Box<(SurfaceMap, MapForce, Creases)>),
    Pair(Box<([Relief; 2], PairForce, SizeFade)>),
}

/// The node `TwoTextures`.
#[derive(Debug)]
pub struct TwoTextures {
    params: TwoTexturesParams,
    /// The linked strength.
    kappa: Option<Strength>,
    method: Method,
    joints: JointForce,
    voices: Voices<Contact>,
}

/// The law of the parameters; a linked strength replaces the number.
fn law(p: &TwoTexturesParams, kappa: Option<Strength>, ball: bool) -> [f64; 3] {
    // The map of a ball holds changes per metre, which its speed turns into changes in time.
    [kappa.map_or(p.kappa, |s| s.kappa) * p.contact.gain, p.a_exponent, if ball { 1.0 } else { 0.0 }]
}

pub(in crate::scrape) fn check(field: &'static str, luma: &Luma) -> Result<(), Reject> {
    check_grid(field, &luma.grid, &luma.surface)?;
    if (0.0..=1.0).contains(&luma.surface.depth) {
        return Ok(());
    }
    let message = format!("`{field}` is {} m deep; 0 to 1 m can be felt", luma.surface.depth);
    Err(Reject::new("F128", message).at(field))
}

impl Node for TwoTextures {
    type Params = TwoTexturesParams;
    type Ports = TwoTexturesPorts;
    const NAME: &'static str = "TwoTextures";
    const VERSION: u32 = 7;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 50.0;

    fn shape(p: &TwoTexturesParams, s: &mut Shape<'_, '_, TwoTexturesPorts>) -> Result<(), Reject> {
        s.tail(ticks(LONGEST) + p.contact.rate.span(9));
        s.output(TwoTexturesPorts::force, p.contact.rate, Channels(1));
        Ok(())
    }

    fn build(p: &TwoTexturesParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (a, b) = (cx.value(TwoTexturesPorts::a), cx.optional_value(TwoTexturesPorts::b));
        check("a", &a)?;
        let rate = p.contact.rate.as_f64();
        let kappa = linked(cx.optional_value(TwoTexturesPorts::kappa))?;
        let law = strength::law(law(p, kappa, b.is_none()), kappa, rate);
        let method = if let Some(b) = b {
            check("b", &b)?;
            let reliefs = [&a, &b].map(|luma| Relief::new(&heights(luma), &luma.surface));
            let range = reliefs[0].range() + reliefs[1].range();
            // With two surfaces there is no speed at which one of them alone is matched.
            let law = Law { curve: None, ..law };
            let force = PairForce::new(law, p.taps.into(), p.radius, range);
            Method::Pair(Box::new((reliefs, force, SizeFade::new(p.contact.scale, rate))))
        } else {
            let (map, creases) = ball_map_and_creases(&heights(&a), &a.surface, p.radius);
            let force = MapForce::new(law, p.contact.scale, Interp::Bspline3, rate);
            Method::Ball(Box::new((map, force, creases)))
        };
        let blank = Default::default();
        let joints = JointForce::new(&p.joints, p.contact.gain, rate, p.contact.contacts.into());
        let voices = Voices::new(p.contact.contacts.into(), p.contact.rate, blank);
        Ok(Self { kappa, method, joints, voices, params: p.clone() })
    }

    fn run(&mut self, mut io: TwoTexturesIo<'_>) -> Result<(), Fault> {
        let (first, out) = (io.force.first(), io.force.items());
        let object = self.params.contact.object;
        let mut both = (&mut self.method, &mut self.joints);
        self.voices.play_cells(
            io.paths.events(),
            object,
            first,
            out,
            &mut both,
            |_| Default::default(),
            |(method, joints), contact, segment, out| match method {
                Method::Ball(ball) => {
                    let (map, force, creases) = &mut **ball;
                    force.add(map, &mut contact.map, segment, out);
                    if joints.params.impacts > 0.0 {
                        let size = force.scale.nearer_end(segment.anchor);
                        joints.find(creases, size, &mut contact.crease, segment);
                    } else {
                        contact.crease = CreaseVoice::default();
                    }
                }
                Method::Pair(pair) => {
                    let ([a, b], force, sizes) = &mut **pair;
                    let (before, dominant) = (contact.heading, sizes.dominant(segment.anchor));
                    let strength = joints.params.pair_impacts;
                    let strikes = strength > 0.0;
                    if strikes {
                        contact.touch.resize(dominant);
                    } else {
                        contact.touch = PairTouch::default();
                    }
                    sizes.add(segment, out, |size, scaled, out| {
                        contact.heading = before;
                        if !strikes || size != dominant {
                            return force.add([a, b], &mut contact.heading, scaled, out);
                        }
                        let Contact { heading, touch, .. } = contact;
                        for jump in force.add_and_follow([a, b], heading, touch, scaled, out) {
                            joints.strike(segment, jump.sample, jump.at, size * jump.speed, strength);
                        }
                    });
                }
            },
            |(_, joints), first, out| joints.add(first, out),
        );
        self.voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: TwoTexturesIo<'_>) -> Result<Summary, Fault> {
        let mut summary = self.voices.summary();
        summary.push(("impacts", self.joints.count.into()));
        if self.joints.left_out > 0 {
            summary.push(("impacts_left_out", self.joints.left_out.into()));
        }
        Ok(summary)
    }

    fn silence(&self) -> Option<Silence> {
        self.voices.silence(&self.params.contact, self.params.kappa, self.kappa)
    }

    fn retune(&mut self, new: &TwoTexturesParams) -> Retune {
        let fixed =
            |p: &TwoTexturesParams| (p.radius, p.taps, p.contact.object, p.contact.contacts, p.contact.rate);
        if fixed(new) != fixed(&self.params) {
            return Retune::Rebuild;
        }
        match &mut self.method {
            Method::Ball(ball) => {
                ball.1.law.ramp_to(law(new, self.kappa, true), self.voices.now());
                ball.1.scale.ramp_to(new.contact.scale, self.voices.now());
            }
            Method::Pair(pair) => {
                pair.1.law.ramp_to(law(new, self.kappa, false), self.voices.now());
                pair.2.ramp_to(new.contact.scale, self.voices.now());
            }
        }
        (self.joints.params, self.joints.gain) = (new.joints.clone(), new.contact.gain);
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.voices.take_state(&old.voices);
        self.joints.take_state(&old.joints);
    }

    archive_state!(joints, voices);

    fn trial(rng: &mut Rng) -> (TwoTexturesParams, MemoryFiles) {
        let params = TwoTexturesParams::trial(rng);
        let object = params.contact.object.map(|_| rng.below(2) as u32);
        let contacts = 1 + rng.below(5) as u16;
        let scale = rng.between(0.2, 5.0);
        (
            TwoTexturesParams {
                contact: ContactForceParams { object, contacts, scale, ..params.contact },
                ..params
            },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
