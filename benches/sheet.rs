//! Time from an edit of the warp to a new file, with everything before the edit cached: of a minute of cloth at 96 kHz
//! over almost four minutes of recordings, as in the paper's cotton sheet, and of `graphs/cloth/sheet.ron` with a
//! minute of motion.
//!
//! `cargo bench -p foley -- sheet`

use foley::graph::Override;
use foley::memo::{MEMORY, Memo};
use foley::run::Report;
use foley_nodes::core::random::Random;
use std::path::{Path, PathBuf};

const RATE: u32 = 96_000;

/// Noise whose level and colour wander, as a hand that rubs a cloth makes it.
fn recording(seed: u64, seconds: f64) -> Vec<f32> {
    let random = Random::new(seed, "recording");
    let (mut low, mut out) = (0.0_f64, Vec::new());
    for i in 0..(seconds * f64::from(RATE)) as u64 {
        let time = i as f64 / f64::from(RATE);
        let wander = |f: f64| 0.5 + 0.5 * (f * time + seed as f64).sin();
        let colour = 0.02 + 0.9 * wander(3.1);
        low += colour * (random.uniform(0, i, 0) - 0.5 - low);
        out.push((0.5 * wander(1.7).powi(3) * low) as f32);
    }
    out
}

fn write(path: &Path, samples: &[f32]) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(path, spec).expect("the folder can be written");
    samples.iter().for_each(|&x| writer.write_sample(x).expect("the folder can be written"));
    writer.finalize().expect("the folder can be written");
}

fn text(lambda: f64) -> String {
    format!(
        "#![schema = \"foley:graph/1\"]
        Graph(seed: 3, nodes: {{
            \"model\": FrictionModelFromClips(recordings: [\"take0.wav\"]),
            \"planes\": MeshGenerator(kind: Planes, vertices: [36, 36], speed: 0.4, duration: 60.0),
            \"contacts\": ContactDetector(mesh: \"planes\", radius: 0.02),
            \"speed\": SlidingSpeed(contacts: \"contacts\"),
            \"steady\": IftNoise(speeds: \"speed\", model: \"model\", rate: 96000),
            \"hand\": WavIn(path: \"hand.wav\"),
            \"target\": Mix(inputs: [\"steady\", \"hand\"]),
            \"database\": UnitDatabase(recordings: [\"take0.wav\", \"take1.wav\", \"take2.wav\"], rate: 96000),
            \"mfcc\": Mfcc(audio: \"target\"),
            \"features\": TemporalGaussian(features: \"mfcc.features\"),
            \"pairs\": CorrespondenceSet(path: \"pairs.ron\"),
            \"fit\": TpsFit(features: \"features\", database: \"database\", pairs: \"pairs\", lambda: {lambda:?}),
            \"warped\": TpsWarp(features: \"features\", warp: \"fit\"),
            \"selector\": UnitSelector(features: \"warped\", database: \"database\"),
            \"audio\": UnitConcatenator(picks: \"selector\", database: \"database\", target: \"target\"),
            \"out\": WavOut(audio: \"audio\", path: \"out.wav\"),
        }})"
    )
}

/// 14 correspondences, as many as in the paper for cotton; correspondence `moved` starts a little later.
fn pairs(moved: usize) -> String {
    let mut text = String::from("Correspondences(pairs: [\n");
    for k in 0..14 {
        let shift = if k == moved { 0.05 } else { 0.0 };
        text += &format!(
            "(target: {:?}, source: {}, database: {:?}, duration: 0.2),\n",
            4.0 * k as f64 + shift,
            k % 3,
            5.0 * k as f64
        );
    }
    text + "])\n"
}

fn run_once(folder: &Path, lambda: f64, memo: &Memo) -> (f64, Report) {
    crate::common::run_text(folder, &text(lambda), Some(memo))
}

pub fn bench() {
    let folder = tempfile::tempdir().expect("a folder for the bench");
    let folder = folder.path();
    for k in 0..3 {
        write(&folder.join(format!("take{k}.wav")), &recording(k, 75.0));
    }
    write(&folder.join("hand.wav"), &recording(9, 60.0));
    std::fs::write(folder.join("pairs.ron"), pairs(99)).expect("the folder can be written");
    let graph = folder.join("graph.ron");
    let fresh = || Memo::new(folder.join("cache"), 2 << 30, &graph);
    let reported = |what: &str, (seconds, report): (f64, Report)| {
        let (cached, computed) = (report.nodes.iter().filter(|n| n.cached).count(), report.computed());
        println!("{what:<44} {seconds:>7.3} s  {cached} cached, computed: {}", computed.join(", "));
    };
    println!(
        "60 s at 96 kHz, 14400 targets, 225 s of recordings, two threads; from load to the written file. An edit may take 2 s (paper: 5 to \
         197 s to choose units again, and up to 3 hours of edits for a warp)"
    );
    reported("cold", run_once(folder, 100.0, &fresh()));
    reported("another lambda, cache on disk", run_once(folder, 1000.0, &fresh()));
    std::fs::write(folder.join("pairs.ron"), pairs(5)).expect("the folder can be written");
    reported("a correspondence moved, cache on disk", run_once(folder, 1000.0, &fresh()));
    let held = fresh().with_memory(MEMORY);
    run_once(folder, 1000.0, &held);
    reported("another lambda, watching", run_once(folder, 10.0, &held));
    std::fs::write(folder.join("pairs.ron"), pairs(7)).expect("the folder can be written");
    reported("a correspondence moved, watching", run_once(folder, 10.0, &held));
    shipped(&folder.join("shipped"));
    sleep(folder);
}

/// Frames of a minute.
const FRAMES: usize = 3600;

/// Extends a point cache to and fro until it is long enough; its mesh lies beside it.
fn longer(name: &str, folder: &Path) -> PathBuf {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets/cloth").join(name);
    let cache = std::fs::read(from.with_extension("pc2")).expect("the animation ships");
    let (head, frames) = cache.split_at(32);
    let points = i32::from_le_bytes(head[16..20].try_into().expect("four bytes")) as usize;
    let frames: Vec<&[u8]> = frames.chunks_exact(12 * points).collect();
    let turn = 2 * (frames.len() - 1);
    let mut long = head[..28].to_vec();
    long.extend((FRAMES as i32).to_le_bytes());
    for k in 0..FRAMES {
        let at = k % turn;
        long.extend(frames[at.min(turn - at)]);
    }
    let to = folder.join(name).with_extension("pc2");
    std::fs::write(&to, long).expect("the folder can be written");
    std::fs::copy(from.with_extension("obj"), to.with_extension("obj")).expect("the folder can be written");
    to
}

/// The graph that ships, over a minute of its own animation, to and fro.
fn shipped(folder: &Path) {
    std::fs::create_dir_all(folder).expect("the folder can be written");
    let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    let marked = std::fs::read_to_string(graphs.join("assets/cloth/sheet.correspondences.ron"));
    let marked = marked.expect("the correspondences ship");
    let pairs = folder.join("pairs.ron");
    let mark = |seconds: &str| {
        let text = marked.replacen("duration: 0.1", &format!("duration: {seconds}"), 1);
        std::fs::write(&pairs, text).expect("the folder can be written");
    };
    let path = |of: &str, path: &Path| Override {
        target: format!("{of}.path"),
        value: format!("{:?}", path.display().to_string()),
    };
    let of = |body: &str| longer(&format!("cotton_sheet_drag_drop_crumple{body}"), folder);
    let mut sets = vec![
        path("sheet", &of("")),
        path("wall1", &of(".body_wall1")),
        path("wall2", &of(".body_wall2")),
        path("cotton.recomposed.pairs", &pairs),
        Override { target: "lambda".into(), value: "100.0".into() },
    ];
    let graph = graphs.join("cloth/sheet.ron");
    let memo = || Memo::new(folder.join("cache"), 2 << 30, &graph);
    let mut run = |what: &str, lambda: &str, seconds: &str| {
        mark(seconds);
        if let Some(last) = sets.last_mut() {
            last.value = lambda.into();
        }
        let (seconds, report) = crate::common::run_file(&graph, &sets, folder, Some(&memo()));
        let cached = report.nodes.iter().filter(|n| n.cached).count();
        println!(
            "sheet.ron over {FRAMES} frames, {what:<28} {seconds:>7.3} s  {cached} of {} nodes cached",
            report.nodes.len()
        );
    };
    run("cold", "100.0", "0.1");
    run("another lambda", "1000.0", "0.1");
    // Shorter: a longer one may leave its recording.
    run("a correspondence changed", "1000.0", "0.08");
}

/// Time that sleep saves on an example take with two materials, one of which is silent for a while.
fn sleep(folder: &Path) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/cloth/two_materials.ron");
    for id in ["itself_units", "cover_units"] {
        let run = |keep: bool| {
            let sets =
                [Override { target: format!("{id}.selector.keep_room_tone"), value: keep.to_string() }];
            let (_, report) = crate::common::run_file(&path, &sets, folder, None);
            let node = report.nodes.iter().find(|n| n.id == format!("{id}.selector"));
            node.map_or((0.0, 0.0), |n| {
                let share = n.summary.get("asleep_share").and_then(serde_json::Value::as_f64);
                (n.time.as_secs_f64() * 1e3, share.unwrap_or(0.0))
            })
        };
        let ((awake, _), (asleep, share)) = (run(true), run(false));
        println!(
            "two_materials.ron, choice for {id}: {asleep:.1} ms with sleep ({:.0} % of the units), {awake:.1} ms without",
            100.0 * share
        );
    }
}
