//! EventPlayer of matched events in one channel, as a node.

use super::event_player::EventPlayer;
use super::onset_timing::JitterParams;
use super::playback_params::PlaybackParams;
use super::voices::Mono;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
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
        /// Delays of samples after their events.
        [group] onset: JitterParams;
        /// Levels, voices and output.
        [group] playback: PlaybackParams;
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

impl Node for CrumplePlayer {
    type Params = CrumplePlayerParams;
    type Ports = CrumplePlayerPorts;
    const NAME: &'static str = "CrumplePlayer";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 10.0;

    fn shape(p: &CrumplePlayerParams, s: &mut Shape<'_, '_, CrumplePlayerPorts>) -> Result<(), Reject> {
        s.lookaround(CrumplePlayerPorts::matched, 0, p.onset.ahead(0, p.playback.rate) as usize);
        s.tail(ticks(p.playback.tail));
        s.output(CrumplePlayerPorts::audio, p.playback.rate, Channels(1));
        Ok(())
    }

    fn build(p: &CrumplePlayerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let bank = cx.value(CrumplePlayerPorts::bank);
        let playback = EventPlayer::new(&bank, (&p.onset, &p.playback), [0; 2], cx.random)?;
        Ok(Self { playback, params: p.clone() })
    }

    fn run(&mut self, mut io: CrumplePlayerIo<'_>) -> Result<(), Fault> {
        self.playback.run(&io.matched, &mut io.audio, |_, _| Mono)
    }

    fn finish(&mut self, _: CrumplePlayerIo<'_>) -> Result<Summary, Fault> {
        Ok(self.playback.summary())
    }

    fn retune(&mut self, new: &CrumplePlayerParams) -> Retune {
        let playback = self.params.playback.with_gains_of(&new.playback);
        if (CrumplePlayerParams { playback, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        self.playback.set_gains(&new.playback);
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.playback.adopt(&old.playback);
    }

    archive_state!(playback);

    fn trial(rng: &mut Rng) -> (CrumplePlayerParams, MemoryFiles) {
        let small = PlaybackParams::small(rng);
        let p = CrumplePlayerParams::trial(rng);
        let gain = p.playback.gain.min(2.0);
        let playback = PlaybackParams { gain, ..small.with_gains_of(&p.playback) };
        (CrumplePlayerParams { playback, ..p }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
