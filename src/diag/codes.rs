//! Every code of a diagnostic, with its meaning and correction: the text of `codes.md` beside this file.

use std::sync::LazyLock;

/// One code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// The code.
    pub code: &'static str,
    /// A short title.
    pub title: &'static str,
    /// Meaning, reason and correction, as Markdown.
    pub text: &'static str,
}

/// All codes, in order.
#[must_use]
pub fn all() -> &'static [Code] {
    static ALL: LazyLock<Vec<Code>> = LazyLock::new(|| read(include_str!("codes.md")));
    &ALL
}

/// The code of a name.
#[must_use]
pub fn find(code: &str) -> Option<&'static Code> {
    all().iter().find(|c| c.code == code)
}

/// Splits a text into its entries: `## CODE: title`, then the text up to the next one.
fn read(text: &'static str) -> Vec<Code> {
    let entry = |section: &'static str| {
        let (head, text) = section.split_once('\n').unwrap_or((section, ""));
        let (code, title) = head.split_once(": ")?;
        Some(Code { code, title, text: text.trim() })
    };
    text.split("\n## ").skip(1).filter_map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lang::parse;
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    /// Every code that stands in quotes in the sources below a folder.
    fn used_in(folder: &Path, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                used_in(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).unwrap();
                // The quotes of a code stand around exactly four characters.
                for (at, _) in text.match_indices("\"F") {
                    let Some(code) = text.get(at + 1..at + 5) else { continue };
                    let digits = code[1..].bytes().all(|b| b.is_ascii_digit());
                    if digits && text[at + 5..].starts_with('"') {
                        found.insert(code.to_owned());
                    }
                }
            }
        }
    }

    #[test]
    fn every_code_in_the_sources_is_explained_and_every_explained_code_is_used() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut used = BTreeSet::new();
        used_in(&root.join("src"), &mut used);
        used_in(&root.join("nodes/src"), &mut used);
        let explained: BTreeSet<String> = all().iter().map(|c| c.code.to_owned()).collect();
        let missing: Vec<_> = used.difference(&explained).collect();
        let idle: Vec<_> = explained.difference(&used).collect();
        assert!(missing.is_empty(), "no entry in codes.md for {missing:?}");
        assert!(idle.is_empty(), "nothing uses the entries {idle:?}");
    }

    #[test]
    fn codes_are_in_order_and_say_something() {
        assert!(all().is_sorted_by(|a, b| a.code < b.code), "out of order, or twice");
        for code in all() {
            assert!(!code.title.is_empty() && code.text.len() > 80, "{} says too little", code.code);
        }
        assert_eq!(find("F025").map(|c| c.title), Some("loop without a Feedback node"));
        assert_eq!(find("E025"), None);
    }

    #[test]
    fn right_examples_are_ron_and_wrong_syntax_is_not() {
        for code in all() {
            for (k, block) in code.text.split("```").enumerate().filter(|(k, _)| k % 2 == 1) {
                let (tag, body) = block.split_once('\n').unwrap();
                // A piece of a graph is one or more entries of a map or fields of a struct.
                let texts = [body.to_owned(), format!("{{{body}}}"), format!("Graph({body})")];
                let parses = texts.iter().any(|t| parse(t).is_ok());
                match tag {
                    "ron" => assert!(parses, "{} block {k}: {body}", code.code),
                    "ron,syntax-error" => assert!(!parses, "{} block {k}: {body}", code.code),
                    "text" => {}
                    other => panic!("{}: a block of kind {other:?}", code.code),
                }
            }
        }
    }
}
