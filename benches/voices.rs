//! 128 voices of all kinds at once, live: impacts, scrapes, rustles of sheets of 216 vertices, sound textures and grains, at 48 kHz in windows of 256,
//! on a clock without a card.
//!
//! `cargo bench -p foley -- voices`, or `-- voices 600` for ten minutes instead of one. Budget: one core for everything, and no window late.

use crate::common::{live_graph, play};
use foley::graph::LoadOptions;
use foley::live::LiveGraph;
use std::fmt::Write as _;
use std::path::Path;

/// Voices of each of the four kinds.
const EACH: usize = 32;
const RATE: u32 = 48_000;
const QUANTUM: usize = 256;

/// A graph of all voices, and the impacts that some of them read. The sheets are a metre long for each second, so that they touch until the end.
fn graph(seconds: f64) -> (String, String) {
    let mut impacts = "time_s,object,velocity,mass,hardness,point\n".to_owned();
    for k in 0..(seconds / 0.31) as usize {
        let (time, speed) = (0.05 + 0.31 * k as f64, 0.5 + 0.1 * (k * 7 % 5) as f64);
        let _ = writeln!(impacts, "{time:.3},bar,{speed},0.02,0.3,0");
    }
    let mut nodes = String::new();
    let mut voices = Vec::new();
    for k in 0..EACH {
        let (speed, pitch) = (0.2 + 0.01 * k as f64, 0.5 + k as f64 / EACH as f64);
        let _ = write!(
            nodes,
            "\"force{k}\": ImpactForce(impacts: \"impacts\", object: 0, tau: 0.0003, rate: {RATE}),
            \"strike{k}\": ModalBank(forces: [\"force{k}\"], modes: \"modes\", gain: 0.05, pitch: {pitch}),
            \"stroke{k}\": Stroke(shape: Circle, from: [0.7, 0.7], radius: 0.3, laps: 400, speed: {speed}),
            \"rub{k}\": TwoTextures(paths: \"stroke{k}\", a: \"tiles\", radius: 0.02, mass: 0.1, rate: {RATE}),
            \"scrape{k}\": ModalBank(forces: [\"rub{k}\"], modes: \"modes\", gain: 0.05, pitch: {pitch}),
            \"sheet{k}\": MeshGenerator(kind: Planes, speed: {speed}, duration: {seconds:?}, size: [{seconds:?}, 0.2], vertices: [36, 3]),
            \"contacts{k}\": ContactDetector(mesh: \"sheet{k}\", radius: 0.02),
            \"speed{k}\": SlidingSpeed(contacts: \"contacts{k}\", gate: Causal, between: Hold, rate: 40),
            \"rustle{k}\": IftNoise(speeds: \"speed{k}\", model: \"model\", rate: {RATE}, motion_at: Start, level: 0.05),
            "
        );
        voices.extend([format!("strike{k}"), format!("scrape{k}"), format!("rustle{k}")]);
        if k % 2 == 0 {
            let _ = writeln!(
                nodes,
                "\"texture{k}\": TextureSynthesis(model: \"texture\", duration: {seconds:?}, rate: {RATE}),"
            );
            voices.push(format!("texture{k}.audio"));
        } else {
            let _ = writeln!(
                nodes,
                "\"grains{k}\": GrainRetarget(dictionary: \"grains.dictionary\", triggers: \"triggers\", triggered: [\"wood hit\"], gain: 0.1, rate: {RATE}),"
            );
            voices.push(format!("grains{k}"));
        }
    }
    let voices: Vec<String> = voices.iter().map(|voice| format!("{voice:?}")).collect();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets");
    let assets = assets.display();
    let text = format!(
        "#![schema = \"foley:graph/1\"]\nGraph(seed: 3, nodes: {{
        \"impacts\": ImpactFile(path: \"impacts.csv\", objects: [\"bar\"]),
        \"modes\": ModalFromRecording(recording: \"{assets}/recordings/glass_hit_a1.flac\", impulse: 0.03),
        \"tiles\": ImageLuma(path: \"{assets}/images/tiles.png\", density: 512.0, depth: 0.001),
        \"model\": FrictionModelFromClips(recordings: [\"{assets}/recordings/blanket_movement_3.flac\"]),
        \"tree\": WaveletTree(recordings: [\"{assets}/recordings/birds.ogg\"], rate: {RATE}),
        \"texture\": TextureModel(tree: \"tree\"),
        \"recordings\": GrainRecordings(manifest: \"{assets}/recordings/grains.csv\", rate: {RATE}),
        \"grains\": GrainDictionary(recordings: \"recordings\"),
        \"triggers\": TriggerFile(path: \"{assets}/impact/taps.csv\"),
        {nodes}
        \"all\": Mix(inputs: [{}]),
        \"level\": Gain(audio: \"all\", gain: 0.1),
        \"out\": WavOut(audio: \"level\", path: \"voices.wav\"),\n}})",
        voices.join(", ")
    );
    (text, impacts)
}

fn loaded(folder: &Path, seconds: f64) -> LiveGraph {
    let (text, impacts) = graph(seconds + 2.0);
    let path = folder.join("voices.ron");
    std::fs::write(&path, text).expect("the folder can be written");
    std::fs::write(folder.join("impacts.csv"), impacts).expect("the folder can be written");
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets");
    live_graph(&path, &LoadOptions::default().allow_read(assets))
}

pub fn bench() {
    let seconds: f64 = std::env::args().skip(1).find_map(|arg| arg.parse().ok()).unwrap_or(60.0);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let played = play(loaded(folder.path(), seconds), QUANTUM, RATE, seconds);
    let (voices, length) = (4 * EACH, played.seconds);
    println!("{voices} voices, {RATE} Hz in windows of {QUANTUM}, {length:.0} s on a clock without a card:");
    println!("  callback {:>6.1} % of a core", played.callback_share());
    played.print();
}
