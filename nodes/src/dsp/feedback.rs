//! The one way to close a loop.

use super::gain::Gain;
use super::node::{nearest_items, ramp};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, same_rate};
use crate::core::params::Params;
use crate::core::ports::{Late, Stream};
use crate::core::random::Draw;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::{params, ports};

params! {
    /// Returns audio of a later node, delayed: the only node through which a graph may loop.
    ///
    /// Rate, channels and length come from `like`, for the stream that comes back is known only when the loop is closed.
    /// An echo is `Mix(inputs: ["dry", "echo"])` with `"echo": Feedback(audio: "mix", like: "dry", delay: 0.25, gain: 0.5)`.
    pub struct FeedbackParams {
        /// How much later, to the nearest sample and at least one; longer than the look-ahead of the nodes in the loop.
        delay: f64 = 0.25, unit "s", range 0.0001..=60.0;
        /// Amplitude factor of the way round; at +-1 or beyond the loop does not die away.
        gain: f32 = 0.5, unit "", range -2.0..=2.0_f32;
        /// How long the loop goes on after `like` has ended.
        tail: f64 = 2.0, unit "s", range 0.0..=600.0;
    }
}
ports! {
    /// Ports of `Feedback`.
    pub struct FeedbackPorts / FeedbackIo {
        in {
            /// What comes back; it may come from a node that this one feeds.
            audio: Late<Stream<f32>>,
            /// A stream of the same rate and channels, from before the loop.
            like: Stream<f32>,
        }
        out {
            /// What came back, later and times the gain.
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
        if let Some(audio) = s.late(FeedbackPorts::audio) {
            same_rate("audio", like.rate, audio.rate)?;
            if audio.format != like.format {
                let (found, wanted) = (audio.format.0, like.format.0);
                let message = format!("`audio` has {found} channels, `like` has {wanted}");
                return Err(Reject::new("F046", message).at("audio"));
            }
        }
        s.delayed(FeedbackPorts::audio, nearest_items(like.rate, p.delay).max(1));
        s.ends(like.end.map(|end| end + ticks(p.tail)));
        s.output(FeedbackPorts::out, like.rate, like.format);
        Ok(())
    }

    fn build(p: &FeedbackParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let like = cx.input(FeedbackPorts::like);
        let gain = Gain::new(f64::from(p.gain), ramp(like.rate), like.format.0.into());
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

    fn trial(draw: &mut Draw) -> (FeedbackParams, MemoryFiles) {
        let (delay, tail) = (draw.between(0.0001, 0.2), draw.between(0.0, 0.2));
        (FeedbackParams { delay, tail, ..FeedbackParams::trial(draw) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::solo::{Feed, Solo};
    use crate::core::time::Rate;

    fn feedback(channels: u16) -> Solo {
        let params = FeedbackParams { delay: 0.03, gain: 0.5, tail: 0.02 };
        let back = Feed::stream::<f32>(Rate::hz(100), Channels(1), vec![1.0, 2.0, 3.0, 4.0]);
        let silent = vec![0.0; 4 * usize::from(channels)];
        let solo = Solo::new::<FeedbackNode>(params).feed(FeedbackPorts::audio.index(), back);
        solo.input(FeedbackPorts::like, Rate::hz(100), Channels(channels), silent)
    }

    #[test]
    fn what_comes_back_is_late_by_the_delay_and_lasts_for_the_tail() {
        let out = feedback(1).run().unwrap().stream(FeedbackPorts::out);
        assert_eq!(out, [0.0, 0.0, 0.0, 0.5, 1.0, 1.5]);
    }

    #[test]
    fn what_comes_back_must_be_like_the_other() {
        assert_eq!(feedback(2).shape().unwrap_err().field.as_deref(), Some("audio"));
    }
}
