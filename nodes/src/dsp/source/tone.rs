//! The node `Tone`.

use super::oscillator::{Saw, Sine, Square};
use super::output::{SourceIo, SourceOutput, SourcePorts, ends_after};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune};
use crate::core::params::Params;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{choices, params};
choices! {
    /// Shape of a period.
    pub enum Waveform {
        /// Sine, without harmonics.
        Sine,
        /// Rising sawtooth, with all harmonics; band-limited.
        Saw,
        /// Square, with odd harmonics; band-limited.
        Square,
    }
}
params! {
    /// Generates a steady tone whose phase is zero at time zero and does not drift.
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
        /// Length; None is endless.
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
    output: SourceOutput,
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
        let output = SourceOutput::new(p.level.into(), cx);
        Ok(Self { output, generator: Generator::new(p)?, params: p.clone() })
    }

    fn run(&mut self, mut io: SourceIo<'_>) -> Result<(), Fault> {
        self.output.run(&mut io.audio, |channel, first, block| match &self.generator {
            // The block still holds the samples of channel 0.
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
        self.output.set_level(new.level.into());
        Retune::Done
    }

    fn trial(rng: &mut Rng) -> (ToneParams, MemoryFiles) {
        let params = ToneParams::trial(rng);
        let frequency = params.rate.as_f64() * rng.between(0.001, 0.499);
        let (duration, channels) = (params.duration.map(|_| rng.between(0.0, 0.5)), 1 + rng.below(3) as u16);
        (ToneParams { duration, channels, frequency, ..params }, MemoryFiles::default())
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
    }
}
