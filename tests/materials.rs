//! Several materials in one scene: each pair of them sounds with its own model, and only where it slides.

mod common;

use foley::graph::{DirFiles, Limits, load_text};
use foley::plan::PlanOptions;
use foley_nodes::io::AudioReader;
use std::path::Path;

/// A sheet that slides over two floors, slowly and then fast; what is heard of each pair, one file each.
fn scene(left: &str, right: &str) -> String {
    let model = |id: &str, name: &str| {
        format!(
            "\"{id}\": FrictionModelFromClips(recordings: [\"clothing_rustle_{name}.flac\"], materials: [\"{id}\", \"{id}\"]),"
        )
    };
    let pair = |id: &str| {
        format!(
            "\"{id}\": MaterialRouter(contacts: \"contacts\", between: [\"cotton\", \"{id}\"]),
            \"{id}_speed\": SlidingSpeed(contacts: \"{id}\"),
            \"{id}_sound\": IftNoise(speeds: \"{id}_speed\", model: \"{id}_model\", rate: 16000),
            \"{id}_out\": WavOut(audio: \"{id}_sound\", path: \"{id}.wav\"),"
        )
    };
    let floor = |id: &str, material: &str, x: f64| {
        format!(
            "\"{id}\": MeshGenerator(kind: Sheet, speed: 0.0, duration: 3.0, vertices: [5, 5], place: [{x:?}, 0.0, -0.005], material: \"{material}\"),"
        )
    };
    format!(
        "#![schema = \"foley:graph/1\"]
        Graph(seed: 3, nodes: {{
            \"sheet\": MeshGenerator(kind: Sheet, speed: 0.8, duration: 3.0, vertices: [9, 9], size: [0.5, 0.5], place: [-1.0, 0.0, 0.0], material: \"cotton\"),
            {} {}
            \"contacts\": ContactDetector(mesh: \"sheet\", others: [\"left\", \"right\"], radius: 0.01),
            {} {} {} {}
        }})",
        floor("left", left, -1.5),
        floor("right", right, 1.5),
        model("wool_model", "2"),
        model("nylon_model", "3"),
        pair("wool"),
        pair("nylon"),
    )
}

/// What was heard, in bits.
fn heard(folder: &Path, name: &str) -> Vec<u32> {
    let file = std::fs::File::open(folder.join(name)).unwrap();
    let samples = AudioReader::open(Box::new(file)).unwrap().read_mono().unwrap();
    samples.iter().map(|x| x.to_bits()).collect()
}

fn run(text: &str) -> [Vec<u32>; 2] {
    let folder = tempfile::tempdir().unwrap();
    let path = common::graphs().join("assets/recordings/test.ron");
    let loaded = load_text("test.ron", text, &path, &[]);
    let shown = foley::diag::render(&loaded.diagnostics, &loaded.sources, false);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{shown}"));
    let files = DirFiles::new(loaded.root, Limits::default());
    common::run_graph(&graph, &files, &PlanOptions::default(), folder.path()).unwrap();
    ["wool.wav", "nylon.wav"].map(|name| heard(folder.path(), name))
}

/// First and last sample that is not silent.
fn sounding(samples: &[u32]) -> Option<(usize, usize)> {
    let loud = |bits: &u32| f32::from_bits(*bits) != 0.0;
    Some((samples.iter().position(loud)?, samples.iter().rposition(loud)?))
}

#[test]
fn each_pair_is_heard_only_while_it_slides_and_swapped_materials_swap_places() {
    let [wool, nylon] = run(&scene("wool", "nylon"));
    // The floors are 1 m wide and 2 m apart: the sheet leaves the left one before it comes to the right one.
    let (first, second) = (sounding(&wool).unwrap(), sounding(&nylon).unwrap());
    assert!(first.1 < second.0, "{first:?} {second:?}");
    let [wool, nylon] = run(&scene("nylon", "wool"));
    let (later, earlier) = (sounding(&wool).unwrap(), sounding(&nylon).unwrap());
    assert!(earlier.0.abs_diff(first.0) < 20 && later.0.abs_diff(second.0) < 20, "{earlier:?} {later:?}");
    // The same material on both sides is one material.
    let one = scene("wool", "wool").replace("\"cotton\", \"nylon\"", "\"cotton\", \"wool\"");
    let [both, _] = run(&one);
    assert_eq!(sounding(&both), Some((first.0, later.1)));
}
