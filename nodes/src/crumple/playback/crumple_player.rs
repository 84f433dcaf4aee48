//! EventPlayer of matched events in one channel, as a node.

use super::event_player::EventPlayer;
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
    /// Plays a recorded sample for each event.
    ///
    /// Samples begin with a random delay after their event. Without delays all samples of a frame of the motion would
    /// begin at once, and the frame rate would be audible. Samples have their recorded level and overlap. A bank of
    /// another rate is resampled to `rate`, which sets the sample rate of the audio.
    ///
    /// # Randomness
    /// The delay of a sample is a function of the seed, the time of the event and its lowest vertex.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3, who
    /// jitter by 1/30 s without details.
    pub struct CrumplePlayerParams {
        /// Delay of a sample after its event.
        jitter: Jitter = Jitter::WholeFrames;
        /// Range of the delays.
        jitter_time: f64 = 0.033333333333333, unit "s", range 0.0..=0.2;
        /// Factor on the output.
        gain: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Scales samples to the exact energy of the match, by at most 6 dB.
        match_gain: bool = false;
        /// Maximum number of simultaneous samples; above it those with the least remaining energy are stolen. 64 is
        /// good for live use.
        max_voices: usize = 4096, unit "voices", range 1..=65_536;
        /// Duration of the output after the last event, for the jitter and the longest sample.
        tail: f64 = 0.6, unit "s", range 0.0..=60.0;
        /// Sample rate of the audio.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct CrumplePlayerPorts / CrumplePlayerIo {
        in {
            /// Events with the indices of their samples.
            matched: Events<MatchedCrumple>,
            /// Bank of samples.
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
    playback: EventPlayer<Mono>,
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
        let playback = EventPlayer::new(&bank, timing(p), [0; 2], cx.random)?;
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
