//! A source around a head, as a node.

use super::binaural::{Binaural, ROOM_DELAY};
use super::head::{Head, PINNA_MAX_DELAY, PinnaSet, SHOULDER_MAX_DELAY};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
use crate::spatial::motion::interpolation::{LOOK_AHEAD, LOOK_BEHIND, listener_pose, pose_at};
use crate::spatial::motion::item::Poses;
use crate::spatial::motion::pose::Pose;
use crate::{archive_state, choices, params, ports};

choices! {
    /// Reflections of the pinna, which tell elevation and front from side.
    pub enum Pinna {
        /// None.
        Off,
        /// Brown and Duda's first set of delays.
        Set0,
        /// Their second set.
        Set1,
    }
}

impl Pinna {
    /// The set, where there is one.
    #[must_use]
    pub fn set(self) -> Option<PinnaSet> {
        match self {
            Self::Off => None,
            Self::Set0 => Some(PinnaSet::Set0),
            Self::Set1 => Some(PinnaSet::Set1),
        }
    }
}

params! {
    /// What the two ears of a head hear of a source: shadow and delay of a sphere, reflections of the pinna.
    ///
    /// Mono audio becomes stereo. Source and listener stand still where the parameters say, or move with a link to `position` or
    /// `listener` (`PoseFile`, `VertexPose`, `Orbit`); the pose of the source counts for its place only. A head's own axes are x
    /// to the front, y to the left and z up, those of the scene where it is not turned. All that follows from where things
    /// are moves on straight lines from one set of 64 samples to the next, also when a parameter changes while the graph runs.
    ///
    /// The middle of the head hears the source at its time, a near ear up to 0.26 ms earlier, for which the node looks ahead.
    /// Low frequencies arrive another 0.1 ms or so later than that at the far ear, as they do around a real head. Distance
    /// changes nothing here: see `DistanceGain`. The model is that of a source far away; nearer than about a metre it is a cue
    /// and no more. It does not tell behind from in front but for the shadow: the pinna's law holds for the front half only and is
    /// mirrored. At worst (a reflection in phase with the sound, straight at the ear) a peak grows sevenfold.
    ///
    /// # Source
    /// Brown and Duda, "A structural model for binaural sound synthesis" (IEEE Trans. Speech and Audio Processing 6(5), 1998). The
    /// delays of their pinna are samples at 44.1 kHz and mean the same time at every rate.
    pub struct StructuralHrtfParams {
        /// Place of the source, where no link gives it.
        position: [f64; 3] = [1.0, 0.0, 0.0], unit "m", range -100_000.0..=100_000.0;
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
        /// Level of an echo from the shoulder; 0.2 is natural, 0 is none.
        shoulder: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Level of an echo from the room after 15 ms, the same in both ears: 0.178 (-15 dB) puts sounds outside of the head.
        room: f64 = 0.0, unit "", range 0.0..=1.0;
    }
}
ports! {
    /// Ports of `StructuralHrtf`.
    pub struct StructuralHrtfPorts / StructuralHrtfIo {
        in {
            /// What the source sounds like: mono.
            audio: Stream<f32>,
            /// Where the source is, in place of the parameter.
            position: Option<Stream<Poses>>,
            /// Where the listener's head is and looks, in place of the parameters.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// What the ears hear: stereo.
            out: Stream<f32>,
        }
    }
}

/// The node over [`Binaural`].
#[derive(Debug)]
pub struct StructuralHrtf {
    binaural: Binaural,
    started: bool,
    source: [f64; 3],
    listener: Pose,
    params: StructuralHrtfParams,
}

fn head(p: &StructuralHrtfParams) -> Head {
    Head { radius: p.radius, pinna: p.pinna.set(), shoulder: p.shoulder, ..Head::default() }
}

/// Longest delay after the middle of the head, in s.
fn tail(p: &StructuralHrtfParams) -> f64 {
    let head = head(p);
    let pinna = if head.pinna.is_some() { PINNA_MAX_DELAY } else { 0.0 };
    let shoulder = if p.shoulder > 0.0 { SHOULDER_MAX_DELAY } else { 0.0 };
    let around = head.max_delay() - head.centre_delay() + pinna + shoulder;
    if p.room > 0.0 { around.max(ROOM_DELAY) } else { around }
}

impl Node for StructuralHrtf {
    type Params = StructuralHrtfParams;
    type Ports = StructuralHrtfPorts;
    const NAME: &'static str = "StructuralHrtf";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 60.0;

    fn shape(p: &StructuralHrtfParams, s: &mut Shape<'_, '_, StructuralHrtfPorts>) -> Result<(), Reject> {
        type Port = StructuralHrtfPorts;
        let audio = s.input(Port::audio);
        if audio.format != Channels(1) {
            let message = format!("`audio` has {} channels; a source is mono", audio.format.0);
            s.wrong(Reject::new("F046", message).at("audio").help("put Mono before it"));
        }
        s.check(listener_pose(p.listener, p.look, p.up));
        let fs = audio.rate.as_f64();
        s.lookaround(Port::audio, 0, Binaural::new(head(p), p.room, fs).lag());
        s.when_ended(Port::audio, Ends::Stop);
        s.lookaround(Port::position, LOOK_BEHIND, LOOK_AHEAD);
        s.when_ended(Port::position, Ends::Hold);
        s.lookaround(Port::listener, LOOK_BEHIND, LOOK_AHEAD);
        s.when_ended(Port::listener, Ends::Hold);
        s.tail(audio.rate.span((tail(p) * fs).ceil() as usize + 2));
        s.output(Port::out, audio.rate, Channels(2));
        Ok(())
    }

    fn build(p: &StructuralHrtfParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let fs = cx.input(StructuralHrtfPorts::audio).rate.as_f64();
        Ok(Self {
            binaural: Binaural::new(head(p), p.room, fs),
            started: false,
            source: p.position,
            listener: listener_pose(p.listener, p.look, p.up)?,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: StructuralHrtfIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.out.first().max(0) as u64, io.out.rate());
        let (before, audio) = io.audio.around().split_at(self.binaural.lag().min(io.audio.around().len()));
        if !std::mem::replace(&mut self.started, true) {
            self.binaural.feed(before);
        }
        let (source, head) = (self.source, self.listener);
        self.binaural.process(first, audio, io.out.items(), |n| {
            let tick = rate.tick(n as i64);
            let source =
                io.position.as_ref().map_or(source, |poses| pose_at(poses, tick).position.map(f64::from));
            io.listener.as_ref().map_or(head, |poses| pose_at(poses, tick)).to_local(source)
        });
        Ok(())
    }

    fn retune(&mut self, new: &StructuralHrtfParams) -> Retune {
        let StructuralHrtfParams { position, listener: at, look, up, .. } = *new;
        if (StructuralHrtfParams { position, listener: at, look, up, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        // Parameters that leave the head's turn open are refused before they come here.
        if let Some(pose) = Pose::looking(at, look, up) {
            self.listener = pose;
        }
        self.source = position;
        self.params = new.clone();
        Retune::Done
    }

    archive_state!(binaural, started, source, listener);
}

#[cfg(test)]
mod tests;
