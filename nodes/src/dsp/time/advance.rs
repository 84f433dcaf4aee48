//! The node `Advance`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::{params, ports};

params! {
    /// Shifts audio earlier by `seconds`.
    ///
    /// The inverse of Delay, to align a recording with a known lead-in. The node looks ahead by the whole shift, so streams that join
    /// its output are delayed as long; `foley plan` shows the memory for it. The audio before the new start is dropped, and the end
    /// is silent.
    pub struct AdvanceParams {
        /// Shift, rounded to the nearest sample.
        seconds: f64 = 0.0, unit "s", range 0.0..=60.0;
    }
}

ports! {
    pub struct AdvancePorts / AdvanceIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
        }
        out {
            /// The shifted audio.
            out: Stream<f32>,
        }
    }
}

/// The node `Advance`.
#[derive(Debug)]
pub struct Advance;

/// Returns the number of samples nearest to a time.
fn samples(seconds: f64, rate: Rate) -> usize {
    let tick = ticks(seconds);
    let after = rate.first_at(tick);
    let before = (after - 1).max(0);
    let nearest = if tick - rate.tick(before) < rate.tick(after) - tick { before } else { after };
    usize::try_from(nearest).unwrap_or(0)
}

impl Node for Advance {
    type Params = AdvanceParams;
    type Ports = AdvancePorts;
    const NAME: &'static str = "Advance";
    const CLASS: Class = Class::Audio;

    fn shape(p: &AdvanceParams, s: &mut Shape<'_, '_, AdvancePorts>) -> Result<(), Reject> {
        let audio = s.input(AdvancePorts::audio);
        s.lookaround(AdvancePorts::audio, 0, samples(p.seconds, audio.rate));
        s.output(AdvancePorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(_: &AdvanceParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self)
    }

    fn run(&mut self, mut io: AdvanceIo<'_>) -> Result<(), Fault> {
        let around = io.audio.around();
        let out = io.out.items();
        out.copy_from_slice(&around[around.len() - out.len()..]);
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (AdvanceParams, MemoryFiles) {
        // Short against the streams of a trial, so that they contain the samples looked ahead at.
        (AdvanceParams { seconds: rng.between(0.0, 0.1) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;

    #[test]
    fn a_ramp_is_shifted_by_whole_samples() {
        let ramp: Vec<f32> = (0..100).map(|k| k as f32).collect();
        let run = Standalone::new::<Advance>(AdvanceParams { seconds: 0.0101 })
            .input(AdvancePorts::audio, Rate::hz(1000), Channels(1), ramp)
            .window(Rate::hz(1000).tick(7))
            .run()
            .unwrap();
        let out = run.stream(AdvancePorts::out);
        assert_eq!(out[..90], (10..100).map(|k| k as f32).collect::<Vec<_>>());
        assert_eq!(out[90..], [0.0; 10]);
    }
}
