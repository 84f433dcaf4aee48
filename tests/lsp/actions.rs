//! Quick fixes, and the extraction of nodes into a sub-graph.

use super::editor::{Editor, edited, edits_of, position, range};
use foley::Session;
use foley::run::StreamTap;
use serde_json::json;
use std::sync::Arc;

fn graph(nodes: &str) -> String {
    format!("#![schema = \"foley:graph/1\"]\nGraph(\n    nodes: {{\n        {nodes}\n    }},\n)\n")
}

/// The text after the fix whose title has these words, for the first finding of a text.
fn fixed(editor: &mut Editor, text: &str, title: &str) -> String {
    let name = format!("fix{}.ron", text.len());
    let found = editor.open(&name, text);
    let first = found.first().unwrap_or_else(|| panic!("nothing is wrong with {text}"));
    let context = json!({"diagnostics": [first]});
    let params =
        json!({"textDocument": {"uri": editor.uri(&name)}, "range": first["range"], "context": context});
    let actions = editor.request("textDocument/codeAction", params);
    let actions = actions.as_array().unwrap();
    let action = actions.iter().find(|a| a["title"].as_str().unwrap().contains(title));
    let action = action.unwrap_or_else(|| panic!("no fix `{title}` for {first}: {actions:?}"));
    assert_eq!(action["diagnostics"][0]["code"], first["code"]);
    let new = edited(text, &edits_of(&action["edit"], &editor.uri(&name)));
    editor.notify("textDocument/didClose", json!({"textDocument": {"uri": editor.uri(&name)}}));
    new
}

#[test]
fn each_finding_has_its_fix() {
    let mut editor = Editor::new();
    let mut fix = |nodes: &str, title: &str, expected: &str| {
        assert_eq!(fixed(&mut editor, &graph(nodes), title), graph(expected), "{nodes}");
    };
    let out = "\"o\": WavOut(audio: \"g\", path: \"o.wav\"),";
    let noise = "\"noise\": Noise(duration: Some(1.0)),";
    let with = |node: &str| format!("{noise}\n        {node}\n        {out}");
    fix(&with("\"g\": Gian(audio: \"noise\"),"), "write `Gain`", &with("\"g\": Gain(audio: \"noise\"),"));
    fix(
        &with("\"g\": Gain(audoi: \"noise\", audio: \"noise\"),"),
        "write `audio`",
        &with("\"g\": Gain(audio: \"noise\", audio: \"noise\"),"),
    );
    fix(
        &with("\"g\": Gain(audio: \"nosie\"),"),
        "write `\"noise\"`",
        &with("\"g\": Gain(audio: \"noise\"),"),
    );
    fix(
        &with("\"g\": Gain(audio: \"noise.audo\"),"),
        "write `\"noise.audio\"`",
        &with("\"g\": Gain(audio: \"noise.audio\"),"),
    );
    fix(&with("\"g\": Gain(audio: noise),"), "write `\"noise\"`", &with("\"g\": Gain(audio: \"noise\"),"));
    fix(&with("\"g\": Gain(),"), "add `audio: \"noise\"`", &with("\"g\": Gain(audio: \"noise\"),"));
    fix(&with("\"g\": Gain,"), "add `audio: \"noise\"`", &with("\"g\": Gain(audio: \"noise\"),"));
    fix(
        &with("\"g\": Gain(audio: \"noise\", gain: \"0.5\"),"),
        "write `0.5`",
        &with("\"g\": Gain(audio: \"noise\", gain: 0.5),"),
    );
    fix(&with("\"g\": Noise(colour: Pnk),"), "write `Pink`", &with("\"g\": Noise(colour: Pink),"));
    fix(&with("\"g\": Noise(rate: \"48 kHz\"),"), "write `48000`", &with("\"g\": Noise(rate: 48000),"));
    fix(&with("\"g\": Mix(inputs: [\"noise\"])"), "insert `,`", &with("\"g\": Mix(inputs: [\"noise\"]),"));
    fix(
        &with("\"g\": Gain(audio: \"noise\"), \"idle\": Noise(),"),
        "remove the node",
        &with("\"g\": Gain(audio: \"noise\"), "),
    );
    fix(
        &with("\"g\": Gain(audio: [\"noise\", \"noise\"]),"),
        "put Mix in between",
        &with("\"g_mix\": Mix(inputs: [\"noise\", \"noise\"]),\n        \"g\": Gain(audio: \"g_mix\"),"),
    );
    fix(
        &with("\"g\": Gain(audio: \"noise\", gain: 1e12),"),
        "write `",
        &with("\"g\": Gain(audio: \"noise\", gain: 1000),"),
    );
    fix(
        &with(
            "\"k\": Noise(rate: 44100, duration: Some(1.0)),\n        \"g\": Mix(inputs: [\"noise\", \"k\"]),",
        ),
        "put Resample in between",
        &with(
            "\"k\": Noise(rate: 44100, duration: Some(1.0)),\n        \"k_resample\": Resample(audio: \"k\", rate: 48000),\n        \"g\": Mix(inputs: [\"noise\", \"k_resample\"]),",
        ),
    );
}

#[test]
fn fixes_of_the_graph_itself() {
    let mut editor = Editor::new();
    let head = "#![schema = \"foley:graph/1\"]\n";
    let body = "Graph(nodes: {\"noise\": Noise(duration: Some(1.0)), \"o\": WavOut(audio: \"noise\", path: \"o.wav\")})\n";
    assert_eq!(fixed(&mut editor, body, "begin with"), format!("{head}{body}"));
    let wrong = format!("{head}{}", body.replace("Graph(", "Graph(titel: \"x\", "));
    assert_eq!(fixed(&mut editor, &wrong, "write `title`"), wrong.replace("titel", "title"));
    let wrong = format!("{}{body}", head.replace("/1", "/7"));
    assert_eq!(fixed(&mut editor, &wrong, "write `\"foley:graph/1\"`"), format!("{head}{body}"));
    let wrong = format!(
        "{head}{}",
        body.replace("Graph(", "Graph(params: {\"long\": 1.0}, ").replace("Some(1.0)", "\"$lnog\"")
    );
    assert_eq!(fixed(&mut editor, &wrong, "write `\"$long\"`"), wrong.replace("$lnog", "$long"));
}

#[test]
fn selected_nodes_move_into_a_sub_graph_that_sounds_the_same() {
    let mut editor = Editor::new();
    let text = "#![schema = \"foley:graph/1\"]
Graph(
    params: {\"level\": 0.25},
    nodes: {
        // The filter.
        \"low\": LowPass(audio: \"in\", cutoff: 900.0),
        \"soft\": Gain(audio: \"low\", gain: \"$level\"),

        \"in\": Tone(frequency: 300.0, duration: Some(0.5)),
        \"out\": WavOut(audio: \"soft\", path: \"out.wav\"),
    },
)
";
    let found = editor.open("song.ron", text);
    assert!(found.iter().all(|d| d["severity"] != 1), "{found:?}");
    let selection =
        json!({"start": position(text, "low\": LowPass"), "end": range(text, "gain: \"$level\"")["end"]});
    let params = json!({"textDocument": {"uri": editor.uri("song.ron")}, "range": selection, "context": {"diagnostics": []}});
    let actions = editor.request("textDocument/codeAction", params);
    let action = actions.as_array().unwrap().iter().find(|a| a["kind"] == "refactor.extract").unwrap();
    let changes = action["edit"]["documentChanges"].as_array().unwrap();
    assert_eq!(changes[0]["kind"], "create");
    assert_eq!(changes[0]["uri"], editor.uri("song_part.ron"));
    let inner = changes[1]["edits"][0]["newText"].as_str().unwrap();
    let outer = edited(text, &changes[2]["edits"]);
    assert!(inner.contains("// The filter.") && inner.contains("\"in\": Required"), "{inner}");
    assert!(
        outer.contains(
            "\"part\": Sub(path: \"song_part.ron\", params: {\"in\": \"in\", \"level\": \"$level\"})"
        ),
        "{outer}"
    );
    assert!(outer.contains("audio: \"part.soft\"") && !outer.contains("The filter"), "{outer}");
    editor.write("before.ron", text);
    editor.write("song_part.ron", inner);
    editor.write("after.ron", &outer);
    let sound = |name: &str| {
        let mut session = Session::from_file(editor.path(name));
        let tap = Arc::new(StreamTap::<f32>::new());
        session.tap(if name == "after.ron" { "part.soft" } else { "soft" }, &tap);
        session.render_to_memory().unwrap();
        tap.take().unwrap().data
    };
    let (before, after) = (sound("before.ron"), sound("after.ron"));
    assert!(before.len() > 1000 && before.iter().any(|x| x.abs() > 0.01));
    assert_eq!(before, after);
}

#[test]
fn links_to_a_graph_that_is_extended_become_parameters_of_what_is_extracted() {
    let mut editor = Editor::new();
    let head = "#![schema = \"foley:graph/1\"]\n";
    editor.write(
        "base.ron",
        format!("{head}Graph(params: {{\"level\": 0.5}}, nodes: {{\"in\": Tone(duration: Some(0.1))}})\n"),
    );
    let text = format!(
        "{head}Graph(\n    extends: \"base.ron\",\n    nodes: {{\n        \"in\": Tone(frequency: 300.0),\n        \"soft\": Gain(audio: \"in\", gain: \"$level\"),\n        \"out\": WavOut(audio: \"soft\", path: \"o.wav\"),\n    }},\n)\n"
    );
    assert!(editor.open("more.ron", &text).iter().all(|d| d["severity"] != 1));
    let extract = |editor: &mut Editor, part: &str| {
        let document = json!({"uri": editor.uri("more.ron")});
        let params =
            json!({"textDocument": document, "range": range(&text, part), "context": {"diagnostics": []}});
        let actions = editor.request("textDocument/codeAction", params);
        actions.as_array().unwrap().iter().find(|a| a["kind"] == "refactor.extract").cloned()
    };
    let action = extract(&mut editor, "\"soft\": Gain").unwrap();
    let changes = action["edit"]["documentChanges"].as_array().unwrap();
    let inner = changes[1]["edits"][0]["newText"].as_str().unwrap();
    assert!(inner.contains("audio: \"$in\"") && inner.contains("\"level\": Required"), "{inner}");
    let outer = edited(&text, &changes[2]["edits"]);
    assert!(outer.contains("params: {\"in\": \"in\", \"level\": \"$level\"}"), "{outer}");
    editor.write("more_part.ron", inner);
    editor.write("after.ron", &outer);
    Session::from_file(editor.path("after.ron")).render_to_memory().unwrap();
    // What changes a node of the other graph has its meaning in this one alone.
    assert!(extract(&mut editor, "\"in\": Tone(frequency").is_none());
}
