//! The promises of the cache: values are cached from run to run, and no result depends on the cache.

use crate::common::project::{LEVEL, MODEL, Project, cached, calls, foley, warned};
use foley::graph::{DirFiles, Limits, LoadOptions, load};
use foley::memo::{Memo, RunCache, Store, changes, default_dir};
use foley::plan::{Plan, PlanOptions};
use foley::run::Report;
use foley_nodes::core::random::Rng;
use std::collections::HashSet;
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn a_second_run_takes_a_fold_from_the_cache_and_skips_its_phase() {
    let project = Project::new(LEVEL);
    let first = project.run();
    let wav = project.out("loud.wav");
    assert!(!cached(&first, "measured") && calls(&first, "measured") > 0);
    let second = project.run();
    assert!(cached(&second, "measured"));
    assert_eq!(calls(&second, "measured"), 0);
    assert_eq!(2 * calls(&second, "noise"), calls(&first, "noise"));
    assert_eq!(project.out("loud.wav"), wav);
    let summary = |r: &Report| r.nodes.iter().find(|n| n.id == "measured").unwrap().summary.clone();
    assert_eq!(summary(&first), summary(&second));
}

#[test]
fn a_cached_fold_is_skipped_in_a_phase_that_runs_for_a_writer() {
    let also = LEVEL.replace("\"out\":", "\"raw\": WavOut(audio: \"soft\", path: \"raw.wav\"), \"out\":");
    let project = Project::new(&also);
    project.run();
    let report = project.run();
    assert!(cached(&report, "measured") && calls(&report, "measured") == 0);
    assert!(!project.out("raw.wav").is_empty());
    assert_eq!(project.entries().len(), 1);
    project.edit(LEVEL);
    assert!(cached(&project.run(), "measured"));
}

#[test]
fn a_parameter_does_not_recompute_the_nodes_upstream() {
    let project = Project::new(LEVEL);
    project.run();
    project.edit(&LEVEL.replace("peak_db: -6.0", "peak_db: -12.0"));
    assert!(cached(&project.run(), "measured"));
    let stored = project.out("loud.wav");
    project.run_with(false, &PlanOptions::default(), None);
    assert_eq!(project.out("loud.wav"), stored);

    let project = Project::new(MODEL);
    assert!(!cached(&project.run(), "model"));
    project.edit(&MODEL.replace("level: 0.3", "level: 0.2"));
    assert!(cached(&project.run(), "model"));
}

/// A sound put together from units of recordings, through a warp from a user's correspondences.
const WARPED: &str = "#![schema = \"foley:graph/1\"]
Graph(
    nodes: {
        \"database\": UnitDatabase(recordings: [\"a.wav\", \"b.wav\"], widths: [10, 10, 10]),
        \"target\": WavIn(path: \"c.wav\"),
        \"mfcc\": Mfcc(audio: \"target\"),
        \"features\": TemporalGaussian(features: \"mfcc.features\", widths: [10, 10, 10]),
        \"pairs\": CorrespondenceSet(path: \"pairs.ron\"),
        \"fit\": TpsFit(features: \"features\", database: \"database\", pairs: \"pairs\", lambda: 10.0),
        \"warped\": TpsWarp(features: \"features\", warp: \"fit\"),
        \"selector\": UnitSelector(features: \"warped\", database: \"database\", d_max: 3.0),
        \"audio\": UnitConcatenator(picks: \"selector\", database: \"database\", target: \"target\"),
        \"out\": WavOut(audio: \"audio\", path: \"out.wav\"),
    },
)
";

#[test]
fn another_correspondence_fits_and_warps_again_and_loads_no_audio() {
    let project = Project::new(WARPED);
    for (name, seed) in [("a.wav", 3), ("b.wav", 4), ("c.wav", 5)] {
        project.record(name, seed);
    }
    let pairs = |database: f64| {
        let more = "(target: 0.3, source: 1, database: 0.1, duration: 0.1), (target: 0.05, database: 0.35, duration: 0.05)";
        let text =
            format!("Correspondences(pairs: [(target: 0.1, database: {database}, duration: 0.1), {more}])");
        fs::write(project.path("pairs.ron"), text).unwrap();
    };
    let after = ["fit", "warped", "selector", "audio", "out"];
    pairs(0.3);
    let first = project.run();
    assert!(["database", "pairs", "target"].iter().chain(&after).all(|id| !cached(&first, id)));
    let sound = project.out("out.wav");
    // A change of the recording would be detected: the database is not made again, from cache or files.
    pairs(0.2);
    let second = project.run();
    assert!(cached(&second, "database") && calls(&second, "database") == 0, "{second:?}");
    assert!(after.iter().all(|id| !cached(&second, id)) && calls(&second, "fit") > 0, "{second:?}");
    assert!(["warped", "selector", "audio"].iter().all(|id| calls(&second, id) > 0));
    let other = project.out("out.wav");
    assert!(other != sound);
    project.run_with(false, &PlanOptions::default(), None);
    assert_eq!(project.out("out.wav"), other, "the same as all of it anew");
    // Back again, the first fit is cached too.
    pairs(0.3);
    let third = project.run();
    assert!(cached(&third, "database") && cached(&third, "fit") && project.out("out.wav") == sound);
}

#[test]
fn every_parameter_upstream_of_a_fold_recomputes_it_and_window_and_threads_do_not() {
    let project = Project::new(LEVEL);
    project.run();
    for (from, to) in [("gain: 0.5", "gain: 0.25"), ("seed: 5", "seed: 6"), ("\"soft\"", "\"quiet\"")] {
        project.edit(&LEVEL.replace(from, to));
        assert!(!cached(&project.run(), "measured"), "{to}");
    }
    project.edit(LEVEL);
    let window = PlanOptions { window: PlanOptions::default().window / 3, threads: 2, ..Default::default() };
    assert!(cached(&project.run_with(true, &window, None), "measured"));
    let until = PlanOptions { until: Some(PlanOptions::default().window * 5), ..Default::default() };
    assert!(!cached(&project.run_with(true, &until, None), "measured"));
}

#[test]
fn a_node_on_a_feedback_loop_counts_wherever_it_stands() {
    let text = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"noise\": Noise(level: 0.1, rate: 8000, duration: Some(0.3)),
    \"mix\": Mix(inputs: [\"noise\", \"back\"]),
    \"soft\": Gain(audio: \"mix\", gain: 0.5),
    \"back\": Feedback(audio: \"soft\", like: \"noise\", delay: 0.05, gain: 0.5, tail: 0.1),
    \"measured\": Loudness(audio: \"mix\"),
    \"loud\": Normalize(audio: \"mix\", level: \"measured\"),
    \"out\": WavOut(audio: \"loud\", path: \"loud.wav\"),
})";
    let project = Project::new(text);
    project.run();
    assert!(cached(&project.run(), "measured"));
    project.edit(&text.replace("audio: \"mix\", gain: 0.5", "audio: \"mix\", gain: -0.9"));
    assert!(!cached(&project.run(), "measured"));
}

#[test]
fn the_content_of_a_recording_counts_and_not_its_time() {
    let project = Project::new(MODEL);
    project.run();
    let time = fs::metadata(project.path("b.wav")).unwrap().modified().unwrap();
    let bytes = fs::read(project.path("b.wav")).unwrap();
    // The same bytes, written again.
    fs::write(project.path("b.wav"), &bytes).unwrap();
    assert!(cached(&project.run(), "model"));
    // Other bytes under the same name, length and time.
    project.record("b.wav", 9);
    assert_eq!(fs::metadata(project.path("b.wav")).unwrap().len(), bytes.len() as u64);
    fs::File::options().append(true).open(project.path("b.wav")).unwrap().set_modified(time).unwrap();
    assert!(!cached(&project.run(), "model"));
    // And back: the first entry is still cached.
    fs::write(project.path("b.wav"), &bytes).unwrap();
    assert!(cached(&project.run(), "model"));
}

#[test]
fn a_changed_node_that_gives_an_equal_value_stops_the_recomputation_below_it() {
    let text = LEVEL.replace(
        "\"out\":",
        "\"second\": Loudness(audio: \"loud\"), \"equal\": Normalize(audio: \"loud\", level: \"second\"), \"out\":",
    );
    let text = text.replace("audio: \"loud\", path", "audio: \"equal\", path");
    let project = Project::new(&text);
    project.run();
    // `measured` reads the noise through another gain of 1, so it has another key and an equal value.
    let refit = text.replace(
        "\"measured\": Loudness(audio: \"soft\")",
        "\"same\": Gain(audio: \"soft\", gain: 1.0), \"measured\": Loudness(audio: \"same\")",
    );
    project.edit(&refit);
    let report = project.run();
    assert!(!cached(&report, "measured"));
    assert!(cached(&report, "second"));
}

#[test]
fn unusable_entries_are_computed_again_with_a_warning() {
    let project = Project::new(MODEL);
    project.run();
    let wav = project.out("sound.wav");
    let entries = project.entries();
    assert_eq!(entries.len(), 1);
    let whole = fs::read(&entries[0]).unwrap();
    let mut flipped = whole.clone();
    *flipped.last_mut().unwrap() ^= 1;
    let mut version = whole.clone();
    version[8] = 99;
    let damaged: [(&str, Vec<u8>); 6] = [
        ("damaged", flipped),
        ("cut short", whole[..whole.len() / 2].to_vec()),
        ("cut short", Vec::new()),
        ("another kind of file", vec![b'x'; 4000]),
        ("format 99", version),
        ("another key", {
            // A whole entry of something else, under this name.
            let other = Project::new(LEVEL);
            other.run();
            fs::read(&other.entries()[0]).unwrap()
        }),
    ];
    for (what, bytes) in damaged {
        fs::write(&entries[0], bytes).unwrap();
        let report = project.run();
        assert!(!cached(&report, "model"), "{what}");
        assert!(warned(&report, what) && warned(&report, "F084"), "{what}: {:?}", report.notes);
        assert_eq!(project.out("sound.wav"), wav);
        let report = project.run();
        assert!(cached(&report, "model") && !warned(&report, "F084"), "{what}");
    }
}

/// Only this program writes entries; a forged entry with a valid hash does not end a run.
#[test]
fn made_up_entries_with_fitting_hashes_are_reported_or_taken_and_never_panic() {
    let project = Project::new(MODEL);
    project.run();
    let path = &project.entries()[0];
    let key = path.file_stem().unwrap().to_str().unwrap().to_owned();
    let whole = fs::read(path).unwrap();
    let header = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    let (mut taken, mut refused) = (0, 0);
    for round in 0..400 {
        let mut draw = Rng::new(round);
        let mut bytes = whole.clone();
        // In the header where there is one, and in the values behind it.
        let at = 48 + if round % 2 == 0 { draw.below(header) } else { draw.below(bytes.len() - 48) };
        bytes[at] = draw.below(256) as u8;
        if round % 5 == 0 {
            bytes.truncate(48 + draw.below(bytes.len() - 48));
        }
        if round % 7 == 0 {
            bytes[12..16].copy_from_slice(&(draw.below(1 << 20) as u32).to_le_bytes());
        }
        let hash = blake3::hash(&bytes[48..]);
        bytes[16..48].copy_from_slice(hash.as_bytes());
        fs::write(path, &bytes).unwrap();
        match project.store().read(&key) {
            Ok(entry) => {
                taken += usize::from(entry.is_some());
                // It may hold another value: the run ends with a file or with an error.
                if round % 4 == 1 {
                    let _ = project.try_run();
                }
            }
            Err(why) => {
                refused += 1;
                assert!(!why.to_string().is_empty());
            }
        }
    }
    assert!(taken > 20 && refused > 20, "{taken} taken, {refused} refused");
    fs::write(path, vec![0; 4096]).unwrap();
    assert!(Store::new(path.parent().unwrap(), 4095).read(&key).is_err_and(|e| e.0.contains("larger")));
}

#[test]
fn no_byte_of_an_entry_can_change_unseen() {
    let project = Project::new(LEVEL);
    project.run();
    let path = &project.entries()[0];
    let key = path.file_stem().unwrap().to_str().unwrap().to_owned();
    let whole = fs::read(path).unwrap();
    assert!(project.store().read(&key).unwrap().is_some());
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        fs::write(path, &bytes).unwrap();
        assert!(project.store().read(&key).is_err(), "byte {at}");
        fs::write(path, &whole[..at]).unwrap();
        assert!(project.store().read(&key).is_err(), "cut at {at}");
    }
}

#[test]
fn results_are_the_same_bits_with_and_without_the_memo() {
    for (text, wav, value) in [(LEVEL, "loud.wav", "measured"), (MODEL, "sound.wav", "model")] {
        let project = Project::new(text);
        let options = PlanOptions::default();
        let runs = [false, true, true].map(|with_cache| {
            project.run_with(with_cache, &options, Some(value));
            (project.out(wav), fs::read(project.path("tap.json")).unwrap())
        });
        assert_eq!(runs[0], runs[1]);
        assert_eq!(runs[0], runs[2]);
    }
}

#[test]
fn a_renamed_recording_stands_in_the_provenance_of_its_model() {
    let project = Project::new(MODEL);
    project.run();
    fs::rename(project.path("b.wav"), project.path("c.wav")).unwrap();
    project.edit(&MODEL.replace("b.wav", "c.wav"));
    project.run_with(true, &PlanOptions::default(), Some("model"));
    let model = fs::read_to_string(project.path("tap.json")).unwrap();
    assert!(model.contains("c.wav") && !model.contains("b.wav"));
}

#[test]
fn the_size_is_limited_and_entries_that_save_least_per_byte_are_removed_first() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::new(dir.path(), 4000);
    let entry = |name: char, seconds: f64| foley::memo::Entry {
        key: name.to_string().repeat(64),
        seconds,
        ..Default::default()
    };
    let used = HashSet::new();
    for (name, seconds) in [('a', 3.0), ('b', 1.0), ('c', 2.0)] {
        assert!(store.write(&entry(name, seconds), &[0; 900], &used).unwrap());
    }
    assert!(store.write(&entry('d', 5.0), &[0; 900], &used).unwrap());
    let names = || -> Vec<String> {
        let names =
            store.list().into_iter().map(|l| l.path.file_name().unwrap().to_string_lossy()[..1].into());
        names.collect()
    };
    assert_eq!(names(), ["c", "a", "d"]);
    // Entries that this run uses stay, also if they are worth least; others that do not fit beside them are removed.
    let used: HashSet<String> = ["c", "a", "d"].iter().map(|n| n.repeat(64)).collect();
    assert!(!store.write(&entry('e', 9.0), &[0; 900], &used).unwrap());
    assert!(!store.write(&entry('f', 9.0), &[0; 5000], &HashSet::new()).unwrap());
    assert_eq!(names(), ["c", "a", "d"]);
    assert!(store.list().iter().map(|l| l.bytes).sum::<u64>() <= 4000);
    store.clear();
    assert!(store.list().is_empty());
}

#[test]
fn a_cache_without_room_or_that_cannot_be_written_fails_no_run() {
    let mut project = Project::new(LEVEL);
    project.cap = 10;
    let report = project.run();
    assert!(warned(&report, "no room"), "{:?}", report.notes);
    assert!(project.entries().is_empty());
    let blocked = Project::new(LEVEL);
    fs::write(blocked.path(".foley"), "a file where the folder should be").unwrap();
    assert!(warned(&blocked.run(), "cannot be cached"));
    assert!(!blocked.out("loud.wav").is_empty());
}

#[test]
fn runs_at_once_share_a_cache_without_harm() {
    let project = Project::new(LEVEL);
    let expected = {
        project.run_with(false, &PlanOptions::default(), None);
        project.out("loud.wav")
    };
    let graph = project.path("graph.ron");
    let start = |k: usize| {
        let out = project.path(&format!("out{k}"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        command.args(["run", "--quiet", "--cache-size", "2K", "--out"]).arg(out).arg(&graph);
        command.spawn().unwrap()
    };
    let children: Vec<_> = (0..6).map(start).collect();
    for (k, mut child) in children.into_iter().enumerate() {
        assert!(child.wait().unwrap().success());
        assert_eq!(fs::read(project.path(&format!("out{k}/loud.wav"))).unwrap(), expected);
    }
    let left = fs::read_dir(default_dir(&graph)).unwrap().flatten();
    let parts = left.filter(|e| e.path().extension().is_some_and(|e| e == "part")).count();
    assert_eq!(parts, 0);
    assert!(!warned(&project.run(), "F084"));
}

#[test]
fn why_names_the_parameter_that_has_changed() {
    let project = Project::new(LEVEL);
    let why = || foley(&project, &["cache", "why", "graph.ron", "measured"]);
    assert!(why().contains("no earlier run"), "{}", why());
    foley(&project, &["run", "graph.ron"]);
    assert!(why().contains("the next run does not compute it"), "{}", why());
    project.edit(&LEVEL.replace("gain: 0.5", "gain: 0.25"));
    let text = why();
    assert!(text.contains("the next run computes it") && text.contains("soft.gain: 0.5 -> 0.25"), "{text}");
    assert_eq!(text.lines().count(), 3, "{text}");
    foley(&project, &["run", "graph.ron"]);
    let text = why();
    assert!(text.contains("nothing that it depends on has changed"), "{text}");
    assert!(text.contains("soft.gain: 0.5 -> 0.25"), "{text}");
    let stream = foley(&project, &["cache", "why", "graph.ron", "soft"]);
    assert!(stream.contains("no values that can be cached") && stream.contains("measured"), "{stream}");
}

#[test]
fn the_command_counts_and_empties_the_cache_and_does_without() {
    let project = Project::new(LEVEL);
    foley(&project, &["run", "graph.ron", "--no-cache"]);
    assert!(!project.path(".foley").exists());
    foley(&project, &["run", "graph.ron"]);
    let stat: serde_json::Value =
        serde_json::from_str(&foley(&project, &["cache", "stat", "--json"])).unwrap();
    assert_eq!(stat["entries"], 1);
    assert_eq!(stat["kinds"]["Loudness"]["entries"], 1);
    assert!(foley(&project, &["run", "graph.ron"]).contains("1 node(s) from the cache"));
    foley(&project, &["run", "graph.ron", "--cache", "elsewhere"]);
    assert_eq!(Store::new(project.path("elsewhere"), 0).list().len(), 1);
    foley(&project, &["cache", "gc"]);
    assert_eq!(project.entries().len(), 1);
    foley(&project, &["cache", "gc", "--all"]);
    assert!(project.entries().is_empty());
}

#[test]
fn a_survey_finds_the_key_of_the_next_run_without_running() {
    let project = Project::new(LEVEL);
    let path = project.path("graph.ron");
    let status = || {
        let loaded = load(&path, &LoadOptions::default());
        let graph = loaded.graph.unwrap();
        let files = DirFiles::new(loaded.root, Limits::default());
        let plan = Plan::new(&graph, &files, &PlanOptions::default()).unwrap();
        let memo = Memo::new(default_dir(Path::new(&path)), 1 << 30, &path);
        let cache = RunCache::new(&memo, &graph, &plan, &files, graph.seed);
        cache.status(graph.find("measured").unwrap()).unwrap()
    };
    let (before, there) = status();
    assert!(!there);
    project.run();
    let (after, there) = status();
    assert!(there && changes(&before.parts, &after.parts).is_empty());
    assert_eq!(before.hash, after.hash);
}

#[test]
fn what_a_stopped_computation_saved_belongs_to_its_inputs_and_goes_when_it_is_done() {
    use foley_nodes::core::computation::Partial;
    let project = Project::new(MODEL);
    let path = project.path("graph.ron");
    let with = |then: &dyn Fn(Option<&dyn Partial>)| {
        let loaded = load(&path, &LoadOptions::default());
        let graph = loaded.graph.unwrap();
        let files = DirFiles::new(loaded.root, Limits::default());
        let plan = Plan::new(&graph, &files, &PlanOptions::default()).unwrap();
        let memo = Memo::new(default_dir(Path::new(&path)), 1 << 30, &path);
        let mut cache = RunCache::new(&memo, &graph, &plan, &files, graph.seed);
        let node = graph.find("model").unwrap();
        // Without its key there is nothing.
        let stop = std::sync::atomic::AtomicBool::new(true);
        assert!(cache.partial(node, &stop).is_none());
        assert!(cache.look_up(node, &std::collections::HashMap::new()).is_none());
        let partial = cache.partial(node, &stop);
        then(partial.as_ref().map(|p| p as &dyn Partial));
    };
    with(&|partial| {
        let partial = partial.unwrap();
        assert_eq!(partial.load(), None);
        partial.offer(&|| Some(b"first".to_vec()));
        partial.offer(&|| None);
        partial.offer(&|| Some(b"half of it".to_vec()));
    });
    with(&|partial| assert_eq!(partial.unwrap().load().as_deref(), Some(&b"half of it"[..])));
    // Another key has another partial result; a finished run removes that of its own.
    project.run();
    assert_eq!(project.entries().len(), 1);
    assert!(cached(&project.run(), "model"));
}
