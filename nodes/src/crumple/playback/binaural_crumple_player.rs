//! EventPlayer of matched events at two ears, as a node.

use super::event_player::EventPlayer;
use super::onset_timing::JitterParams;
use super::playback_params::PlaybackParams;
use super::voices::{Level, VoiceFilter};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::ticks;
use crate::crumple::bank::CrumpleBank;
use crate::crumple::matching::MatchedCrumple;
use crate::spatial::hrtf::head_params::HeadParams;
use crate::spatial::motion::interpolation::{LOOK_AHEAD, LOOK_BEHIND, pose_at};
use crate::spatial::{Distance, Head, Pose, Poses, StaticSource};
use crate::{archive_state, params, ports};

params! {
    /// Plays a recorded sample for each event at the two ears of a listener, as `CrumplePlayer` with positions.
    ///
    /// A sample has the direction and distance of its event, as in `StructuralHrtf` and `DistanceGain`: it is earlier
    /// and louder at the nearer ear, has the reflections of the pinna, and its level decreases with distance. The pose
    /// of the listener is that at the beginning of the sample, which lasts a few hundredths of a second at most. Delays
    /// are relative to the middle of the head. The sound at the nearer ear is up to 0.26 ms earlier, for which the node
    /// has look-ahead.
    ///
    /// # Randomness
    /// The delay of a sample is a function of the seed, the time of the event and its lowest vertex.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3;
    /// Brown and Duda, "A structural model for binaural sound synthesis" (1998).
    pub struct BinauralCrumplePlayerParams {
        /// Delays of samples after their events.
        [group] onset: JitterParams;
        /// The head.
        [group] head: HeadParams;
        /// Distance at which a sample has its recorded level; None ignores distance.
        reference: Option<f64> = Some(1.0), unit "m", range 0.001..=10_000.0;
        /// Distance below which the level is constant.
        nearest: f64 = 0.1, unit "m", range 0.001..=10_000.0;
        /// Levels, voices and output.
        [group] playback: PlaybackParams;
    }
}
ports! {
    pub struct BinauralCrumplePlayerPorts / BinauralCrumplePlayerIo {
        in {
            /// Events with the indices of their samples.
            matched: Events<MatchedCrumple>,
            /// Bank of samples.
            bank: Value<CrumpleBank>,
            /// Pose of the listener's head, in place of the parameters.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// Crumple sound at the ears, stereo, full scale +-1.
            audio: Stream<f32>,
        }
    }
}

impl VoiceFilter for StaticSource {
    const CHANNELS: usize = 2;

    fn level(&self) -> f32 {
        self.gain()
    }

    fn add(&mut self, sample: &[f32], from: i64, level: Level, out: &mut [f32]) {
        StaticSource::add(self, sample, from, out, |x, frame| level.of(x, frame));
    }
}

/// The node `BinauralCrumplePlayer`.
pub struct BinauralCrumplePlayer {
    playback: EventPlayer<StaticSource>,
    head: Head,
    distance: Option<Distance>,
    listener: Pose,
    params: BinauralCrumplePlayerParams,
}

/// Returns the frames of output before the beginning of a sample and after its end.
fn margins(p: &BinauralCrumplePlayerParams) -> [usize; 2] {
    let (head, fs) = (p.head.head(), p.playback.rate.as_f64());
    [StaticSource::max_advance(&head, fs), StaticSource::tail(&head, fs)]
}

impl Node for BinauralCrumplePlayer {
    type Params = BinauralCrumplePlayerParams;
    type Ports = BinauralCrumplePlayerPorts;
    const NAME: &'static str = "BinauralCrumplePlayer";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 6.0;

    fn shape(
        p: &BinauralCrumplePlayerParams,
        s: &mut Shape<'_, '_, BinauralCrumplePlayerPorts>,
    ) -> Result<(), Reject> {
        type Port = BinauralCrumplePlayerPorts;
        p.head.pose()?;
        let [lead, ring] = margins(p);
        s.lookaround(Port::matched, 0, p.onset.ahead(lead, p.playback.rate) as usize);
        if let Some(poses) = s.optional(Port::listener) {
            // A sample begins up to `lead` frames after its first output.
            let extra = poses.rate.first_at(p.playback.rate.span(lead + 1)) as usize;
            s.lookaround(Port::listener, LOOK_BEHIND, LOOK_AHEAD + extra);
        }
        s.when_ended(Port::listener, Ends::Hold);
        s.tail(ticks(p.playback.tail) + p.playback.rate.span(ring));
        s.output(Port::audio, p.playback.rate, Channels(2));
        Ok(())
    }

    fn build(p: &BinauralCrumplePlayerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let bank = cx.value(BinauralCrumplePlayerPorts::bank);
        Ok(Self {
            playback: EventPlayer::new(&bank, (&p.onset, &p.playback), margins(p), cx.random)?,
            head: p.head.head(),
            distance: p.reference.map(|reference| Distance { reference, nearest: p.nearest }),
            listener: p.head.pose()?,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: BinauralCrumplePlayerIo<'_>) -> Result<(), Fault> {
        let (head, distance, fs) = (self.head, self.distance, io.audio.rate().as_f64());
        let (listener, poses) = (self.listener, &io.listener);
        self.playback.run(&io.matched, &mut io.audio, |position, tick| {
            let pose = poses.as_ref().map_or(listener, |poses| pose_at(poses, tick));
            StaticSource::new(&head, distance, pose.to_local(position.map(f64::from)), fs)
        })
    }

    fn finish(&mut self, _: BinauralCrumplePlayerIo<'_>) -> Result<Summary, Fault> {
        Ok(self.playback.summary())
    }

    fn retune(&mut self, new: &BinauralCrumplePlayerParams) -> Retune {
        let playback = self.params.playback.with_gains_of(&new.playback);
        let head = self.params.head.posed_as(&new.head);
        if (BinauralCrumplePlayerParams { playback, head, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        // Invalid directions were refused before.
        if let Ok(pose) = new.head.pose() {
            self.listener = pose;
        }
        self.playback.set_gains(&new.playback);
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        if (margins(&self.params), self.params.head.pinna) == (margins(&old.params), old.params.head.pinna) {
            self.playback.adopt(&old.playback);
        }
    }

    archive_state!(playback);

    fn trial(rng: &mut Rng) -> (BinauralCrumplePlayerParams, MemoryFiles) {
        let small = PlaybackParams::small(rng);
        let p = BinauralCrumplePlayerParams::trial(rng);
        let look = [1.0, 0.5, 0.1];
        let listener = [0; 3].map(|_| rng.between(-2.0, 2.0));
        let head = HeadParams { listener, look, up: [0.0, 0.1, 1.0], ..p.head };
        let gain = p.playback.gain.min(2.0);
        let playback = PlaybackParams { gain, ..small.with_gains_of(&p.playback) };
        (BinauralCrumplePlayerParams { playback, head, ..p }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
