//! The node that plays crumples at two ears.

use super::event_player::Playback;
use super::onset_timing::{Jitter, Timing};
use super::voices::{Hearing, Level};
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
use crate::spatial::hrtf_node::Pinna;
use crate::spatial::track::{AHEAD, PAST, listener, pose_at};
use crate::spatial::{Distance, Head, Pose, Poses, StillSource};
use crate::{archive_state, params, ports};

params! {
    /// Plays a recorded sample for each crumple at the two ears of a listener: as `CrumplePlayer`, with every fold where it is.
    ///
    /// A sample is heard from the place of its crumple as in `StructuralHrtf` and `DistanceGain`: earlier and louder at the nearer
    /// ear, with the reflections of the pinna, and the softer the farther away. Where the listener is when the sample
    /// begins counts until it ends, since a crumple lasts a few hundredths of a second at most. Both ears hear one sample at one
    /// time; the middle of the head hears it at its time, and the nearer ear up to 0.26 ms earlier, for which the node looks
    /// ahead.
    ///
    /// # Randomness
    /// How much later a sample begins follows from the seed, the time of the event and its lowest vertex alone.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3; Brown and
    /// Duda, "A structural model for binaural sound synthesis" (1998).
    pub struct BinauralCrumplePlayerParams {
        /// How much later than its event a sample begins.
        jitter: Jitter = Jitter::WholeFrames;
        /// Spread of the beginnings.
        jitter_time: f64 = 0.033333333333333, unit "s", range 0.0..=0.2;
        /// Place of the listener's head, where no link gives its pose.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Where the listener looks, where no link gives its pose: a direction of any length.
        look: [f64; 3] = [1.0, 0.0, 0.0], unit "", range -100_000.0..=100_000.0;
        /// What is above the listener: a direction that is not parallel to `look`.
        up: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Reflections of the pinna.
        pinna: Pinna = Pinna::Set0;
        /// Radius of the head.
        radius: f64 = 0.0875, unit "m", range 0.01..=1.0;
        /// Distance at which a sample is as loud as it was recorded; None leaves distance out.
        reference: Option<f64> = Some(1.0), unit "m", range 0.001..=10_000.0;
        /// Distance below which it gets no louder.
        nearest: f64 = 0.1, unit "m", range 0.001..=10_000.0;
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
    pub struct BinauralCrumplePlayerPorts / BinauralCrumplePlayerIo {
        in {
            /// The events, with the numbers of their samples.
            matched: Events<MatchedCrumple>,
            /// The samples.
            bank: Value<CrumpleBank>,
            /// Where the listener's head is and looks, in place of the parameters.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// Crumple sound at the ears, stereo, full scale +-1.
            audio: Stream<f32>,
        }
    }
}

impl Hearing for StillSource {
    const CHANNELS: usize = 2;

    fn level(&self) -> f32 {
        self.gain()
    }

    fn add(&mut self, sample: &[f32], at: i64, level: Level, out: &mut [f32]) {
        StillSource::add(self, sample, at, out, |x, frame| level.of(x, frame));
    }
}

/// The node `BinauralCrumplePlayer`.
pub struct BinauralCrumplePlayer {
    playback: Playback<StillSource>,
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

/// Frames in which a sample is heard before its beginning and after its end.
fn around(p: &BinauralCrumplePlayerParams) -> [usize; 2] {
    let (head, fs) = (head(p), p.rate.as_f64());
    [StillSource::lead(&head, fs), StillSource::ring(&head, fs)]
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
        listener(p.listener, p.look, p.up)?;
        let [lead, ring] = around(p);
        s.lookaround(Port::matched, 0, timing(p).ahead(lead) as usize);
        if let Some(poses) = s.optional(Port::listener) {
            // A sample begins up to `lead` frames after it is first heard.
            let beyond = poses.rate.first_at(p.rate.span(lead + 1)) as usize;
            s.lookaround(Port::listener, PAST, AHEAD + beyond);
        }
        s.when_ended(Port::listener, Ends::Hold);
        s.tail(ticks(p.tail) + p.rate.span(ring));
        s.output(Port::audio, p.rate, Channels(2));
        Ok(())
    }

    fn build(p: &BinauralCrumplePlayerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let bank = cx.value(BinauralCrumplePlayerPorts::bank);
        Ok(Self {
            playback: Playback::new(&bank, timing(p), around(p), cx.random)?,
            head: head(p),
            distance: p.reference.map(|reference| Distance { reference, nearest: p.nearest }),
            listener: listener(p.listener, p.look, p.up)?,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: BinauralCrumplePlayerIo<'_>) -> Result<(), Fault> {
        let (head, distance, fs) = (self.head, self.distance, io.audio.rate().as_f64());
        let (still, poses) = (self.listener, &io.listener);
        self.playback.run(&io.matched, &mut io.audio, |place, tick| {
            let pose = poses.as_ref().map_or(still, |poses| pose_at(poses, tick));
            StillSource::new(&head, distance, pose.toward(place.map(f64::from)), fs)
        })
    }

    fn finish(&mut self, _: BinauralCrumplePlayerIo<'_>) -> Result<Summary, Fault> {
        Ok(self.playback.summary())
    }

    fn retune(&mut self, new: &BinauralCrumplePlayerParams) -> Retune {
        let BinauralCrumplePlayerParams { gain, match_gain, listener: at, look, up, .. } = *new;
        let same =
            BinauralCrumplePlayerParams { gain, match_gain, listener: at, look, up, ..self.params.clone() };
        if same != *new {
            return Retune::Rebuild;
        }
        // Parameters that leave the head's turn open are refused before they come here.
        if let Some(pose) = Pose::looking(at, look, up) {
            self.listener = pose;
        }
        self.playback.set_gain(gain, match_gain);
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        if (around(&self.params), self.params.pinna) == (around(&old.params), old.params.pinna) {
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
