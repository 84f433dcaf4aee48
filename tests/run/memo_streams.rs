//! The promises of the cache for streams: the last streams of an expensive part are cached, only nodes downstream of an edit run
//! again, and no result depends on the cache.

use crate::common::ALL;
use crate::common::project::{MODEL, Project, cached, calls, foley, warned};
use foley::memo::{CachePolicy, MEMORY};
use foley::plan::PlanOptions;
use foley::run::Report;
use foley_nodes::core::time::ticks;
use std::fs;
use std::path::PathBuf;

/// Caches only expensive streams, of any size: contacts, in the graphs of these tests.
const EXPENSIVE: CachePolicy =
    CachePolicy { seconds_per_byte: 8e-9, min_seconds: 0.01, read_seconds_per_byte: 2.5e-9, max_nodes: 1000 };

/// Clicks, a loop, look-ahead and streams of unequal lengths.
const LOOP: &str = "#![schema = \"foley:graph/1\"]
Graph(
    seed: 9,
    nodes: {
        \"beat\": Metronome(interval: 0.11, duration: Some(0.9)),
        \"click\": Impulses(events: \"beat\", rate: 8000),
        \"mixed\": Mix(inputs: [\"click\", \"back\"]),
        \"back\": Feedback(audio: \"damped\", like: \"click\", delay: 0.05, gain: 0.8, tail: 0.3),
        \"damped\": Gain(audio: \"mixed\", gain: 0.5),
        \"early\": Advance(audio: \"damped\", seconds: 0.07),
        \"hiss\": Noise(colour: White, level: 0.1, rate: 8000, duration: Some(0.4)),
        \"both\": Mix(inputs: [\"early\", \"hiss\"]),
        \"last\": Gain(audio: \"both\", gain: 0.9),
        \"out\": WavOut(audio: \"last\", path: \"loop.wav\"),
    },
)
";

fn project(text: &str, policy: CachePolicy) -> Project {
    Project { policy, ..Project::new(text) }
}

fn louder(text: &str) -> String {
    text.replace("level: 0.3", "level: 0.2")
}

/// The output of a project without a cache.
fn without(project: &Project, options: &PlanOptions, name: &str) -> Vec<u8> {
    let report = project.run_with(false, options, None);
    assert!(report.nodes.iter().all(|n| !n.cached));
    project.out(name)
}

const UPSTREAM: [&str; 3] = ["planes", "contacts", "speed"];

#[test]
fn an_edit_of_a_late_node_runs_only_the_nodes_downstream() {
    let project = project(MODEL, ALL);
    let first = project.run();
    assert!(UPSTREAM.iter().all(|id| !cached(&first, id) && calls(&first, id) > 0));
    project.edit(&louder(MODEL));
    let second = project.run();
    assert!(UPSTREAM.iter().all(|id| cached(&second, id) && calls(&second, id) == 0), "{second:?}");
    assert!(cached(&second, "model") && !cached(&second, "sound") && calls(&second, "sound") > 0);
    let wav = project.out("sound.wav");
    assert_eq!(wav, without(&project, &PlanOptions::default(), "sound.wav"));
    // The summaries of skipped nodes are the same.
    let summary = |r: &Report, id: &str| r.nodes.iter().find(|n| n.id == id).unwrap().summary.clone();
    for id in UPSTREAM {
        assert_eq!(summary(&first, id), summary(&second, id), "{id}");
    }
    // Nothing but the writer runs when nothing has changed.
    let third = project.run();
    assert!(cached(&third, "sound") && !cached(&third, "out") && project.out("sound.wav") == wav);
}

#[test]
fn only_expensive_streams_are_cached() {
    let text = MODEL.replace("size: [0.3, 0.3]", "size: [0.4, 0.4]");
    let project = project(&text, EXPENSIVE);
    for name in ["a.wav", "b.wav"] {
        project.record(name, 3);
    }
    project.run();
    let cached_ids: Vec<String> =
        project.store().list().into_iter().filter_map(|l| l.entry).map(|e| e.node).collect();
    assert!(cached_ids.iter().any(|id| id == "contacts"), "{cached_ids:?}");
    assert!(
        !cached_ids.iter().any(|id| id == "planes"),
        "a generated mesh is made faster than read: {cached_ids:?}"
    );
}

#[test]
fn a_parameter_upstream_of_a_cached_stream_recomputes_it() {
    let project = project(MODEL, ALL);
    project.run();
    for (from, to) in
        [("radius: 0.02", "radius: 0.021"), ("speed: 0.4", "speed: 0.5"), ("seed: 5", "seed: 6")]
    {
        project.edit(&MODEL.replace(from, to));
        let report = project.run();
        assert!(!cached(&report, "contacts"), "{to}");
        assert_eq!(project.out("sound.wav"), without(&project, &PlanOptions::default(), "sound.wav"), "{to}");
    }
    // A node's version is in the key: see `Keys`. Its id is as well.
    project.edit(&MODEL.replace("\"planes\"", "\"sheets\""));
    assert!(!cached(&project.run(), "contacts"));
}

#[test]
fn cached_streams_are_the_same_for_any_window_and_threads() {
    let ahead = MODEL.replace("gate: Causal", "gate: Interval");
    for (text, edited, wav) in [
        (MODEL.to_owned(), louder(MODEL), "sound.wav"),
        (ahead.clone(), louder(&ahead), "sound.wav"),
        (LOOP.to_owned(), LOOP.replace("0.9),\n        \"out\"", "0.8),\n        \"out\""), "loop.wav"),
        (LOOP.to_owned(), LOOP.replace("level: 0.1", "level: 0.2"), "loop.wav"),
    ] {
        assert_ne!(text, edited);
        let mut project = project(&text, ALL);
        if text != MODEL {
            project.record("a.wav", 3);
            project.record("b.wav", 4);
        }
        project.edit(&edited);
        let wanted = without(&project, &PlanOptions::default(), wav);
        for (cold, warm) in [(0.02, 0.02), (0.0031, 0.5), (5.0, 0.0017)] {
            let options = |seconds| PlanOptions {
                window: ticks(seconds),
                min_region_ns: 1.0,
                ..PlanOptions::default()
            };
            foley(&project, &["cache", "gc", "--all"]);
            project.threads = 3;
            project.edit(&text);
            project.run_with(true, &options(cold), None);
            project.edit(&edited);
            for threads in [1, 3] {
                project.threads = threads;
                let report = project.run_with(true, &options(warm), None);
                assert!(report.nodes.iter().any(|n| n.cached));
                assert!(project.out(wav) == wanted, "{cold} s, then {warm} s, {threads} threads:\n{edited}");
            }
        }
    }
}

#[test]
fn until_truncates_a_cached_stream_like_a_computed_one() {
    let project = project(LOOP, ALL);
    let until = |seconds| PlanOptions { until: Some(ticks(seconds)), ..PlanOptions::default() };
    for seconds in [0.3, 0.5, 0.3] {
        let wanted = without(&project, &until(seconds), "loop.wav");
        let report = project.run_with(true, &until(seconds), None);
        assert_eq!(project.out("loop.wav"), wanted);
        assert!(!warned(&report, "F08"));
    }
    assert!(cached(&project.run_with(true, &until(0.5), None), "mixed"));
}

#[test]
fn a_tap_of_a_cached_stream_is_the_same_file() {
    for (text, node, tap) in [
        (MODEL, "speed", "tap.npy"),
        (MODEL, "contacts", "tap.npy"),
        (LOOP, "beat", "tap.jsonl"),
        (LOOP, "last", "tap.npy"),
    ] {
        let project = project(text, ALL);
        let runs = [false, true, true].map(|with_cache| {
            let report = project.run_with(with_cache, &PlanOptions::default(), Some(node));
            (cached(&report, node), fs::read(project.path(tap)).unwrap())
        });
        assert_eq!(runs.each_ref().map(|(cached, _)| *cached), [false, false, true]);
        assert!(runs[0].1 == runs[1].1 && runs[1].1 == runs[2].1 && runs[0].1.len() > 100);
    }
}

#[test]
fn an_unusable_stream_is_computed_again_with_a_warning() {
    let project = project(LOOP, ALL);
    let wanted = without(&project, &PlanOptions::default(), "loop.wav");
    project.run();
    let of = |node: &str| {
        let all = project.store().list().into_iter();
        all.filter(|l| l.entry.as_ref().is_some_and(|e| e.node == node)).map(|l| l.path).next().unwrap()
    };
    let path: PathBuf = of("last");
    let whole = fs::read(&path).unwrap();
    let mut harms: Vec<Vec<u8>> = Vec::new();
    for at in (0..whole.len()).step_by(whole.len() / 12 + 1).chain([whole.len() - 1, 13, 25, 40]) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        harms.push(bytes);
        harms.push(whole[..at].to_vec());
    }
    harms.push(fs::read(of("damped")).unwrap());
    for harm in harms {
        fs::write(&path, harm).unwrap();
        let report = project.run();
        assert!(warned(&report, "F084"), "{:?}", report.notes);
        assert!(!cached(&report, "last") && cached(&report, "both"));
        assert_eq!(project.out("loop.wav"), wanted);
        // It was replaced.
        assert!(!warned(&project.run(), "F084"));
    }
}

#[test]
fn entries_in_memory_are_not_read_again() {
    let project = project(MODEL, ALL);
    let memo = project.memo().with_memory(MEMORY);
    let run = || project.run_over(Some(&memo), &PlanOptions::default(), None);
    run();
    run();
    let wav = project.out("sound.wav");
    for path in project.entries() {
        fs::write(path, "harm").unwrap();
    }
    let report = run();
    assert!(
        cached(&report, "model") && cached(&report, "sound") && report.notes.is_empty(),
        "{:?}",
        report.notes
    );
    assert_eq!(project.out("sound.wav"), wav);
    assert!(warned(&project.run(), "F084"), "another cache has nothing in memory");
}

#[test]
fn streams_stay_within_the_size_and_leave_no_partial_files() {
    let mut project = project(MODEL, ALL);
    project.cap = 60_000;
    project.run();
    let entries = project.store().list();
    assert!(entries.iter().map(|l| l.bytes).sum::<u64>() <= 60_000);
    assert!(entries.iter().all(|l| !l.path.ends_with("stream") || l.bytes <= 15_000));
    project.run();
    let parts = || {
        let all = fs::read_dir(project.path(".foley/cache")).unwrap().flatten();
        all.filter(|e| e.path().extension().is_some_and(|e| e == "part")).count()
    };
    assert_eq!(parts(), 0);
}

#[test]
fn the_command_lists_cached_streams() {
    let project = project(MODEL, ALL);
    project.run();
    let stat = foley(&project, &["cache", "stat"]);
    assert!(
        stat.contains("ContactDetector: 1 entries") && stat.contains("SlidingSpeed: 1 entries"),
        "{stat}"
    );
    let why = || foley(&project, &["cache", "why", "graph.ron", "contacts"]);
    assert!(why().contains("contacts: cached"), "{}", why());
    project.edit(&MODEL.replace("radius: 0.02", "radius: 0.03"));
    let text = why();
    assert!(text.contains("not cached") && text.contains("radius: 0.02 -> 0.03"), "{text}");
}

/// A short fold, and a sound that does not depend on it but is mixed with what does.
fn folded() -> String {
    let text = MODEL.replace(
        "\"out\": WavOut(audio: \"sound\", path: \"sound.wav\"),",
        "\"hiss\": Noise(colour: White, level: 0.1, rate: 48000, duration: Some(0.1)),
        \"level\": Loudness(audio: \"hiss\"),
        \"even\": Normalize(audio: \"hiss\", level: \"level\", peak_db: -20.0),
        \"all\": Mix(inputs: [\"even\", \"sound\"]),
        \"out\": WavOut(audio: \"all\", path: \"sound.wav\"),",
    );
    assert!(text.contains("Normalize"));
    text
}

#[test]
fn streams_of_a_later_phase_are_computed_while_an_earlier_one_runs() {
    let text = folded();
    let project = project(&text, ALL);
    let record = |project: &Project| ["a.wav", "b.wav"].map(|name| project.record(name, 3));
    record(&project);
    // The second phase fails as it begins, and the first one has stored what the second would have read.
    fs::create_dir(project.path("out")).unwrap();
    fs::write(project.path("out/taken"), "").unwrap();
    project.edit(&text.replace("\"sound.wav\"", "\"taken/sound.wav\""));
    assert!(project.try_run().is_err());
    let stored = |project: &Project| {
        project.store().list().into_iter().filter_map(|l| l.entry).any(|e| e.node == "sound")
    };
    assert!(stored(&project));
    project.edit(&text);
    let report = project.run();
    assert!(cached(&report, "sound") && cached(&report, "contacts"));
    let wanted = without(&project, &PlanOptions::default(), "sound.wav");
    assert_eq!(project.out("sound.wav"), wanted);
    // From an empty cache, with another fold and with several threads: the sound runs once.
    for threads in [1, 3] {
        foley(&project, &["cache", "gc", "--all"]);
        let project = Project { threads, policy: ALL, ..Project::new(&text) };
        record(&project);
        let first = project.run();
        assert_eq!(project.out("sound.wav"), wanted, "{threads} threads");
        assert!(calls(&first, "sound") > 0 && !cached(&first, "sound"));
        project.edit(&text.replace("level: 0.1", "level: 0.05"));
        let second = project.run();
        assert!(cached(&second, "sound") && calls(&second, "level") > 0, "{second:?}");
        assert_eq!(project.out("sound.wav"), without(&project, &PlanOptions::default(), "sound.wav"));
    }
    // What only later nodes need that are cached is not computed ahead.
    project.edit(&text);
    project.run();
    project.edit(&text.replace("peak_db: -20.0", "peak_db: -30.0"));
    assert_eq!(calls(&project.run(), "sound"), 0);
}
