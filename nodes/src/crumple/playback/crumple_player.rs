//! The node that plays crumples in one channel.

use super::event_player::Playback;
use super::onset_timing::{Jitter, Timing};
use super::voices::Mono;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::crumple::bank::CrumpleBank;
use crate::crumple::matching::MatchedCrumple;
use crate::{archive_state, params, ports};

params! {
    /// Plays a recorded sample for each crumple.
    ///
    /// Samples begin at the time of their event and a little later, at random, since motion knows whole frames only: without that, all folds of
    /// a frame snap at once and the frame rate is heard. They are as loud as they were recorded, and overlap. A bank of another
    /// rate is brought to `rate` first. This node makes audio from something that is none, so it has a sample rate of its own.
    ///
    /// # Randomness
    /// How much later a sample begins follows from the seed, the time of the event and its lowest vertex alone.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3, who jitter by 1/30 s and
    /// do not say how.
    pub struct CrumplePlayerParams {
        /// How much later than its event a sample begins.
        jitter: Jitter = Jitter::WholeFrames;
        /// Spread of the beginnings.
        jitter_time: f64 = 0.033333333333333, unit "s", range 0.0..=0.2;
        /// Factor on everything.
        gain: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Whether a sample is scaled to exactly the energy that it should have, by 6 dB at most.
        match_gain: bool = false;
        /// Samples that sound at once; of more, those with the least energy left give way. 64 is good for live use.
        max_voices: usize = 4096, unit "voices", range 1..=65_536;
        /// How long it goes on after the last event: jitter and the longest sample.
        tail: f64 = 0.6, unit "s", range 0.0..=60.0;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct CrumplePlayerPorts / CrumplePlayerIo {
        in {
            /// The events, with the numbers of their samples.
            matched: Events<MatchedCrumple>,
            /// The samples.
            bank: Value<CrumpleBank>,
        }
        out {
            /// Mono crumple sound, full scale +-1.
            audio: Stream<f32>,
        }
    }
}

/// The node `CrumplePlayer`.
pub struct CrumplePlayer {
    playback: Playback<Mono>,
    params: CrumplePlayerParams,
}

fn timing(p: &CrumplePlayerParams) -> Timing {
    let CrumplePlayerParams { jitter, jitter_time, gain, match_gain, max_voices, rate, .. } = *p;
    Timing { jitter, jitter_time, gain, match_gain, max_voices, rate }
}

impl Node for CrumplePlayer {
    type Params = CrumplePlayerParams;
    type Ports = CrumplePlayerPorts;
    const NAME: &'static str = "CrumplePlayer";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 10.0;

    fn shape(p: &CrumplePlayerParams, s: &mut Shape<'_, '_, CrumplePlayerPorts>) -> Result<(), Reject> {
        s.lookaround(CrumplePlayerPorts::matched, 0, timing(p).ahead(0) as usize);
        s.tail(ticks(p.tail));
        s.output(CrumplePlayerPorts::audio, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &CrumplePlayerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let bank = cx.value(CrumplePlayerPorts::bank);
        let playback = Playback::new(&bank, timing(p), [0; 2], cx.random)?;
        Ok(Self { playback, params: p.clone() })
    }

    fn run(&mut self, mut io: CrumplePlayerIo<'_>) -> Result<(), Fault> {
        self.playback.run(&io.matched, &mut io.audio, |_, _| Mono)
    }

    fn finish(&mut self, _: CrumplePlayerIo<'_>) -> Result<Summary, Fault> {
        Ok(self.playback.summary())
    }

    fn retune(&mut self, new: &CrumplePlayerParams) -> Retune {
        let CrumplePlayerParams { gain, match_gain, .. } = *new;
        if (CrumplePlayerParams { gain, match_gain, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        (self.params.gain, self.params.match_gain) = (gain, match_gain);
        self.playback.set_gain(gain, match_gain);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.playback.adopt(&old.playback);
    }

    archive_state!(playback);

    fn trial(rng: &mut Rng) -> (CrumplePlayerParams, MemoryFiles) {
        let rate = Rate::hz([4000, 8000, 8820][rng.below(3)]);
        let (max_voices, tail) = (1 + rng.below(20), rng.between(0.0, 0.1));
        let p = CrumplePlayerParams { rate, max_voices, tail, ..CrumplePlayerParams::trial(rng) };
        (CrumplePlayerParams { gain: p.gain.min(2.0), ..p }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
