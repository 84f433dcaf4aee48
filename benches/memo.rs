//! Time that the cache saves: a graph of 30 nodes, run with an empty cache, then after an edit of its last, a middle
//! and its first parameter, each against the same run without the cache.
//!
//! `cargo bench -p foley -- memo`

use foley::memo::{MEMORY, Memo};
use foley::run::Report;
use std::fmt::Write as _;
use std::path::Path;

/// The parameters that are edited.
#[derive(Clone, Copy)]
struct Edit {
    /// Speed of the first mesh.
    first: f64,
    /// Level of the friction sound, before the loop of filters.
    middle: f64,
    /// Level of the output.
    last: f64,
}

const START: Edit = Edit { first: 0.4, middle: 0.3, last: -3.0 };

/// Two cloths over one model of recordings: values, heavy streams, light streams, and a fold.
fn text(edit: &Edit) -> String {
    let Edit { first, middle, last } = edit;
    let mut text = String::from("#![schema = \"foley:graph/1\"]\nGraph(seed: 3, nodes: {\n");
    let recordings: Vec<String> = (1..4).map(|k| format!("\"clothing_rustle_{k}.flac\"")).collect();
    let _ = writeln!(text, "\"model\": FrictionModelFromClips(recordings: [{}]),", recordings.join(", "));
    for (k, speed) in [(0, first), (1, &0.25)] {
        let _ = writeln!(
            text,
            "\"planes{k}\": MeshGenerator(kind: Planes, speed: {speed:?}, duration: 4.0, size: [0.4, 0.4]),
            \"contacts{k}\": ContactDetector(mesh: \"planes{k}\", radius: 0.02),
            \"speed{k}\": SlidingSpeed(contacts: \"contacts{k}\"),
            \"sound{k}\": IftNoise(speeds: \"speed{k}\", model: \"model\", rate: 48000, level: {middle:?}),"
        );
    }
    let _ = writeln!(text, "\"f0\": Mix(inputs: [\"sound0\", \"sound1\"]),");
    for k in 1..=17 {
        let frequency = 100.0 * f64::from(k);
        let _ = writeln!(
            text,
            "\"f{k}\": Biquad(audio: \"f{}\", kind: Peak, frequency: {frequency:?}, q: 2.0),",
            k - 1
        );
    }
    text += "\"level\": Loudness(audio: \"f17\"),\n";
    let _ = writeln!(text, "\"even\": Normalize(audio: \"f17\", level: \"level\", peak_db: {last:?}),");
    text += "\"out\": WavOut(audio: \"even\", path: \"out.wav\"),\n})\n";
    text
}

fn run_once(folder: &Path, edit: &Edit, memo: Option<&Memo>) -> (f64, Report, Vec<u8>) {
    let (seconds, report) = crate::common::run_text(folder, &text(edit), memo);
    (seconds, report, std::fs::read(folder.join("out/out.wav")).unwrap_or_default())
}

pub fn bench() {
    let folder = tempfile::tempdir().expect("a folder for the bench");
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/assets/recordings");
    for k in 1..4 {
        let name = format!("clothing_rustle_{k}.flac");
        std::fs::copy(assets.join(&name), folder.path().join(&name)).expect("a recording of the examples");
    }
    let graph = folder.path().join("graph.ron");
    let fresh = || Memo::new(folder.path().join("cache"), 1 << 30, &graph);
    let (plain, ..) = run_once(folder.path(), &START, None);
    let (cold, report, _) = run_once(folder.path(), &START, Some(&fresh()));
    println!("{} nodes, {:.1} s of sound; seconds of a run, two threads", report.nodes.len(), report.length);
    println!("{:<34} {:>8} {:>8} {:>8}  cached, computed", "", "disk", "memory", "no memo");
    println!("{:<34} {cold:>8.3} {:>8} {plain:>8.3}", "cold", "");
    let edits = [
        ("nothing", START, START),
        ("last (even.peak_db)", Edit { last: -4.0, ..START }, Edit { last: -5.0, ..START }),
        ("middle (sound.level)", Edit { middle: 0.2, ..START }, Edit { middle: 0.25, ..START }),
        ("first (planes0.speed)", Edit { first: 0.5, ..START }, Edit { first: 0.45, ..START }),
    ];
    for (name, one, other) in edits {
        let (disk, report, wav) = run_once(folder.path(), &one, Some(&fresh()));
        let (plain, _, wanted) = run_once(folder.path(), &one, None);
        assert!(wav == wanted, "{name}: another result with the memo");
        let held = fresh().with_memory(MEMORY);
        run_once(folder.path(), &START, Some(&held));
        let (memory, ..) = run_once(folder.path(), &other, Some(&held));
        let (cached, computed) = (report.nodes.iter().filter(|n| n.cached).count(), report.computed().len());
        println!(
            "{name:<34} {disk:>8.3} {memory:>8.3} {plain:>8.3}  {cached}, {computed}  ({:.1} times faster)",
            plain / disk
        );
    }
    let entries = fresh().store().list();
    let bytes: u64 = entries.iter().map(|l| l.bytes).sum();
    println!("{} entries on disk, {:.1} MB", entries.len(), bytes as f64 / 1e6);
}
