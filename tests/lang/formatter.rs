//! The formatter preserves values and comments, and does not change formatted text.

use super::plain::Plain;
use foley::lang::{fmt::format, parse};
use proptest::prelude::*;

fn comments(text: &str) -> Vec<String> {
    let tokens = parse(text).syntax().descendants_with_tokens().filter_map(|element| element.into_token());
    let mut comments: Vec<String> =
        tokens.filter(|t| t.kind().is_comment()).map(|t| t.text().trim_end().to_owned()).collect();
    comments.sort();
    comments
}

fn check(text: &str) -> String {
    let once = format(text).unwrap_or_else(|errors| panic!("{text:?}: {errors:?}"));
    let read = |text: &str| ron::from_str::<Plain>(text).unwrap_or_else(|e| panic!("{text:?}: {e}"));
    assert_eq!(read(text), read(&once), "the value of {text:?}\nas {once}");
    assert_eq!(comments(text), comments(&once), "the comments of {text:?}\nas {once}");
    let twice = format(&once).expect("formatted text is valid");
    assert_eq!(once, twice, "formatting {text:?} twice");
    assert!(!once.lines().any(|line| line.ends_with(' ')) || text.contains(['"', '*']), "{once:?}");
    once
}

fn check_is(text: &str, expected: &str) {
    assert_eq!(check(text), expected);
}

#[test]
fn the_example_of_the_design_keeps_its_alignment() {
    let text = r#"#![schema = "foley:graph/1"]
Graph(
    title: "Cotton sheet dragged over a floor",
    params: { "lambda": 100.0 }, // overridable
    nodes: {
        "sheet":    MeshSequence(path: "../assets/sheet.abc"),
        "contacts": ContactDetector(mesh: "sheet", radius: 0.05),
        "out":      WavOut(audio: "friction", path: "sheet.wav"),
    },
)
"#;
    check_is(text, text);
    check_is(&text.replace("\n    ", "\n\t\t"), text);
}

#[test]
fn alignment_needs_all_of_a_group() {
    check("(a:{{\n}:1,-2.5:1,inf\t:1})");
    check("{[\n]:1,ab\t:1,(\n):2}");
    check_is("{\n\"a\":   1,\n\"bbb\": 2,\n}", "{\n    \"a\":   1,\n    \"bbb\": 2,\n}\n");
    check_is("{\n\"a\":   1,\n\"bbb\":  2,\n}", "{\n    \"a\": 1,\n    \"bbb\": 2,\n}\n");
    check_is("{\n\"a\":     1,\n\"bbb\":   2,\n}", "{\n    \"a\":   1,\n    \"bbb\": 2,\n}\n");
    check_is(
        "{\n\"a\":   1,\n\"bbb\": 2,\n\n\"c\": 3}",
        "{\n    \"a\":   1,\n    \"bbb\": 2,\n\n    \"c\": 3,\n}\n",
    );
}

#[test]
fn short_containers_stay_on_one_line_and_long_ones_do_not() {
    check_is(
        "A( a :1,b:[ 1,2 , 3, ] ,c:{1:2},d:{},e:( ),f:(1 , ) , )",
        "A(a: 1, b: [1, 2, 3], c: { 1: 2 }, d: {}, e: ( ), f: (1,))\n",
    );
    check_is("A(\na:1)", "A(\n    a: 1,\n)\n");
    check_is("{1:2,\n3:4}", "{\n    1: 2,\n    3: 4,\n}\n");
    check_is("[1,2,\n3,4]", "[\n    1, 2,\n    3, 4,\n]\n");
    let long = format!("[{}]", "12345, ".repeat(40));
    assert!(check(&long).lines().all(|line| line.len() <= 100));
    let long = format!("A(a: \"{}\", b: \"{}\")", "x".repeat(60), "y".repeat(60));
    assert_eq!(check(&long).lines().count(), 4);
}

#[test]
fn comments_stay_where_they_belong() {
    check_is(
        "// head\n\n\n\n#![type = \"x\"] // type\n( // open\na: 1 // a\n, /* b */ b: 2,\n\n\n// c\nc: // moved\n3\n// end\n) // tail\n// last",
        "// head\n\n#![type = \"x\"] // type\n( // open\n    a: 1, // a\n    /* b */ b: 2,\n\n    // c\n    // moved\n    c: 3,\n    // end\n) // tail\n// last\n",
    );
    check_is("[/* a */ 1 /* b */, 2 /* c */]", "[/* a */ 1 /* b */, 2 /* c */]\n");
    check_is("{ // only\n}", "{ // only\n}\n");
    check_is("[\n// only\n\n]", "[\n    // only\n]\n");
    check_is("A /* n */ (/* e */)", "A /* n */(/* e */)\n");
}

#[test]
fn every_valid_document_of_the_table_can_be_formatted() {
    for case in include_str!("../lang_ron/cases.txt").lines().filter(|case| parse(case).is_ok()) {
        check(case);
        for wrapped in
            ["[\n@]", "(@,\n@)", "{@:\n@,@:@}", "A(\n\na : // c\n @)", "[@, // c\n\n\n@ /* d */, @]"]
        {
            let document = wrapped.replace('@', case);
            if parse(&document).is_ok() {
                check(&document);
            }
        }
    }
}

#[test]
fn lines_end_as_they_did() {
    let unix = "Graph(\n    nodes: {\n        \"a\": Tone(), // c\n    },\n)\n";
    let windows = unix.replace('\n', "\r\n");
    assert_eq!(format(&windows).unwrap(), windows);
    assert_eq!(format(&windows.replace("    ", " ")).unwrap(), windows);
    // Those of a string stay; they are part of the value.
    let mixed = "[\r\n    \"two\nlines\", // c\r\n]\r\n";
    assert_eq!(format(mixed).unwrap(), mixed);
}

#[test]
fn a_text_with_errors_is_not_formatted() {
    assert_eq!(format("[1 2").unwrap_err().len(), 2);
}

fn trivia() -> impl Strategy<Value = String> {
    let pieces = ["", "", "", " ", "\n", "\n\n\n", " // c\n", "/* b */", "/* m\n  n */", "\r\n", "\t"];
    prop::collection::vec(prop::sample::select(pieces.to_vec()), 0..3).prop_map(|all| all.concat())
}

fn value() -> impl Strategy<Value = String> {
    let atoms = [
        "1",
        "-2.5",
        "inf",
        "true",
        "()",
        "( )",
        "'x'",
        "\"s\"",
        "\"two\nlines\"",
        "r#\"raw\"#",
        "b\"b\"",
        "None",
        "A",
        "1..2",
        "..",
        "\"a rather long string that makes the line around it too long to fit\"",
        "r#a.b",
        "0x1F",
    ];
    let atom = prop::sample::select(atoms.to_vec()).prop_map(str::to_owned);
    atom.prop_recursive(4, 40, 5, |inner| {
        let item = (trivia(), inner, trivia()).prop_map(|(a, b, c)| format!("{a}{b}{c}")).boxed();
        let names = prop::sample::select(vec!["", "Node", "r#type"]);
        let fields = prop::sample::select(vec!["a", "longer_name", "r#x"]);
        let tail = prop::sample::select(vec!["", ","]);
        let join = |items: Vec<String>, tail: &str| {
            let tail = if items.is_empty() { "" } else { tail };
            format!("{}{tail}", items.join(","))
        };
        let field =
            (trivia(), fields, trivia(), item.clone()).prop_map(|(a, f, b, v)| format!("{a}{f}{b}:{v}"));
        let entry = (item.clone(), item.clone()).prop_map(|(k, v)| format!("{k}:{v}"));
        let many = prop::collection::vec(item.clone(), 0..5);
        prop_oneof![
            (many.clone(), tail.clone()).prop_map(move |(v, t)| format!("[{}]", join(v, t))),
            (names.clone(), trivia(), many, tail.clone(), trivia())
                .prop_map(move |(n, s, v, t, e)| format!("{n}{s}({}{e})", join(v, t))),
            (names, trivia(), prop::collection::vec(field, 1..5), tail.clone(), trivia())
                .prop_map(move |(n, s, v, t, e)| format!("{n}{s}({}{e})", join(v, t))),
            (prop::collection::vec(entry, 0..5), tail.clone(), trivia())
                .prop_map(move |(v, t, e)| format!("{{{}{e}}}", join(v, t))),
            (item, tail).prop_map(|(v, t)| format!("Some({v}{t})")),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn generated_documents_keep_value_and_comments(head in trivia(), value in value(), tail in trivia()) {
        check(&format!("{head}{value}{tail}"));
    }
}
