//! The node around [`IsophoteForce`].

use super::isophote_force::{IsophoteForce, IsophoteVoice, Reading};
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
use crate::dsp::Reference;
use crate::scrape::force::contact_force_params::{ContactForceParams, ForceLawParams};
use crate::scrape::force::pulses::LONGEST;
use crate::scrape::force::strength::{self, Strength, linked, silent};
use crate::scrape::force::voices::Voices;
use crate::scrape::path::piece::PathPiece;
use crate::texture::Isophotes;
use crate::{archive_state, choices, params, ports};

choices! { @param Reading {
    /// A pulse for each crossed curve, proportional to the change of slope since the previous curve.
    Crossing,
    /// A force near curves, proportional to the change of slope of the nearest curve over the last pixel.
    Proximity,
} }

params! {
    /// Excites an object with the force that contacts meet on the isophotes of a surface.
    ///
    /// The slope of a curve is the gradient of its image along the path of the contact. `Crossing` produces a pulse, a
    /// raised cosine, at the exact time at which a curve is crossed. The pulse lasts `width / density / speed` seconds,
    /// limited to between two samples and 5 ms. Its area is that of `m` over 1 ms, where `m` is the slope less that of
    /// the curve crossed before; for the first curve `m` is the slope itself. `Proximity` produces
    /// `m = (1 - (d / radius)^2)^2` times the change of the slope of the nearest curve over the last pixel, at a
    /// distance `d`. The force is `gain kappa (f/1 N)^a (v/1 m/s)^b m`, summed over all contacts. A contact at rest
    /// fades out in 5 ms. A surface of constant slope is silent after its first curve, and so is a path along a curve.
    /// A reversed path changes the sign of the slopes, and so of the first pulse; the changes of slopes are the same in
    /// both directions. By default slopes are divided by their RMS over all curves.
    ///
    /// `gain`, `kappa`, `a`, `b`, `scale`, `width` and `radius` can change while the node runs. A link to `kappa` replaces the number. A
    /// contact has at most 32 crossings in 64 samples; the summary counts the crossings and those that were left out. The input is not
    /// audio, so the node has a sample rate of its own.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.1, names
    /// the proximity to an isocurve and the difference between gradients, without a formula. Both readings are choices: `Crossing`, the
    /// default, has no proximity but exact times, and the difference of `Proximity` is taken over a distance, because between two samples
    /// it would fall with the sample rate. Shapes, widths and exponents are choices as well.
    pub struct IsophoteExcitationParams {
        /// Reading of the isophotes that becomes the force.
        reading: Reading = Reading::Crossing;
        /// Scale of the slopes: `Normalized` for an RMS of 1 over all curves. A linked strength has a scale of its own.
        reference: Reference = Reference::Normalized;
        /// Distance over which a pulse extends.
        width: f64 = 1.0, unit "px", range 0.01..=100.0;
        /// Distance up to which a curve acts, with `Proximity`.
        radius: f64 = 2.0, unit "px", range 0.1..=8.0;
        /// Force per value.
        [group] law: ForceLawParams;
        /// Force and contacts.
        [group] contact: ContactForceParams;
    }
}
ports! {
    pub struct IsophoteExcitationPorts / IsophoteExcitationIo {
        in {
            /// Paths of the contacts over the surface.
            paths: Events<PathPiece>,
            /// The curves of the surface.
            isophotes: Value<Isophotes>,
            /// Strength that replaces the number, from LevelMatcher.
            kappa: Option<Value<Strength>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// The node `IsophoteExcitation`.
#[derive(Debug)]
pub struct IsophoteExcitation {
    params: IsophoteExcitationParams,
    /// The linked strength.
    kappa: Option<Strength>,
    /// RMS of the slopes.
    rms: f64,
    force: IsophoteForce,
    voices: Voices<IsophoteVoice>,
}

/// The law of the parameters; a linked strength replaces the number.
fn law(p: &IsophoteExcitationParams, kappa: Option<Strength>, rms: f64) -> [f64; 3] {
    [kappa.map_or(p.law.kappa * p.reference.unit(rms), |s| s.kappa) * p.contact.gain, p.law.a, p.law.b]
}

/// RMS of the part of the gradients of all points along any direction.
fn rms(all: &Isophotes) -> f64 {
    let squares = all.gradients.iter().flatten().map(|g| f64::from(*g).powi(2)).sum::<f64>();
    (0.5 * squares / all.gradients.len().max(1) as f64).sqrt()
}

/// Checks that isophotes can be read.
pub(in crate::scrape) fn check(field: &'static str, all: &Isophotes) -> Result<(), Reject> {
    let density = all.surface.density;
    let message = if !density.iter().all(|d| (1e-3..1e9).contains(d)) {
        format!("`{field}` has {density:?} pixels per metre; 0.001 to 1e9 can be read")
    } else if all.points.len() != all.gradients.len() {
        format!("`{field}` has {} points and {} gradients", all.points.len(), all.gradients.len())
    } else {
        return Ok(());
    };
    Err(Reject::new("F127", message).at(field))
}

impl Node for IsophoteExcitation {
    type Params = IsophoteExcitationParams;
    type Ports = IsophoteExcitationPorts;
    const NAME: &'static str = "IsophoteExcitation";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 15.0;

    fn shape(
        p: &IsophoteExcitationParams,
        s: &mut Shape<'_, '_, IsophoteExcitationPorts>,
    ) -> Result<(), Reject> {
        if let Some(all) = s.value(IsophoteExcitationPorts::isophotes) {
            check("isophotes", &all)?;
        }
        s.tail(ticks(LONGEST) + p.contact.rate.span(3));
        s.output(IsophoteExcitationPorts::force, p.contact.rate, Channels(1));
        Ok(())
    }

    fn build(p: &IsophoteExcitationParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let all = cx.value(IsophoteExcitationPorts::isophotes);
        check("isophotes", &all)?;
        let kappa = linked(cx.optional_value(IsophoteExcitationPorts::kappa))?;
        let (rate, rms) = (p.contact.rate.as_f64(), rms(&all));
        let mut force = IsophoteForce::new(
            &all,
            p.reading,
            strength::law(law(p, kappa, rms), kappa, rate),
            rate,
            p.contact.contacts.into(),
        );
        force.set(p.width, p.radius, p.contact.scale);
        let voices = Voices::new(p.contact.contacts.into(), p.contact.rate, IsophoteVoice::default());
        Ok(Self { params: p.clone(), kappa, rms, force, voices })
    }

    fn run(&mut self, mut io: IsophoteExcitationIo<'_>) -> Result<(), Fault> {
        let (first, events, out) = (io.force.first(), io.paths.events(), io.force.items());
        if silent(self.kappa, out) {
            return Ok(());
        }
        self.voices.play_cells(
            events,
            self.params.contact.object,
            first,
            out,
            &mut self.force,
            |_| IsophoteVoice::default(),
            IsophoteForce::add,
            IsophoteForce::ring_out,
        );
        self.voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: IsophoteExcitationIo<'_>) -> Result<Summary, Fault> {
        let mut summary = self.voices.summary();
        if self.params.reading == Reading::Crossing {
            summary.push(("crossings", self.force.crossings.into()));
        }
        if self.force.all_left_out() > 0 {
            summary.push(("crossings_left_out", self.force.all_left_out().into()));
        }
        Ok(summary)
    }

    fn silence(&self) -> Option<Silence> {
        self.voices.silence(&self.params.contact, self.params.law.kappa, self.kappa)
    }

    fn retune(&mut self, new: &IsophoteExcitationParams) -> Retune {
        let fixed =
            |p: &IsophoteExcitationParams| (p.reading, p.contact.object, p.contact.contacts, p.contact.rate);
        if fixed(new) != fixed(&self.params) {
            return Retune::Rebuild;
        }
        self.force.law.ramp_to(law(new, self.kappa, self.rms), self.voices.now());
        self.force.scale.ramp_to(new.contact.scale, self.voices.now());
        self.force.radius.ramp_to(new.radius, self.voices.now());
        self.force.width = new.width;
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.voices.take_state(&old.voices);
        self.force.take_state(&old.force);
    }

    archive_state!(force, voices);

    fn trial(rng: &mut Rng) -> (IsophoteExcitationParams, MemoryFiles) {
        let params = IsophoteExcitationParams::trial(rng);
        let object = params.contact.object.map(|_| rng.below(2) as u32);
        let contacts = 1 + rng.below(5) as u16;
        let (width, scale) = (rng.between(0.1, 5.0), rng.between(0.2, 5.0));
        (
            IsophoteExcitationParams {
                width,
                contact: ContactForceParams { object, contacts, scale, ..params.contact },
                ..params
            },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
