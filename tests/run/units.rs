//! Concatenative synthesis through whole graphs: a recording put together from itself is itself.

use crate::common;
use foley::graph::{DirFiles, Limits, LoadOptions, Root, load_text};
use foley::plan::PlanOptions;
use foley_nodes::core::time::{Rate, ticks};
use foley_nodes::feature::FeatureConventions;
use foley_nodes::io::{AudioReader, AudioWriter, WriteFormat, WriteSpec};
use foley_nodes::unit::{Take, build};
use std::fs::File;
use std::path::Path;

fn samples(path: &Path) -> Vec<f32> {
    AudioReader::open(Box::new(File::open(path).unwrap())).unwrap().read_mono().unwrap()
}

/// A recording that ships, cut to a whole number of units.
fn rustle() -> Vec<f32> {
    let mut all = samples(&common::graphs().join("assets/recordings/clothing_rustle_2.flac"));
    all.truncate(all.len() / 184 * 184);
    all
}

fn graph_text(recording: &Path, own: &str) -> String {
    format!(
        r#"#![schema = "foley:graph/1"]
Graph(
    nodes: {{
        "database": UnitDatabase(recordings: ["{0}"], rate: 44100),
        "target": WavIn(path: "{0}"),
        "mfcc": Mfcc(audio: "target"{own}),
        "smooth": TemporalGaussian(features: "mfcc.features"),
        "selector": UnitSelector(features: "smooth", database: "database"),
        "units": UnitConcatenator(picks: "selector", database: "database"),
        "out": WavOut(audio: "units", path: "out.wav", format: Float32),
    }},
)
"#,
        recording.file_name().unwrap().to_string_lossy()
    )
}

/// Writes a sound as a file.
fn write(path: &Path, rate: u32, samples: &[f32]) {
    let spec = WriteSpec::new(rate, 1, WriteFormat::Float32);
    let mut writer = AudioWriter::new(File::create(path).unwrap(), spec).unwrap();
    writer.write(samples).unwrap();
    writer.finish().unwrap();
}

fn run(own: &str, window: f64) -> Result<Vec<f32>, String> {
    let dir = tempfile::tempdir().unwrap();
    let recording = dir.path().join("rustle.wav");
    write(&recording, 44_100, &rustle());
    run_in(dir.path(), &graph_text(&recording, own), window)?;
    Ok(samples(&dir.path().join("out.wav")))
}

/// Runs a graph whose files lie in a folder.
fn run_in(dir: &Path, text: &str, window: f64) -> Result<(), String> {
    let file = dir.join("units.ron");
    let loaded = load_text("units.ron", text, &file, &LoadOptions::default());
    let graph = loaded.graph.ok_or_else(|| format!("{:?}", loaded.diagnostics))?;
    let files = DirFiles::new(Root::of(&file), Limits::default());
    let options = PlanOptions { window: ticks(window), ..PlanOptions::default() };
    common::run_graph(&graph, &files, &options, dir).map(|_| ())
}

#[test]
fn a_recording_put_together_from_itself_is_itself_bit_for_bit() {
    let recording = rustle();
    let c = FeatureConventions::cloth(Rate::hz(44_100), 184);
    let db =
        build(&[Take { channels: vec![recording.clone()].into(), ..Take::default() }], &c, None).unwrap();
    for window in [0.02, 0.0031] {
        let out = run("", window).unwrap();
        assert!(recording.len() > 70 * 184 && out == db.audio, "window {window}");
    }
}

#[test]
fn a_target_shorter_than_a_unit_is_silence_of_its_length() {
    let dir = tempfile::tempdir().unwrap();
    let sound = rustle();
    // Units of 200 samples.
    write(&dir.path().join("rustle.wav"), 48_000, &sound);
    let selector = |name: &str| {
        format!(
            "\"{name}\": {name}(features: \"smooth\", database: \"database\"),
            \"{name}_units\": UnitConcatenator(picks: \"{name}\", database: \"database\"),
            \"{name}_out\": WavOut(audio: \"{name}_units\", path: \"{name}.wav\", format: Float32),"
        )
    };
    let names = ["UnitSelector", "OnlineUnitSelector", "GlobalUnitSelector"];
    let text = format!(
        "#![schema = \"foley:graph/1\"]
        Graph(nodes: {{
            \"database\": UnitDatabase(recordings: [\"rustle.wav\"], rate: 48000),
            \"target\": WavIn(path: \"target.wav\"),
            \"mfcc\": Mfcc(audio: \"target\"),
            \"smooth\": TemporalGaussian(features: \"mfcc.features\"),
            {}
        }})",
        names.map(selector).concat()
    );
    for length in [0, 100, 199, 200, 300] {
        write(&dir.path().join("target.wav"), 48_000, &sound[4000..4000 + length]);
        for window in [0.02, 0.001] {
            run_in(dir.path(), &text, window).unwrap();
            for name in names {
                let out = samples(&dir.path().join(format!("{name}.wav")));
                assert_eq!(out.len(), length, "{name}, {window}");
                let sounds = out.iter().any(|x| *x != 0.0);
                assert_eq!(sounds, length >= 200, "{name}, {length} samples, {window}");
            }
        }
    }
}

#[test]
fn features_of_another_make_are_refused_by_the_name_of_the_parameter() {
    let message = run(", f_hi: 16000", 0.02).unwrap_err();
    assert!(message.contains("f_hi") && message.contains("F100"), "{message}");
}
