//! `foley run --trace-silence`: where a whole file, a part of a mix or a stretch of time is lost.

use serde_json::Value;
use std::fs;
use std::process::Command;

const GRAPH: &str = "#![schema = \"foley:graph/1\"]
Graph(
    params: { \"gain\": 1.0, \"low\": 1.0, \"start\": 0.0 },
    nodes: {
        \"tone\": Tone(frequency: 300.0, level: 0.5, rate: 8000, duration: Some(4.0)),
        \"endless\": Noise(level: 0.1, rate: 8000),
        \"part\": Trim(audio: \"endless\", start: 0.0, duration: Some(4.0)),
        \"high\": Gain(audio: \"tone\", gain: 0.5),
        \"low\": Gain(audio: \"part\", gain: \"$low\"),
        \"both\": Mix(inputs: [\"high\", \"low\"]),
        \"late\": Delay(audio: \"both\", seconds: \"$start\"),
        \"loud\": Gain(audio: \"late\", gain: \"$gain\"),
        \"out\": WavOut(audio: \"loud\", path: \"o.wav\"),
    },
)
";

/// Output of a run with values from its trace on, and the trace of its report.
fn trace(sets: &[&str], more: &[&str]) -> (String, Value) {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("g.ron"), GRAPH).unwrap();
    let run = |folder: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        command.current_dir(dir.path()).args(["run", "g.ron", "--trace-silence", "--report", "r.json"]);
        command.args(["--out", folder]).args(sets.iter().flat_map(|set| ["--set", set])).args(more);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        let text = text[text.find("trace: ").unwrap_or(text.len())..].to_owned();
        let report = fs::read_to_string(dir.path().join("r.json")).unwrap();
        (text, serde_json::from_str::<Value>(&report).unwrap()["silence"].clone())
    };
    let first = run("a");
    // The cache changes nothing about the trace, and the trace nothing about the sound.
    assert_eq!(run("b"), first);
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(dir.path()).args(["run", "g.ron", "--out", "plain", "--no-cache", "--quiet"]);
    let plain = command.args(sets.iter().flat_map(|set| ["--set", set])).output().unwrap();
    assert!(plain.status.success());
    let [plain, traced] = ["plain/o.wav", "a/o.wav"].map(|file| fs::read(dir.path().join(file)).unwrap());
    assert!(plain == traced);
    first
}

#[test]
fn where_nothing_is_lost_the_level_of_each_file_is_stated() {
    let (text, json) = trace(&[], &[]);
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(text.starts_with("trace: o.wav: peak -") && text.contains("nothing is lost"), "{text}");
    assert_eq!(json[0]["losses"].as_array().map(Vec::len), Some(0));
    assert_eq!(json[0]["path"].as_array().map(Vec::len), Some(9));
    // A tone of 0.5 at half its level.
    let high = json[0]["path"].as_array().unwrap().iter().find(|step| step["node"] == "high").unwrap();
    let level = |port: &Value| port["peak_db"].as_f64().unwrap();
    let [before, after] = [level(&high["inputs"][0]), level(&high["outputs"][0])];
    assert!((before + 6.02).abs() < 0.1 && (before - after - 6.02).abs() < 0.01, "{high}");
    assert_eq!(
        (high["inputs"][0]["from"].as_str(), high["type"].as_str()),
        (Some("tone.audio"), Some("Gain"))
    );
}

#[test]
fn a_silent_file_names_the_first_node_that_is_silent_though_its_inputs_are_not() {
    let (text, json) = trace(&["gain=0.0"], &[]);
    assert!(text.contains("silent throughout: lost at `loud` (Gain): `gain` is 0"), "{text}");
    let line = text.lines().find(|line| line.ends_with("<-- lost here")).unwrap();
    assert!(
        line.contains("loud") && line.contains("audio <- late.out -") && line.contains("-> out silent"),
        "{line}"
    );
    let loss = &json[0]["losses"][0];
    assert_eq!((loss["extent"].as_str(), loss["node"].as_str()), (Some("throughout"), Some("loud")));
    assert_eq!(json[0]["levels"][0]["active"], false);
}

#[test]
fn a_silent_part_of_a_mix_and_a_tap_are_traced() {
    let (text, json) = trace(&["low=0.0"], &["--tap", "low.out=low.wav"]);
    assert!(text.contains("`low.out` is silent in it: lost at `low` (Gain): `gain` is 0"), "{text}");
    assert!(text.contains("trace: low.out: silent"), "{text}");
    let extents: Vec<_> =
        json.as_array().unwrap().iter().map(|o| o["losses"][0]["extent"].as_str()).collect();
    assert_eq!(extents, [Some("part"), Some("throughout")]);
}

#[test]
fn a_stretch_of_silence_has_its_time_and_the_node_that_causes_it() {
    let (text, json) = trace(&["start=1.5", "low=0.0"], &[]);
    assert!(text.contains("silent from 0.00 to 1.50 s: lost at `late` (Delay)"), "{text}");
    let loss = json[0]["losses"].as_array().unwrap().iter().find(|l| l["extent"] == "stretch").unwrap();
    assert_eq!(loss["time"], serde_json::json!([0.0, 1.5]));
    // Sources that end before the file does.
    let (text, _) =
        trace(&["part.duration=Some(1.0)", "tone.duration=Some(1.0)"], &["--tap", "late.out=late.wav"]);
    assert!(text.contains("nothing is lost"), "the file ends with its sources: {text}");
}
