//! The noise of impacts, as a node.

use super::noise_bank::NoiseBank;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary, same_rate};
use crate::core::params::Params;
use crate::core::ports::{Many, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::dsp::{Gain, Reference, db_to_linear, ramp_frames};
use crate::modal::bank::loudness::unit;
use crate::modal::mode::modes::Modes;
use crate::{archive_state, params, ports};

params! {
    /// The part of an impact that no mode explains, as bands of noise that decay: the click, scraping, modes that are too dense.
    ///
    /// The bands are stored with the modes: at most 32, each with its own level and decay. The node runs beside a `ModalBank` with the
    /// same forces and modes, and their outputs are added. An impact excites each band like a mode at its frequency. Its sound is the same
    /// each time but for random detail. Forces of several channels are added up. Modes without bands of noise give silence.
    ///
    /// # Randomness
    /// Phases and frequencies of the bands are a function of the seed and the sample index.
    ///
    /// # Source
    /// Ren, Yeh and Lin, "Example-guided physically based modal sound synthesis" (ACM TOG 32(1), 2013), section 6, for a residual beside the
    /// modes; bands of noise in place of its samples are a choice.
    pub struct ModalResidualParams {
        /// Scale of the gains, as in `ModalBank`: with the same choice here and there, both have the levels of the recording.
        reference: Reference = Reference::Normalized;
        /// Factor of the sound.
        gain: f32 = 1.0, unit "", range -1_000_000.0..=1_000_000.0_f32;
        /// Level change in addition to `gain`.
        db: f32 = 0.0, unit "dB", range -120.0..=120.0_f32;
        /// Time for which the noise still sounds after the end of the last force.
        tail: f64 = 1.0, unit "s", range 0.0..=3600.0;
    }
}
ports! {
    pub struct ModalResidualPorts / ModalResidualIo {
        in {
            /// Forces in N, at the sample rate of the sound.
            forces: Many<Stream<f32>>,
            /// The modes of the object, with their bands of noise.
            modes: Value<Modes>,
        }
        out {
            /// The sound, mono.
            audio: Stream<f32>,
        }
    }
}

/// The node over [`NoiseBank`].
#[derive(Debug)]
pub struct ModalResidual {
    bank: NoiseBank,
    gain: Gain,
    params: ModalResidualParams,
    /// Scale of the gains of the modes.
    unit: f64,
    /// Samples of force per second: a force of 1 N for one sample is an impulse of 1 / rate.
    per_sample: f32,
}

/// Number of samples whose forces are added up at a time.
const BLOCK: usize = 64;

fn reject(e: impl std::fmt::Display) -> Reject {
    Reject::new("F078", e.to_string()).at("modes")
}

fn factor(p: &ModalResidualParams, unit: f64) -> f64 {
    f64::from(p.gain) * db_to_linear(p.db.into()) * unit
}

impl Node for ModalResidual {
    type Params = ModalResidualParams;
    type Ports = ModalResidualPorts;
    const NAME: &'static str = "ModalResidual";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 3.0;

    fn shape(p: &ModalResidualParams, s: &mut Shape<'_, '_, ModalResidualPorts>) -> Result<(), Reject> {
        let forces = s.many(ModalResidualPorts::forces);
        let Some(first) = forces.first() else {
            return Err(Reject::new("F078", "there is no force").at("forces"));
        };
        for (k, force) in forces.iter().enumerate() {
            s.check(same_rate(&format!("forces[{k}]"), force.rate, "`forces[0]`", first.rate));
        }
        if let Some(modes) = s.value(ModalResidualPorts::modes) {
            modes.validate().map_err(reject)?;
            if modes.noise.is_empty() {
                s.note("the modes have no bands of noise: this gives silence".to_owned());
            }
        }
        s.tail(ticks(p.tail));
        s.output(ModalResidualPorts::audio, first.rate, Channels(1));
        Ok(())
    }

    fn build(p: &ModalResidualParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let modes = cx.value(ModalResidualPorts::modes);
        modes.validate().map_err(reject)?;
        let rate: Rate = cx.output(ModalResidualPorts::audio).rate;
        let bank = NoiseBank::new(&modes.noise, rate.as_f64(), cx.random);
        let unit = unit(&modes, p.reference).map_err(reject)?;
        let gain = Gain::new(factor(p, unit), ramp_frames(rate), 1);
        let per_sample = (1.0 / rate.as_f64()) as f32;
        Ok(Self { bank, gain, params: p.clone(), unit, per_sample })
    }

    fn run(&mut self, mut io: ModalResidualIo<'_>) -> Result<(), Fault> {
        let first = io.audio.first();
        let out = io.audio.items();
        out.fill(0.0);
        for (k, out) in out.chunks_mut(BLOCK).enumerate() {
            let at = k * BLOCK;
            let mut sum = [0.0; BLOCK];
            for force in io.forces.iter() {
                let width = force.width().max(1);
                let frames = force.items().get(at * width..(at + out.len()) * width).unwrap_or_default();
                for (sum, frame) in sum.iter_mut().zip(frames.chunks_exact(width)) {
                    *sum += frame.iter().sum::<f32>() * self.per_sample;
                }
            }
            self.bank.process(first + at as i64, &sum[..out.len()], out);
        }
        self.gain.process(out);
        Ok(())
    }

    fn finish(&mut self, _: ModalResidualIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("noise_bands", self.bank.len().into())])
    }

    fn retune(&mut self, new: &ModalResidualParams) -> Retune {
        if (new.tail, new.reference) != (self.params.tail, self.params.reference) {
            return Retune::Rebuild;
        }
        self.params = new.clone();
        self.gain.set_target(factor(new, self.unit));
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.gain.start_from(old.gain.current());
        self.bank.take_state(&old.bank);
    }

    archive_state!(bank, gain);

    fn trial(rng: &mut Rng) -> (ModalResidualParams, MemoryFiles) {
        let params = ModalResidualParams::trial(rng);
        (ModalResidualParams { tail: rng.between(0.0, 2.0), ..params }, MemoryFiles::default())
    }
}
