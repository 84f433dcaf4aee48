//! Every preset of a material plays a cloth from end to end: those of table 2 of the paper for a first animation make a warp, those for
//! another one take it over.

mod common;

use common::graphs;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn presets() -> Vec<String> {
    let entries = fs::read_dir(graphs().join("lib/presets")).unwrap().map(|e| e.unwrap().path());
    let mut names: Vec<String> =
        entries.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    names.sort();
    names
}

/// The preset whose warp another takes over: that of its material without more words.
fn first_of(name: &str) -> &str {
    name.split('_').next().unwrap_or(name)
}

/// A graph in which a sleeve is of this material; `more` is given to the preset.
fn graph(name: &str, more: &str) -> String {
    let graphs = graphs().display().to_string();
    format!(
        "#![schema = \"foley:graph/1\"]
Graph(seed: 3, use: {{
    \"cloth\": Sub(path: \"{graphs}/lib/presets/{name}.ron\", params: {{
        \"mesh\": \"sleeve\", \"bodies\": [\"arm\"], \"radius\": 0.01, \"threshold\": 0.02, \"d_max\": 4.0, {more}
    }}),
}}, nodes: {{
    \"sleeve\": MeshSequence(path: \"{graphs}/assets/cloth/nylon_sleeve_elbow.pc2\", fps: 30),
    \"arm\": MeshSequence(path: \"{graphs}/assets/cloth/nylon_sleeve_elbow.body_arm.pc2\", fps: 30),
    \"head\": VertexPose(mesh: \"arm\", origin: 0, offset: [-0.2, 0.1, 0.5]),
    \"out\": WavOut(audio: \"cloth.recomposed.audio\", path: \"a.wav\"),
}})"
    )
}

/// A run that has to succeed, with what it tells of `a.wav`; the warp goes to a file of that name where one is given.
fn run(dir: &Path, text: &str, warp: Option<&str>) -> Value {
    let [graph, read] = [dir.join("g.ron"), graphs()].map(|path| path.display().to_string());
    fs::write(&graph, text).unwrap();
    let tap = warp.map(|file| format!("cloth.recomposed.fit.warp={}", dir.join(file).display()));
    let tap: Vec<&str> = tap.iter().flat_map(|tap| ["--tap", tap]).collect();
    common::foley(dir, &[&["run", &graph, "--allow-read", &read], &tap[..]].concat())["outputs"][0].clone()
}

/// What the ears of somebody might have heard: clicks and noise, another level in each ear.
fn binaural_recording(path: &Path) {
    let spec = hound::WavSpec {
        channels: 2,
        sample_rate: 48_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    let mut state = 1_u32;
    for n in 0..96_000 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(state >> 16) / 32_768.0 - 1.0;
        let swell = (f64::from(n) / 24_000.0).sin().abs() + 5.0 * f64::from(u8::from(n % 4000 < 200));
        for level in [1500.0, 900.0] {
            writer.write_sample((level * swell * noise) as i16).unwrap();
        }
    }
    writer.finalize().unwrap();
}

#[test]
fn every_preset_plays_a_cloth() {
    let dir = tempfile::tempdir().unwrap();
    binaural_recording(&dir.path().join("ears.wav"));
    let marked = "\"correspondences\": \"marked.correspondences.ron\"";
    fs::write(
        dir.path().join("marked.correspondences.ron"),
        "Correspondences(pairs: [
            (target: 0.85, source: 3, database: 0.45, duration: 0.1),
            (target: 0.65, source: 0, database: 0.0, duration: 0.1),
            (target: 0.35, source: 2, database: 0.1, duration: 0.1),
        ])",
    )
    .unwrap();
    fs::write(dir.path().join("ears.correspondences.ron"), "Correspondences(pairs: [])").unwrap();
    let names = presets();
    assert!(names.len() >= 10, "{names:?}");
    let (first, later): (Vec<_>, Vec<_>) = names.iter().partition(|name| first_of(name) == *name);
    for name in first {
        let told = run(dir.path(), &graph(name, marked), Some(&format!("{name}.warp.json")));
        assert!(told["peak"].as_f64().unwrap() > 1e-3, "{name}: {told}");
        assert_eq!(told["channels"], 1);
    }
    for name in later {
        let text = if name.ends_with("first_person") {
            let own = "\"listener\": \"head\", \"recordings\": [\"ears.wav\"], \"correspondences\": \"ears.correspondences.ron\"";
            graph(name, own)
        } else {
            graph(name, &format!("\"warp\": \"{}.warp.json\"", first_of(name)))
        };
        let told = run(dir.path(), &text, None);
        assert!(told["peak"].as_f64().unwrap() > 1e-3, "{name}: {told}");
        assert_eq!(told["channels"], if name.ends_with("first_person") { 2 } else { 1 }, "{name}");
    }
}
