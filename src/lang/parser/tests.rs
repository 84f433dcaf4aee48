//! One mistake is one error in its place, and hides nothing else of the document.

use super::*;
use crate::lang::{Value, ValueKind};

const GRAPH: &str = r#"#![schema = "foley:graph/1"]
Graph(
    title: "t",
    params: { "lambda": 100.0 },
    nodes: {
        "sheet":    MeshSequence(path: "a.abc"),
        "contacts": ContactDetector(mesh: "sheet", radius: 0.05),
        "speed":    SlidingSpeed(
            contacts: "contacts",
            threshold: 0.02,
        ),
        "out":      WavOut(audio: "speed", path: "sheet.wav"),
    },
)
"#;

fn broken(from: &str, to: &str) -> (String, Parse) {
    assert_eq!(GRAPH.matches(from).count(), 1, "{from:?} is in the graph once");
    let text = GRAPH.replace(from, to);
    let parsed = parse(&text);
    assert_eq!(parsed.syntax().text().to_string(), text);
    (text, parsed)
}

fn ids(parsed: &Parse) -> Vec<String> {
    let document = parsed.document();
    let nodes = document.value.as_ref().and_then(|graph| graph.field("nodes")).and_then(Value::as_map);
    let keys = nodes.unwrap_or_default().iter().filter(|entry| entry.value.as_struct().is_some());
    keys.filter_map(|entry| entry.key.as_str().map(str::to_owned)).collect()
}

/// One error of this kind, whose place starts with `at` (or comes right after it when it is empty), and
/// all nodes are still there.
fn one_error(from: &str, to: &str, code: ErrorKind, at: &str) {
    let (text, parsed) = broken(from, to);
    let [error] = parsed.errors() else { panic!("{from:?} -> {to:?}: {:#?}", parsed.errors()) };
    assert_eq!(error.code, code, "{error:?}");
    assert!(error.expected.is_some(), "{error:?}");
    let right = if error.span.is_empty() {
        text[..error.span.start].ends_with(at)
    } else {
        text[error.span.start..].starts_with(at)
    };
    assert!(right, "{from:?} -> {to:?}: {error:?} at {:?}", &text[error.span.start..]);
    assert_eq!(ids(&parsed), ["sheet", "contacts", "speed", "out"], "{from:?} -> {to:?}");
}

#[test]
fn a_missing_comma_is_one_error_at_its_place() {
    one_error("\"t\",", "\"t\"", ErrorKind::MissingComma, "\"t\"");
    one_error("\"a.abc\"),", "\"a.abc\")", ErrorKind::MissingComma, "\"a.abc\")");
    one_error("\"sheet\", r", "\"sheet\" r", ErrorKind::MissingComma, "\"sheet\"");
    one_error("100.0 },", "100.0 }", ErrorKind::MissingComma, "100.0 }");
    one_error("\"contacts\",\n", "\"contacts\"\n", ErrorKind::MissingComma, "\"contacts\"");
}

#[test]
fn a_missing_closing_bracket_is_one_error_at_the_opening_one() {
    one_error("\"a.abc\"),", "\"a.abc\",", ErrorKind::MissingBracket, "(path: \"a.abc\"");
    one_error("100.0 },", "100.0,", ErrorKind::MissingBracket, "{ \"lambda\"");
    one_error(
        "            threshold: 0.02,\n        ),",
        "            threshold: 0.02,",
        ErrorKind::MissingBracket,
        "(\n            contacts",
    );
    one_error("    },\n)\n", ")\n", ErrorKind::MissingBracket, "{\n        \"sheet\"");
    one_error("    },\n)\n", "    },\n", ErrorKind::MissingBracket, "(\n    title");
    one_error(": 0.05),\n        \"speed\"", ": 0.05, \"speed\"", ErrorKind::MissingBracket, "(mesh");
}

#[test]
fn a_closing_bracket_too_many_is_one_error() {
    one_error("\"a.abc\"),", "\"a.abc\")),", ErrorKind::StrayBracket, "),");
    one_error("100.0 },", "100.0 }},", ErrorKind::StrayBracket, "},");
    one_error("\"t\",", "\"t\"),", ErrorKind::StrayBracket, "),");
    one_error("\"t\",", "\"t\"],", ErrorKind::StrayBracket, "],");
}

#[test]
fn a_missing_colon_value_or_quote_is_one_error() {
    one_error("title: ", "title ", ErrorKind::MissingColon, "title");
    one_error("title: ", "title = ", ErrorKind::MissingColon, "=");
    one_error("radius: ", "radius ", ErrorKind::MissingColon, "radius");
    one_error("\"out\": ", "\"out\" ", ErrorKind::MissingColon, "\"out\"");
    one_error("\"t\",", ",", ErrorKind::MissingValue, "title:");
    one_error("radius: 0.05", "radius:", ErrorKind::MissingValue, "radius:");
    one_error("\"t\",", "\"t,", ErrorKind::UnterminatedString, "\"t");
    one_error("0.02", "0.0.2", ErrorKind::BadNumber, "0.0.2");
    one_error("\"t\",", "\"t\";", ErrorKind::UnknownCharacter, ";");
    one_error("\"t\",", "'text',", ErrorKind::BadCharacter, "'text'");
    one_error("\"t\",", "\"\\q\",", ErrorKind::BadEscape, "\\q");
    one_error("\"t\",", "\"t\",,", ErrorKind::MissingValue, ",");
    one_error("title:", "\"title\":", ErrorKind::MissingKey, "\"title\"");
    one_error("radius: 0.05", "0.05", ErrorKind::MixedFields, "0.05");
    one_error("schema = ", "schema ", ErrorKind::BadAttribute, "schema");
    one_error("#![schema", "#![scheme", ErrorKind::BadAttribute, "scheme");
}

#[test]
fn several_mistakes_are_all_reported() {
    let text = GRAPH
        .replace("\"t\",", "\"t\"")
        .replace("0.05", "0.0.5")
        .replace("\"a.abc\"),", "\"a.abc\",")
        .replace("audio: ", "audio ");
    let parsed = parse(&text);
    let codes: Vec<ErrorKind> = parsed.errors().iter().map(|error| error.code).collect();
    use ErrorKind::*;
    assert_eq!(codes, [MissingComma, MissingBracket, BadNumber, MissingColon]);
    assert_eq!(ids(&parsed), ["sheet", "contacts", "speed", "out"]);
}

#[test]
fn what_is_not_broken_can_be_read() {
    let (_, parsed) = broken("radius: 0.05", "radius: 0.0.5");
    let document = parsed.document();
    let nodes = document.value.as_ref().unwrap().field("nodes").unwrap();
    let contacts = nodes.get("contacts").unwrap();
    assert_eq!(contacts.field("mesh").and_then(Value::as_str), Some("sheet"));
    assert_eq!(contacts.field("radius").map(|value| &value.value), Some(&ValueKind::Error));
    assert_eq!(document.attribute("schema").map(|text| text.value.as_str()), Some("foley:graph/1"));
}

#[test]
fn spans_cover_the_value_alone() {
    let text = "/* a */ A ( x : [ 1 , Some( -2. ) ] /* b */ , x: r#b ) // c";
    let document = parse(text).document();
    let value = document.value.unwrap();
    let mut spans = Vec::new();
    value.walk(&mut |value| spans.push(&text[value.span()]));
    assert_eq!(
        spans,
        [
            "A ( x : [ 1 , Some( -2. ) ] /* b */ , x: r#b )",
            "[ 1 , Some( -2. ) ]",
            "1",
            "Some( -2. )",
            "-2.",
            "r#b"
        ]
    );
    let (name, fields) = value.as_struct().unwrap();
    assert_eq!(name.map(|name| &text[name.span()]), Some("A"));
    let names: Vec<_> =
        fields.iter().map(|field| (&text[field.name.span()], &text[field.span.clone()])).collect();
    assert_eq!(names, [("x", "x : [ 1 , Some( -2. ) ]"), ("x", "x: r#b")]);
}

#[test]
fn a_map_keeps_duplicate_keys_in_order() {
    let document = parse(r#"{"b": 1, "a": 2, "b": 3}"#).document();
    let value = document.value.unwrap();
    let keys: Vec<_> = value
        .as_map()
        .unwrap()
        .iter()
        .map(|entry| (entry.key.as_str().unwrap(), entry.value.as_int().unwrap()))
        .collect();
    assert_eq!(keys, [("b", 1), ("a", 2), ("b", 3)]);
}

#[test]
fn a_byte_order_mark_is_one_error_and_the_rest_is_read() {
    let text = format!("\u{feff}{GRAPH}");
    let parsed = parse(&text);
    assert_eq!(parsed.syntax().text().to_string(), text);
    let [error] = parsed.errors() else { panic!("{:?}", parsed.errors()) };
    assert!(error.span == (0..3) && error.message.contains("byte order mark"), "{error:?}");
    assert_eq!(ids(&parsed), ids(&parse(GRAPH)));
    assert!(!parse(&format!("{GRAPH}\u{feff}")).errors().is_empty());
}
