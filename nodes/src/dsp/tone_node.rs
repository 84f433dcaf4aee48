//! The nodes around the tone generators.

use super::node::ends_after;
use super::source::{Source, SourceIo, SourcePorts};
use super::{Saw, Sine, Square, Sweep, SweepLaw};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune};
use crate::core::params::Params;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::{choices, params};

choices! {
    /// Shape of a period.
    pub enum Waveform {
        /// A pure tone.
        Sine,
        /// All harmonics, rising; band-limited.
        Saw,
        /// Odd harmonics; band-limited.
        Square,
    }
}
params! {
    /// Makes a steady tone whose phase is zero at time zero and never drifts.
    ///
    /// # Source
    /// Valimaki and Huovilainen, "Antialiasing Oscillators in Subtractive Synthesis" (IEEE SPM 24(2), 2007).
    pub struct ToneParams {
        /// Shape of a period.
        waveform: Waveform = Waveform::Sine;
        /// Periods per second; below half the rate.
        frequency: f64 = 440.0, unit "Hz", range 0.001..=300_000.0;
        /// Peak, of full scale.
        level: f32 = 0.5, unit "", range 0.0..=100.0_f32;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
        /// Channels, all with the same tone.
        channels: u16 = 1, unit "channels", range 1..=64_u16;
        /// Length; None goes on for ever.
        duration: Option<f64> = None, unit "s", range 0.0..=86_400.0;
    }
}

#[derive(Debug)]
enum Generator {
    Sine(Sine),
    Saw(Saw),
    Square(Square),
}

/// The node `Tone`.
#[derive(Debug)]
pub struct ToneNode {
    source: Source,
    generator: Generator,
    params: ToneParams,
}

impl Generator {
    fn new(p: &ToneParams) -> Result<Self, Reject> {
        let rate = p.rate.as_f64();
        Ok(match p.waveform {
            Waveform::Sine => Self::Sine(Sine::new(p.frequency, rate)?),
            Waveform::Saw => Self::Saw(Saw::new(p.frequency, rate)?),
            Waveform::Square => Self::Square(Square::new(p.frequency, rate)?),
        })
    }
}

impl Node for ToneNode {
    type Params = ToneParams;
    type Ports = SourcePorts;
    const NAME: &'static str = "Tone";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 8.0;

    fn shape(p: &ToneParams, s: &mut Shape<'_, '_, SourcePorts>) -> Result<(), Reject> {
        Generator::new(p)?;
        s.ends(ends_after(p.duration));
        s.output(SourcePorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &ToneParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let source = Source::new(p.level.into(), cx);
        Ok(Self { source, generator: Generator::new(p)?, params: p.clone() })
    }

    fn run(&mut self, mut io: SourceIo<'_>) -> Result<(), Fault> {
        self.source.run(&mut io.audio, |channel, first, block| match &self.generator {
            // The block still holds the tone from channel 0.
            _ if channel > 0 => {}
            Generator::Sine(tone) => tone.fill(first, block),
            Generator::Saw(tone) => tone.fill(first, block),
            Generator::Square(tone) => tone.fill(first, block),
        });
        Ok(())
    }

    fn retune(&mut self, new: &ToneParams) -> Retune {
        if *new != (ToneParams { level: new.level, ..self.params.clone() }) {
            return Retune::Rebuild;
        }
        self.params.level = new.level;
        self.source.set_level(new.level.into());
        Retune::Done
    }

    fn trial(rng: &mut Rng) -> (ToneParams, MemoryFiles) {
        let params = ToneParams::trial(rng);
        let frequency = params.rate.as_f64() * rng.between(0.001, 0.499);
        let (duration, channels) = (params.duration.map(|_| rng.between(0.0, 0.5)), 1 + rng.below(3) as u16);
        (ToneParams { duration, channels, frequency, ..params }, MemoryFiles::default())
    }
}

choices!(@param SweepLaw {
    /// The same number of hertz in each second.
    Linear,
    /// The same number of octaves in each second.
    Exponential,
});
params! {
    /// Makes a sine that goes from one frequency to another.
    pub struct SweepParams {
        /// How the frequency moves.
        law: SweepLaw = SweepLaw::Exponential;
        /// Frequency at the start; below half the rate.
        from: f64 = 20.0, unit "Hz", range 0.001..=300_000.0;
        /// Frequency at the end; below half the rate.
        to: f64 = 20_000.0, unit "Hz", range 0.001..=300_000.0;
        /// Peak, of full scale.
        level: f32 = 0.5, unit "", range 0.0..=100.0_f32;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
        /// Channels, all with the same sweep.
        channels: u16 = 1, unit "channels", range 1..=64_u16;
        /// Length.
        duration: f64 = 1.0, unit "s", range 0.001..=3600.0;
    }
}

/// The node `Sweep`.
#[derive(Debug)]
pub struct SweepNode {
    source: Source,
    sweep: Sweep,
}

fn sweep(p: &SweepParams) -> Result<Sweep, Reject> {
    let (rate, frames) = (p.rate.as_f64(), p.rate.first_at(ticks(p.duration)) as u64);
    // The maths calls both of them a frequency.
    Sweep::new(p.law, p.from, p.from, frames, rate).map_err(|e| Reject::from(e).at("from"))?;
    Sweep::new(p.law, p.from, p.to, frames, rate).map_err(|e| Reject::from(e).at("to"))
}

impl Node for SweepNode {
    type Params = SweepParams;
    type Ports = SourcePorts;
    const NAME: &'static str = "Sweep";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 30.0;

    fn shape(p: &SweepParams, s: &mut Shape<'_, '_, SourcePorts>) -> Result<(), Reject> {
        sweep(p)?;
        s.ends(Some(ticks(p.duration)));
        s.output(SourcePorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &SweepParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { source: Source::new(p.level.into(), cx), sweep: sweep(p)? })
    }

    fn run(&mut self, mut io: SourceIo<'_>) -> Result<(), Fault> {
        self.source.run(&mut io.audio, |channel, first, block| {
            if channel == 0 {
                self.sweep.fill(first, block);
            }
        });
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (SweepParams, MemoryFiles) {
        let params = SweepParams::trial(rng);
        let rate = params.rate.as_f64();
        let (from, to) = (rate * rng.between(0.001, 0.499), rate * rng.between(0.001, 0.499));
        let (duration, channels) = (rng.between(0.001, 0.5), 1 + rng.below(3) as u16);
        (SweepParams { from, to, duration, channels, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    #[test]
    fn a_quarter_of_the_rate_is_four_samples_long_in_every_channel() {
        let params = ToneParams {
            waveform: Waveform::Sine,
            frequency: 250.0,
            level: 0.5,
            rate: Rate::hz(1000),
            channels: 2,
            duration: Some(0.6),
        };
        let audio = Standalone::new::<ToneNode>(params).run().unwrap().stream(SourcePorts::audio);
        assert_eq!(audio.len(), 1200);
        for (k, frame) in audio.chunks(2).enumerate() {
            assert!((frame[0] - [0.0, 0.5, 0.0, -0.5][k % 4]).abs() < 1e-6 && frame[1] == frame[0], "{k}");
        }
    }

    #[test]
    fn a_tone_above_half_the_rate_is_refused() {
        let params = ToneParams { frequency: 24_000.0, ..ToneParams::read(&|_| None).unwrap() };
        assert_eq!(
            Standalone::new::<ToneNode>(params).shape().unwrap_err().field.as_deref(),
            Some("frequency")
        );
        let params = SweepParams { to: 24_000.0, ..SweepParams::read(&|_| None).unwrap() };
        assert_eq!(Standalone::new::<SweepNode>(params).shape().unwrap_err().field.as_deref(), Some("to"));
    }

    #[test]
    fn a_sweep_lasts_for_its_duration() {
        let params = SweepParams { duration: 0.25, ..SweepParams::read(&|_| None).unwrap() };
        let audio = Standalone::new::<SweepNode>(params).run().unwrap().stream(SourcePorts::audio);
        assert_eq!(audio.len(), 12_000);
        assert!(audio[11_990..].iter().any(|x| x.abs() > 0.1));
    }
}
