//! The node `TransientResidual`.

use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, same_channels, same_rate};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
use crate::{params, ports};

params! {
    /// Computes the residual of a sound without its steady part: `transient = audio - steady`, so that both parts add up to the sound.
    ///
    /// The transient part remains a signal, without a model of noise. Delays of the analysis are compensated: the samples of both inputs
    /// are those of the same time.
    ///
    /// # Source
    /// Serra and Smith, "Spectral modeling synthesis" (Computer Music Journal 14(4), 1990); Picard, Tsingos and Faure, "Retargetting Example
    /// Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.1.
    pub struct TransientResidualParams {}
}
ports! {
    /// Ports of `TransientResidual`.
    pub struct TransientResidualPorts / TransientResidualIo {
        in {
            /// The sound.
            audio: Stream<f32>,
            /// Its steady part, from `AdditiveResynth`.
            steady: Stream<f32>,
        }
        out {
            /// The sound without its sinusoids.
            transient: Stream<f32>,
        }
    }
}

/// The node `TransientResidual`.
#[derive(Debug)]
pub struct TransientResidual;

impl Node for TransientResidual {
    type Params = TransientResidualParams;
    type Ports = TransientResidualPorts;
    const NAME: &'static str = "TransientResidual";
    const CLASS: Class = Class::Audio;

    fn shape(
        _: &TransientResidualParams,
        s: &mut Shape<'_, '_, TransientResidualPorts>,
    ) -> Result<(), Reject> {
        let audio = s.input(TransientResidualPorts::audio);
        let steady = s.input(TransientResidualPorts::steady);
        same_rate("steady", steady.rate, "`audio`", audio.rate)?;
        same_channels("steady", steady.format, "`audio`", audio.format)?;
        s.when_ended(TransientResidualPorts::audio, Ends::Stop);
        s.output(TransientResidualPorts::transient, audio.rate, audio.format);
        Ok(())
    }

    fn build(_: &TransientResidualParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self)
    }

    #[inline]
    fn run(&mut self, mut io: TransientResidualIo<'_>) -> Result<(), Fault> {
        let parts = io.audio.items().iter().zip(io.steady.items());
        for (out, (x, steady)) in io.transient.items().iter_mut().zip(parts) {
            *out = x - steady;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn the_difference_lasts_as_long_as_the_sound() {
        let run = |steady| {
            Standalone::new::<TransientResidual>(TransientResidualParams {})
                .input(TransientResidualPorts::audio, Rate::hz(100), Channels(1), vec![1.0, 0.5, -1.0])
                .input(TransientResidualPorts::steady, Rate::hz(100), Channels(1), steady)
                .run()
                .unwrap()
                .stream(TransientResidualPorts::transient)
        };
        assert_eq!(run(vec![0.25, 0.5]), [0.75, 0.0, -1.0]);
        assert_eq!(run(vec![1.0; 5]), [0.0, -0.5, -2.0]);
    }
}
