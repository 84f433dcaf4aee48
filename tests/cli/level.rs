//! Sound beyond full scale: what to set, and that it does.

use std::fs;
use std::process::Command;

const GRAPH: &str = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"tone\": Tone(frequency: 440.0, rate: 8000, duration: Some(0.5)),
    \"loud\": Gain(audio: \"tone\", gain: 28.0),
    \"out\": NODE,
})
";

/// Output of `foley run` on the graph with values that are set, and the peak of its sound.
fn run(out: &str, sets: &[&str]) -> (String, f64) {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("g.ron"), GRAPH.replace("NODE", out)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(dir.path()).args(["run", "g.ron", "--report", "r.json"]);
    command.args(sets.iter().flat_map(|set| ["--set", set]));
    let run = command.output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let report = fs::read_to_string(dir.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    (String::from_utf8_lossy(&run.stdout).into_owned(), report["outputs"][0]["peak"].as_f64().unwrap())
}

#[test]
fn a_sound_28_times_full_scale_names_a_level_that_does_not_clip() {
    let out = "WavOut(audio: \"loud\", path: \"o.wav\")";
    let (text, peak) = run(out, &[]);
    assert!(peak > 10.0);
    let note = text
        .lines()
        .find(|line| line.starts_with("note: out: its peak is"))
        .unwrap_or_else(|| panic!("{text}"));
    let db = note.split("set `db: ").nth(1).unwrap().split('`').next().unwrap();
    assert!(note.ends_with("on `loud` (now 0)"), "{note}");
    assert!(text.contains("samples beyond full scale"), "{text}");
    let (text, peak) = run(out, &[&format!("loud.db={db}")]);
    assert!(!text.contains("full scale") && (20.0 * peak.log10() + 1.0).abs() < 0.06, "{peak}: {text}");
}

#[test]
fn a_barely_audible_sound_is_noted() {
    let (text, peak) = run("WavOut(audio: \"loud\", path: \"o.wav\")", &["loud.gain=0.0005"]);
    assert!(peak < 0.001 && text.contains("which is barely audible: set `db: "), "{text}");
    let (text, _) = run("WavOut(audio: \"loud\", path: \"o.wav\")", &["loud.gain=0.01"]);
    assert!(!text.contains("barely"), "{text}");
}

#[test]
fn without_a_level_of_one_source_a_gain_is_put_before_the_output() {
    let graph = "WavOut(audio: \"both\", path: \"o.wav\"), \"both\": Mix(inputs: [\"tone\", \"loud\"])";
    let (text, _) = run(graph, &[]);
    assert!(text.contains("put Gain(db: -") && text.contains("before `out`"), "{text}");
}

#[test]
fn a_limiter_is_named_where_few_samples_exceed_full_scale_and_holds_its_ceiling() {
    let few = "WavOut(audio: \"both\", path: \"o.wav\"),
    \"clock\": Metronome(interval: 1.0, gain: 3.0, duration: Some(0.5)), \"one\": Impulses(events: \"clock\", rate: 8000),
    \"both\": Mix(inputs: [\"one\", \"tone\"], gains: [1.0, 0.2])";
    let (text, _) = run(few, &[]);
    assert!(text.contains("or put Limiter before it"), "{text}");
    let limited = few.replace("audio: \"both\"", "audio: \"soft\"") + ", \"soft\": Limiter(audio: \"both\")";
    let (text, peak) = run(&limited, &[]);
    assert!(!text.contains("full scale") && peak <= 0.8913, "{peak}: {text}");
}
