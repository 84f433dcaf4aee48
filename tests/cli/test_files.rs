//! `foley test`: the checks beside the example graphs, and what a user sees of those that pass, fail or are wrong.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const GRAPH: &str = "#![schema = \"foley:graph/1\"]
Graph(
    params: { \"gain\": 1.0 },
    nodes: {
        \"noise\": Noise(level: 0.1, rate: 8000, duration: Some(0.5)),
        \"loud\": Gain(audio: \"noise\", gain: \"$gain\"),
        \"beat\": Metronome(interval: 0.25, duration: Some(1.0)),
        \"clicks\": Impulses(events: \"beat\", rate: 8000),
        \"level\": Loudness(audio: \"loud\"),
        \"out\": WavOut(audio: \"loud\", path: \"o.wav\", format: Float32),
        \"take\": WavIn(path: \"take.wav\"),
        \"copy\": WavOut(audio: \"take\", path: \"copy.wav\", format: Float32),
    },
)
";

fn foley(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.current_dir(dir).env("NO_COLOR", "1").arg("test").args(args).output().unwrap()
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// A folder with the graph and a test file of these cases.
fn project(cases: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    crate::common::write_wav(&dir.path().join("take.wav"), 1, 8000, vec![0_i16; 800]);
    fs::write(dir.path().join("g.ron"), GRAPH).unwrap();
    let file = format!("#![schema = \"foley:test/1\"]\n// A comment.\nTest(cases: {{\n{cases}\n}})\n");
    fs::write(dir.path().join("g.test.ron"), file).unwrap();
    dir
}

/// The names of the files in a folder.
fn files(dir: &Path) -> Vec<String> {
    let names = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn the_checks_beside_the_example_graphs_pass() {
    let tested = foley(Path::new(env!("CARGO_MANIFEST_DIR")), &["graphs"]);
    let text = text(&tested);
    assert!(tested.status.success() && text.contains(" 0 failed"), "{text}");
    for family in ["basics/clock", "impact/strikes", "cloth/planes", "space/circle"] {
        assert!(text.contains(&format!("ok      graphs/{family}.ron: ")), "{family}: {text}");
    }
}

#[test]
fn each_check_has_a_line_with_what_was_found_and_nothing_is_written() {
    let dir = project(
        "\"as it is\": Case(outputs: {
    \"o.wav\": [Rms(db: -21.0..-19.0), Duration(seconds: 0.5), Repeats],
    \"beat\": [Events(count: 4, times: [0.0, 0.25, 0.5, 0.75])],
    \"clicks\": [Onsets(count: 3..=4)],
    \"level\": [Value(at: \"rms\", is: 0.1..0.2)],
    \"copy.wav\": [Silent, Channels(count: 1)],
}),
\"softer\": Case(set: { \"gain\": 0.5 }, seed: 3, until: 0.25, outputs: {
    \"o.wav\": [Rms(db: -27.0..-25.0), Duration(seconds: 0.25), Peak(db: ..-1.0, during: 0.1..0.2)],
}),",
    );
    let before = files(dir.path());
    let tested = foley(dir.path(), &["g.ron"]);
    let shown = text(&tested);
    assert_eq!(tested.status.code(), Some(0), "{shown}");
    assert!(shown.contains("ok      g.ron: as it is: beat: Events: 4 events at 0.000, 0.250"), "{shown}");
    assert!(shown.contains("ok      g.ron: softer: o.wav: Peak 0.1..0.2 s: -"), "{shown}");
    assert!(shown.ends_with("11 passed, 0 failed in 2 case(s) of 1 file(s)\n"), "{shown}");
    assert_eq!(files(dir.path()), before);
}

#[test]
fn a_check_that_fails_states_what_was_found_and_where_it_is_written() {
    let dir = project("\"a\": Case(outputs: { \"o.wav\": [\n    Rms(db: -10.0..),\n    Finite,\n] })");
    let tested = foley(dir.path(), &["g.ron"]);
    let shown = text(&tested);
    assert_eq!(tested.status.code(), Some(1), "{shown}");
    let line = shown.lines().find(|line| line.starts_with("FAILED  g.ron: a: o.wav: Rms: found -")).unwrap();
    assert!(line.ends_with("dB, expected at least -10 dB (g.test.ron:5:5)"), "{line}");
    let json = foley(dir.path(), &["g.ron", "--json"]);
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(
        (&json["passed"], &json["failed"], &json["checks"][0]["line"]),
        (&1.into(), &1.into(), &5.into())
    );
    assert_eq!(json["checks"][0]["passed"], false);
    // The filter takes the part of the name that is listed.
    let listed = text(&foley(dir.path(), &["g.ron", "--list"]));
    assert_eq!(listed, "g.ron: a: o.wav: Rms\ng.ron: a: o.wav: Finite\n");
    let filtered = foley(dir.path(), &["g.test.ron", "--filter", "Finite"]);
    assert!(filtered.status.success() && text(&filtered).starts_with("ok "), "{filtered:?}");
    assert_eq!(foley(dir.path(), &["g.ron", "--filter", "nothing"]).status.code(), Some(2));
    let quiet = text(&foley(dir.path(), &["g.ron", "--quiet"]));
    assert_eq!(quiet.lines().count(), 2, "{quiet}");
}

#[test]
fn a_result_is_stored_once_and_compared_from_then_on() {
    let dir = project(
        "\"a\": Case(outputs: {
    \"o.wav\": [Stored(file: \"o.stored.wav\")],
    \"beat\": [Stored], // the beat
})",
    );
    let missing = foley(dir.path(), &["g.ron"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(text(&missing).contains("found nothing stored"), "{}", text(&missing));
    let stored = foley(dir.path(), &["g.ron", "--write"]);
    assert!(
        stored.status.success() && text(&stored).contains("stored  g.ron: a: beat: Stored"),
        "{}",
        text(&stored)
    );
    let file = fs::read_to_string(dir.path().join("g.test.ron")).unwrap();
    assert!(
        file.contains("[Stored(digest: \"") && file.contains("// the beat") && file.contains("// A comment.")
    );
    assert!(foley(dir.path(), &["g.ron"]).status.success());
    assert!(foley(dir.path(), &["g.ron", "--write"]).status.success());
    assert_eq!(fs::read_to_string(dir.path().join("g.test.ron")).unwrap(), file, "nothing changes");
    // Another sound and another beat.
    let changed = GRAPH.replace("level: 0.1", "level: 0.11").replace("interval: 0.25", "interval: 0.2");
    fs::write(dir.path().join("g.ron"), changed).unwrap();
    let tested = foley(dir.path(), &["g.ron"]);
    let shown = text(&tested);
    assert_eq!(tested.status.code(), Some(1), "{shown}");
    assert!(shown.contains("found a difference of -") && shown.contains("found digest "), "{shown}");
    assert!(foley(dir.path(), &["g.ron", "--write"]).status.success());
    assert!(foley(dir.path(), &["g.ron"]).status.success());
}

#[test]
fn a_seed_that_matters_and_a_reference_of_another_length_fail() {
    let dir = project(
        "\"a\": Case(outputs: {
    \"noise\": [SameForSeeds(seeds: [1, 2])],
    \"beat\": [SameForSeeds(seeds: [1])],
    \"copy.wav\": [SameAs(file: \"take.wav\")],
    \"o.wav\": [SameAs(file: \"take.wav\"), SameAs(file: \"none.wav\")],
})",
    );
    let shown = text(&foley(dir.path(), &["g.ron"]));
    for line in [
        "FAILED  g.ron: a: noise: SameForSeeds: found a difference of -",
        "ok      g.ron: a: beat: SameForSeeds: the same",
        "ok      g.ron: a: copy.wav: SameAs: the same samples",
        "FAILED  g.ron: a: o.wav: SameAs: found 4000 items of 1 at 8000 Hz, expected 800 items",
        "FAILED  g.ron: a: o.wav: SameAs: found cannot read none.wav",
    ] {
        assert!(shown.contains(line), "{line}\n{shown}");
    }
}

#[test]
fn a_path_that_is_set_is_relative_to_the_graph() {
    let dir = project(
        "\"a\": Case(set: { \"take.path\": \"other.wav\" }, outputs: { \"copy.wav\": [Duration(seconds: 0.2)] })",
    );
    crate::common::write_wav(&dir.path().join("other.wav"), 1, 8000, vec![0_i16; 1600]);
    let elsewhere = tempfile::tempdir().unwrap();
    let tested = foley(elsewhere.path(), &[dir.path().join("g.ron").to_str().unwrap()]);
    assert!(tested.status.success(), "{}", text(&tested));
}

#[test]
fn mistakes_in_a_graph_or_a_test_file_end_with_2_and_leave_the_other_cases() {
    for (cases, message) in [
        ("\"a\": Case(outputs: { \"p.wav\": [Finite] })", "the graph has no file or output `p.wav`"),
        ("\"a\": Case(outputs: { \"loudd\": [Finite] })", "did you mean `loud"),
        ("\"a\": Case(outputs: { \"o.wav\": [Finit] })", "did you mean `Finite`?"),
        (
            "\"a\": Case(set: { \"gian\": 1.0 }, outputs: { \"o.wav\": [Finite] })",
            "this graph has no parameter `gian`",
        ),
        ("\"a\": Case(outputs: { \"o.wav\": [Finite] }", "F001"),
    ] {
        let dir = project(cases);
        let tested = foley(dir.path(), &["g.ron"]);
        let shown = text(&tested);
        assert_eq!(tested.status.code(), Some(2), "{cases}: {shown}");
        assert!(shown.contains(message), "{cases}: {shown}");
    }
    let dir = project(
        "\"a\": Case(outputs: { \"p.wav\": [Finite] }), \"b\": Case(outputs: { \"o.wav\": [Finite] })",
    );
    let shown = text(&foley(dir.path(), &["g.ron"]));
    assert!(
        shown.contains("ok      g.ron: b: o.wav: Finite") && shown.contains("1 could not be run"),
        "{shown}"
    );
    let json = foley(dir.path(), &["g.ron", "--json"]);
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&json["errors"][0]["errors"][0]["code"], &json["passed"]), (&"F086".into(), &1.into()));
    fs::remove_file(dir.path().join("g.test.ron")).unwrap();
    let missing = foley(dir.path(), &["g.ron"]);
    assert!(missing.status.code() == Some(2) && text(&missing).contains("g.test.ron"), "{}", text(&missing));
}

#[test]
fn check_finds_the_mistakes_of_a_test_file() {
    let dir = project("\"a\": Case(outputs: { \"o.wav\": [Peek(db: -1.0)] })");
    let check = |file: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
        command.current_dir(dir.path()).env("NO_COLOR", "1").args(["check", file]).output().unwrap()
    };
    let found = check("g.test.ron");
    assert_eq!(found.status.code(), Some(2));
    assert!(
        text(&found).contains("F086") && text(&found).contains("did you mean `Peak`?"),
        "{}",
        text(&found)
    );
    let right = fs::read_to_string(dir.path().join("g.test.ron")).unwrap().replace("Peek", "Peak");
    fs::write(dir.path().join("g.test.ron"), right).unwrap();
    assert_eq!(check("g.test.ron").status.code(), Some(0));
}
