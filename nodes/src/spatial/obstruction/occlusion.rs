//! The node `Occlusion`.

use std::sync::Arc;

use super::line_of_sight::is_blocked;
use super::occlusion_filter::OcclusionFilter;
use crate::contact::vector::Vec3;
use crate::core::fault::{Fault, Reject};
use crate::core::item::Item;
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{In, Many, Stream};
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::Tick;
use crate::mesh::{Mesh, Topology};
use crate::spatial::hrtf::head::Head;
use crate::spatial::motion::item::Poses;
use crate::spatial::motion::pose::Pose;
use crate::{archive_state, params, ports};

/// Samples between two tests of the lines of sight.
const INTERVAL: i64 = 64;

params! {
    /// Attenuates and low-passes a sound while a body is between its source and the listener.
    ///
    /// The line of sight runs from the source to each ear, or to the centre of the head if the audio is not stereo. If it intersects a
    /// triangle of any body, the sound at that ear is attenuated and low-passed by a first-order filter. The transition has the time
    /// constant `time`. Diffraction is not modelled: this is approximate. Use it before `StructuralHrtf` for one source, or after it for
    /// the two ears.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012).
    pub struct OcclusionParams {
        /// Position of the source, if not linked.
        position: [f64; 3] = [1.0, 0.0, 0.0], unit "m", range -100_000.0..=100_000.0;
        /// Position of the listener, who looks along x with z above, if not linked.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Cutoff of the blocked sound.
        cutoff: f64 = 1500.0, unit "Hz", range 10.0..=20_000.0;
        /// Level of the blocked sound.
        gain_db: f64 = -6.0, unit "dB", range -60.0..=0.0;
        /// Time constant of the transition between free and blocked.
        time: f64 = 0.05, unit "s", range 0.001..=2.0;
    }
}
ports! {
    pub struct OcclusionPorts / OcclusionIo {
        in {
            /// Audio of the source; two channels are the left and the right ear.
            audio: Stream<f32>,
            /// Bodies that may block the sound.
            bodies: Many<Stream<Mesh>>,
            /// Poses of the source; replace the parameter.
            position: Option<Stream<Poses>>,
            /// Poses of the listener's head; replace the parameter.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// The audio at the listener.
            out: Stream<f32>,
        }
    }
}

/// The node `Occlusion`.
pub struct Occlusion {
    bodies: Vec<Arc<Topology>>,
    /// Filter of each channel, and true if its line of sight is blocked.
    channels: Vec<(OcclusionFilter, bool)>,
    /// True after the first test of the lines of sight.
    updated: bool,
    params: OcclusionParams,
    samples: u64,
    blocked_samples: u64,
}

/// Returns the latest frame of a stream at a time of the window. No interpolation is needed, since the filter smooths the result.
fn frame<'a, T: Item>(frames: &'a In<'_, T>, tick: Tick) -> &'a [T::Elem] {
    let (index, behind) = (frames.rate().first_at(tick + 1) - 1 - frames.first(), frames.behind() as i64);
    let last = (frames.around().len() / frames.width().max(1)) as i64 - behind - 1;
    frames.item(index.clamp(-behind, last.max(-behind)) as isize)
}

/// Returns the latest pose at a time of the window.
fn pose(poses: &In<'_, Poses>, tick: Tick) -> Pose {
    frame(poses, tick).first().copied().unwrap_or_default()
}

impl Occlusion {
    fn update(&mut self, io: &OcclusionIo<'_>, tick: Tick) {
        let from: Vec3 = match &io.position {
            Some(poses) => pose(poses, tick).position.map(f64::from),
            None => self.params.position,
        };
        let head = match &io.listener {
            Some(poses) => pose(poses, tick),
            None => Pose::at(self.params.listener.map(|x| x as f32)),
        };
        let radius = Head::default().radius;
        let count = self.channels.len();
        for (channel, (_, blocked)) in self.channels.iter_mut().enumerate() {
            let side = match (count, channel) {
                (2, 0) => radius,
                (2, _) => -radius,
                _ => 0.0,
            };
            let ear = head.to_scene([0.0, side, 0.0]);
            let mut bodies = io.bodies.iter().zip(&self.bodies);
            *blocked = bodies.any(|(mesh, body)| is_blocked(from, ear, frame(&mesh, tick), &body.triangles));
        }
        self.updated = true;
    }
}

impl Node for Occlusion {
    type Params = OcclusionParams;
    type Ports = OcclusionPorts;
    const NAME: &'static str = "Occlusion";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 500.0;

    fn shape(_: &OcclusionParams, s: &mut Shape<'_, '_, OcclusionPorts>) -> Result<(), Reject> {
        type Port = OcclusionPorts;
        let audio = s.input(Port::audio);
        s.when_ended(Port::audio, Ends::Stop);
        s.lookaround(Port::bodies, 1, 0);
        s.when_ended(Port::bodies, Ends::Hold);
        s.lookaround(Port::position, 1, 0);
        s.when_ended(Port::position, Ends::Hold);
        s.lookaround(Port::listener, 1, 0);
        s.when_ended(Port::listener, Ends::Hold);
        s.output(Port::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &OcclusionParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(OcclusionPorts::audio);
        let gain = libm::pow(10.0, p.gain_db / 20.0);
        let filter = OcclusionFilter::new(p.cutoff, gain, p.time, audio.rate.as_f64());
        Ok(Self {
            bodies: cx.many(OcclusionPorts::bodies).into_iter().map(|body| body.format.topology).collect(),
            channels: vec![(filter, false); audio.format.0.into()],
            updated: false,
            params: p.clone(),
            samples: 0,
            blocked_samples: 0,
        })
    }

    fn run(&mut self, mut io: OcclusionIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.audio.first(), io.audio.rate(), io.audio.width().max(1));
        let mut done = 0;
        while done < io.audio.len() {
            let index = first + done as i64;
            if index % INTERVAL == 0 || !self.updated {
                self.update(&io, rate.tick(index));
            }
            let count = ((INTERVAL - index.rem_euclid(INTERVAL)) as usize).min(io.audio.len() - done);
            let samples = done * width..(done + count) * width;
            let input = io.audio.items().get(samples.clone()).unwrap_or_default();
            let out = io.out.items().get_mut(samples).unwrap_or_default();
            for (from, to) in input.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
                for ((x, y), (filter, blocked)) in from.iter().zip(to).zip(&mut self.channels) {
                    *y = filter.process(*x, *blocked);
                }
            }
            self.samples += (count * width) as u64;
            self.blocked_samples +=
                count as u64 * self.channels.iter().filter(|(_, blocked)| *blocked).count() as u64;
            done += count;
        }
        Ok(())
    }

    fn finish(&mut self, _: OcclusionIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("behind_share", (self.blocked_samples as f64 / self.samples.max(1) as f64).into())])
    }

    archive_state!(channels, updated, samples, blocked_samples);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};
    use crate::mesh::MeshFormat;

    /// A board that blocks the left ear from the source at x = 1 from 0.5 s on. Returns the output and the share of blocked samples.
    fn occluded(channels: u16, window: f64) -> (Vec<f32>, f64) {
        let board = [[0.5, 0.02, -1.0], [0.5, 2.0, -1.0], [0.5, 0.02, 2.0]];
        let topology = Topology { rest: board.to_vec(), triangles: vec![[0, 1, 2]] };
        let positions = |k: i32| board.map(|[x, y, z]: [f32; 3]| [x, y + if k < 5 { 5.0 } else { 0.0 }, z]);
        let p = OcclusionParams::read(&|_| None).unwrap();
        let standalone = Standalone::new::<Occlusion>(p)
            .input(
                OcclusionPorts::audio,
                Rate::hz(8000),
                Channels(channels),
                vec![1.0; 8000 * channels as usize],
            )
            .also(
                OcclusionPorts::bodies,
                Rate::hz(10),
                MeshFormat::moving(topology),
                (0..10).flat_map(positions).collect(),
            )
            .window(ticks(window));
        let run = standalone.run().unwrap();
        let share = run.summary.iter().find(|(name, _)| *name == "behind_share").unwrap().1.as_f64();
        (run.stream(OcclusionPorts::out), share.unwrap())
    }

    #[test]
    fn a_body_on_the_left_blocks_the_left_ear_only_in_windows_of_any_size() {
        let (out, share) = occluded(2, 1.0);
        let (left, right): (Vec<f32>, Vec<f32>) = out.chunks(2).map(|ears| (ears[0], ears[1])).unzip();
        assert!(right.iter().all(|x| *x == 1.0) && left[..3900].iter().all(|x| *x == 1.0));
        assert!((left[7999] - 0.501).abs() < 0.01, "{}", left[7999]);
        assert!((share - 0.25).abs() < 0.01, "{share}");
        for window in [0.000_125, 0.0037, 0.1, 5.0] {
            assert!(occluded(2, window).0 == out, "{window}");
        }
        assert!(occluded(1, 1.0).0.iter().all(|x| *x == 1.0), "the centre of the head is free");
    }
}
