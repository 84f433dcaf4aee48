//! A mesh from outside.

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
use crate::mesh::sequence_node::MeshSequenceParams;
use crate::mesh::{Mesh, MeshFormat, UpAxis, metres, rest};
use crate::{archive_state, params, ports};
use std::sync::Arc;

params! {
    /// A mesh that moves while the graph plays: the positions of its vertices come in over TCP, frame by frame.
    ///
    /// Each item shows the newest frame that is not later than it; while none comes the mesh stands still, and `age` grows. A file tells
    /// the faces, the materials and the rest pose, which is shown before the first frame: let it be where the motion begins. Frames have the
    /// vertices of the file in their order, in its unit and with its upward axis. Offline no frame comes: the mesh rests, and `age` counts
    /// from the start.
    pub struct LiveMeshParams {
        /// The name under which it is sent.
        channel: Text;
        /// The faces and the rest pose: an OBJ, or whatever else `MeshSequence` reads.
        path: AssetPath;
        /// Length of one unit of the file and of what is sent, as 0.01 for centimetres.
        metres_per_unit: f64 = 1.0, unit "m", range 0.000001..=1000000.0;
        /// What the mesh is made of, where the file does not say.
        material: Text = "".into();
        /// Frames per second of the output; those of the sender may come at any other rate, and irregularly.
        rate: Rate = Rate::hz(60);
        /// How long to listen; None listens for ever.
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
            /// Time from the time stamp of the frame that an item shows to the item, s.
            age: Stream<f32>,
        }
    }
}

/// The node `LiveMesh`.
pub struct LiveMesh {
    frames: Option<Box<dyn Frames>>,
    /// The last frame as it was sent.
    sent: Vec<[f32; 3]>,
    /// Where the vertices are, and since when.
    shown: Vec<[f32; 3]>,
    since: Tick,
    scale: f64,
    up: UpAxis,
    taken: u64,
    left_out: u64,
}

/// What `MeshSequence` would read the file with.
fn file(p: &LiveMeshParams) -> MeshSequenceParams {
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
    /// Shows the newest frame that is not later than `now`, and gives its age.
    fn look(&mut self, now: Tick) -> f32 {
        let frames = self.frames.as_mut();
        let come =
            frames.and_then(|frames| frames.latest(now.saturating_add(1), self.sent.as_flattened_mut()));
        if let Some(at) = come {
            let scaled = |(v, p): (usize, &[f32; 3])| metres(p.map(f64::from), self.scale, 0, v).ok();
            if self.sent.iter().enumerate().all(|vertex| scaled(vertex).is_some()) {
                for (vertex, place) in self.sent.iter().enumerate().zip(&mut self.shown) {
                    *place = scaled(vertex).unwrap_or(*place);
                }
                self.up.convert(UpAxis::Z, &mut self.shown);
                self.since = at;
                self.taken += 1;
            } else {
                self.left_out += 1;
            }
        }
        seconds(now - self.since) as f32
    }
}

impl Node for LiveMesh {
    type Params = LiveMeshParams;
    type Ports = LiveMeshPorts;
    const NAME: &'static str = "LiveMesh";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 20.0;

    fn shape(p: &LiveMeshParams, s: &mut Shape<'_, '_, LiveMeshPorts>) -> Result<(), Reject> {
        let (topology, materials, up) = rest(&file(p), s)?;
        let format = MeshFormat { materials: Arc::new(materials), ..MeshFormat::moving(topology) };
        s.keep(up);
        s.output(LiveMeshPorts::mesh, p.rate, format);
        s.output(LiveMeshPorts::age, p.rate, Channels(1));
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveMeshParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let shown = cx.output(LiveMeshPorts::mesh).format.topology.rest.clone();
        Ok(Self {
            frames: cx.inputs.open_frames(&p.channel.0, 3 * shown.len()),
            sent: shown.clone(),
            shown,
            since: 0,
            scale: p.metres_per_unit,
            up: cx.kept().map_or(UpAxis::Z, |up| *up),
            taken: 0,
            left_out: 0,
        })
    }

    fn run(&mut self, mut io: LiveMeshIo<'_>) -> Result<(), Fault> {
        let (first, width, rate) = (io.mesh.first(), io.mesh.width(), io.mesh.rate());
        let items = io.mesh.items().chunks_exact_mut(width.max(1));
        for ((index, item), age) in (first..).zip(items).zip(io.age.items()) {
            *age = self.look(rate.tick(index));
            item.copy_from_slice(&self.shown);
        }
        Ok(())
    }

    fn finish(&mut self, _: LiveMeshIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("frames", self.taken.into()), ("left_out", self.left_out.into())])
    }

    fn adopt(&mut self, old: &mut Self) {
        if self.shown.len() == old.shown.len() {
            self.shown.copy_from_slice(&old.shown);
            self.since = old.since;
        }
    }

    archive_state!(shown, since, taken, left_out);

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
    use crate::core::input::{Inbox, Inputs, NoInputs};
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
    fn offline_it_rests_and_ages() {
        let mut standalone = Standalone::new::<LiveMesh>(params(Some(0.5)));
        standalone.files = files();
        let shape = standalone.shape().unwrap();
        let format = shape.outputs[0].as_ref().unwrap().format::<Mesh>().unwrap();
        assert!(!format.still && format.materials.names() == ["silk"]);
        let run = standalone.window(ticks(0.07)).run().unwrap();
        let (mesh, age) = (run.stream(LiveMeshPorts::mesh), run.stream(LiveMeshPorts::age));
        assert_eq!((mesh.len(), age.len()), (90, 30));
        let rest = [[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]];
        assert!(mesh.chunks_exact(3).all(|frame| frame == rest));
        for (k, age) in age.iter().enumerate() {
            assert!((f64::from(*age) - k as f64 / 60.0).abs() < 1e-6, "{k}: {age}");
        }
    }

    /// Frames whose vertices are all at one place.
    struct Script(VecDeque<(Tick, [f32; 3])>);

    impl Frames for Script {
        fn latest(&mut self, before: Tick, into: &mut [f32]) -> Option<Tick> {
            let mut newest = None;
            while let Some((at, place)) = self.0.pop_front_if(|(at, _)| *at < before) {
                into.chunks_exact_mut(3).for_each(|p| p.copy_from_slice(&place));
                newest = Some(at);
            }
            newest
        }
    }

    fn made(frames: &[(f64, [f32; 3])], scale: f64, up: UpAxis) -> LiveMesh {
        let frames = frames.iter().map(|(at, place)| (ticks(*at), *place)).collect();
        LiveMesh {
            frames: Some(Box::new(Script(frames))),
            sent: vec![[0.0; 3]; 3],
            shown: vec![[9.0; 3]; 3],
            since: 0,
            scale,
            up,
            taken: 0,
            left_out: 0,
        }
    }

    #[test]
    fn an_item_shows_the_newest_frame_that_is_not_later() {
        let frames = [(0.1, [1.0, 0.0, 0.0]), (0.15, [2.0, 0.0, 0.0]), (0.3, [3.0, 0.0, 0.0])];
        let mut node = made(&frames, 1.0, UpAxis::Z);
        for (time, x, age) in
            [(0.05, 9.0, 0.05), (0.1, 1.0, 0.0), (0.2, 2.0, 0.05), (0.29, 2.0, 0.14), (9.0, 3.0, 8.7)]
        {
            let found = node.look(ticks(time));
            assert!((f64::from(found) - age).abs() < 1e-6, "{time}: {found}");
            assert!(node.shown.iter().all(|p| p[0] == x), "{time}: {:?}", node.shown);
        }
        assert_eq!(node.taken, 3);
    }

    #[test]
    fn frames_have_the_unit_and_the_axis_of_the_file_and_what_is_no_place_is_left_out() {
        let frames = [(0.1, [1.0, 2.0, 3.0]), (0.2, [1.0, f32::NAN, 0.0]), (0.3, [0.0, 1e10, 0.0])];
        let mut node = made(&frames, 0.5, UpAxis::Y);
        node.look(ticks(0.1));
        assert_eq!(node.shown, [[0.5, -1.5, 1.0]; 3]);
        for time in [0.2, 0.3] {
            let age = node.look(ticks(time));
            assert!((f64::from(age) - (time - 0.1)).abs() < 1e-6, "{age}");
            assert_eq!(node.shown, [[0.5, -1.5, 1.0]; 3]);
        }
        assert_eq!((node.taken, node.left_out), (1, 2));
    }

    #[test]
    fn a_node_that_takes_its_place_goes_on_where_it_was() {
        let mut old = made(&[(0.1, [1.0; 3])], 1.0, UpAxis::Z);
        old.look(ticks(0.2));
        let mut new = made(&[], 1.0, UpAxis::Z);
        new.adopt(&mut old);
        assert!((new.look(ticks(0.3)) - 0.2).abs() < 1e-6 && new.shown == [[1.0; 3]; 3]);
        let mut other = LiveMesh { shown: vec![[7.0; 3]; 2], ..made(&[], 1.0, UpAxis::Z) };
        other.adopt(&mut old);
        assert_eq!(other.shown, [[7.0; 3]; 2]);
    }

    /// Remembers what was opened.
    #[derive(Default)]
    struct Opened(Mutex<Vec<(String, usize)>>);

    impl Inputs for Opened {
        fn open(&self, _: &str) -> Option<Box<dyn Inbox>> {
            None
        }

        fn open_frames(&self, channel: &str, numbers: usize) -> Option<Box<dyn Frames>> {
            self.0.lock().unwrap().push((channel.to_owned(), numbers));
            NoInputs.open_frames(channel, numbers)
        }
    }

    #[test]
    fn it_asks_for_three_numbers_for_each_vertex() {
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
            },
        );
        assert!(node.unwrap().frames.is_none());
        assert_eq!(*opened.0.lock().unwrap(), [("sheet".to_owned(), 9)]);
    }
}
