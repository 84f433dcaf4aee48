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
