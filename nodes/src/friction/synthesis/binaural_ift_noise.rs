//! Friction noise as two ears hear it, as a node.

use super::clip_stream::ClipStream;
use super::clip_timing::{MotionAt, hop};
use super::noise::{ClipInput, IftNoise};
use super::noise_params::{AreaWeight, EmitterKind, Emitters, IftNoiseParams, Magnitude};
use super::speed_coverage::coverage_summary;
use super::window::Window;
use crate::contact::Speeds;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{In, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::{Rate, Tick};
use crate::dsp;
use crate::friction::model::{FrictionModel, Gain};
use crate::mesh::Mesh;
use crate::spatial::hrtf_node::Pinna;
use crate::spatial::track::{frames_of, listener, on_frames, pose_at};
use crate::spatial::{Distance, Head, HeadReceiver, Pose, Poses};
use crate::{archive_state, params, ports};

params! {
    /// The sound of sliding cloth at the two ears of a listener: as `IftNoise`, with every patch of cloth where it is.
    ///
    /// `mesh` is the cloth whose vertices slide. Vertices in one cell of a grid share phases: such a cluster is heard from its own
    /// direction and distance as in `StructuralHrtf` and `DistanceGain`. Both ears get the same phases of a cluster: independent ones
    /// would destroy all cues. The gains of the ears are laid on spectra, so delays wrap around within a clip, which is not heard; the
    /// middle of the head hears the cloth at its time.
    ///
    /// # Randomness
    /// A phase follows from the seed, the emitter, the clip and the bin alone.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2; Brown and
    /// Duda, "A structural model for binaural sound synthesis" (1998).
    pub struct BinauralIftNoiseParams {
        /// Sample rate of the audio.
        rate: Rate = Rate::hz(48_000);
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
        /// Distance at which cloth is as loud as its model; None leaves distance out.
        reference: Option<f64> = Some(1.0), unit "m", range 0.001..=10_000.0;
        /// Distance below which it gets no louder.
        nearest: f64 = 0.1, unit "m", range 0.001..=10_000.0;
        /// Cross-fade between clips.
        window: Window = Window::SqrtTriangle;
        /// Magnitude of a bin around its expected value.
        magnitude: Magnitude = Magnitude::Fixed;
        /// How vertices become sound sources.
        emitters: EmitterKind = EmitterKind::Clustered;
        /// Most clusters of `Clustered`: beyond them the weakest join the nearest of the others.
        clusters: usize = 64, unit "clusters", range 1..=4096;
        /// Edge of a cluster's cell.
        cell: f32 = 0.1, unit "m", range 0.001..=1000.0;
        /// When in a clip speeds, places and the listener are taken.
        motion_at: MotionAt = MotionAt::Centre;
        /// How loud a vertex is for its area.
        area_weight: AreaWeight = AreaWeight::Sqrt;
        /// Level of spectra between measured speeds.
        gain: Gain = Gain::Rms;
        /// Factor on the output; one that changes while the graph runs is reached on a straight line in 10 ms.
        level: f32 = 1.0, unit "", range 0.0..=1000.0;
    }
}

ports! {
    pub struct BinauralIftNoisePorts / BinauralIftNoiseIo {
        in {
            /// Sliding speed per vertex.
            speeds: Stream<Speeds>,
            /// Power density per speed.
            model: Value<FrictionModel>,
            /// Where the vertices are.
            mesh: Stream<Mesh>,
            /// Where the listener's head is and looks, in place of the parameters.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// Friction sound at the ears, stereo, full scale +-1.
            audio: Stream<f32>,
        }
    }
}

/// The node over [`ClipStream`] with a [`HeadReceiver`].
pub struct BinauralIftNoise {
    clips: ClipStream<HeadReceiver>,
    level: dsp::Gain,
    peak: f32,
    /// Positions at the middle of a clip.
    positions: Vec<[f32; 3]>,
    /// One channel after the other, before they are woven together.
    planes: Vec<f32>,
    listener: Pose,
    params: BinauralIftNoiseParams,
}

/// Positions at a time of the window, on straight lines between frames.
fn positions_at(mesh: &In<'_, Mesh>, tick: Tick, out: &mut [[f32; 3]]) {
    let rate = mesh.rate();
    let at = rate.first_at(tick + 1) - 1;
    let (from, to) = (rate.tick(at), rate.tick(at + 1));
    let t = (tick - from) as f32 / (to - from).max(1) as f32;
    let last = (mesh.around().len() / mesh.width().max(1)) as i64 - mesh.behind() as i64 - 1;
    let frame = |k: i64| mesh.item((k - mesh.first()).clamp(-(mesh.behind() as i64), last) as isize);
    for (out, (a, b)) in out.iter_mut().zip(frame(at).iter().zip(frame(at + 1))) {
        *out = std::array::from_fn(|k| a[k] + t * (b[k] - a[k]));
    }
}

impl Node for BinauralIftNoise {
    type Params = BinauralIftNoiseParams;
    type Ports = BinauralIftNoisePorts;
    const NAME: &'static str = "BinauralIftNoise";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 400.0;

    fn shape(p: &BinauralIftNoiseParams, s: &mut Shape<'_, '_, BinauralIftNoisePorts>) -> Result<(), Reject> {
        type Port = BinauralIftNoisePorts;
        let (speeds, mesh) = (s.input(Port::speeds), s.input(Port::mesh));
        s.check(hop(p.rate, speeds.rate));
        s.check(listener(p.listener, p.look, p.up));
        if let Some(model) = s.value(Port::model) {
            s.check(model.validate().map_err(|e| Reject::new("F076", e.to_string()).at("model")));
        }
        let (slide, stand) = (speeds.format.len(), mesh.format.topology.vertex_count());
        if slide != stand {
            let message = format!("`speeds` has {slide} vertices, `mesh` has {stand}");
            s.wrong(
                Reject::new("F067", message).at("mesh").help("link the mesh whose contacts give the speeds"),
            );
        }
        let [past, ahead] = p.motion_at.reach();
        s.lookaround(Port::speeds, past, ahead);
        s.when_ended(Port::speeds, Ends::Stop);
        let near = frames_of(speeds.rate, mesh.rate);
        // Between frames the cloth lies on a line to the next one.
        let next = usize::from(!on_frames(speeds.rate, mesh.rate));
        s.lookaround(Port::mesh, past * near + 1, ahead * near + next);
        s.when_ended(Port::mesh, Ends::Hold);
        if let Some(poses) = s.optional(Port::listener) {
            let near = frames_of(speeds.rate, poses.rate);
            // Between frames poses lie on a cubic through two more.
            let next = if on_frames(speeds.rate, poses.rate) { 0 } else { 2 };
            s.lookaround(Port::listener, past * near + 2, ahead * near + next);
        }
        s.when_ended(Port::listener, Ends::Hold);
        s.output(Port::audio, p.rate, Channels(2));
        Ok(())
    }

    fn build(p: &BinauralIftNoiseParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let speeds = cx.input(BinauralIftNoisePorts::speeds);
        let model = cx.value(BinauralIftNoisePorts::model);
        let (len, fs) = (2 * hop(p.rate, speeds.rate)?, p.rate.as_f64());
        let params = IftNoiseParams {
            clip: len as f64 / fs,
            window: p.window,
            magnitude: p.magnitude,
            emitters: match p.emitters {
                EmitterKind::Clustered => Emitters::Clustered { max: p.clusters, cell: p.cell },
                EmitterKind::PerVertex => Emitters::PerVertex,
            },
            area_weight: p.area_weight,
            gain: p.gain,
        };
        let head = Head { radius: p.radius, pinna: p.pinna.set(), ..Head::default() };
        let distance = p.reference.map(|reference| Distance { reference, nearest: p.nearest });
        let receiver = HeadReceiver::new(head, fs, len, distance);
        let noise = IftNoise::with_receiver(&model, fs, params, &speeds.format, cx.random, receiver);
        let noise = noise.map_err(|e| Fault::new("F076", e.to_string()).at("model"))?;
        Ok(Self {
            clips: ClipStream::new(noise),
            level: dsp::Gain::new(f64::from(p.level), (0.010 * fs).round() as u64, 2),
            peak: 0.0,
            positions: vec![[0.0; 3]; speeds.format.len()],
            planes: vec![0.0; len],
            listener: listener(p.listener, p.look, p.up)?,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: BinauralIftNoiseIo<'_>) -> Result<(), Fault> {
        let (speeds, first, rate) = (&io.speeds, io.speeds.first(), io.speeds.rate());
        let hop = self.clips.hop() as u64;
        let from = io.audio.first().max(0) as u64;
        let out = io.audio.items();
        let mut done = 0;
        // A hop at a time, since head and cloth move from clip to clip.
        while done < out.len() / 2 {
            let at = from + done as u64;
            let count = ((hop - at % hop) as usize).min(out.len() / 2 - done);
            for clip in [at / hop, at / hop + 1] {
                if self.clips.holds(clip) {
                    continue;
                }
                let item = self.params.motion_at.item(clip);
                let tick = rate.tick(item);
                positions_at(&io.mesh, tick, &mut self.positions);
                let head = io.listener.as_ref().map_or(self.listener, |poses| pose_at(poses, tick));
                self.clips.noise_mut().receiver_mut().set_listener(head);
                let input = ClipInput {
                    speeds: speeds.item((item - first) as isize),
                    positions: Some(&self.positions),
                };
                self.clips
                    .prepare(clip, input)
                    .map_err(|e| Fault::new("F076", e.to_string()).at("speeds"))?;
            }
            let (left, right) = self.planes[..2 * count].split_at_mut(count);
            self.clips.overlap(0, at, left);
            self.clips.overlap(1, at, right);
            let frames = out[2 * done..2 * (done + count)].as_chunks_mut::<2>().0;
            for (frame, (l, r)) in frames.iter_mut().zip(left.iter().zip(right)) {
                *frame = [*l, *r];
            }
            done += count;
        }
        self.level.process(out);
        self.peak = out.iter().fold(self.peak, |peak, x| peak.max(x.abs()));
        Ok(())
    }

    fn retune(&mut self, new: &BinauralIftNoiseParams) -> Retune {
        let BinauralIftNoiseParams { level, listener: at, look, up, .. } = *new;
        if (BinauralIftNoiseParams { level, listener: at, look, up, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        self.level.set_target(f64::from(level));
        if let Some(pose) = Pose::looking(at, look, up) {
            self.listener = pose;
        }
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.level.start_from(old.level.current());
    }

    fn finish(&mut self, _: BinauralIftNoiseIo<'_>) -> Result<Summary, Fault> {
        Ok(coverage_summary(self.clips.noise().coverage(), self.peak))
    }

    archive_state!(clips, peak);

    fn trial(rng: &mut Rng) -> (BinauralIftNoiseParams, MemoryFiles) {
        let rate = [6000, 12_000, 24_000][rng.below(3)];
        (BinauralIftNoiseParams { rate: Rate::hz(rate), ..Params::trial(rng) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
