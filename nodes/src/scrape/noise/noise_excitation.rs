//! The node around [`NoiseForce`].

use super::bands::NoiseBands;
use super::interpolation::NoiseInterp;
use super::noise_force::{NoiseForce, NoiseVoice};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::dsp::Reference;
use crate::scrape::force::contact_force_params::ContactForceParams;
use crate::scrape::force::strength::{self, Strength, linked, silent};
use crate::scrape::force::voices::Voices;
use crate::scrape::path::piece::PathPiece;
use crate::texture::{NoiseProfile, NoiseValue};
use crate::{archive_state, choices, params, ports};

/// Maximum length of a loop; its bands need 17 times its memory.
const LONGEST: usize = 1 << 21;

choices! { @param NoiseInterp {
    /// Windowed sinc of 32 taps: images at -108 dB.
    Sinc32,
    /// Linear: -25 dB.
    Linear,
    /// A cubic through the samples: -43 dB.
    Catmull,
    /// A cubic B-spline: -52 dB; the finest detail is halved.
    Bspline3,
} }

choices! { @param NoiseValue {
    /// Change of the noise per pixel of its image: the slope that a slider meets, as of maps.
    Slope,
    /// The noise itself.
    Height,
} }

params! {
    /// Excites an object with the noise of a surface that has no distinct features.
    ///
    /// A contact reads a loop of noise at its speed, backwards after a reversal. The force is `gain kappa (f/1 N)^a (v/1 m/s)^b` times
    /// the slope of the noise at the position of the contact, divided by its RMS by default, summed over all contacts. With the default exponents the amplitude is proportional to
    /// the square root of the power of friction. A contact at rest fades out in 5 ms. At any speed the spectrum is complete up to 0.4 of
    /// the sample rate, and nothing aliases from above half of it.
    ///
    /// `gain`, `kappa`, `a`, `b` and `scale` can change while the node runs and ramp over 20 ms. A link to `kappa` replaces the number.
    /// The input is not audio, so the node has a sample rate of its own.
    ///
    /// # Randomness
    /// The position on the loop at which a contact begins follows from the seed, the number of the contact and the count of its jumps.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2; the
    /// exponents are a choice. Playback at a speed other than that of the recording: van den Doel, Kry and Pai, "FoleyAutomatic"
    /// (SIGGRAPH 2001).
    pub struct NoiseExcitationParams {
        /// Interpolation between the samples of the noise.
        interp: NoiseInterp = NoiseInterp::Sinc32;
        /// Quantity of the noise that becomes force.
        value: NoiseValue = NoiseValue::Slope;
        /// Scale of the value: `Normalized` for an RMS of 1 over the whole loop. A linked strength has a scale of its own.
        reference: Reference = Reference::Normalized;
        /// Force in N of a value of 1 at 1 N and 1 m/s.
        kappa: f64 = 1.0, unit "N", range -1_000_000.0..=1_000_000.0;
        /// Exponent of the normal force.
        a: f64 = 0.5, unit "", range 0.0..=2.0;
        /// Exponent of the speed.
        b: f64 = 0.5, unit "", range 0.0..=2.0;
        /// Force and contacts.
        [group] contact: ContactForceParams;
    }
}
ports! {
    pub struct NoiseExcitationPorts / NoiseExcitationIo {
        in {
            /// Paths of the contacts over the surface.
            paths: Events<PathPiece>,
            /// The noise of the surface.
            noise: Value<NoiseProfile>,
            /// Strength that replaces the number, from LevelMatcher.
            kappa: Option<Value<Strength>>,
        }
        out {
            /// Force, mono, N.
            force: Stream<f32>,
        }
    }
}

/// The node `NoiseExcitation`.
#[derive(Debug)]
pub struct NoiseExcitation {
    params: NoiseExcitationParams,
    /// The linked strength.
    kappa: Option<Strength>,
    /// RMS of the values of the loop.
    rms: f64,
    noise: NoiseBands,
    random: Random,
    force: NoiseForce,
    voices: Voices<NoiseVoice>,
}

/// Root of the mean square.
fn rms(samples: &[f32]) -> f64 {
    let squares = samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    (squares / samples.len().max(1) as f64).sqrt()
}

/// The law of the parameters; a linked strength replaces the number.
fn law(p: &NoiseExcitationParams, kappa: Option<Strength>, rms: f64) -> [f64; 3] {
    [kappa.map_or(p.kappa * p.reference.unit(rms), |s| s.kappa) * p.contact.gain, p.a, p.b]
}

pub(in crate::scrape) fn check(noise: &NoiseProfile) -> Result<(), Reject> {
    let factor = noise.detail.map_or(1, |detail| detail.factor as usize);
    let count = noise.samples.len().saturating_mul(factor);
    let message = if count == 0 || count > LONGEST {
        format!("`noise` has {count} samples; 1 to {LONGEST} can be read")
    } else if !noise.samples.iter().all(|x| x.abs() < 1e9) {
        "`noise` holds numbers beyond 1e9 or none at all".into()
    } else if !(1e-9..1e3).contains(&noise.spacing) {
        format!("`noise` has a sample every {} m; 1e-9 to 1000 m can be read", noise.spacing)
    } else {
        return Ok(());
    };
    Err(Reject::new("F128", message).at("noise"))
}

impl Node for NoiseExcitation {
    type Params = NoiseExcitationParams;
    type Ports = NoiseExcitationPorts;
    const NAME: &'static str = "NoiseExcitation";
    const VERSION: u32 = 5;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 15.0;

    fn shape(p: &NoiseExcitationParams, s: &mut Shape<'_, '_, NoiseExcitationPorts>) -> Result<(), Reject> {
        s.output(NoiseExcitationPorts::force, p.contact.rate, Channels(1));
        Ok(())
    }

    fn build(p: &NoiseExcitationParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let noise = cx.value(NoiseExcitationPorts::noise);
        check(&noise)?;
        let kappa = linked(cx.optional_value(NoiseExcitationPorts::kappa))?;
        let rate = p.contact.rate.as_f64();
        let line = noise.line(p.value);
        let rms = rms(&line.samples);
        Ok(Self {
            rms,
            kappa,
            noise: NoiseBands::read_by(&line, p.interp),
            random: cx.random,
            force: NoiseForce::new(strength::law(law(p, kappa, rms), kappa, rate), p.contact.scale, rate),
            voices: Voices::new(p.contact.contacts.into(), p.contact.rate, NoiseVoice::default()),
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: NoiseExcitationIo<'_>) -> Result<(), Fault> {
        let (first, out) = (io.force.first(), io.force.items());
        if silent(self.kappa, out) {
            return Ok(());
        }
        let Self { noise, force, voices, random, .. } = self;
        let start = |piece: &PathPiece| {
            let part = random.uniform(piece.jump, piece.contact, 0);
            NoiseVoice::at(part * noise.round())
        };
        voices.play(
            io.paths.events(),
            self.params.contact.object,
            first,
            out,
            start,
            |voice, segment, out| {
                force.add(noise, voice, segment, out);
            },
        );
        self.voices.made(first, out);
        Ok(())
    }

    fn finish(&mut self, _: NoiseExcitationIo<'_>) -> Result<Summary, Fault> {
        Ok(self.voices.summary())
    }

    fn silence(&self) -> Option<Silence> {
        self.voices.silence(&self.params.contact, self.params.kappa, self.kappa)
    }

    fn retune(&mut self, new: &NoiseExcitationParams) -> Retune {
        let old = &self.params;
        let fixed = |p: &NoiseExcitationParams| {
            (p.interp, p.value, p.contact.object, p.contact.contacts, p.contact.rate)
        };
        if fixed(new) != fixed(old) {
            return Retune::Rebuild;
        }
        self.force.law.ramp_to(law(new, self.kappa, self.rms), self.voices.now());
        self.force.scale.ramp_to(new.contact.scale, self.voices.now());
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        // A position on a loop of another length means nothing.
        if self.noise.round() == old.noise.round() {
            self.voices.take_state(&old.voices);
        }
    }

    archive_state!(voices);

    fn trial(rng: &mut Rng) -> (NoiseExcitationParams, MemoryFiles) {
        let params = NoiseExcitationParams::trial(rng);
        let object = params.contact.object.map(|_| rng.below(2) as u32);
        let contacts = 1 + rng.below(5) as u16;
        (
            NoiseExcitationParams {
                contact: ContactForceParams { object, contacts, ..params.contact },
                ..params
            },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
