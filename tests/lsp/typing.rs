//! Findings and completion while a text is typed.

use super::editor::{Editor, labels, position, range};
use serde_json::json;

const HEAD: &str = "#![schema = \"foley:graph/1\"]\n";

fn graph(nodes: &str) -> String {
    format!("{HEAD}Graph(nodes: {{\n{nodes}\n}})\n")
}

#[test]
fn findings_follow_the_unsaved_text() {
    let mut editor = Editor::new();
    let text = graph("\"a\": Noise(duration: Some(1.0)),\n\"b\": WavOut(audio: \"aa\", path: \"b.wav\"),");
    let found = editor.open("a.ron", &text);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((&found[0]["code"], &found[0]["severity"]), (&json!("F020"), &json!(1)));
    assert_eq!(found[0]["range"], range(&text, "\"aa\""));
    assert!(found[0]["message"].as_str().unwrap().contains("did you mean `a`?"), "{found:?}");
    // One letter is deleted; then the text is broken, then whole again.
    let start = position(&text, "aa\"");
    let end = json!({"line": start["line"], "character": start["character"].as_u64().unwrap() + 1});
    assert!(editor.change("a.ron", Some(json!({"start": start, "end": end})), "").is_empty());
    let broken = editor.change("a.ron", None, &graph("\"a\": Noise(durat"));
    assert!(broken.iter().any(|d| d["code"] == "F001"), "{broken:?}");
    let warned = editor.change(
        "a.ron",
        None,
        &text.replace("aa", "a").replace("})\n", "\"c\": Gain(audio: \"a\")})\n"),
    );
    assert_eq!(warned[0]["tags"], json!([1]), "{warned:?}");
    // Columns are UTF-16 units.
    let text = graph("/* 😀 */ \"ä\": Nois(),");
    let found = editor.change("a.ron", None, &text);
    assert_eq!(found[0]["range"], range(&text, "Nois"));
}

#[test]
fn a_change_of_a_sub_graph_reaches_the_graphs_that_use_it() {
    let mut editor = Editor::new();
    let inner = format!(
        "{HEAD}Graph(params: {{\"level\": Required}}, nodes: {{\"n\": Noise(duration: Some(0.1)), \"g\": Gain(audio: \"n\", gain: \"$level\")}})\n"
    );
    let outer = format!(
        "{HEAD}Graph(use: {{\"s\": Sub(path: \"inner.ron\", params: {{\"level\": 0.5}})}}, nodes: {{\n\"o\": WavOut(audio: \"s.g\", path: \"o.wav\")}})\n"
    );
    editor.write("inner.ron", &inner);
    assert_eq!(editor.open("outer.ron", &outer), Vec::<serde_json::Value>::new());
    // A graph that waits for its parameters is no error.
    let found = editor.open("inner.ron", &inner);
    assert!(found.iter().all(|d| d["severity"] == 4), "{found:?}");
    editor.change("inner.ron", None, &inner.replace("Noise", "Nois"));
    let found = editor.next_findings("outer.ron");
    assert_eq!(found[0]["range"], range(&outer, "\"inner.ron\""), "{found:?}");
    assert_eq!(found[0]["relatedInformation"][0]["location"]["uri"], editor.uri("inner.ron"));
}

#[test]
fn what_can_be_typed_follows_the_place() {
    let mut editor = Editor::new();
    editor.write("data/take.wav", "x");
    editor.write("lib.ron", format!("{HEAD}Graph(params: {{\"a\": 1}}, nodes: {{\"n\": Noise()}})"));
    let mut typed = |text: &str| labels(&editor.completions(text));
    assert!(typed("|").contains(&"Graph".to_owned()));
    assert_eq!(typed("Graph(title: \"x\", |)"), ["extends", "nodes", "params", "seed", "use"]);
    let types = typed(&graph("\"a\": |"));
    assert!(types.len() > 150 && types.contains(&"Gain".to_owned()), "{}", types.len());
    assert!(typed(&graph("\"a\": Ga|")).contains(&"Gain".to_owned()));
    // Fields that have to be given come first, and those that are given are left out.
    assert_eq!(typed(&graph("\"a\": Gain(|)"))[..2], ["audio".to_owned(), "gain".to_owned()]);
    assert!(!typed(&graph("\"a\": Gain(audio: \"x\", |)")).contains(&"audio".to_owned()));
    assert!(!typed(&graph("\"a\": Gain(|, audio: \"x\")")).contains(&"audio".to_owned()));
    assert!(typed(&graph("\"a\": Noise(colour: |)")).contains(&"Pink".to_owned()));
    assert!(typed(&graph("\"a\": Noise(duration: Some(|))")).iter().all(|label| label != "Gain"));
    // Links by type: the numbers of a curve are no audio.
    let nodes = "\"n\": Noise(), \"e\": ContactDetector(|), \"w\": WavOut(audio: \"|\"), \"z\": Noise()";
    let links = typed(&graph(&nodes.replacen("(|)", "()", 1)));
    assert_eq!(links, ["n", "z"]);
    assert_eq!(typed(&graph("\"n\": Noise(),\n\"m\": Mix(inputs: [\"n\", |")), ["n"]);
    assert_eq!(typed("Graph(use: {\"s\": \"lib.ron\"}, nodes: {\"w\": WavOut(audio: \"s.|\")"), ["s.n"]);
    assert_eq!(typed("Graph(params: {\"p\": 1}, nodes: {\"g\": Gain(gain: \"$|\")"), ["$p"]);
    assert_eq!(typed(&graph("\"w\": WavIn(path: \"data/|\")")), ["data/take.wav"]);
    assert!(typed("Graph(use: {\"s\": \"|\"").contains(&"lib.ron".to_owned()));
    assert_eq!(typed("Graph(use: {\"s\": Sub(path: \"lib.ron\", params: {\"|\": 2}"), ["a"]);
    assert_eq!(typed(&graph("// \"a\": |")), Vec::<String>::new());
    assert_eq!(typed("#![schema = \"|\"]"), ["foley:graph/1"]);
}

#[test]
fn a_node_comes_with_its_required_fields() {
    let mut editor = Editor::new();
    let items = editor.completions(&graph("\"a\": |"));
    let insert = |name: &str| {
        let item = items.iter().find(|item| item["label"] == name).unwrap();
        item["textEdit"]["newText"].as_str().unwrap().to_owned()
    };
    assert_eq!(insert("Gain"), "Gain(audio: \"$1\")");
    assert_eq!(insert("Mix"), "Mix(inputs: [\"$1\"])");
    assert_eq!(insert("WavOut"), "WavOut(audio: \"$1\", path: \"$2\")");
    // Every snippet is a node whose text can be read.
    for item in &items {
        let text = item["textEdit"]["newText"].as_str().unwrap();
        let mut plain = text.to_owned();
        while let Some(at) = plain.find('$') {
            let end = at + 1 + plain[at + 1..].find(|c: char| !c.is_ascii_digit() && c != '{').unwrap();
            let inner = plain[at..].starts_with("${");
            plain.replace_range(at..if inner { end + 1 } else { end }, "");
            if inner {
                let close = plain[at..].find('}').unwrap();
                plain.remove(at + close);
            }
        }
        let nodes = graph(&format!("\"a\": {plain}"));
        assert!(foley::lang::parse(&nodes).is_ok(), "{text} {plain}");
    }
}

#[test]
fn links_of_another_rate_come_last() {
    let mut editor = Editor::new();
    let nodes = "\"a\": Noise(rate: 44100),\n\"b\": Noise(rate: 48000),\n\"c\": Noise(rate: 48000),\n\"m\": Mix(inputs: [\"c\", \"|\"]),";
    let text = graph(nodes);
    editor.open("m.ron", &text.replacen('|', "", 1));
    let found = editor.request("textDocument/completion", editor.at("m.ron", &text));
    let found = found["items"].as_array().unwrap();
    assert_eq!(labels(found), ["b", "c", "a"]);
    let b = found.iter().find(|item| item["label"] == "b").unwrap();
    assert!(b["detail"].as_str().unwrap().contains("48000 Hz, mono"), "{b}");
}

#[test]
fn correspondences_materials_and_scores_are_checked_and_completed() {
    let mut editor = Editor::new();
    let text = "Correspondences(\n  version: 1,\n  pairs: [\n    (target: 1.0, database: 2.0, duration: -3),\n  ],\n)\n";
    let found = editor.open("a.correspondences.ron", text);
    assert_eq!(found[0]["range"], range(text, "-3"), "{found:?}");
    assert!(found[0]["message"].as_str().unwrap().contains("a number from"), "{found:?}");
    let right = text.replace("-3", "0.1");
    assert!(editor.change("a.correspondences.ron", None, &right).is_empty());
    let typed = labels(&editor.completions("SoundScore(sources: [(name: \"a\", |)])"));
    assert_eq!(typed, ["outside", "recording", "segments"]);
    assert!(labels(&editor.completions("Material(damping: (model: |))")).contains(&"Rayleigh".to_owned()));
    let params = json!({"textDocument": {"uri": editor.uri("a.correspondences.ron")}});
    let symbols = editor.request("textDocument/documentSymbol", params);
    assert_eq!(symbols[1]["children"][0]["children"][2]["name"], "duration", "{symbols}");
    // Checks beside a graph.
    let test =
        "#![schema = \"foley:test/1\"]\nTest(cases: {\"a\": Case(outputs: {\"o.wav\": [Peek(db: 1.0)]})})\n";
    let found = editor.open("a.test.ron", test);
    assert_eq!((&found[0]["code"], &found[0]["range"]), (&json!("F086"), &range(test, "Peek")), "{found:?}");
    let typed = labels(&editor.completions("Test(cases: {\"a\": Case(outputs: {\"o.wav\": [|]})})"));
    assert!(typed.contains(&"Onsets".to_owned()) && typed.len() > 15, "{typed:?}");
    let typed = labels(&editor.completions("Test(cases: {\"a\": Case(outputs: {\"o.wav\": [Peak(|)]})})"));
    assert_eq!(typed, ["db", "during"]);
    // A file of another program.
    assert!(editor.open("other.ron", "Settings(a: 1)").is_empty());
    assert!(editor.completions("Settings(|)").is_empty());
}
