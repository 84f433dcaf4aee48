//! `foley table`: parameters and results of nodes over several graphs.

use crate::common::graphs;
use std::path::Path;
use std::process::{Command, Output};

fn table(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_foley")).current_dir(folder).arg("table").args(args).output().unwrap()
}

fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn parameters_stand_in_a_row_for_each_graph_and_part() {
    let columns =
        ["--column", "contacts.radius", "-c", "target.speed.threshold", "-c", "recomposed.selector.d_max"];
    let files = ["sheet.ron", "couch.ron", "exercises.ron"];
    let folder = graphs().join("cloth");
    let text = printed(&table(&folder, &[&files[..], &columns[..]].concat()));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        "| graph | part | contacts.radius | target.speed.threshold | recomposed.selector.d_max |"
    );
    assert!(text.contains("| sheet | cotton.target | 0.016 |  |  |\n"), "{text}");
    assert!(text.contains("| sheet | cotton |  | 0.02 | 4 |\n"), "{text}");
    // The trousers have no crumples, and contacts of their own.
    assert!(
        text.contains("| exercises | windbreaker | ") && text.contains("| exercises | corduroy | 0.012 | "),
        "{text}"
    );
    let json = printed(&table(&folder, &["sheet.ron", "-c", "contacts.radius", "--json"]));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json[0]["graph"], "sheet");
    assert!((json[0]["contacts.radius"].as_f64().unwrap() - 0.016).abs() < 1e-6, "{json}");
    let set = ["sheet.ron", "-c", "contacts.radius", "--csv", "--set", "cotton.target.contacts.radius=0.02"];
    assert_eq!(printed(&table(&folder, &set)), "graph,part,contacts.radius\nsheet,cotton.target,0.0200000\n");
}

#[test]
fn what_runs_report_has_columns_as_well_and_no_file_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let graph = |gain: f64| {
        format!(
            "#![schema = \"foley:graph/1\"]
Graph(nodes: {{
    \"tone\": Tone(frequency: 440.0, rate: 8000, duration: Some(0.5)),
    \"loud\": Gain(audio: \"tone\", gain: {gain:?}),
    \"out\": WavOut(audio: \"loud\", path: \"o.wav\"),
}})"
        )
    };
    for (name, gain) in [("a.ron", 0.5), ("b.ron", 0.25)] {
        std::fs::write(dir.path().join(name), graph(gain)).unwrap();
    }
    let args = ["a.ron", "b.ron", "--run", "-c", "loud.gain", "-c", "out.peak", "-c", "tone.time", "--json"];
    let json: serde_json::Value = serde_json::from_str(&printed(&table(dir.path(), &args))).unwrap();
    for (row, gain) in json.as_array().unwrap().iter().zip([0.5, 0.25]) {
        assert_eq!(row["loud.gain"], gain);
        assert!(
            (row["out.peak"].as_f64().unwrap() / gain - 0.5).abs() < 0.01 && row["tone.time"].is_number(),
            "{row}"
        );
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "no output, no cache");
}

#[test]
fn columns_that_nothing_has_are_named_with_what_there_is() {
    let folder = graphs().join("cloth");
    let refused = |args: &[&str]| {
        let output = table(&folder, args);
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let text = refused(&["sheet.ron", "-c", "contacts.radios"]);
    assert!(
        text.contains("`cotton.target.contacts` (ContactDetector) has no `radios`; it has radius, "),
        "{text}"
    );
    assert!(text.contains("`--run` adds"), "{text}");
    let text = refused(&["sheet.ron", "-c", "contact.radius"]);
    assert!(text.contains("no graph has a node `contact`"), "{text}");
    let text = refused(&["sheet.ron", "-c", "radius"]);
    assert!(text.contains("NODE.FIELD was expected"), "{text}");
    let text = refused(&["nothing.ron", "-c", "a.b"]);
    assert!(text.contains("nothing.ron"), "{text}");
}
