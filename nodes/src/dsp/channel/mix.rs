//! The node `Mix`.

use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune, same_channels, same_rate};
use crate::core::ports::{Many, Stream};
use crate::core::shape::{Build, Shape};
use crate::dsp::Gain;
use crate::dsp::ramp_frames;
use crate::{params, ports};

params! {
    /// Adds streams; the output is as long as the longest input.
    ///
    /// All inputs have the same rate and number of channels.
    /// A gain that changes while the graph runs is reached along a linear ramp of 10 ms.
    pub struct MixParams {
        /// Amplitude factor of each input, in order; an empty list is 1 for all inputs.
        gains: Vec<f32> = Vec::new(), unit "", range -1000.0..=1000.0_f32;
    }
}
ports! {
    /// Ports of `Mix`.
    pub struct MixPorts / MixIo {
        in {
            /// Audio to add.
            inputs: Many<Stream<f32>>,
        }
        out {
            /// The sum.
            out: Stream<f32>,
        }
    }
}

/// The node `Mix`.
#[derive(Debug)]
pub struct MixNode {
    gains: Vec<Gain>,
}

fn check_gains(p: &MixParams, inputs: usize) -> Result<(), Reject> {
    if p.gains.is_empty() || p.gains.len() == inputs {
        return Ok(());
    }
    let message = format!("`gains` has {} numbers for {inputs} inputs", p.gains.len());
    Err(Reject::new("F051", message).at("gains").help("give one for each input, or an empty list"))
}

impl Node for MixNode {
    type Params = MixParams;
    type Ports = MixPorts;
    const NAME: &'static str = "Mix";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 2.5;

    fn shape(p: &MixParams, s: &mut Shape<'_, '_, MixPorts>) -> Result<(), Reject> {
        let inputs = s.many(MixPorts::inputs);
        let Some(first) = inputs.first().cloned() else {
            return Err(Reject::new("F051", "`inputs` is empty")
                .at("inputs")
                .help("link at least one stream"));
        };
        s.check(check_gains(p, inputs.len()));
        for (k, input) in inputs.iter().enumerate() {
            let field = format!("inputs[{k}]");
            s.check(same_rate(&field, input.rate, "`inputs[0]`", first.rate));
            s.check(same_channels(&field, input.format, "`inputs[0]`", first.format));
        }
        s.output(MixPorts::out, first.rate, first.format);
        Ok(())
    }

    fn build(p: &MixParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let inputs = cx.many(MixPorts::inputs);
        let gain = |k: usize| f64::from(p.gains.get(k).copied().unwrap_or(1.0));
        let gains = inputs
            .iter()
            .enumerate()
            .map(|(k, input)| Gain::new(gain(k), ramp_frames(input.rate), usize::from(input.format.0)));
        Ok(Self { gains: gains.collect() })
    }

    fn run(&mut self, mut io: MixIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        out.fill(0.0);
        let mut inputs = io.inputs.iter();
        let (groups, rest) = self.gains.as_chunks_mut::<4>();
        for gains in groups {
            let (Some(a), Some(b), Some(c), Some(d)) =
                (inputs.next(), inputs.next(), inputs.next(), inputs.next())
            else {
                break;
            };
            Gain::add_all(gains, [a.items(), b.items(), c.items(), d.items()], out);
        }
        for (input, gain) in inputs.zip(rest) {
            gain.add(input.items(), out);
        }
        Ok(())
    }

    fn retune(&mut self, new: &MixParams) -> Retune {
        if !new.gains.is_empty() && new.gains.len() != self.gains.len() {
            return Retune::Rebuild;
        }
        for (k, gain) in self.gains.iter_mut().enumerate() {
            gain.set_target(f64::from(new.gains.get(k).copied().unwrap_or(1.0)));
        }
        Retune::Done
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    fn mix(gains: &[f32], inputs: &[(u32, u16, &[f32])]) -> Standalone {
        let standalone = Standalone::new::<MixNode>(MixParams { gains: gains.to_vec() });
        inputs.iter().fold(standalone, |standalone, &(rate, channels, audio)| {
            standalone.also(MixPorts::inputs, Rate::hz(rate), Channels(channels), audio.to_vec())
        })
    }

    #[test]
    fn the_output_is_as_long_as_the_longest_input() {
        let standalone = mix(&[], &[(100, 1, &[1.0, 2.0]), (100, 1, &[0.5, 0.5, 0.5, 0.25])]);
        assert_eq!(standalone.run().unwrap().stream(MixPorts::out), [1.5, 2.5, 0.5, 0.25]);
    }

    #[test]
    fn each_input_has_its_gain() {
        let standalone = mix(&[2.0, -1.0], &[(100, 2, &[1.0, 2.0]), (100, 2, &[0.5, 0.25])]);
        assert_eq!(standalone.run().unwrap().stream(MixPorts::out), [1.5, 3.75]);
        let wrong = mix(&[2.0], &[(100, 1, &[1.0]), (100, 1, &[0.5])]);
        assert_eq!(wrong.shape().unwrap_err().field.as_deref(), Some("gains"));
    }

    #[test]
    fn inputs_that_differ_are_named() {
        let rates = mix(&[], &[(100, 1, &[1.0]), (200, 1, &[1.0])]).shape().unwrap_err();
        assert!(rates.message.contains("inputs[1]") && rates.help.unwrap().contains("Resample"));
        let widths = mix(&[], &[(100, 1, &[1.0]), (100, 2, &[1.0, 1.0])]).shape().unwrap_err();
        assert!(widths.message.contains("inputs[1]"), "{}", widths.message);
    }
}
