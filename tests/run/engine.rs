//! The promises of the planner and the engine, on graphs made at random.

use crate::common;
use crate::common::grown;
use foley::graph::{DirFiles, Limits, Root};
use foley::plan::{Plan, PlanOptions};
use foley_nodes::core::time::{Tick, ticks};
use std::fs;
use std::path::Path;

/// Every file that a run writes, by name. Cut into as many parts as can be, so that hand-overs are tried too.
fn outputs(text: &str, taps: &[String], window: Tick, threads: usize) -> Vec<(String, Vec<u8>)> {
    let dir = tempfile::tempdir().unwrap();
    let options = PlanOptions { window, threads, min_region_ns: 0.0, ..PlanOptions::default() };
    let run = common::graph(text).and_then(|graph| {
        let files = DirFiles::new(Root::of(Path::new("test.ron")), Limits::default());
        common::run_tapped(&graph, &files, &options, taps, dir.path())
    });
    if let Err(e) = run {
        panic!("{e}\n{text}");
    }
    let mut files: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
    files.iter().map(|f| (name(f), fs::read(f).unwrap())).collect()
}

/// Any window and any thread count produce the same bits; nothing hangs; buffers stay within the plan. Successive graphs try other pairs of both, so
/// that three graphs try all.
fn same_for_any_window_and_threads(text: &str, taps: &[String], graph: u64) -> Vec<(String, Vec<u8>)> {
    let whole = outputs(text, taps, ticks(5.0), 1);
    for (k, ms) in [1.0, 7.3, 10.0, 100.0, 5000.0].into_iter().enumerate() {
        let threads = 1 + (k + graph as usize) % 3;
        let other = outputs(text, taps, ticks(ms * 1e-3), threads);
        for (one, same) in other.iter().zip(&whole) {
            assert!(one == same, "window {ms} ms, {threads} threads: {} differs\n{text}", one.0);
        }
        assert_eq!(other.len(), whole.len());
    }
    whole
}

#[test]
fn random_graphs_end_with_the_same_bits_for_any_window_and_threads() {
    for seed in 0..40 {
        let (text, taps) = grown::audio_graph(seed);
        let whole = same_for_any_window_and_threads(&text, &taps, seed);
        assert!(whole.iter().any(|(_, file)| file.len() > 200), "nothing was written\n{text}");
    }
}

#[test]
fn random_graphs_of_frames_units_events_and_folds_do_too() {
    let (mut kinds, mut bytes) = (std::collections::BTreeSet::new(), 0);
    for seed in 0..40 {
        let (text, taps) = grown::mixed_graph(seed);
        let whole = same_for_any_window_and_threads(&text, &taps, seed);
        for (name, file) in whole.iter().filter(|(_, file)| file.len() > 300) {
            kinds.insert(name.trim_start_matches(|c: char| c.is_ascii_digit()).to_owned());
            bytes += file.len();
        }
    }
    // The comparison is not empty: each kind of output occurred, with more than headers.
    let met: Vec<&str> = kinds.iter().map(String::as_str).collect();
    assert_eq!(
        met,
        ["beats.jsonl", "curvature.npy", "events.jsonl", "features.npy", "levels.csv", "out.wav"]
    );
    assert!(bytes > 1_000_000, "{bytes}");
}

#[test]
fn more_events_than_were_planned_come_out_of_the_memory_that_is_left() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"beats\": Metronome(interval: 0.001, duration: Some(200.0)),
        \"clicks\": Impulses(events: \"beats\", rate: 1000),
        \"out\": WavOut(audio: \"clicks\", path: \"a.wav\", format: Float32),
    })";
    let graph = common::graph(text).unwrap();
    let files = DirFiles::new(Root::of(Path::new("test.ron")), Limits::default());
    let planned = |memory| PlanOptions { window: ticks(100.0), memory, ..PlanOptions::default() };
    let plan = Plan::new(&graph, &files, &planned(1 << 30)).unwrap();
    let run = |memory| {
        let dir = tempfile::tempdir().unwrap();
        let ran = common::run_unmeasured(&graph, &files, &planned(memory), &[], dir.path());
        (ran, fs::read(dir.path().join("a.wav")).ok())
    };
    let (enough, whole) = run(plan.bytes + (8 << 20));
    let report = enough.unwrap();
    // 100,000 beats of 16 bytes in a window.
    let grown = report.buffer_bytes - plan.bytes;
    assert!((1_000_000..=8 << 20).contains(&grown), "{grown} bytes more than planned");
    assert!(whole.is_some_and(|file| file.len() > 800_000));
    let (little, nothing) = run(plan.bytes + (1 << 20));
    let error = little.unwrap_err();
    assert!(error.contains("F050") && error.contains("beats") && error.contains("--memory"), "{error}");
    assert_eq!(nothing, None);
}

/// Fan-out, one branch with 100,000 samples of look-ahead, join: schedulers that pass tokens hang here.
#[test]
fn a_branch_that_looks_far_ahead_joins_its_sibling() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"in\": Noise(rate: 48000, duration: Some(5.0), level: 0.1),
        \"far\": Advance(audio: \"in\", seconds: 2.0833333333),
        \"back\": Delay(audio: \"far\", seconds: 2.0833333333),
        \"minus\": Gain(audio: \"in\", gain: -0.5),
        \"sum\": Mix(inputs: [\"back\", \"minus\"]),
        \"whole\": WavOut(audio: \"in\", path: \"in.wav\", format: Float32),
        \"out\": WavOut(audio: \"sum\", path: \"sum.wav\", format: Float32),
    })";
    // The contents of both files after the first 100,000 samples, which were dropped; the delay sounds on for as long.
    let behind = |file: &[u8]| -> Vec<f32> {
        let start = file.windows(4).position(|id| id == b"data").unwrap() + 8;
        let samples = file[start..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        samples.skip(100_000).take(140_000).collect()
    };
    let (sender, done) = std::sync::mpsc::channel();
    let runs = std::thread::spawn(move || {
        for threads in [1, 2] {
            for window in [ticks(64.0 / 48_000.0), ticks(0.02)] {
                let files = outputs(text, &[], window, threads);
                let (whole, sum) = (behind(&files[0].1), behind(&files[1].1));
                assert_eq!((whole.len(), sum.len()), (140_000, 140_000));
                // A sound that was moved earlier and later again matches its sibling to the sample.
                assert!(whole.iter().zip(&sum).all(|(x, half)| *half == 0.5 * x));
                assert!(whole.iter().any(|x| x.abs() > 0.05));
            }
        }
        let _ = sender.send(());
    });
    // A run takes a fraction of a second; one that hangs must not hang the suite with it.
    let waited = done.recv_timeout(std::time::Duration::from_secs(300));
    assert!(waited != Err(std::sync::mpsc::RecvTimeoutError::Timeout), "the run hangs");
    runs.join().unwrap();
}

#[test]
fn a_run_beyond_the_memory_limit_is_refused_before_it_starts() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"in\": Noise(rate: 48000, duration: Some(5.0)),
        \"far\": Advance(audio: \"in\", seconds: 30.0),
        \"out\": WavOut(audio: \"far\", path: \"a.wav\"),
    })";
    let dir = tempfile::tempdir().unwrap();
    let options = PlanOptions { memory: 4 << 20, ..PlanOptions::default() };
    let error = common::run_text(text, &options, dir.path()).unwrap_err();
    assert!(error.contains("F050") && error.contains("in.audio"), "{error}");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn recordings_models_and_images_beyond_the_memory_limit_are_refused_before_they_are_read() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"units\": UnitDatabase(recordings: [
            \"graphs/assets/recordings/clothing_rustle_1.flac\", \"graphs/assets/recordings/clothing_rustle_2.flac\",
        ]),
        \"model\": FrictionModelFile(path: \"graphs/assets/cloth/cotton.friction.json\"),
        \"floor\": ImageLuma(path: \"graphs/assets/images/tiles.png\"),
    })";
    let graph = common::graph(text).unwrap();
    let refused = |memory| {
        let files = DirFiles::new(Root::of(Path::new("test.ron")), Limits { memory, ..Limits::default() });
        let plan = Plan::new(&graph, &files, &PlanOptions::default());
        plan.err().unwrap_or_default().iter().map(|e| format!("{} {}", e.code, e.message)).collect::<Vec<_>>()
    };
    assert_eq!(refused(4 << 30), [""; 0]);
    let found = refused(20_000);
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(
        found.iter().all(|e| e.starts_with("F063") && e.ends_with("the memory limit is 20000")),
        "{found:?}"
    );
    // The first recording fits alone, both do not.
    let one = found[0].split(" takes ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    let one = one.parse::<usize>().unwrap();
    assert!(refused(one).iter().any(|e| e.contains("clothing_rustle_2")), "{:?}", refused(one));
}

#[test]
fn a_loop_shorter_than_its_look_ahead_is_refused() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"in\": Noise(rate: 48000, duration: Some(1.0)),
        \"sum\": Mix(inputs: [\"in\", \"back\"]),
        \"early\": Advance(audio: \"sum\", seconds: 0.1),
        \"back\": Feedback(audio: \"early\", like: \"in\", delay: 0.05, gain: 0.5),
        \"out\": WavOut(audio: \"sum\", path: \"a.wav\"),
    })";
    let error = common::run_text(text, &PlanOptions::default(), Path::new("unused")).unwrap_err();
    assert!(error.contains("F049"), "{error}");
}

#[test]
fn a_fault_leaves_no_file_behind() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("taken.wav"), b"already here").unwrap();
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"in\": Noise(rate: 48000, duration: Some(1.0)),
        \"a\": WavOut(audio: \"in\", path: \"a.wav\"),
        \"b\": WavOut(audio: \"in\", path: \"taken.wav/b.wav\"),
    })";
    let error = common::run_text(text, &PlanOptions::default(), dir.path()).unwrap_err();
    assert!(error.contains("F080"), "{error}");
    let names: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["taken.wav"]);
}

#[test]
fn a_window_longer_than_the_take_costs_no_more_than_the_take() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"tone\": Tone(frequency: 100.0, rate: 8000, duration: Some(2.0)),
        \"out\": WavOut(audio: \"tone\", path: \"tone.wav\"),
    })";
    let dir = tempfile::tempdir().unwrap();
    let planned = |seconds: i32| {
        let options = PlanOptions { window: ticks(f64::from(seconds)), ..PlanOptions::default() };
        common::run_text(text, &options, dir.path()).unwrap().planned_bytes
    };
    assert_eq!(planned(1_000_000), planned(2));
    assert!(planned(1) < planned(2));
}

#[test]
fn a_take_of_next_to_nothing_runs_its_tail_in_windows_of_the_usual_length() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"tone\": Tone(frequency: 100.0, rate: 8000, duration: Some(0.000001)),
        \"late\": Delay(audio: \"tone\", seconds: 1.0),
        \"out\": WavOut(audio: \"late\", path: \"tone.wav\"),
    })";
    let (graph, files) =
        (common::graph(text).unwrap(), DirFiles::new(Root::of(Path::new("test.ron")), Limits::default()));
    let plan = Plan::new(&graph, &files, &PlanOptions::default()).unwrap();
    assert_eq!(plan.window, PlanOptions::default().window);
}
