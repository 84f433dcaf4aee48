//! The syntax tree accepts what `ron` accepts, and reads the same values.

use super::plain::Plain;
use foley::lang::{Value, ValueKind, parse};
use serde::de::IgnoredAny;

/// Verdict of `ron`: `deserialize_any` over the whole document, without requirements on the values.
fn ron_accepts(text: &str) -> bool {
    ron::from_str::<IgnoredAny>(text).is_ok()
}

fn assert_same(text: &str) {
    let parsed = parse(text);
    assert_eq!(parsed.syntax().text().to_string(), text, "the tree preserves the text");
    let theirs = ron::from_str::<IgnoredAny>(text);
    assert_eq!(parsed.is_ok(), theirs.is_ok(), "{text:?}\nours: {:?}\nron: {theirs:?}", parsed.errors());
    for error in parsed.errors() {
        assert!(text.get(error.span.clone()).is_some(), "{text:?}: {error:?}");
    }
    let document = parsed.document();
    assert_spans(text, &document, parsed.is_ok());
    if parsed.is_ok() {
        let value = document.value.expect("an accepted document has a value");
        assert_no_error(text, &value);
        let theirs: Plain = ron::from_str(text).expect("accepted above");
        assert_eq!(plain(&value), theirs, "{text:?}");
    }
}

fn assert_no_error(text: &str, value: &Value) {
    value.walk(&mut |value| assert!(!value.is_error(), "{text:?}: {value:?}"));
}

/// A span is the value's text without anything around it. In a broken text the end may be cut off.
fn assert_spans(text: &str, document: &foley::lang::Document, whole: bool) {
    let Some(value) = &document.value else { return };
    value.walk(&mut |value| {
        let own = text.get(value.span()).expect("a span is inside the text");
        assert!(!own.starts_with([' ', '\n', '\t', '\r']), "{text:?}");
        assert!(!whole || !own.starts_with('/'), "{text:?}");
        assert!(!whole || !own.ends_with([' ', '\n', '\t', '\r', '/']), "{text:?}");
    });
}

/// Our value, with what `ron` passes of it to a visitor.
fn plain(value: &Value) -> Plain {
    let all = |values: &[Value]| Plain::Seq(values.iter().map(plain).collect());
    let text = |text: &str| Plain::Str(text.to_owned());
    match &value.value {
        ValueKind::Unit | ValueKind::Name(_) => Plain::Unit,
        ValueKind::Bool(truth) => Plain::Bool(*truth),
        ValueKind::Char(c) => Plain::Char(*c),
        ValueKind::Int(number) => Plain::Int(*number),
        ValueKind::Float(number) => Plain::float(*number),
        ValueKind::Str(string) => text(string),
        ValueKind::Bytes(bytes) => Plain::Bytes(bytes.clone()),
        ValueKind::List(values) | ValueKind::Tuple(values) | ValueKind::NamedTuple(_, values) => all(values),
        ValueKind::Map(entries) => {
            Plain::Map(entries.iter().map(|entry| (plain(&entry.key), plain(&entry.value))).collect())
        }
        ValueKind::Struct(_, fields) => {
            Plain::Map(fields.iter().map(|field| (text(&field.name.value), plain(&field.value))).collect())
        }
        ValueKind::Option(inner) => Plain::Option(inner.as_deref().map(|inner| Box::new(plain(inner)))),
        ValueKind::Range(range) => match (&range.start, &range.end) {
            (None, None) => Plain::Unit,
            (start, end) => {
                let ends = [("start", start), ("end", end)];
                Plain::Map(ends.iter().filter_map(|(k, v)| v.as_ref().map(|v| (text(k), plain(v)))).collect())
            }
        },
        ValueKind::Error => panic!("an accepted document has no broken value"),
    }
}

const GRAPH: &str = r##"#![schema = "foley:graph/1"]
Graph(
    title: "Cotton sheet dragged over a floor",
    seed: 7,
    params: { "lambda": 100.0 },                               // overridable: --set lambda=1e5
    use: { "material": "../lib/cotton.ron" },                  // sub-graph: its ids become material.*
    nodes: {
        "sheet":    MeshSequence(path: "../assets/sheet.abc"),
        "contacts": ContactDetector(mesh: "sheet", radius: 0.05),
        /* nested /* comment */ */
        "speed":    SlidingSpeed(contacts: "contacts", threshold: 0.02),
        "friction": IftNoise(speeds: "speed", model: "material.friction"),
        "out":      WavOut(audio: "friction", path: r#"sheet.wav"#),
    },
)
"##;

/// Valid and invalid documents, one on each line where that is possible.
const CASES: &str = include_str!("../lang_ron/cases.txt");
const MORE: &[&str] = &[
    "",
    " ",
    "// only a comment",
    "1 // trailing",
    "/* open",
    "1 /* a /* b */",
    "1 /* a /* b */ */",
    "/*/ 1",
    "/*/*/*/**/ 1",
    "/* */ 1 /**/",
    "\"two\nlines\"",
    "\"continued \\\n   line\"",
    "\"continued \\\r\n   line\"",
    "\"bad \\\r line\"",
    "b\"continued \\\n   line\"",
    "r\"two\nlines\"",
    "'\n'",
    "[1,\n2\n]",
    "(a: 1\n b: 2)",
    "\u{85}1\u{2028}",
    "\u{a0}1",
    "\u{feff}1",
    "\u{200e}[\u{200f}1\u{2029}]",
    "\x0b1\x0c",
    "#![enable(implicit_some)]\nSome 5",
    "#![enable(implicit_some)]\n#![enable(unwrap_newtypes,)] (1, Some)",
    "#\n!\n[\nenable\n(\nimplicit_some\n)\n]\n1",
    "#![schema = \"a\"]\n#![type = r#\"b\"#]\n(x: 1)",
    "1 #![schema = \"a\"]",
];

#[test]
fn the_table_gets_the_verdict_of_ron() {
    let cases: Vec<&str> = CASES.lines().chain(MORE.iter().copied()).chain([GRAPH]).collect();
    assert!(cases.len() > 300, "{} cases", cases.len());
    let accepted = cases.iter().filter(|case| ron_accepts(case)).count();
    assert!(accepted > 120 && cases.len() - accepted > 120, "{accepted} of {} are valid", cases.len());
    cases.iter().for_each(|case| assert_same(case));
}

#[test]
fn nesting_ends_where_it_ends_in_ron() {
    let shapes = [
        ("[", "]"),
        ("(", ")"),
        ("{1:", "}"),
        ("{", ":1}"),
        ("A(a:", ")"),
        ("Some(", ")"),
        ("Some([", "])"),
        ("(Some(", "),)"),
    ];
    for enable in ["", "#![enable(unwrap_variant_newtypes)]", "#![enable(implicit_some)]"] {
        for (open, close) in shapes {
            for inner in ["", "1", "()", "( )", "[]", "[1]", "a:1", "1,2", "Some 1", "{1:1}"] {
                for depth in 30..132 {
                    assert_same(&format!("{enable}{}{inner}{}", open.repeat(depth), close.repeat(depth)));
                }
            }
        }
    }
}

#[test]
fn hostile_depth_is_an_error_and_no_crash() {
    for open in [
        "[",
        "(",
        "{",
        "{1:",
        "a(",
        "a(b:",
        "Some(",
        "Some ",
        "#![enable(implicit_some)] Some ",
        "(a:(",
        "/*",
    ] {
        let parsed = parse(&open.repeat(100_000));
        assert!(!parsed.is_ok());
        assert_eq!(usize::from(parsed.syntax().text().len()), open.len() * 100_000);
        parsed.document();
    }
    for text in ["]", ")", "}", "'", "\"\\", "r#", "r#\"", "=", "..", ",", ":", ";", "a:", "\"\n", "/"] {
        assert!(!parse(&text.repeat(50_000)).is_ok());
    }
}

/// A small deterministic generator (Weyl sequence with a finalizer).
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

const BITS: &[&str] = &[
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "..",
    "..=",
    ".",
    "-",
    "+",
    "_",
    "=",
    "#",
    "!",
    "\"",
    "'",
    "\\",
    "/",
    "//",
    "/*",
    "*/",
    " ",
    "\n",
    "\r\n",
    "\t",
    "0",
    "1",
    "9",
    "0x",
    "0b",
    "0o",
    "e",
    "E",
    "f",
    "f32",
    "f64",
    "u8",
    "i8",
    "i64",
    "u128",
    "inf",
    "NaN",
    "inff32",
    "true",
    "false",
    "Some",
    "Some(",
    "None",
    "()",
    "r",
    "b",
    "r#",
    "b'",
    "b\"",
    "br\"",
    "br#\"",
    "\"#",
    "r#\"",
    "\\x41",
    "\\xC3\\xA9",
    "\\u{1F600}",
    "\\\n",
    "a",
    "A(",
    "a:",
    "é",
    "😀",
    "\u{85}",
    "#![enable(implicit_some)]",
    "#![enable(unwrap_variant_newtypes)]",
    "#![type=\"x\"]",
    "'a'",
    "'\\''",
    "b'a'",
    "18446744073709551616",
    "-9223372036854775809",
    ";",
    "\u{200e}",
    "\u{feff}",
];

fn mutate(text: &str, dice: &mut Dice, corpus: &[&str]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for _ in 0..1 + dice.below(4) {
        let at = dice.below(chars.len() + 1);
        let end = (at + dice.below(4)).min(chars.len());
        match dice.below(7) {
            0 | 1 => drop(chars.drain(at..end)),
            2 | 3 => drop(chars.splice(at..at, BITS[dice.below(BITS.len())].chars())),
            4 => drop(chars.splice(at..end, BITS[dice.below(BITS.len())].chars())),
            5 => {
                let copy: Vec<char> = chars[at..end].to_vec();
                let to = dice.below(chars.len() + 1);
                drop(chars.splice(to..to, copy));
            }
            _ => {
                let other = corpus[dice.below(corpus.len())];
                if other.len() < 80 {
                    drop(chars.splice(at..at, other.chars()));
                }
            }
        }
    }
    chars.into_iter().collect()
}

#[test]
fn mutated_documents_get_the_verdict_of_ron() {
    let corpus: Vec<&str> = CASES.lines().chain(MORE.iter().copied()).chain([GRAPH]).collect();
    let mut dice = Dice(7);
    let rounds = std::env::var("FOLEY_FUZZ_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(60_000);
    let mut accepted = 0;
    for round in 0..rounds {
        let mut text = corpus[dice.below(corpus.len())].to_owned();
        for _ in 0..1 + round % 3 {
            text = mutate(&text, &mut dice, &corpus);
        }
        assert_same(&text);
        accepted += usize::from(ron_accepts(&text));
    }
    assert!(accepted > rounds / 20, "{accepted} of {rounds} mutants are valid");
}

#[test]
fn random_pieces_get_the_verdict_of_ron() {
    let mut dice = Dice(11);
    for _ in 0..60_000 {
        let text: String = (0..1 + dice.below(9)).map(|_| BITS[dice.below(BITS.len())]).collect();
        assert_same(&text);
        assert_same(&format!("[{text}]"));
    }
}
