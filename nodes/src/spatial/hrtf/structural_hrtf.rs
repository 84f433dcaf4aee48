//! The node `StructuralHrtf`.

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
    /// Reflections of the pinna, the cues for elevation and for front and side.
    pub enum Pinna {
        /// None.
        Off,
        /// The first set of delays of Brown and Duda.
        Set0,
        /// Their second set of delays.
        Set1,
    }
}

impl Pinna {
    /// Returns the set of delays, if any.
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
    /// Renders a source binaurally by a structural head model: head shadow, interaural delay and reflections of the pinna.
    ///
    /// Mono audio becomes stereo. The positions of source and listener are those of the parameters, or those of streams linked to
    /// `position` and `listener` (`PoseFile`, `VertexPose`, `Orbit`); the orientation of the source has no effect. The local axes of a head
    /// are x to the front, y to the left and z up; without rotation they are those of the scene. Poses are read every 64 samples;
    /// coefficients change linearly in between, also when a parameter changes while the graph runs.
    ///
    /// At the centre of the head the sound is not delayed; at the near ear it is up to 0.26 ms earlier, for which the node looks ahead.
    /// At the far ear low frequencies are about 0.1 ms later than high frequencies, as with a real head. The distance has no effect: see
    /// `DistanceGain`. The model is for distant sources; below about 1 m it is a rough cue only. Front and back differ by the shadow only:
    /// the pinna model holds for the front half and is mirrored. In the worst case (a reflection in phase, straight at the ear) a peak
    /// grows sevenfold.
    ///
    /// # Source
    /// Brown and Duda, "A structural model for binaural sound synthesis" (IEEE Trans. Speech and Audio Processing 6(5), 1998). The
    /// delays of their pinna are samples at 44.1 kHz; here they are the same times at every rate.
    pub struct StructuralHrtfParams {
        /// Position of the source, if not linked.
        position: [f64; 3] = [1.0, 0.0, 0.0], unit "m", range -100_000.0..=100_000.0;
        /// Position of the listener's head, if not linked.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Look direction of the listener, if not linked; of any length.
        look: [f64; 3] = [1.0, 0.0, 0.0], unit "", range -100_000.0..=100_000.0;
        /// Direction above the listener, if not linked; not parallel to `look`.
        up: [f64; 3] = [0.0, 0.0, 1.0], unit "", range -100_000.0..=100_000.0;
        /// Reflections of the pinna.
        pinna: Pinna = Pinna::Set0;
        /// Radius of the head.
        radius: f64 = 0.0875, unit "m", range 0.01..=1.0;
        /// Level of the shoulder reflection; 0.2 is natural, 0 is none.
        shoulder: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Level of a room echo after 15 ms, the same at both ears; 0.178 (-15 dB) externalises the sound.
        room: f64 = 0.0, unit "", range 0.0..=1.0;
    }
}
ports! {
    /// Ports of `StructuralHrtf`.
    pub struct StructuralHrtfPorts / StructuralHrtfIo {
        in {
            /// Audio of the source, mono.
            audio: Stream<f32>,
            /// Poses of the source; replace the parameter.
            position: Option<Stream<Poses>>,
            /// Poses of the listener's head; replace the parameters.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// Audio at the ears, stereo.
            out: Stream<f32>,
        }
    }
}

/// The node `StructuralHrtf`.
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

/// Returns the longest delay after that of the centre of the head, in s.
fn tail(p: &StructuralHrtfParams) -> f64 {
    let head = head(p);
    let pinna = if head.pinna.is_some() { PINNA_MAX_DELAY } else { 0.0 };
    let shoulder = if p.shoulder > 0.0 { SHOULDER_MAX_DELAY } else { 0.0 };
    let ear_delay = head.max_delay() - head.centre_delay() + pinna + shoulder;
    if p.room > 0.0 { ear_delay.max(ROOM_DELAY) } else { ear_delay }
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
            s.wrong(Reject::new("F046", message).at("audio").help("insert Mono before it"));
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
        // Parameters that do not define an orientation are refused earlier.
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
