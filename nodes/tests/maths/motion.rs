//! The chain from a simulated cloth to its friction sound, node by node, on real data if present.

use foley_nodes::contact::detection::contact_detector::{
    ContactDetector, ContactDetectorParams, ContactDetectorPorts,
};
use foley_nodes::contact::sliding::sliding_speed::{SlidingSpeed, SlidingSpeedParams, SlidingSpeedPorts};
use foley_nodes::contact::{Contact, Contacts, Speeds};
use foley_nodes::core::files::MemoryFiles;
use foley_nodes::core::item::{Item, StreamShape};
use foley_nodes::core::params::{AssetPath, Datum, Params, Text};
use foley_nodes::core::ports::{Port, Stream};
use foley_nodes::core::standalone::{Feed, Standalone};
use foley_nodes::core::time::Rate;
use foley_nodes::friction::FrictionModel;
use foley_nodes::friction::builder::friction_model_from_clips::{
    FrictionModelFromClips, FrictionModelFromClipsParams,
};
use foley_nodes::friction::synthesis::ift_noise::{IftNoiseNode, IftNoiseNodeParams, IftNoisePorts};
use foley_nodes::mesh::Mesh;
use foley_nodes::mesh::mesh_sequence::{MeshSequence, MeshSequenceParams, MeshSequencePorts};
use std::path::PathBuf;

const SHEET: &str = "cloth/cotton_sheet_drag_drop_crumple";

fn data(path: &str) -> Option<Vec<u8>> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    std::fs::read(folder.join(path)).ok()
}

fn read<P: Params>(given: &[(&str, Datum)]) -> P {
    P::read(&|name| given.iter().find(|(n, _)| *n == name).map(|(_, d)| d.clone())).unwrap()
}

/// The output stream of a node, to feed to the next node.
struct Output<T: Item> {
    shape: StreamShape,
    data: Vec<T::Elem>,
    summary: Vec<(&'static str, serde_json::Value)>,
}

impl<T: Item> Output<T> {
    fn of(standalone: &Standalone, port: Port<Stream<T>>) -> Self {
        let shape = standalone.shape().unwrap().outputs[port.index()].clone().unwrap();
        let run = standalone.run().unwrap();
        Self { shape, data: run.stream(port), summary: run.summary }
    }

    fn format(&self) -> T::Format {
        self.shape.format::<T>().unwrap().clone()
    }

    fn feed(&self) -> Feed {
        Feed::stream::<T>(self.shape.rate, self.format(), self.data.clone())
    }

    fn summary_value(&self, name: &str) -> f64 {
        self.summary.iter().find(|(n, _)| *n == name).unwrap().1.as_f64().unwrap()
    }
}

fn mesh(path: &str, base: Option<&str>) -> Option<Output<Mesh>> {
    let mut files = MemoryFiles::default();
    for file in [Some(path), base].into_iter().flatten() {
        files.insert(file, data(file)?);
    }
    let p = MeshSequenceParams {
        base: base.map(AssetPath::from),
        fps: Some(Rate::hz(60)),
        ..read(&[("path", Datum::Text(path.into()))])
    };
    let mut standalone = Standalone::new::<MeshSequence>(p);
    standalone.files = files;
    Some(Output::of(&standalone, MeshSequencePorts::mesh))
}

fn contacts(cloth: &Output<Mesh>, bodies: &[Output<Mesh>], p: ContactDetectorParams) -> Output<Contacts> {
    let mut standalone =
        Standalone::new::<ContactDetector>(p).feed(ContactDetectorPorts::mesh.index(), cloth.feed());
    for body in bodies {
        standalone = standalone.feed(ContactDetectorPorts::others.index(), body.feed());
    }
    Output::of(&standalone, ContactDetectorPorts::contacts)
}

#[test]
fn the_cotton_sheet_has_the_contacts_of_its_notes_and_makes_sound() {
    let name = |end: &str| format!("{SHEET}{end}");
    let Some(cloth) = mesh(&name(".pc2"), Some(&name(".obj"))) else {
        eprintln!("skipped: no simulated cloth");
        return;
    };
    let bodies: Vec<_> = [("floor", false), ("cylinder", false), ("wall1", true), ("wall2", true)]
        .iter()
        .filter_map(|(body, moves)| {
            let obj = name(&format!(".body_{body}.obj"));
            let pc2 = name(&format!(".body_{body}.pc2"));
            if *moves { mesh(&pc2, Some(&obj)) } else { mesh(&obj, None) }
        })
        .collect();
    assert_eq!((cloth.data.len(), bodies.len()), (420 * 2500, 4));
    let alone = ContactDetectorParams { radius: 0.016, ..read(&[]) };
    let own = contacts(&cloth, &[], alone.clone());
    let others = ContactDetectorParams { radius: 0.010, self_contact: false, ..alone.clone() };
    let body = contacts(&cloth, &bodies, others);
    let all = contacts(&cloth, &bodies, alone);
    let slides = |c: &Contact| c.is_some() && c.slide * 60.0 > 0.02;
    // While only the floor is near, the contacts are the vertices within the radius of it.
    for frame in [0, 60, 120, 180, 240] {
        let vertices = frame * 2500..(frame + 1) * 2500;
        let touching = body.data[vertices.clone()].iter().filter(|c| c.is_some()).count();
        let low = cloth.data[vertices].iter().filter(|p| p[2].abs() <= 0.01).count();
        assert_eq!(touching, low, "frame {frame}");
    }
    let sliding = own.data.iter().filter(|c| slides(c)).count() as f64 / 420.0;

    let standalone = Standalone::new::<SlidingSpeed>(read::<SlidingSpeedParams>(&[]))
        .feed(SlidingSpeedPorts::contacts.index(), all.feed());
    let speeds: Output<Speeds> = Output::of(&standalone, SlidingSpeedPorts::speeds);
    let paths = [1, 2, 3].map(|k| format!("recordings/cloth/clothing_rustle_{k}.flac"));
    let paths: Vec<String> =
        paths.into_iter().chain(["recordings/cloth/clothing_rustle_land.flac".into()]).collect();
    let list = Datum::List(paths.iter().cloned().map(Datum::Text).collect());
    let speeds_assumed = [("slowest", Datum::Float(0.02)), ("fastest", Datum::Float(4.0))];
    let given = [("recordings", list)].into_iter().chain(speeds_assumed).collect::<Vec<_>>();
    let mut standalone =
        Standalone::func::<FrictionModelFromClips>(read::<FrictionModelFromClipsParams>(&given));
    for path in &paths {
        let Some(bytes) = data(path) else { return };
        standalone.files.insert(path, bytes);
    }
    let run = standalone.run().unwrap();
    let value = run.value(0).unwrap();
    let model = value.get::<FrictionModel>().unwrap().clone();
    assert!((value.kind().plot)(&value).is_some_and(|svg| svg.contains("<polyline")));
    let standalone = Standalone::new::<IftNoiseNode>(read::<IftNoiseNodeParams>(&[]))
        .feed(IftNoisePorts::speeds.index(), speeds.feed())
        .value(IftNoisePorts::model, model);
    let audio: Output<f32> = Output::of(&standalone, IftNoisePorts::audio);

    // The notes on the data: 243 self contacts on average, 213 of them sliding, and 542 with bodies. They cover some of the frames only
    // and exclude by rings of edges, so the figures are similar and not equal.
    let similar = |found: f64, noted: f64| assert!((found / noted - 1.0).abs() < 0.35, "{found} {noted}");
    similar(own.summary_value("contacts_per_frame"), 243.0);
    similar(sliding, 213.0);
    similar(body.summary_value("contacts_per_frame"), 542.0);
    assert_eq!(audio.data.len(), 7 * 48_000);
    assert!(audio.data.iter().all(|x| x.is_finite()) && audio.summary_value("peak") > 1e-4);
    assert!(audio.summary_value("share_above") < 0.01, "{:?}", audio.summary);
}

#[test]
fn alembic_and_gltf_files_are_streamed_at_the_rate_of_their_frames() {
    let sheet = ("cloth/sheet_on_couch_pulled_off.abc", Some("/cloth/cloth"), 2668, 60);
    for (path, object, vertices, hz) in [sheet, ("cloth/small_sheet_drag_30fps.glb", None, 900, 30)] {
        let Some(bytes) = data(path) else {
            eprintln!("skipped: no {path}");
            continue;
        };
        let given = [("path", Datum::Text(path.into())), ("up", Datum::Name("Y".into()))];
        let p = MeshSequenceParams { object: object.map(Text::from), ..read(&given) };
        let mut standalone = Standalone::new::<MeshSequence>(p);
        standalone.files.insert(path, bytes);
        let made: Output<Mesh> = Output::of(&standalone, MeshSequencePorts::mesh);
        assert_eq!((made.shape.rate, made.shape.width), (Rate::hz(hz), vertices));
        assert!(made.data.len() > 100 * vertices && made.data.iter().all(|p| p[2] > -0.1 && p[2] < 3.0));
    }
}
