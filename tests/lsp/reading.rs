//! Hover, definitions, references, renames, hints and the outline.

use super::editor::{Editor, edited, edits_of, file_name, range};
use serde_json::{Value, json};

const INNER: &str = "#![schema = \"foley:graph/1\"]
Graph(
    title: \"inside\",
    params: {\"in\": Required, \"level\": 0.5},
    nodes: {
        \"quiet\": Gain(audio: \"$in\", gain: \"$level\"),
        \"louder\": Gain(audio: \"quiet\", gain: 2.0),
    },
)
";
const OUTER: &str = "#![schema = \"foley:graph/1\"]
Graph(
    use: {\"s\": Sub(path: \"inner.ron\", params: {\"in\": \"noise\", \"louder.gain\": 3.0})},
    nodes: {
        // What is heard.
        \"noise\": Noise(colour: Pink, rate: 44100, duration: Some(0.5)),
        \"mix\": Mix(inputs: [\"s.louder\", \"noise.audio\", \"s.quiet.out\"]),
        \"out\": WavOut(audio: \"mix\", path: \"out.wav\"),
    },
)
";

fn project() -> Editor {
    let mut editor = Editor::new();
    editor.write("inner.ron", INNER);
    editor.write("other/unrelated.ron", OUTER.replace("inner.ron", "../inner.ron"));
    let found = editor.open("outer.ron", OUTER);
    assert!(found.is_empty(), "{found:?}");
    editor
}

/// The text with a `|` before a part of it.
fn at(text: &str, part: &str) -> String {
    text.replacen(part, &format!("|{part}"), 1)
}

#[test]
fn a_hover_explains_each_word() {
    let mut editor = project();
    let mut hover = |part: &str| editor.hover("outer.ron", &at(OUTER, part));
    let noise = hover("noise\": Noise");
    assert!(noise.contains("**noise**: Noise") && noise.contains("44100 Hz, mono"), "{noise}");
    assert!(noise.contains("ends at 0.500 s; latency 0.0 ms"), "{noise}");
    let ty = hover("Noise(");
    assert!(ty.contains("Outputs:") && ty.contains("`colour`"), "{ty}");
    let field = hover("rate: 44100");
    assert!(field.contains("**rate**") && field.contains("default 48000"), "{field}");
    let choice = hover("Pink");
    assert!(choice.starts_with("`Pink`: "), "{choice}");
    let port = hover("audio\", \"s.quiet");
    assert!(port.contains("`audio`: stream of audio, 44100 Hz, mono (Noise `noise`)"), "{port}");
    // A node of a sub-graph has the rates that it has in this graph.
    let inner = hover("louder\", \"noise");
    assert!(inner.contains("**louder**: Gain"), "{inner}");
    let used = hover("s\": Sub");
    assert!(used.contains("inside, 2 node(s)") && used.contains("`level`: `0.5`"), "{used}");
    let param = hover("in\": \"noise\"");
    assert!(param.contains("Parameter `in`"), "{param}");
    let file = hover("inner.ron");
    assert!(file.contains("File `inner.ron`"), "{file}");
    assert_eq!(hover("What is heard"), "");
}

#[test]
fn a_hover_has_the_level_of_a_graph_that_plays() {
    let mut editor = project();
    let levels = |at: f64| foley::live::Levels {
        graph: "outer.ron".into(),
        at,
        played: 7.0,
        out: Some(-12.34),
        meters: [].into(),
        nodes: [("noise", Some(-20.0)), ("mix", None), ("s.louder", Some(-9.5))]
            .map(|(id, peak)| (id.to_owned(), peak))
            .into(),
    };
    levels(foley::live::now()).write(&editor.path("outer.ron")).unwrap();
    let out = editor.hover("outer.ron", &at(OUTER, "out\": WavOut"));
    assert!(out.contains("heard now: -12.3 dB peak, 7 s into the piece"), "{out}");
    let noise = editor.hover("outer.ron", &at(OUTER, "noise\": Noise"));
    assert!(noise.contains("now: -20.0 dB peak, 7 s into the piece"), "{noise}");
    let mix = editor.hover("outer.ron", &at(OUTER, "mix\": Mix"));
    assert!(mix.contains("now: silence, 7 s into the piece"), "{mix}");
    let inner = editor.hover("outer.ron", &at(OUTER, "louder\", \"noise"));
    assert!(inner.contains("now: -9.5 dB peak, 7 s into the piece"), "{inner}");
    levels(foley::live::now() - 60.0).write(&editor.path("outer.ron")).unwrap();
    assert!(!editor.hover("outer.ron", &at(OUTER, "out\": WavOut")).contains("heard"));
}

#[test]
fn definitions_lead_through_sub_graphs() {
    let mut editor = project();
    let mut goto = |part: &str| {
        let found = editor.request("textDocument/definition", editor.at("outer.ron", &at(OUTER, part)));
        (file_name(&found["uri"]).to_owned(), found["range"].clone())
    };
    assert_eq!(goto("mix\", path"), ("outer.ron".into(), range(OUTER, "\"mix\"")));
    assert_eq!(goto("louder\", \"noise"), ("inner.ron".into(), range(INNER, "\"louder\"")));
    assert_eq!(goto("out\"]"), ("inner.ron".into(), range(INNER, "\"quiet\"")));
    assert_eq!(goto("s.louder"), ("outer.ron".into(), range(OUTER, "\"s\"")));
    assert_eq!(goto("in\": \"noise\""), ("inner.ron".into(), range(INNER, "\"in\"")));
    assert_eq!(goto("louder.gain"), ("inner.ron".into(), range(INNER, "\"louder\"")));
    assert_eq!(goto("inner.ron").0, "inner.ron");
}

#[test]
fn references_and_renames_reach_all_graphs() {
    let mut editor = project();
    editor.open("inner.ron", INNER);
    let mut params = editor.at("inner.ron", &at(INNER, "quiet\": Gain"));
    params["context"] = json!({"includeDeclaration": true});
    let found = editor.request("textDocument/references", params);
    let mut files: Vec<String> =
        found.as_array().unwrap().iter().map(|l| file_name(&l["uri"]).to_owned()).collect();
    files.sort();
    assert_eq!(files, ["inner.ron", "inner.ron", "outer.ron", "unrelated.ron"]);

    let mut rename = |name: &str, text: &str, part: &str, new: &str| {
        let mut params = editor.at(name, &at(text, part));
        params["newName"] = json!(new);
        let edit = editor.try_request("textDocument/rename", params)?;
        let texts = [("outer.ron", OUTER), ("inner.ron", INNER)];
        Ok::<_, String>(texts.map(|(name, text)| edited(text, &edits_of(&edit, &editor.uri(name)))))
    };
    let [outer, inner] = rename("outer.ron", OUTER, "louder.gain", "loud").unwrap();
    assert_eq!(inner, INNER.replace("\"louder\"", "\"loud\""));
    assert_eq!(outer, OUTER.replace("louder", "loud"));
    let [outer, inner] = rename("outer.ron", OUTER, "s.quiet", "sub").unwrap();
    assert_eq!((outer, &*inner), (OUTER.replace("\"s.", "\"sub.").replace("\"s\"", "\"sub\""), INNER));
    let [outer, inner] = rename("inner.ron", INNER, "in\", gain", "input").unwrap();
    assert_eq!(inner, INNER.replace("\"in\"", "\"input\"").replace("$in\"", "$input\""));
    assert_eq!(outer, OUTER.replace("\"in\"", "\"input\""));
    let [outer, _] = rename("outer.ron", OUTER, "noise\": Noise", "wind").unwrap();
    assert_eq!(outer, OUTER.replace("\"noise", "\"wind"));
    assert!(rename("outer.ron", OUTER, "noise\": Noise", "mix").unwrap_err().contains("already"));
    assert!(rename("outer.ron", OUTER, "noise\": Noise", "a.b").unwrap_err().contains("cannot be an id"));
    assert!(rename("outer.ron", OUTER, "audio\", \"s.quiet", "x").unwrap_err().contains("belongs to"));
}

#[test]
fn a_graph_that_extends_another_one_has_its_nodes() {
    let mut editor = project();
    let text = "#![schema = \"foley:graph/1\"]
Graph(
    extends: \"outer.ron\",
    nodes: {
        \"noise\": Noise(rate: 48000),
        \"more\": Gain(audio: \"mix\"),
        \"out\": WavOut(audio: \"more\"),
    },
)
";
    let found = editor.open("more.ron", text);
    assert!(found.iter().all(|d| d["severity"] != 1), "{found:?}");
    let goto = editor.request("textDocument/definition", editor.at("more.ron", &at(text, "mix\"")));
    assert_eq!((file_name(&goto["uri"]), &goto["range"]), ("outer.ron", &range(OUTER, "\"mix\"")));
    let hover = editor.hover("more.ron", &at(text, "mix\""));
    assert!(hover.contains("48000 Hz"), "{hover}");
    let typed = editor.completions(&text.replace("audio: \"mix\"", "audio: \"|\""));
    let typed = super::editor::labels(&typed);
    assert!(["mix", "noise", "s.louder"].iter().all(|id| typed.contains(&(*id).to_owned())), "{typed:?}");
    // A rename reaches the node's fields in the other graph.
    let mut params = editor.at("outer.ron", &at(OUTER, "noise\": Noise"));
    params["newName"] = json!("wind");
    let edit = editor.request("textDocument/rename", params);
    let renamed = edited(text, &edits_of(&edit, &editor.uri("more.ron")));
    assert_eq!(renamed, text.replace("\"noise\"", "\"wind\""));
}

#[test]
fn items_of_arrays_are_followed() {
    let mut editor = Editor::new();
    editor.write("voice.ron", "#![schema = \"foley:graph/1\"]\nGraph(params: {\"f\": Required}, nodes: {\"tone\": Tone(frequency: \"$f\", duration: Some(0.1))})\n");
    let text = "#![schema = \"foley:graph/1\"]
Graph(use: {\"v\": Array(path: \"voice.ron\", items: [{\"f\": 1.0}, {\"f\": 2.0}])}, nodes: {
    \"m\": Mix(inputs: [\"v.*.tone\", \"v.1.tone\"]),
    \"o\": WavOut(audio: \"m\", path: \"o.wav\"),
})
";
    let found = editor.open("chord.ron", text);
    assert!(found.is_empty(), "{found:?}");
    for part in ["tone\", \"v.1", "tone\"]"] {
        let found = editor.request("textDocument/definition", editor.at("chord.ron", &at(text, part)));
        assert_eq!(file_name(&found["uri"]), "voice.ron", "{part}");
    }
    let hover = editor.hover("chord.ron", &at(text, "tone\", \"v.1"));
    assert!(hover.contains("**tone**: Tone"), "{hover}");
    let mut params = editor.at("chord.ron", &at(text, "f\": 2.0"));
    params["newName"] = json!("frequency");
    let edit = editor.request("textDocument/rename", params);
    assert_eq!(
        edited(text, &edits_of(&edit, &editor.uri("chord.ron"))),
        text.replace("\"f\"", "\"frequency\"")
    );
    let whole = json!({"start": {"line": 0, "character": 0}, "end": {"line": 99, "character": 0}});
    let params = json!({"textDocument": {"uri": editor.uri("chord.ron")}, "range": whole});
    let hints = editor.request("textDocument/inlayHint", params);
    assert_eq!(hints.as_array().unwrap().len(), 3, "{hints}");
    let typed = editor.completions(&text.replace("v.1.tone", "|"));
    assert!(super::editor::labels(&typed).contains(&"v.*.tone".to_owned()));
}

#[test]
fn links_show_what_comes_over_them() {
    let mut editor = project();
    let whole = json!({"start": {"line": 0, "character": 0}, "end": {"line": 99, "character": 0}});
    let params = json!({"textDocument": {"uri": editor.uri("outer.ron")}, "range": whole});
    let found = editor.request("textDocument/inlayHint", params);
    let labels: Vec<&str> = found.as_array().unwrap().iter().map(|h| h["label"].as_str().unwrap()).collect();
    assert_eq!(labels, ["44100 Hz, mono"; 5], "{found}");
    // A half-typed field blanks nothing elsewhere.
    editor.change("outer.ron", None, &OUTER.replace("colour: Pink", "colour: "));
    let params = json!({"textDocument": {"uri": editor.uri("outer.ron")}, "range": whole});
    let found = editor.request("textDocument/inlayHint", params);
    assert_eq!(found.as_array().unwrap().len(), 5, "{found}");
    assert!(found.as_array().unwrap().iter().all(|h| h["label"] == "44100 Hz, mono"), "{found}");
}

#[test]
fn the_outline_has_all_nodes_and_brackets_fold() {
    let mut editor = project();
    let document = json!({"textDocument": {"uri": editor.uri("outer.ron")}});
    let found = editor.request("textDocument/documentSymbol", document.clone());
    let names = |all: &Value| -> Vec<String> {
        all.as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&found), ["use", "nodes"]);
    assert_eq!(names(&found[1]["children"]), ["noise", "mix", "out"]);
    assert_eq!(found[1]["children"][1]["detail"], "Mix");
    let folds = editor.request("textDocument/foldingRange", document.clone());
    let lines: Vec<(u64, u64)> = folds
        .as_array()
        .unwrap()
        .iter()
        .map(|f| (f["startLine"].as_u64().unwrap(), f["endLine"].as_u64().unwrap()))
        .collect();
    assert_eq!(lines, [(1, 8), (3, 7)]);
    let links = editor.request("textDocument/documentLink", document.clone());
    assert_eq!(links[0]["range"], range(OUTER, "inner.ron"));
    // Every word has a token, in order and without overlaps.
    let tokens = editor.request("textDocument/semanticTokens/full", document);
    let data: Vec<u64> = tokens["data"].as_array().unwrap().iter().map(|x| x.as_u64().unwrap()).collect();
    let lines: Vec<&str> = OUTER.lines().collect();
    let (mut line, mut column, mut words) = (0, 0, Vec::new());
    for token in data.chunks(5) {
        column = if token[0] == 0 { column + token[1] } else { token[1] };
        line += token[0];
        let word = &lines[line as usize][column as usize..(column + token[2]) as usize];
        words.push((word, token[3], token[4]));
    }
    for expected in [
        ("schema", 7, 0),
        ("nodes", 1, 0),
        ("noise", 6, 1),
        ("noise", 6, 0),
        ("Noise", 0, 0),
        ("Pink", 2, 0),
        ("44100", 4, 0),
        ("// What is heard.", 5, 0),
        ("quiet", 6, 0),
    ] {
        assert!(words.contains(&expected), "{expected:?} {words:?}");
    }
}

#[test]
fn a_text_is_laid_out_by_its_changed_lines_alone() {
    let mut editor = Editor::new();
    let text = foley::lang::fmt::format(OUTER).unwrap();
    let text = text.replace("        \"mix\": Mix(", "\"mix\":Mix(");
    editor.open("f.ron", &text);
    let params = json!({"textDocument": {"uri": editor.uri("f.ron")}, "options": {"tabSize": 4, "insertSpaces": true}});
    let edits = editor.request("textDocument/formatting", params.clone());
    assert_eq!(edits.as_array().unwrap().len(), 1);
    assert_eq!(edited(&text, &edits), foley::lang::fmt::format(&text).unwrap());
    assert!(edits[0]["newText"].as_str().unwrap().starts_with("        \"mix\": Mix("), "{edits}");
    editor.change("f.ron", None, "Graph(nodes: {");
    assert_eq!(editor.request("textDocument/formatting", params), Value::Null);
}

#[test]
fn requests_of_other_methods_are_refused_by_name() {
    let mut editor = Editor::new();
    let error = editor.try_request("textDocument/moniker", json!({})).unwrap_err();
    assert!(error.contains("textDocument/moniker"), "{error}");
    let error = editor.try_request("textDocument/hover", json!({"position": 3})).unwrap_err();
    assert!(error.contains("textDocument/hover"), "{error}");
    // A file that is not open, and is not there.
    let place =
        json!({"textDocument": {"uri": editor.uri("no.ron")}, "position": {"line": 3, "character": 9}});
    assert_eq!(editor.request("textDocument/hover", place.clone()), Value::Null);
    assert_eq!(editor.request("textDocument/definition", place), Value::Null);
}
