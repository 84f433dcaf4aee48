//! EventPlayer of matched events at two ears, as a node.

use super::event_player::EventPlayer;
use super::onset_timing::{Jitter, Timing};
use super::voices::{Level, VoiceFilter};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::{Rate, ticks};
use crate::crumple::bank::CrumpleBank;
use crate::crumple::matching::MatchedCrumple;
use crate::spatial::Pinna;
use crate::spatial::motion::interpolation::{LOOK_AHEAD, LOOK_BEHIND, listener_pose, pose_at};
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
        /// Delay of a sample after its event.
        jitter: Jitter = Jitter::WholeFrames;
        /// Range of the delays.
        jitter_time: f64 = 0.033333333333333, unit "s", range 0.0..=0.2;
        /// Position of the listener's head, unless `listener` is linked.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Direction of view of the listener, unless `listener` is linked: a vector of any length.
        look: [f64; 3] = [1.0, 0.0, 0.0], unit "", range -100_000.0..=100_000.0;
        /// Direction upwards from the listener: a vector not parallel to `look`.
        up: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Reflections of the pinna.
        pinna: Pinna = Pinna::Set0;
        /// Radius of the head.
        radius: f64 = 0.0875, unit "m", range 0.01..=1.0;
        /// Distance at which a sample has its recorded level; None ignores distance.
        reference: Option<f64> = Some(1.0), unit "m", range 0.001..=10_000.0;
        /// Distance below which the level is constant.
        nearest: f64 = 0.1, unit "m", range 0.001..=10_000.0;
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

fn timing(p: &BinauralCrumplePlayerParams) -> Timing {
    let BinauralCrumplePlayerParams { jitter, jitter_time, gain, match_gain, max_voices, rate, .. } = *p;
    Timing { jitter, jitter_time, gain, match_gain, max_voices, rate }
}

fn head(p: &BinauralCrumplePlayerParams) -> Head {
    Head { radius: p.radius, pinna: p.pinna.set(), ..Head::default() }
}

/// Returns the frames of output before the beginning of a sample and after its end.
fn margins(p: &BinauralCrumplePlayerParams) -> [usize; 2] {
    let (head, fs) = (head(p), p.rate.as_f64());
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
        listener_pose(p.listener, p.look, p.up)?;
        let [lead, ring] = margins(p);
        s.lookaround(Port::matched, 0, timing(p).ahead(lead) as usize);
        if let Some(poses) = s.optional(Port::listener) {
            // A sample begins up to `lead` frames after its first output.
            let extra = poses.rate.first_at(p.rate.span(lead + 1)) as usize;
            s.lookaround(Port::listener, LOOK_BEHIND, LOOK_AHEAD + extra);
        }
        s.when_ended(Port::listener, Ends::Hold);
        s.tail(ticks(p.tail) + p.rate.span(ring));
        s.output(Port::audio, p.rate, Channels(2));
        Ok(())
    }

    fn build(p: &BinauralCrumplePlayerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let bank = cx.value(BinauralCrumplePlayerPorts::bank);
        Ok(Self {
            playback: EventPlayer::new(&bank, timing(p), margins(p), cx.random)?,
            head: head(p),
            distance: p.reference.map(|reference| Distance { reference, nearest: p.nearest }),
            listener: listener_pose(p.listener, p.look, p.up)?,
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
        let BinauralCrumplePlayerParams { gain, match_gain, listener, look, up, .. } = *new;
        let compared =
            BinauralCrumplePlayerParams { gain, match_gain, listener, look, up, ..self.params.clone() };
        if compared != *new {
            return Retune::Rebuild;
        }
        // Invalid directions were refused before.
        if let Some(pose) = Pose::looking(listener, look, up) {
            self.listener = pose;
        }
        self.playback.set_gain(gain, match_gain);
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        if (margins(&self.params), self.params.pinna) == (margins(&old.params), old.params.pinna) {
            self.playback.adopt(&old.playback);
        }
    }

    archive_state!(playback);

    fn trial(rng: &mut Rng) -> (BinauralCrumplePlayerParams, MemoryFiles) {
        let rate = Rate::hz([4000, 8000, 8820][rng.below(3)]);
        let (max_voices, tail) = (1 + rng.below(20), rng.between(0.0, 0.1));
        let p = BinauralCrumplePlayerParams { rate, max_voices, tail, ..Params::trial(rng) };
        let (gain, look) = (p.gain.min(2.0), [1.0, 0.5, 0.1]);
        let listener = [0; 3].map(|_| rng.between(-2.0, 2.0));
        (
            BinauralCrumplePlayerParams { gain, listener, look, up: [0.0, 0.1, 1.0], ..p },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
