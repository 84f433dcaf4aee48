//! The node `FeatureCrossings`.

use super::crossing_force::{CrossingForce, CrossingVoice};
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
use crate::scrape::force::contact_force_params::{ContactForceParams, ForceLawParams};
use crate::scrape::force::pulses::LONGEST;
use crate::scrape::force::ramp::Ramp;
use crate::scrape::force::strength::{self, Strength, linked, silent};
use crate::scrape::force::voices::Voices;
use crate::scrape::isophote::isophote_excitation::check;
use crate::scrape::path::piece::PathPiece;
use crate::texture::Isophotes;
use crate::{archive_state, params, ports};

params! {
    /// Excites an object with a pulse wherever a feature of one surface crosses a feature of the other.
    ///
    /// A cheaper form of TwoTextures: both surfaces are reduced to lines, isophotes of few levels. The surfaces touch along a line of
    /// length `2 reach` in the direction of motion. Where a line of one surface crosses a line of the other within it, a pulse begins at
    /// that exact time. Its area is the product of the slopes of both lines along the path, times
    /// `1 ms gain kappa (f/1 N)^a (v/1 m/s)^b`, with the speed `v` at which the lines approach each other. Evenly spaced lines cross at
    /// the sum of the frequencies at which they pass.
    ///
    /// Add the noise of both surfaces with one NoiseExcitation each, the second one on the paths of OtherSurface. Where paths have no
    /// position on the other surface, that position is constant. `gain`, `kappa`, `a`, `b` and `scale` can change while the node runs. A
    /// link to `kappa` replaces the number. A contact has at most 32 crossings in 64 samples; the summary counts the crossings and those
    /// that were left out. In tight curves a crossing may be missed or counted twice.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 6, leaves two
    /// textures to future work; pulses at crossings are a choice.
    pub struct FeatureCrossingsParams {
        /// Half the length of the line of contact.
        reach: f64 = 0.002, unit "m", range 0.00001..=0.1;
        /// Distance over which a pulse extends, in pixels of the first surface.
        width: f64 = 1.0, unit "px", range 0.01..=100.0;
        /// Force per value.
        [group] law: ForceLawParams;
        /// Force and contacts.
        [group] contact: ContactForceParams;
    }
}
ports! {
    pub struct FeatureCrossingsPorts / FeatureCrossingsIo {
        in {
            /// Paths of the contacts over both surfaces.
            paths: Events<PathPiece>,
            /// Lines of the first surface.
            first: Value<Isophotes>,
            /// Lines of the second surface.
            second: Value<Isophotes>,
            /// Strength that replaces the number, from PairMatcher.
            kappa: Option<Value<Strength>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// The node `FeatureCrossings`.
#[derive(Debug)]
pub struct FeatureCrossings {
    params: FeatureCrossingsParams,
    /// The linked strength.
    kappa: Option<Strength>,
    force: CrossingForce,
    voices: Voices<CrossingVoice>,
}

/// The law of the parameters; a linked strength replaces the number.
fn law(p: &FeatureCrossingsParams, kappa: Option<Strength>) -> [f64; 3] {
    [kappa.map_or(p.law.kappa, |s| s.kappa) * p.contact.gain, p.law.a, p.law.b]
}

impl Node for FeatureCrossings {
    type Params = FeatureCrossingsParams;
    type Ports = FeatureCrossingsPorts;
    const NAME: &'static str = "FeatureCrossings";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 15.0;

    fn shape(p: &FeatureCrossingsParams, s: &mut Shape<'_, '_, FeatureCrossingsPorts>) -> Result<(), Reject> {
        s.tail(ticks(LONGEST) + p.contact.rate.span(3));
        s.output(FeatureCrossingsPorts::force, p.contact.rate, Channels(1));
        Ok(())
    }

    fn build(p: &FeatureCrossingsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (a, b) = (cx.value(FeatureCrossingsPorts::first), cx.value(FeatureCrossingsPorts::second));
        check("first", &a)?;
        check("second", &b)?;
        let rate = p.contact.rate.as_f64();
        let kappa = linked(cx.optional_value(FeatureCrossingsPorts::kappa))?;
        let law = strength::law(law(p, kappa), kappa, rate);
        let mut force = CrossingForce::new([&a, &b], law, rate, p.contact.contacts.into());
        (force.reach, force.width, force.scale) = (p.reach, p.width, Ramp::new(p.contact.scale, rate));
        let voices = Voices::new(p.contact.contacts.into(), p.contact.rate, CrossingVoice::default());
        Ok(Self { params: p.clone(), kappa, force, voices })
    }

    fn run(&mut self, mut io: FeatureCrossingsIo<'_>) -> Result<(), Fault> {
        let (first, events, out) = (io.force.first(), io.paths.events(), io.force.items());
        if silent(self.kappa, out) {
            return Ok(());
        }
        let object = self.params.contact.object;
        let Self { force, voices, .. } = self;
        let fresh = |_: &PathPiece| CrossingVoice::default();
        voices.play_cells(
            events,
            object,
            first,
            out,
            force,
            fresh,
            CrossingForce::add,
            CrossingForce::ring_out,
        );
        voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: FeatureCrossingsIo<'_>) -> Result<Summary, Fault> {
        let mut summary = self.voices.summary();
        summary.push(("meetings", self.force.crossings.into()));
        if self.force.all_left_out() > 0 {
            summary.push(("meetings_left_out", self.force.all_left_out().into()));
        }
        Ok(summary)
    }

    fn silence(&self) -> Option<Silence> {
        self.voices.silence(&self.params.contact, self.params.law.kappa, self.kappa)
    }

    fn retune(&mut self, new: &FeatureCrossingsParams) -> Retune {
        let fixed = |p: &FeatureCrossingsParams| (p.contact.object, p.contact.contacts, p.contact.rate);
        if fixed(new) != fixed(&self.params) {
            return Retune::Rebuild;
        }
        self.force.law.ramp_to(law(new, self.kappa), self.voices.now());
        self.force.scale.ramp_to(new.contact.scale, self.voices.now());
        (self.force.reach, self.force.width) = (new.reach, new.width);
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.voices.take_state(&old.voices);
        self.force.take_state(&old.force);
    }

    archive_state!(force, voices);

    fn trial(rng: &mut Rng) -> (FeatureCrossingsParams, MemoryFiles) {
        let params = FeatureCrossingsParams::trial(rng);
        let object = params.contact.object.map(|_| rng.below(2) as u32);
        let contacts = 1 + rng.below(5) as u16;
        let (width, scale) = (rng.between(0.1, 5.0), rng.between(0.2, 5.0));
        let reach = rng.between(0.0001, 0.01);
        (
            FeatureCrossingsParams {
                width,
                reach,
                contact: ContactForceParams { object, contacts, scale, ..params.contact },
                ..params
            },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
