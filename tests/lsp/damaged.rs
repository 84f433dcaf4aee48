//! Requests about texts in every state of being typed: all are answered.

use super::editor::Editor;
use foley_nodes::core::random::Rng;
use serde_json::json;
use std::fs;

/// Requests at a place, and of a whole text.
const REQUESTS: [&str; 11] = [
    "completion",
    "hover",
    "definition",
    "documentHighlight",
    "prepareRename",
    "documentSymbol",
    "foldingRange",
    "documentLink",
    "semanticTokens/full",
    "inlayHint",
    "codeAction",
];

/// Pieces that are typed into texts.
const PIECES: [&str; 20] = [
    "\"", "(", ")", "[", "]", "{", "}", ",", ":", "$", ".", "*", "/*", "//", "Gain(", "\"s.", "é😀", "Some(",
    "\n", "#![",
];

#[test]
fn every_request_about_a_half_typed_text_is_answered() {
    let mut editor = Editor::new();
    let mut rng = Rng::new(7);
    for name in
        ["cloth/sheet.ron", "cloth/units_global.ron", "lib/recompose.ron", "assets/scores/manual.score.ron"]
    {
        let original = fs::read_to_string(crate::common::graphs().join(name)).unwrap();
        let file = name.rsplit('/').next().unwrap();
        let mut text = original.clone();
        editor.open(file, &text);
        for round in 0..60 {
            if round % 20 == 0 {
                text.clone_from(&original);
            }
            // A place between two characters; a piece is typed, or a few characters are deleted.
            let places: Vec<usize> = text.char_indices().map(|(at, _)| at).chain([text.len()]).collect();
            let at = rng.below(places.len());
            let end = places[(at + rng.below(8)).min(places.len() - 1)];
            let at = places[at];
            match rng.below(2) {
                0 => text.insert_str(at, PIECES[rng.below(PIECES.len())]),
                _ => text.replace_range(at..end, ""),
            }
            let lines: Vec<&str> = text[..at].split('\n').collect();
            let position =
                json!({"line": lines.len() - 1, "character": lines[lines.len() - 1].encode_utf16().count()});
            let whole = json!({"start": {"line": 0, "character": 0}, "end": position});
            let document = json!({"uri": editor.uri(file)});
            editor.change_unheard(file, &text);
            let method = REQUESTS[rng.below(REQUESTS.len())];
            let params = json!({
                "textDocument": document, "position": position, "range": whole,
                "context": {"diagnostics": [], "triggerKind": 1},
            });
            editor.request(&format!("textDocument/{method}"), params);
        }
        editor.notify("textDocument/didClose", json!({"textDocument": {"uri": editor.uri(file)}}));
    }
}
