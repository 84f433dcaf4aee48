//! The node `Feedback`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, same_channels, same_rate};
use crate::core::params::Params;
use crate::core::ports::{Delayed, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::dsp::Gain;
use crate::dsp::{nearest_items, ramp_frames};
use crate::{params, ports};

params! {
    /// Returns the delayed audio of a later node. Only this node can close a loop in a graph.
    ///
    /// Rate, channels and length are those of `like`, since the returned stream is known only when the loop is closed.
    /// An echo is `Mix(inputs: ["dry", "echo"])` with `"echo": Feedback(audio: "mix", like: "dry", delay: 0.25, gain: 0.5)`.
    pub struct FeedbackParams {
        /// Delay, to the nearest sample and at least one sample; longer than the look-ahead of the nodes in the loop.
        delay: f64 = 0.25, unit "s", range 0.0001..=60.0;
        /// Amplitude factor of the loop; from a magnitude of 1 on the loop does not decay.
        gain: f32 = 0.5, unit "", range -2.0..=2.0_f32;
        /// Time for which the loop continues after the end of `like`.
        tail: f64 = 2.0, unit "s", range 0.0..=600.0;
    }
}
ports! {
    /// Ports of `Feedback`.
    pub struct FeedbackPorts / FeedbackIo {
        in {
            /// The returned audio; it may come from a node that this one feeds.
            audio: Delayed<Stream<f32>>,
            /// A stream of the same rate and channels from outside the loop.
            like: Stream<f32>,
        }
        out {
            /// The returned audio, delayed and times the gain.
            out: Stream<f32>,
        }
    }
}

/// The node `Feedback`.
#[derive(Debug)]
pub struct FeedbackNode {
    gain: Gain,
    params: FeedbackParams,
}

impl Node for FeedbackNode {
    type Params = FeedbackParams;
    type Ports = FeedbackPorts;
    const NAME: &'static str = "Feedback";
    const CLASS: Class = Class::Audio;

    fn shape(p: &FeedbackParams, s: &mut Shape<'_, '_, FeedbackPorts>) -> Result<(), Reject> {
        let like = s.input(FeedbackPorts::like);
        if let Some(audio) = s.delayed_input(FeedbackPorts::audio) {
            s.check(same_rate("audio", audio.rate, "`like`", like.rate));
            s.check(same_channels("audio", audio.format, "`like`", like.format));
        }
        s.delay(FeedbackPorts::audio, nearest_items(like.rate, p.delay).max(1));
        s.ends(like.end.map(|end| end + ticks(p.tail)));
        s.output(FeedbackPorts::out, like.rate, like.format);
        Ok(())
    }

    fn build(p: &FeedbackParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let like = cx.input(FeedbackPorts::like);
        let gain = Gain::new(f64::from(p.gain), ramp_frames(like.rate), like.format.0.into());
        Ok(Self { gain, params: p.clone() })
    }

    fn run(&mut self, mut io: FeedbackIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        out.copy_from_slice(io.audio.items());
        self.gain.process(out);
        Ok(())
    }

    fn retune(&mut self, new: &FeedbackParams) -> Retune {
        if *new != (FeedbackParams { gain: new.gain, ..self.params.clone() }) {
            return Retune::Rebuild;
        }
        self.params.gain = new.gain;
        self.gain.set_target(f64::from(new.gain));
        Retune::Done
    }

    fn trial(rng: &mut Rng) -> (FeedbackParams, MemoryFiles) {
        let (delay, tail) = (rng.between(0.0001, 0.2), rng.between(0.0, 0.2));
        (FeedbackParams { delay, tail, ..FeedbackParams::trial(rng) }, MemoryFiles::default())
    }
}
#[cfg(test)]
mod tests;
