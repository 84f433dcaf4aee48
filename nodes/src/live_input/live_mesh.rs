//! The node `LiveMesh`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::Frames;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick, seconds, ticks};
use crate::mesh::mesh_sequence::MeshSequenceParams;
use crate::mesh::{Mesh, MeshFormat, UpAxis, rest_mesh, to_metres};
use crate::{archive_state, params, ports};
use std::sync::Arc;

params! {
    /// A mesh whose frames come in over TCP while the graph plays.
    ///
    /// Each item is the newest frame that is not later than the item. Without a new frame the mesh does not move, and `age`
    /// grows. A file has the faces, the materials and the rest pose. The mesh has the rest pose before the first frame, so
    /// the motion should begin in this pose. Frames have the vertices of the file in the same order, unit and upward axis.
    /// In an offline run there are no frames: the mesh stays in the rest pose, and `age` is the time since the start.
    pub struct LiveMeshParams {
        /// Name of the channel.
        channel: Text;
        /// File with the faces and the rest pose: an OBJ, or another format of `MeshSequence`.
        path: AssetPath;
        /// Length of one unit of the file and of the frames, for example 0.01 for centimetres.
        metres_per_unit: f64 = 1.0, unit "m", range 0.000001..=1000000.0;
        /// Name of the material of faces without one in the file.
        material: Text = "".into();
        /// Frames per second of the output; the frames of the sender can have any other rate, and can be irregular.
        rate: Rate = Rate::hz(60);
        /// Time to receive frames; None for no limit.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveMesh`.
    pub struct LiveMeshPorts / LiveMeshIo {
        in {}
        out {
            /// The moving mesh, in metres.
            mesh: Stream<Mesh>,
            /// Time from the time stamp of the frame to the item that shows it, s.
            age: Stream<f32>,
        }
    }
}

/// The node `LiveMesh`.
pub struct LiveMesh {
    frames: Option<Box<dyn Frames>>,
    /// The last frame as received.
    received: Vec<[f32; 3]>,
    /// Current positions, and the time of their frame.
    positions: Vec<[f32; 3]>,
    frame_time: Tick,
    scale: f64,
    up_axis: UpAxis,
    frame_count: u64,
    left_out: u64,
}

/// Parameters of `MeshSequence` that read the file.
fn sequence_params(p: &LiveMeshParams) -> MeshSequenceParams {
    MeshSequenceParams {
        path: p.path.clone(),
        base: None,
        object: None,
        animation: None,
        fps: Some(p.rate),
        metres_per_unit: p.metres_per_unit,
        material: p.material.clone(),
        up: None,
        start: None,
        duration: None,
    }
}

impl LiveMesh {
    /// Takes the newest frame that is not later than `now`, and returns its age in seconds.
    fn update(&mut self, now: Tick) -> f32 {
        let frames = self.frames.as_mut();
        let newest =
            frames.and_then(|frames| frames.latest(now.saturating_add(1), self.received.as_flattened_mut()));
        if let Some(time) = newest {
            let scaled = |(v, p): (usize, &[f32; 3])| to_metres(p.map(f64::from), self.scale, 0, v).ok();
            if self.received.iter().enumerate().all(|vertex| scaled(vertex).is_some()) {
                for (vertex, position) in self.received.iter().enumerate().zip(&mut self.positions) {
                    *position = scaled(vertex).unwrap_or(*position);
                }
                self.up_axis.convert(UpAxis::Z, &mut self.positions);
                self.frame_time = time;
                self.frame_count += 1;
            } else {
                self.left_out += 1;
            }
        }
        seconds(now - self.frame_time) as f32
    }
}

impl Node for LiveMesh {
    type Params = LiveMeshParams;
    type Ports = LiveMeshPorts;
    const NAME: &'static str = "LiveMesh";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 20.0;

    fn shape(p: &LiveMeshParams, s: &mut Shape<'_, '_, LiveMeshPorts>) -> Result<(), Reject> {
        let (topology, materials, up_axis) = rest_mesh(&sequence_params(p), s)?;
        let format = MeshFormat { materials: Arc::new(materials), ..MeshFormat::moving(topology) };
        s.prepare(up_axis);
        s.output(LiveMeshPorts::mesh, p.rate, format);
        s.output(LiveMeshPorts::age, p.rate, Channels(1));
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveMeshParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rest = cx.output(LiveMeshPorts::mesh).format.topology.rest.clone();
        Ok(Self {
            frames: cx.inputs.open_frames(&p.channel.0, 3 * rest.len()),
            received: rest.clone(),
            positions: rest,
            frame_time: 0,
            scale: p.metres_per_unit,
            up_axis: cx.prepared().map_or(UpAxis::Z, |up_axis| *up_axis),
            frame_count: 0,
            left_out: 0,
        })
    }

    fn run(&mut self, mut io: LiveMeshIo<'_>) -> Result<(), Fault> {
        let (first, width, rate) = (io.mesh.first(), io.mesh.width(), io.mesh.rate());
        let items = io.mesh.items().chunks_exact_mut(width.max(1));
        for ((index, item), age) in (first..).zip(items).zip(io.age.items()) {
            *age = self.update(rate.tick(index));
            item.copy_from_slice(&self.positions);
        }
        Ok(())
    }

    fn finish(&mut self, _: LiveMeshIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("frames", self.frame_count.into()), ("left_out", self.left_out.into())])
    }

    fn adopt(&mut self, old: &mut Self) {
        if self.positions.len() == old.positions.len() {
            self.positions.copy_from_slice(&old.positions);
            self.frame_time = old.frame_time;
        }
    }

    archive_state!(positions, frame_time, frame_count, left_out);

    fn trial(rng: &mut Rng) -> (LiveMeshParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("rest.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 4 3\n".to_owned());
        let params = LiveMeshParams::trial(rng);
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        (LiveMeshParams { path: "rest.obj".into(), duration, ..params }, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::files::MemoryOutputs;
    use crate::core::input::{Inbox, Inputs, MessageKind, NoInputs};
    use crate::core::standalone::Standalone;
    use std::collections::VecDeque;
    use std::sync::Mutex;

    const OBJ: &str = "usemtl silk\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    fn params(duration: Option<f64>) -> LiveMeshParams {
        let metres_per_unit = 0.5;
        let (channel, path, material) = ("sheet".into(), "rest.obj".into(), "".into());
        LiveMeshParams { channel, path, metres_per_unit, material, rate: Rate::hz(60), duration }
    }

    fn files() -> MemoryFiles {
        let mut files = MemoryFiles::default();
        files.insert("rest.obj", OBJ.to_owned());
        files
    }

    #[test]
    fn an_offline_run_keeps_the_rest_pose_and_age_grows() {
        let mut standalone = Standalone::new::<LiveMesh>(params(Some(0.5)));
        standalone.files = files();
        let shape = standalone.shape().unwrap();
        let format = shape.outputs[0].as_ref().unwrap().format::<Mesh>().unwrap();
        assert!(!format.is_static && format.materials.names() == ["silk"]);
        let run = standalone.window(ticks(0.07)).run().unwrap();
        let (mesh, age) = (run.stream(LiveMeshPorts::mesh), run.stream(LiveMeshPorts::age));
        assert_eq!((mesh.len(), age.len()), (90, 30));
        let rest = [[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]];
        assert!(mesh.chunks_exact(3).all(|frame| frame == rest));
        for (k, age) in age.iter().enumerate() {
            assert!((f64::from(*age) - k as f64 / 60.0).abs() < 1e-6, "{k}: {age}");
        }
    }

    /// Frames whose vertices all have one position.
    struct Script(VecDeque<(Tick, [f32; 3])>);

    impl Frames for Script {
        fn latest(&mut self, before: Tick, into: &mut [f32]) -> Option<Tick> {
            let mut newest = None;
            while let Some((time, position)) = self.0.pop_front_if(|(time, _)| *time < before) {
                into.chunks_exact_mut(3).for_each(|p| p.copy_from_slice(&position));
                newest = Some(time);
            }
            newest
        }
    }

    fn node(frames: &[(f64, [f32; 3])], scale: f64, up_axis: UpAxis) -> LiveMesh {
        let frames = frames.iter().map(|(time, position)| (ticks(*time), *position)).collect();
        LiveMesh {
            frames: Some(Box::new(Script(frames))),
            received: vec![[0.0; 3]; 3],
            positions: vec![[9.0; 3]; 3],
            frame_time: 0,
            scale,
            up_axis,
            frame_count: 0,
            left_out: 0,
        }
    }

    #[test]
    fn an_item_has_the_newest_frame_that_is_not_later() {
        let frames = [(0.1, [1.0, 0.0, 0.0]), (0.15, [2.0, 0.0, 0.0]), (0.3, [3.0, 0.0, 0.0])];
        let mut node = node(&frames, 1.0, UpAxis::Z);
        for (time, x, age) in
            [(0.05, 9.0, 0.05), (0.1, 1.0, 0.0), (0.2, 2.0, 0.05), (0.29, 2.0, 0.14), (9.0, 3.0, 8.7)]
        {
            let found = node.update(ticks(time));
            assert!((f64::from(found) - age).abs() < 1e-6, "{time}: {found}");
            assert!(node.positions.iter().all(|p| p[0] == x), "{time}: {:?}", node.positions);
        }
        assert_eq!(node.frame_count, 3);
    }

    #[test]
    fn frames_are_converted_to_metres_and_z_up_and_invalid_ones_are_left_out() {
        let frames = [(0.1, [1.0, 2.0, 3.0]), (0.2, [1.0, f32::NAN, 0.0]), (0.3, [0.0, 1e10, 0.0])];
        let mut node = node(&frames, 0.5, UpAxis::Y);
        node.update(ticks(0.1));
        assert_eq!(node.positions, [[0.5, -1.5, 1.0]; 3]);
        for time in [0.2, 0.3] {
            let age = node.update(ticks(time));
            assert!((f64::from(age) - (time - 0.1)).abs() < 1e-6, "{age}");
            assert_eq!(node.positions, [[0.5, -1.5, 1.0]; 3]);
        }
        assert_eq!((node.frame_count, node.left_out), (1, 2));
    }

    #[test]
    fn a_node_that_replaces_another_adopts_its_positions() {
        let mut old = node(&[(0.1, [1.0; 3])], 1.0, UpAxis::Z);
        old.update(ticks(0.2));
        let mut new = node(&[], 1.0, UpAxis::Z);
        new.adopt(&mut old);
        assert!((new.update(ticks(0.3)) - 0.2).abs() < 1e-6 && new.positions == [[1.0; 3]; 3]);
        let mut other = LiveMesh { positions: vec![[7.0; 3]; 2], ..node(&[], 1.0, UpAxis::Z) };
        other.adopt(&mut old);
        assert_eq!(other.positions, [[7.0; 3]; 2]);
    }

    /// Records the opened channels.
    #[derive(Default)]
    struct Opened(Mutex<Vec<(String, usize)>>);

    impl Inputs for Opened {
        fn open(&self, _: &str, _: MessageKind, _: usize) -> Option<Box<dyn Inbox>> {
            None
        }

        fn open_frames(&self, channel: &str, numbers: usize) -> Option<Box<dyn Frames>> {
            self.0.lock().unwrap().push((channel.to_owned(), numbers));
            NoInputs.open_frames(channel, numbers)
        }
    }

    #[test]
    fn a_frame_has_three_numbers_per_vertex() {
        let mut standalone = Standalone::new::<LiveMesh>(params(None));
        standalone.files = files();
        let opened = Opened::default();
        let node = LiveMesh::build(
            &params(None),
            &Build {
                random: crate::core::random::Random::new(0, ""),
                links: &[],
                shape: &standalone.shape().unwrap(),
                window: 1,
                files: &files(),
                outputs: &MemoryOutputs::default(),
                inputs: &opened,
                monitor: &crate::core::computation::unmonitored,
                partial: &crate::core::computation::NotStored,
                background: &crate::core::computation::foreground(),
            },
        );
        assert!(node.unwrap().frames.is_none());
        assert_eq!(*opened.0.lock().unwrap(), [("sheet".to_owned(), 9)]);
    }
}
