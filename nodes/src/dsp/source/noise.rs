//! The node `Noise`.

use super::noise_generator::{GaussianNoise, PinkNoise, UniformNoise};
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
    /// Spectrum and distribution of noise.
    pub enum NoiseColour {
        /// Flat spectrum, normal distribution.
        White,
        /// Flat spectrum, uniform distribution up to a peak of 1.73 times the level.
        Uniform,
        /// Power falls by 3 dB per octave.
        Pink,
    }
}
params! {
    /// Generates noise that is independent in each channel.
    ///
    /// # Randomness
    /// A sample depends on the seed, the channel and the sample index only.
    ///
    /// # Source
    /// P. Kellet's filter for pink noise; Box and Muller (1958) for normal numbers.
    pub struct NoiseParams {
        /// Spectrum.
        colour: NoiseColour = NoiseColour::White;
        /// Root mean square, of full scale.
        level: f32 = 0.1, unit "", range 0.0..=100.0_f32;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
        /// Channels.
        channels: u16 = 1, unit "channels", range 1..=64_u16;
        /// Length; None is endless.
        duration: Option<f64> = None, unit "s", range 0.0..=86_400.0;
    }
}

#[derive(Debug)]
enum Generator {
    White(GaussianNoise),
    Uniform(UniformNoise),
    Pink(Box<PinkNoise>),
}

/// The node `Noise`.
#[derive(Debug)]
pub struct NoiseNode {
    output: SourceOutput,
    generators: Vec<Generator>,
    params: NoiseParams,
}

/// Returns the factor from the root mean square of the generator to the level.
fn factor(p: &NoiseParams) -> f64 {
    f64::from(p.level) * if p.colour == NoiseColour::Uniform { 3.0_f64.sqrt() } else { 1.0 }
}

impl Node for NoiseNode {
    type Params = NoiseParams;
    type Ports = SourcePorts;
    const NAME: &'static str = "Noise";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 20.0;

    fn shape(p: &NoiseParams, s: &mut Shape<'_, '_, SourcePorts>) -> Result<(), Reject> {
        s.ends(ends_after(p.duration));
        s.output(SourcePorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &NoiseParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let generator = |channel: u32| match p.colour {
            NoiseColour::White => Generator::White(GaussianNoise::new(cx.random, channel)),
            NoiseColour::Uniform => Generator::Uniform(UniformNoise::new(cx.random, channel)),
            NoiseColour::Pink => Generator::Pink(Box::new(PinkNoise::new(cx.random, channel))),
        };
        let generators = (0..u32::from(p.channels)).map(generator).collect();
        Ok(Self { output: SourceOutput::new(factor(p), cx), generators, params: p.clone() })
    }

    fn run(&mut self, mut io: SourceIo<'_>) -> Result<(), Fault> {
        self.output.run(&mut io.audio, |channel, first, block| match &mut self.generators[channel] {
            Generator::White(noise) => noise.fill(first, block),
            Generator::Uniform(noise) => noise.fill(first, block),
            Generator::Pink(noise) => noise.fill(first, block),
        });
        Ok(())
    }

    fn retune(&mut self, new: &NoiseParams) -> Retune {
        if *new != (NoiseParams { level: new.level, ..self.params.clone() }) {
            return Retune::Rebuild;
        }
        self.params.level = new.level;
        self.output.set_level(factor(new));
        Retune::Done
    }

    fn trial(rng: &mut Rng) -> (NoiseParams, MemoryFiles) {
        let params = NoiseParams::trial(rng);
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        (NoiseParams { duration, channels: 1 + rng.below(3) as u16, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;

    #[test]
    fn every_colour_has_the_given_level() {
        for colour in [NoiseColour::White, NoiseColour::Uniform, NoiseColour::Pink] {
            let rate = Rate::hz(48_000);
            let params = NoiseParams { colour, level: 0.25, rate, channels: 2, duration: Some(2.0) };
            let audio = Standalone::new::<NoiseNode>(params).run().unwrap().stream(SourcePorts::audio);
            assert_eq!(audio.len(), 2 * 96_000);
            for channel in 0..2 {
                let power = audio.iter().skip(channel).step_by(2).map(|x| f64::from(*x).powi(2)).sum::<f64>();
                let rms = (power / 96_000.0).sqrt();
                assert!((rms / 0.25 - 1.0).abs() < 0.1, "{colour:?}: {rms}");
            }
        }
    }

    #[test]
    fn noise_without_a_duration_never_ends() {
        let (params, rate) = (NoiseParams::read(&|_| None).unwrap(), Rate::hz(48_000));
        let mut standalone = Standalone::new::<NoiseNode>(params);
        assert_eq!(standalone.shape().unwrap().end, None);
        standalone.until = ticks(0.5);
        assert_eq!(
            standalone.run().unwrap().stream(SourcePorts::audio).len() as i64,
            rate.first_at(standalone.until)
        );
    }
}
