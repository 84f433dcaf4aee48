//! A source around a head, as a node.

use super::binaural::{Binaural, ROOM_DELAY};
use super::head::{Head, PINNA_LONGEST, PinnaSet, SHOULDER_LONGEST};
use super::item::Poses;
use super::pose::Pose;
use super::track::{AHEAD, PAST, listener, pose_at};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
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
    begun: bool,
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
    let pinna = if head.pinna.is_some() { PINNA_LONGEST } else { 0.0 };
    let shoulder = if p.shoulder > 0.0 { SHOULDER_LONGEST } else { 0.0 };
    let around = head.longest() - head.bias() + pinna + shoulder;
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
        s.check(listener(p.listener, p.look, p.up));
        let fs = audio.rate.as_f64();
        s.lookaround(Port::audio, 0, Binaural::new(head(p), p.room, fs).lag());
        s.when_ended(Port::audio, Ends::Stop);
        s.lookaround(Port::position, PAST, AHEAD);
        s.when_ended(Port::position, Ends::Hold);
        s.lookaround(Port::listener, PAST, AHEAD);
        s.when_ended(Port::listener, Ends::Hold);
        s.tail(audio.rate.span((tail(p) * fs).ceil() as usize + 2));
        s.output(Port::out, audio.rate, Channels(2));
        Ok(())
    }

    fn build(p: &StructuralHrtfParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let fs = cx.input(StructuralHrtfPorts::audio).rate.as_f64();
        Ok(Self {
            binaural: Binaural::new(head(p), p.room, fs),
            begun: false,
            source: p.position,
            listener: listener(p.listener, p.look, p.up)?,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: StructuralHrtfIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.out.first().max(0) as u64, io.out.rate());
        let (before, audio) = io.audio.around().split_at(self.binaural.lag().min(io.audio.around().len()));
        if !std::mem::replace(&mut self.begun, true) {
            self.binaural.feed(before);
        }
        let (source, head) = (self.source, self.listener);
        self.binaural.process(first, audio, io.out.items(), |n| {
            let tick = rate.tick(n as i64);
            let source =
                io.position.as_ref().map_or(source, |poses| pose_at(poses, tick).position.map(f64::from));
            io.listener.as_ref().map_or(head, |poses| pose_at(poses, tick)).toward(source)
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

    archive_state!(binaural, begun, source, listener);
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, TICKS_PER_SECOND, ticks};

    const FS: u32 = 48_000;

    fn params() -> StructuralHrtfParams {
        StructuralHrtfParams::read(&|_| None).unwrap()
    }

    fn standalone(p: StructuralHrtfParams, audio: Vec<f32>) -> Standalone {
        Standalone::new::<StructuralHrtf>(p).input(
            StructuralHrtfPorts::audio,
            Rate::hz(FS),
            Channels(1),
            audio,
        )
    }

    fn click(at: usize) -> Vec<f32> {
        let mut audio = vec![0.0; FS as usize / 10];
        audio[at] = 1.0;
        audio
    }

    fn circle(radius: f32) -> Vec<Pose> {
        let at = |k: u8| 2.0 * PI * f32::from(k) / 60.0;
        (0..60).map(|k| Pose::at([radius * at(k).cos(), radius * at(k).sin(), 0.0])).collect()
    }

    #[test]
    fn a_click_in_front_stays_near_its_time_and_is_the_same_in_both_ears() {
        let p = StructuralHrtfParams { pinna: Pinna::Off, ..params() };
        let out = standalone(p, click(1000)).run().unwrap().stream(StructuralHrtfPorts::out);
        let left: Vec<f32> = out.iter().step_by(2).copied().collect();
        let right: Vec<f32> = out.iter().skip(1).step_by(2).copied().collect();
        assert_eq!(left, right);
        let peak = (0..left.len()).max_by(|a, b| left[*a].total_cmp(&left[*b])).unwrap();
        // Ears at 100 degrees are reached 10 degrees around the head after the middle.
        let expected = 1000.0 + 0.0875 / 343.0 * 10_f64.to_radians() * 48_000.0;
        assert!((peak as f64 - expected).abs() <= 1.0, "{peak} {expected}");
        assert!(left[..900].iter().all(|x| *x == 0.0));
    }

    #[test]
    fn a_source_to_the_left_is_louder_and_earlier_there_however_that_comes_about() {
        let turned = StructuralHrtfParams { look: [0.0, -1.0, 0.0], ..params() };
        let moved = StructuralHrtfParams { listener: [0.0, 5.0, 0.0], position: [0.0, 9.0, 0.0], ..params() };
        let left = StructuralHrtfParams { position: [0.0, 2.0, 0.0], ..params() };
        let out = [turned, moved, left]
            .map(|p| standalone(p, click(1000)).run().unwrap().stream(StructuralHrtfPorts::out));
        for out in &out {
            let power = |ear: usize| out.iter().skip(ear).step_by(2).map(|x| x * x).sum::<f32>();
            assert!(power(0) > 3.0 * power(1), "{} {}", power(0), power(1));
            let first = |ear: usize| out.iter().skip(ear).step_by(2).position(|x| x.abs() > 0.01).unwrap();
            assert!(first(0) + 20 < first(1), "{} {}", first(0), first(1));
        }
        assert!(out[1] == out[2]);
    }

    #[test]
    fn a_link_moves_the_source_or_the_head_and_windows_do_not_matter() {
        let noise: Vec<f32> = (0..FS).map(|n| ((n * n) as f32 * 0.61).sin()).collect();
        let run = |listens: bool, window| {
            let port = if listens { StructuralHrtfPorts::listener } else { StructuralHrtfPorts::position };
            let standalone =
                standalone(params(), noise.clone()).optional(port, Rate::hz(60), (), circle(2.0));
            standalone.window(window).run().unwrap().stream(StructuralHrtfPorts::out)
        };
        for listens in [false, true] {
            let whole = run(listens, 2 * TICKS_PER_SECOND);
            assert!(run(listens, ticks(0.0123)) == whole && run(listens, Rate::hz(FS).span(17)) == whole);
        }
        let out = run(false, TICKS_PER_SECOND);
        let power = |from: usize, ear: usize| {
            out[2 * from..2 * from + 4800].iter().skip(ear).step_by(2).map(|x| x * x).sum::<f32>()
        };
        // A quarter turn to the left, three quarters to the right.
        assert!(power(12_000, 0) > 2.0 * power(12_000, 1));
        assert!(power(36_000, 1) > 2.0 * power(36_000, 0));
    }

    #[test]
    fn a_new_place_is_taken_over_without_a_rebuild_and_a_new_head_needs_one() {
        let cx = standalone(params(), click(0));
        assert!(cx.shape().is_ok());
        let mut node = StructuralHrtf {
            binaural: Binaural::new(head(&params()), 0.0, 48_000.0),
            begun: false,
            source: [1.0, 0.0, 0.0],
            listener: Pose::default(),
            params: params(),
        };
        let moved = StructuralHrtfParams { position: [0.0, 1.0, 0.0], look: [0.0, 1.0, 0.0], ..params() };
        assert_eq!(node.retune(&moved), Retune::Done);
        assert_eq!(node.source, [0.0, 1.0, 0.0]);
        assert_eq!(node.retune(&StructuralHrtfParams { radius: 0.1, ..moved }), Retune::Rebuild);
    }

    #[test]
    fn stereo_and_a_head_turned_nowhere_are_refused() {
        let stereo = Standalone::new::<StructuralHrtf>(params());
        let stereo = stereo.input(StructuralHrtfPorts::audio, Rate::hz(FS), Channels(2), vec![0.0; 4]);
        assert!(stereo.shape().unwrap_err().help.unwrap().contains("Mono"));
        let p = StructuralHrtfParams { up: [2.0, 0.0, 0.0], ..params() };
        assert_eq!(standalone(p, vec![0.0; 4]).shape().unwrap_err().code, "F067");
    }
}
