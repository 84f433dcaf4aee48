//! Test files beside a graph: their mistakes, and completions.

use super::file::TextFile;
use crate::diag::Diagnostic;
use crate::lang::Span;
use crate::lang::cursor::{Cursor, Frame, Slot};
use crate::testing::{CHECKS, CheckSpec, TestFile};

/// Name before the brackets of a test file.
const NAME: &str = "Test";

/// A name that can be typed in a test file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suggestion {
    /// The name.
    pub name: &'static str,
    /// The inserted text; a snippet.
    pub insert: String,
    /// Its meaning.
    pub doc: &'static str,
}

/// Returns true for a test file.
#[must_use]
pub fn is_test(file: &TextFile) -> bool {
    file.kind() == Some(NAME)
}

/// Every mistake in a test file, with its location.
#[must_use]
pub fn mistakes(file: &TextFile) -> Vec<(Span, String)> {
    let place = |found: Diagnostic| {
        let help = found.help.map(|help| format!("\n{help}")).unwrap_or_default();
        (found.location.map_or(0..0, |at| at.span), format!("{}{help}", found.message))
    };
    TestFile::mistakes(&file.text).into_iter().map(place).collect()
}

/// Completions at a cursor in a test file.
#[must_use]
pub fn suggestions(cursor: &Cursor) -> Vec<Suggestion> {
    let field = |&(name, value, doc): &(&'static str, &str, &'static str)| Suggestion {
        name,
        insert: format!("{name}: {value}"),
        doc,
    };
    let frames: Vec<&Frame> = cursor.frames.iter().skip(1).collect();
    match (frames.as_slice(), &cursor.slot) {
        ([_], Slot::Item) => {
            vec![field(&("cases", "{\n    \"$1\": Case(outputs: {$2}),\n}", "Cases by name."))]
        }
        ([_, cases], Slot::Value(_)) if cases.key() == Some("cases") => {
            let insert = "Case(outputs: {\"$1\": [$2]})".to_owned();
            vec![Suggestion { name: "Case", insert, doc: "A run of the graph, and its checks." }]
        }
        ([_, _, case], Slot::Item) if case.name() == Some("Case") => [
            ("set", "{\"$1\": $2}", "Values as of `--set`."),
            ("seed", "$1", "Seed in place of the graph's own."),
            ("until", "$1", "End of the run, s."),
            ("outputs", "{\"$1\": [$2]}", "Checks of files that the graph writes, or of `NODE.PORT`."),
        ]
        .iter()
        .map(field)
        .collect(),
        ([_, _, _, outputs, _], Slot::Item) if outputs.key() == Some("outputs") => {
            let check = |spec: &'static CheckSpec| {
                let required = spec.fields.iter().filter(|(_, _, required)| *required);
                let fields: Vec<String> =
                    required.enumerate().map(|(k, (name, ..))| format!("{name}: ${}", k + 1)).collect();
                let fields =
                    if fields.is_empty() { String::new() } else { format!("({})", fields.join(", ")) };
                Suggestion { name: spec.name, insert: format!("{}{fields}", spec.name), doc: spec.text }
            };
            CHECKS.iter().map(check).collect()
        }
        ([_, _, _, outputs, _, check], Slot::Item) if outputs.key() == Some("outputs") => {
            let spec = CHECKS.iter().find(|spec| Some(spec.name) == check.name());
            let fields = spec.map(|spec| spec.fields).unwrap_or_default().iter();
            fields.map(|(name, ..)| field(&(name, "$1", ""))).collect()
        }
        _ => Vec::new(),
    }
}
