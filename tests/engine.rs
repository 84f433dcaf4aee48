//! The promises of the planner and the engine, on graphs made at random.

mod common;

use foley::plan::PlanOptions;
use foley_nodes::core::random::Draw;
use foley_nodes::core::time::{Tick, ticks};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// A random graph: sources of several rates, look-ahead up to a second, delays, loops, rate changes, unequal ends.
fn random_graph(seed: u64) -> String {
    let mut draw = Draw::new(seed);
    let rates = [8000, 11_025, 16_000, 22_050, 44_100];
    let mut nodes = String::new();
    // Every stream so far, with its rate.
    let mut streams: Vec<(String, usize)> = Vec::new();
    for k in 0..1 + draw.below(3) {
        let rate = rates[draw.below(rates.len())];
        let duration = draw.between(0.05, 0.6);
        let _ = writeln!(nodes, "\"s{k}\": Noise(rate: {rate}, duration: Some({duration:.4}), level: 0.2),");
        streams.push((format!("s{k}"), rate));
    }
    for k in 0..3 + draw.below(10) {
        let (from, rate) = streams[draw.below(streams.len())].clone();
        let id = format!("n{k}");
        let mut made = rate;
        let text = match draw.below(8) {
            0 => format!("Gain(audio: \"{from}\", gain: {:.3})", draw.between(-1.0, 1.0)),
            1 => format!("Delay(audio: \"{from}\", seconds: {:.5})", draw.between(0.0, 0.3)),
            2 => format!("Advance(audio: \"{from}\", seconds: {:.5})", draw.between(0.0, 1.0)),
            3 => format!("HighPass(audio: \"{from}\", cutoff: {:.1})", draw.between(30.0, 2000.0)),
            4 => {
                made = rates[draw.below(rates.len())];
                if made == rate {
                    format!("Gain(audio: \"{from}\", gain: 0.5)")
                } else {
                    format!("Resample(audio: \"{from}\", rate: {made})")
                }
            }
            5 => {
                // A loop: what comes in, mixed with its own past.
                let seconds = draw.between(0.003, 0.1);
                let _ = writeln!(
                    nodes,
                    "\"back{k}\": Feedback(audio: \"{id}\", like: \"{from}\", delay: {seconds:.4}, gain: 0.5, tail: 0.1),"
                );
                format!("Mix(inputs: [\"{from}\", \"back{k}\"])")
            }
            _ => {
                let same: Vec<String> =
                    streams.iter().filter(|(_, r)| *r == rate).map(|(s, _)| format!("\"{s}\"")).collect();
                format!("Mix(inputs: [{}])", same.join(", "))
            }
        };
        let _ = writeln!(nodes, "\"{id}\": {text},");
        streams.push((id, made));
    }
    for (k, (stream, _)) in streams.iter().rev().take(1 + draw.below(3)).enumerate() {
        let _ =
            writeln!(nodes, "\"out{k}\": WavOut(audio: \"{stream}\", path: \"{k}.wav\", format: Float32),");
    }
    format!("#![schema = \"foley:graph/1\"]\nGraph(seed: {seed}, nodes: {{\n{nodes}}})")
}

fn outputs(text: &str, window: Tick, threads: usize) -> Vec<Vec<u8>> {
    let dir = tempfile::tempdir().unwrap();
    // Cut into as many parts as can be, so that hand-overs are tried too.
    let options = PlanOptions { window, threads, worth: 0.0, ..PlanOptions::default() };
    if let Err(e) = common::run_text(text, &options, dir.path()) {
        panic!("{e}\n{text}");
    }
    let mut files: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    assert!(files.iter().all(|f| f.extension().is_some_and(|e| e == "wav")), "{files:?}");
    files.iter().map(|f| fs::read(f).unwrap()).collect()
}

/// Any window and any thread count give the same bits; nothing hangs; buffers stay within the plan.
#[test]
fn random_graphs_end_with_the_same_bits_for_any_window_and_threads() {
    for seed in 0..120 {
        let text = random_graph(seed);
        let whole = outputs(&text, ticks(5.0), 1);
        assert!(whole.iter().any(|file| file.len() > 200), "nothing was written\n{text}");
        for (ms, threads) in [(1.0, 1), (10.0, 2), (100.0, 2), (7.3, 3)] {
            let other = outputs(&text, ticks(ms * 1e-3), threads);
            assert!(other == whole, "window {ms} ms, {threads} threads differ\n{text}");
        }
    }
}

/// Fan-out, one branch with 100,000 samples of look-ahead, join: schedulers that pass tokens hang here.
#[test]
fn a_branch_that_looks_far_ahead_joins_its_sibling() {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"in\": Noise(rate: 48000, duration: Some(5.0), level: 0.1),
        \"far\": Advance(audio: \"in\", seconds: 2.0833333333),
        \"back\": Delay(audio: \"far\", seconds: 2.0833333333),
        \"minus\": Gain(audio: \"in\", gain: -1.0),
        \"sum\": Mix(inputs: [\"back\", \"minus\"]),
        \"out\": WavOut(audio: \"sum\", path: \"sum.wav\", format: Float32),
    })";
    for threads in [1, 2] {
        for window in [ticks(64.0 / 48_000.0), ticks(0.02)] {
            let file = &outputs(text, window, threads)[0];
            let samples: Vec<f32> = file[file.len() - 4 * 100_000..]
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            // What was moved earlier and later again cancels its sibling: the two branches are aligned to the sample.
            assert!(samples.iter().all(|s| *s == 0.0));
        }
    }
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
        \"b\": WavOut(audio: \"in\", path: \"a.wav\"),
    })";
    let error = common::run_text(text, &PlanOptions::default(), dir.path()).unwrap_err();
    assert!(error.contains("F081"), "{error}");
    let names: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["taken.wav"]);
}
