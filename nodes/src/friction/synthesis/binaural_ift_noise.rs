//! Friction noise at two ears, as a node.

use super::clip_stream::ClipStream;
use super::clip_timing::{check_pressure, hop};
use super::noise::{ClipInput, IftNoise};
use super::noise_params::{ClipParams, EmitterKind, Emitters, IftNoiseParams, VertexLevelParams};
use super::speed_coverage::coverage_summary;
use crate::contact::{Pressures, Speeds};
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
use crate::friction::model::FrictionModel;
use crate::mesh::Mesh;
use crate::spatial::hrtf::head_params::HeadParams;
use crate::spatial::motion::interpolation::{frames_per_item, items_on_frames, pose_at};
use crate::spatial::{Distance, HeadReceiver, Pose, Poses};
use crate::{archive_state, params, ports};

params! {
    /// Synthesises the sound of sliding cloth at the two ears of a listener, as `IftNoise` with positions.
    ///
    /// `mesh` is the cloth whose vertices slide. Vertices in one cell of a grid are a cluster and share phases. A
    /// cluster has its own direction and distance, as in `StructuralHrtf` and `DistanceGain`. Both ears receive the
    /// same phases of a cluster; independent phases would destroy all cues. The gains of the ears are applied to
    /// spectra, so delays wrap around within a clip, which is inaudible. Delays are relative to the middle of the head.
    ///
    /// # Randomness
    /// A phase is a function of the seed, the emitter, the clip and the bin.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2;
    /// Brown and Duda, "A structural model for binaural sound synthesis" (1998).
    pub struct BinauralIftNoiseParams {
        /// Sample rate of the audio.
        rate: Rate = Rate::hz(48_000);
        /// The head.
        [group] head: HeadParams;
        /// Distance at which cloth is as loud as its model; None ignores distance.
        reference: Option<f64> = Some(1.0), unit "m", range 0.001..=10_000.0;
        /// Distance below which the level is constant.
        nearest: f64 = 0.1, unit "m", range 0.001..=10_000.0;
        /// Clips.
        [group] clips: ClipParams;
        /// Maximum number of clusters of `Clustered`; the weakest others join the nearest of them.
        clusters: usize = 64, unit "clusters", range 1..=4096;
        /// Edge length of the cell of a cluster.
        cell: f32 = 0.1, unit "m", range 0.001..=1000.0;
        /// Level.
        [group] vertices: VertexLevelParams;
    }
}

ports! {
    pub struct BinauralIftNoisePorts / BinauralIftNoiseIo {
        in {
            /// Sliding speed per vertex.
            speeds: Stream<Speeds>,
            /// Power density per speed.
            model: Value<FrictionModel>,
            /// Factor on the power per vertex, from `ContactPressure`, at the rate of `speeds`.
            pressure: Option<Stream<Pressures>>,
            /// Positions of the vertices.
            mesh: Stream<Mesh>,
            /// Pose of the listener's head, in place of the parameters.
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
    /// Positions at the time of a clip.
    positions: Vec<[f32; 3]>,
    /// Planar samples of a segment, before they are interleaved.
    planar: Vec<f32>,
    listener: Pose,
    params: BinauralIftNoiseParams,
}

/// Writes the positions at a time of the window, linear between frames.
fn positions_at(mesh: &In<'_, Mesh>, tick: Tick, out: &mut [[f32; 3]]) {
    let rate = mesh.rate();
    let (before, [from, to]) = rate.around(tick);
    let t = (tick - from) as f32 / (to - from).max(1) as f32;
    let last = (mesh.around().len() / mesh.width().max(1)) as i64 - mesh.behind() as i64 - 1;
    let frame = |k: i64| mesh.item((k - mesh.first()).clamp(-(mesh.behind() as i64), last) as isize);
    for (out, (a, b)) in out.iter_mut().zip(frame(before).iter().zip(frame(before + 1))) {
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
        s.check(p.head.pose());
        if let Some(model) = s.value(Port::model) {
            s.check(model.validate().map_err(|e| Reject::new("F076", e.to_string()).at("model")));
        }
        let (speed_vertices, mesh_vertices) = (speeds.format.len(), mesh.format.topology.vertex_count());
        if speed_vertices != mesh_vertices {
            let message = format!("`speeds` has {speed_vertices} vertices, `mesh` has {mesh_vertices}");
            s.wrong(
                Reject::new("F067", message).at("mesh").help("link the mesh whose contacts give the speeds"),
            );
        }
        let [behind, ahead] = p.vertices.motion_at.lookaround();
        s.lookaround(Port::speeds, behind, ahead);
        if let Some(pressure) = s.optional(Port::pressure) {
            s.check(check_pressure(&speeds, &pressure));
            s.lookaround(Port::pressure, behind, ahead);
            s.when_ended(Port::pressure, Ends::Hold);
        }
        s.when_ended(Port::speeds, Ends::Stop);
        let frames = frames_per_item(speeds.rate, mesh.rate);
        // Positions between frames are linear.
        let next = usize::from(!items_on_frames(speeds.rate, mesh.rate));
        s.lookaround(Port::mesh, behind * frames + 1, ahead * frames + next);
        s.when_ended(Port::mesh, Ends::Hold);
        if let Some(poses) = s.optional(Port::listener) {
            let frames = frames_per_item(speeds.rate, poses.rate);
            // Poses between frames are cubic, through two more frames.
            let next = if items_on_frames(speeds.rate, poses.rate) { 0 } else { 2 };
            s.lookaround(Port::listener, behind * frames + 2, ahead * frames + next);
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
            window: p.clips.window,
            magnitude: p.clips.magnitude,
            emitters: match p.clips.emitters {
                EmitterKind::Clustered => Emitters::Clustered { max: p.clusters, cell: p.cell },
                EmitterKind::PerVertex => Emitters::PerVertex,
            },
            area_weight: p.vertices.area_weight,
            gain: p.vertices.gain,
        };
        let distance = p.reference.map(|reference| Distance { reference, nearest: p.nearest });
        let receiver = HeadReceiver::new(p.head.head(), fs, len, distance);
        let noise = IftNoise::with_receiver(&model, fs, params, &speeds.format, cx.random, receiver);
        let noise = noise.map_err(|e| Fault::new("F076", e.to_string()).at("model"))?;
        Ok(Self {
            clips: ClipStream::new(noise),
            level: dsp::Gain::new(f64::from(p.vertices.level), (0.010 * fs).round() as u64, 2),
            peak: 0.0,
            positions: vec![[0.0; 3]; speeds.format.len()],
            planar: vec![0.0; len],
            listener: p.head.pose()?,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: BinauralIftNoiseIo<'_>) -> Result<(), Fault> {
        let (speeds, first, rate) = (&io.speeds, io.speeds.first(), io.speeds.rate());
        let hop = self.clips.hop() as u64;
        let from = io.audio.first().max(0) as u64;
        let out = io.audio.items();
        let mut written = 0;
        // One hop at a time, because head and cloth move between clips.
        while written < out.len() / 2 {
            let position = from + written as u64;
            let count = ((hop - position % hop) as usize).min(out.len() / 2 - written);
            for clip in [position / hop, position / hop + 1] {
                if self.clips.is_prepared(clip) {
                    continue;
                }
                let item = self.params.vertices.motion_at.item(clip);
                let tick = rate.tick(item);
                positions_at(&io.mesh, tick, &mut self.positions);
                let head = io.listener.as_ref().map_or(self.listener, |poses| pose_at(poses, tick));
                self.clips.noise_mut().receiver_mut().set_listener(head);
                let input = ClipInput {
                    speeds: speeds.item((item - first) as isize),
                    positions: Some(&self.positions),
                    pressures: io.pressure.as_ref().map(|p| p.item((item - p.first()) as isize)),
                };
                self.clips
                    .prepare(clip, input)
                    .map_err(|e| Fault::new("F076", e.to_string()).at("speeds"))?;
            }
            let (left, right) = self.planar[..2 * count].split_at_mut(count);
            self.clips.overlap_add(0, position, left);
            self.clips.overlap_add(1, position, right);
            let frames = out[2 * written..2 * (written + count)].as_chunks_mut::<2>().0;
            for (frame, (l, r)) in frames.iter_mut().zip(left.iter().zip(right)) {
                *frame = [*l, *r];
            }
            written += count;
        }
        self.level.process(out);
        self.peak = out.iter().fold(self.peak, |peak, x| peak.max(x.abs()));
        Ok(())
    }

    fn retune(&mut self, new: &BinauralIftNoiseParams) -> Retune {
        let level = new.vertices.level;
        let vertices = VertexLevelParams { level, ..self.params.vertices };
        let head = self.params.head.posed_as(&new.head);
        if (BinauralIftNoiseParams { head, vertices, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        self.level.set_target(f64::from(level));
        if let Ok(pose) = new.head.pose() {
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
