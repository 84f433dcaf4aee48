use super::*;

const GRAPH: &str = r#"Graph(
    title: "speed", // the title is no link
    nodes: {
        "speed": SlidingSpeed(contacts: "contacts"), // keep me
        "noise": IftNoise(speeds: "speed" /* all */, model: "speedy.model"),
        "mix":   Mix(inputs: ["speed.out", "noise", Some("speed")], named: {"speed": "speed.in"}),
    },
)"#;

fn key(parse: &Parse, name: &str) -> Span {
    let document = parse.document();
    let nodes = document.value.as_ref().and_then(|graph| graph.field("nodes")).expect("nodes");
    nodes.as_map().unwrap().iter().find(|entry| entry.key.as_str() == Some(name)).unwrap().key.span()
}

#[test]
fn renaming_a_key_changes_its_links_and_nothing_else() {
    let parsed = parse(GRAPH);
    let edits = rename(&parsed, key(&parsed, "speed"), "slip").unwrap();
    let expected = GRAPH
        .replace("\"speed\": Sliding", "\"slip\": Sliding")
        .replace("speeds: \"speed\"", "speeds: \"slip\"")
        .replace("\"speed.out\"", "\"slip.out\"")
        .replace("Some(\"speed\")", "Some(\"slip\")")
        .replace("\"speed.in\"", "\"slip.in\"");
    assert_eq!(apply(GRAPH, &edits).unwrap(), expected);
}

#[test]
fn a_rename_can_be_limited_to_the_fields_that_are_links() {
    let parsed = parse(GRAPH);
    let is_link = |site: LinkSite<'_>| site.field.is_some_and(|field| field.name.value == "speeds");
    let edits = rename_where(&parsed, key(&parsed, "speed"), "slip", is_link).unwrap();
    assert_eq!(edits.len(), 2);
}

#[test]
fn an_id_that_is_taken_or_no_id_is_refused() {
    let parsed = parse(GRAPH);
    let rename = |new| rename(&parsed, key(&parsed, "speed"), new);
    assert_eq!(rename("mix"), Err(EditError::Taken("mix".to_owned())));
    assert_eq!(rename("a.b"), Err(EditError::BadId("a.b".to_owned())));
    assert_eq!(rename(""), Err(EditError::BadId(String::new())));
    assert!(rename("spe\"ed").unwrap()[0].new_text == r#""spe\"ed""#);
    assert!(matches!(super::rename(&parsed, 0..5, "x"), Err(EditError::NoKey(_))));
}

#[test]
fn a_value_is_replaced_in_its_place() {
    let parsed = parse(GRAPH);
    let document = parsed.document();
    let title = document.value.as_ref().unwrap().field("title").unwrap().span();
    let edits = set_value(&parsed, title.clone(), " r#\"a \"title\"\"# ").unwrap();
    let text = apply(GRAPH, &edits).unwrap();
    assert_eq!(text, GRAPH.replacen("\"speed\"", "r#\"a \"title\"\"#", 1));
    assert!(matches!(set_value(&parsed, title.start..title.end - 1, "1"), Err(EditError::NoValue(_))));
    for wrong in ["", "1, 2", "1]", "[1", "1 // c", "#![type = \"x\"] 1", "a: 1", "1,", "\""] {
        let result = set_value(&parsed, title.clone(), wrong);
        assert!(matches!(result, Err(EditError::NotAValue(_))), "{wrong:?}: {result:?}");
    }
}

#[test]
fn edits_that_overlap_or_reach_outside_are_refused() {
    let edit = |span, new: &str| TextEdit { span, new_text: new.to_owned() };
    assert_eq!(apply("abcd", &[edit(2..3, "X"), edit(0..1, "")]).unwrap(), "bXd");
    assert_eq!(apply("abcd", &[edit(2..2, "1"), edit(2..2, "2")]).unwrap(), "ab12cd");
    assert!(matches!(apply("abcd", &[edit(0..3, ""), edit(2..4, "")]), Err(EditError::Overlap(..))));
    assert!(matches!(apply("abcd", &[edit(3..5, "")]), Err(EditError::Outside(_))));
    assert!(matches!(apply("é", &[edit(1..2, "")]), Err(EditError::Outside(_))));
}

/// The value at a path of fields and indices such as `pairs.1.target`.
fn at<'a>(document: &'a Document, path: &str) -> &'a Value {
    let root = document.value.as_ref().unwrap();
    path.split('.').filter(|step| !step.is_empty()).fold(root, |value, step| match step.parse::<usize>() {
        Ok(index) => &value.as_list().unwrap()[index],
        Err(_) => value.field(step).unwrap(),
    })
}

fn inserted(text: &str, path: &str, index: usize, item: &str) -> String {
    let parsed = parse(text);
    let span = at(&parsed.document(), path).span();
    apply(text, &insert_item(&parsed, span, index, item).unwrap()).unwrap()
}

fn removed(text: &str, path: &str) -> String {
    let parsed = parse(text);
    let span = at(&parsed.document(), path).span();
    apply(text, &remove_item(&parsed, span).unwrap()).unwrap()
}

#[test]
fn items_are_inserted_in_the_layout_of_the_others() {
    for (text, index, expected) in [
        ("[]", 0, "[9]"),
        ("[1, 2]", 0, "[9, 1, 2]"),
        ("[1, 2]", 1, "[1, 9, 2]"),
        ("[1, 2]", 2, "[1, 2, 9]"),
        ("[1, 2,]", 2, "[1, 2, 9,]"),
        ("[\n    1, // one\n    2, // two\n]", 1, "[\n    1, // one\n    9,\n    2, // two\n]"),
        ("[\n    1, // one\n    2, // two\n]", 2, "[\n    1, // one\n    2, // two\n    9,\n]"),
        ("[\n    // first\n    1\n    // end\n]", 1, "[\n    // first\n    1,\n    9\n    // end\n]"),
        ("[1 // one\n]", 1, "[1, // one\n9\n]"),
        ("[1 /* one */, 2]", 1, "[1 /* one */, 9, 2]"),
        ("[1\n// late\n, 2]", 1, "[1\n// late\n, 9, 2]"),
    ] {
        assert_eq!(inserted(text, "", index, "9"), expected, "{text:?} at {index}");
    }
    assert_eq!(inserted("A(a: 1)", "", 1, " b: 2 "), "A(a: 1, b: 2)");
    assert_eq!(inserted("A()", "", 0, "b: 2"), "A(b: 2)");
    assert_eq!(inserted("{\"a\": 1}", "", 0, "\"b\": 2"), "{\"b\": 2, \"a\": 1}");
    let list = parse("[1]");
    for wrong in ["", "1, 2", "1]", "a: 1", "1 // c"] {
        assert!(matches!(insert_item(&list, 0..3, 0, wrong), Err(EditError::NotAValue(_))), "{wrong:?}");
    }
    assert_eq!(insert_item(&list, 0..3, 2, "1"), Err(EditError::NoItem { index: 2, items: 1 }));
    assert_eq!(insert_item(&list, 1..2, 0, "1"), Err(EditError::NoValue(1..2)));
}

#[test]
fn items_are_removed_with_their_lines() {
    for (text, path, expected) in [
        ("[1]", "0", "[]"),
        ("[1, 2, 3]", "0", "[2, 3]"),
        ("[1, 2, 3]", "1", "[1, 3]"),
        ("[1, 2, 3]", "2", "[1, 2]"),
        ("[\n    // first\n    1, // one\n    2, // two\n]", "0", "[\n    // first\n    2, // two\n]"),
        ("[\n    1, // one\n    2 // two\n]", "1", "[\n    1, // one\n]"),
        ("[\n    (a: 1,\n     b: 2),\n    3,\n]", "0", "[\n    3,\n]"),
        ("[1, // one\n 2, 3]", "1", "[1, // one\n 3]"),
    ] {
        assert_eq!(removed(text, path), expected, "{text:?} without {path}");
        assert!(parse(expected).is_ok());
    }
    assert_eq!(remove_item(&parse("[1]"), 0..1), Err(EditError::NoValue(0..1)));
}

#[test]
fn a_file_of_correspondences_is_edited_and_read_again() {
    let text = "// Marked by ear.\nCorrespondences(\n    length: 7.0, // s\n    pairs: [\n        // the fold\n        \
                (target: 1.1, database: 0.3, duration: 0.1),\n        (target: 6.5, database: 0.05, duration: 0.1), // soft\n    ],\n)\n";
    let edit = |text: String, make: &dyn Fn(&Parse, &Document) -> Vec<TextEdit>| {
        let parsed = parse(&text);
        let edits = make(&parsed, &parsed.document());
        apply(&text, &edits).unwrap()
    };
    let text = edit(text.to_owned(), &|parse, file| {
        set_field(parse, at(file, "pairs.0").span(), "label", "\"fold\"").unwrap()
    });
    let text =
        edit(text, &|parse, file| set_value(parse, at(file, "pairs.1.target").span(), "6.25").unwrap());
    let text = edit(text, &|parse, file| {
        insert_item(parse, at(file, "pairs").span(), 2, "(target: 3.0, database: 1.0, duration: 0.2)")
            .unwrap()
    });
    let text =
        edit(text, &|parse, file| set_field(parse, at(file, "").span(), "database", "\"a.wav\"").unwrap());
    let expected = "// Marked by ear.\nCorrespondences(\n    length: 7.0, // s\n    pairs: [\n        // the fold\n        \
                    (target: 1.1, database: 0.3, duration: 0.1, label: \"fold\"),\n        \
                    (target: 6.25, database: 0.05, duration: 0.1), // soft\n        \
                    (target: 3.0, database: 1.0, duration: 0.2),\n    ],\n    database: \"a.wav\",\n)\n";
    assert_eq!(text, expected);
    let set = foley_nodes::warp::read_correspondences(&text).unwrap();
    let targets: Vec<f64> = set.pairs.iter().map(|pair| pair.target).collect();
    assert_eq!((targets, set.database.as_str()), (vec![1.1, 6.25, 3.0], "a.wav"));
    let text = edit(text, &|parse, file| remove_item(parse, at(file, "pairs.0").span()).unwrap());
    assert_eq!(foley_nodes::warp::read_correspondences(&text).unwrap().pairs.len(), 2);
    assert!(text.contains("// the fold") && text.contains("// soft"), "{text}");
    let name = parse("Loop");
    assert_eq!(apply("Loop", &set_field(&name, 0..4, "gain", "1").unwrap()).unwrap(), "Loop(gain: 1)");
}
