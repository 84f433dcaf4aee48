//! Fixes that messages suggest.

use std::fs;
use std::process::Command;

/// Output of `foley check` on a graph whose nodes are `nodes`, in a project with the recording `data/take.wav` of 0.489 s.
fn check(nodes: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir_all(dir.path().join("data")).unwrap();
    let samples = (0..(0.489 * 8000.0) as u32).map(|k| (k % 100) as i16);
    crate::common::write_wav(&dir.path().join("data/take.wav"), 1, 8000, samples);
    let graph = format!("#![schema = \"foley:graph/1\"]\nGraph(nodes: {{\n{nodes}\n}})\n");
    fs::write(dir.path().join("g.ron"), graph).unwrap();
    let run =
        Command::new(env!("CARGO_BIN_EXE_foley")).current_dir(dir.path()).args(["check", "g.ron"]).output();
    String::from_utf8_lossy(&run.unwrap().stderr).into_owned()
}

#[test]
fn a_slip_in_the_name_of_a_folder_names_the_path_that_exists() {
    let text = check("\"in\": WavIn(path: \"dat/take.wav\"),");
    assert!(text.contains("there is no file \"dat/take.wav\"; there is \"data/take.wav\""), "{text}");
    let text = check("\"in\": WavIn(path: \"dat/tke.wav\"),");
    assert!(text.contains("there is \"data/take.wav\""), "{text}");
    let text = check("\"in\": WavIn(path: \"dat/quite_another.wav\"),");
    assert!(text.contains("there is \"data\""), "{text}");
    let text = check("\"in\": WavIn(path: \"data/tke.wav\"),");
    assert!(text.contains("; there is \"take.wav\""), "{text}");
}

#[test]
fn a_start_after_the_end_names_the_end() {
    let text = check("\"in\": WavIn(path: \"data/take.wav\", start: 3.0),");
    assert!(text.contains("the recording is 0.489 s long") && text.contains("start below 0.489"), "{text}");
}

#[test]
fn rates_that_do_not_meet_name_the_node_that_can_have_the_other() {
    let nodes = "\"take\": WavIn(path: \"data/take.wav\"),
    \"noise\": Noise(rate: 48000), \"quiet\": Gain(audio: \"noise\", gain: 0.1),
    \"both\": Mix(inputs: [\"take\", \"quiet\"]),";
    let text = check(nodes);
    let help = "put Resample(rate: 48000) before `inputs[0]`, or set `rate: 8000` on `noise`";
    assert!(text.contains(help), "{text}");
    // A recording has the rate that it has.
    let text = check(&nodes.replace("[\"take\", \"quiet\"]", "[\"quiet\", \"take\"]"));
    assert!(text.contains("put Resample(rate: 48000) before `inputs[1]`\n"), "{text}");
}
