//! Reads test files.

use super::checks::{CODE, Check};
use crate::diag::{Diagnostic, SourceLocation, Sources};
use crate::graph::{Limits, Override, read_text, suggestion};
use crate::lang::ast::{Entry, Field};
use crate::lang::{self, Span, Value};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Schema of a test file.
const SCHEMA: &str = "foley:test/1";
/// Ending of its name.
const ENDING: &str = ".test.ron";

/// A test file.
#[derive(Debug)]
pub struct TestFile {
    /// Its path.
    pub path: PathBuf,
    /// The graph that it is about.
    pub graph: PathBuf,
    /// Its text.
    pub text: Arc<str>,
    /// Its cases, in their order.
    pub cases: Vec<Case>,
}

/// A run of the graph, and the expected outputs.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name.
    pub name: String,
    /// Values as of `--set`.
    pub sets: Vec<Override>,
    /// Seed in place of the graph's own.
    pub seed: Option<u64>,
    /// End of the run, s.
    pub until: Option<f64>,
    /// Expectations of each output.
    pub outputs: Vec<Expected>,
}

/// Expectations of an output.
#[derive(Clone, Debug)]
pub struct Expected {
    /// A file that the graph writes, or `NODE.PORT`.
    pub output: String,
    /// Its location in the file.
    pub span: Span,
    /// The checks.
    pub checks: Vec<Check>,
}

/// The test file beside a graph; a test file is its own.
#[must_use]
pub fn test_file_of(graph: &Path) -> PathBuf {
    if graph.to_string_lossy().ends_with(ENDING) {
        graph.to_owned()
    } else {
        graph.with_extension(&ENDING[1..])
    }
}

/// The graph beside a test file.
#[must_use]
pub fn graph_of(test: &Path) -> PathBuf {
    let name = test.file_name().unwrap_or_default().to_string_lossy();
    test.with_file_name(format!("{}.ron", name.trim_end_matches(ENDING)))
}

impl TestFile {
    /// Reads a test file; its text is added to `sources`.
    ///
    /// # Errors
    /// Every mistake in it.
    pub fn read(path: &Path, sources: &mut Sources) -> Result<Self, Vec<Diagnostic>> {
        let name = path.display().to_string();
        let text = read_text(path, &name, Limits::default().graph_bytes).map_err(|e| {
            let found = Diagnostic::general(e.code, e.message);
            vec![match e.code {
                "F060" => found.help(format!("the tests of a graph are in {name}: write them there")),
                _ => found,
            }]
        })?;
        let text: Arc<str> = text.into();
        let file = sources.add(name, Arc::clone(&text));
        let cases = Reader { text: &text, file, errors: Vec::new() }.read()?;
        Ok(Self { path: path.to_owned(), graph: graph_of(path), text, cases })
    }
}

impl TestFile {
    /// Every mistake in the text of a test file, for editors; their locations are in file 0.
    #[must_use]
    pub fn mistakes(text: &str) -> Vec<Diagnostic> {
        Reader { text, file: 0, errors: Vec::new() }.read().err().unwrap_or_default()
    }
}

struct Reader<'a> {
    text: &'a str,
    file: usize,
    errors: Vec<Diagnostic>,
}

impl Reader<'_> {
    fn at(&self, span: Span) -> SourceLocation {
        SourceLocation { file: self.file, span }
    }

    fn error(&mut self, message: impl Into<String>, span: Span, help: Option<String>) {
        let found = Diagnostic::error(CODE, message, self.at(span));
        self.errors.push(Diagnostic { help, ..found });
    }

    fn read(mut self) -> Result<Vec<Case>, Vec<Diagnostic>> {
        let parsed = lang::parse(self.text);
        self.errors.extend(parsed.errors().iter().map(|e| Diagnostic::of_syntax(e, self.file)));
        let document = parsed.document();
        let right = Some(format!("begin with #![schema = {SCHEMA:?}]"));
        match document.attribute("schema") {
            Some(schema) if schema.value == SCHEMA => {}
            Some(schema) => {
                let message = format!("schema {:?} is not that of a test file", schema.value);
                self.error(message, schema.span(), right);
            }
            None => self.error("the file does not state its schema", 0..0, right),
        }
        let mut cases = Vec::new();
        if let Some(value) = document.value.filter(|value| !value.is_error()) {
            let fields = self.fields(&value, "Test", &["cases"]).unwrap_or_default();
            for field in fields {
                for entry in self.entries(&field.value, "cases", "\"a name\": Case(...)") {
                    cases.extend(self.case(&entry));
                }
            }
            if cases.is_empty() && self.errors.is_empty() {
                let help = "write Test(cases: { \"a name\": Case(outputs: { ... }) })".to_owned();
                self.error("there are no cases", value.span(), Some(help));
            }
        }
        if self.errors.is_empty() { Ok(cases) } else { Err(self.errors) }
    }

    /// The fields of a struct of this name; fields that it does not have, or has twice, are errors.
    fn fields(&mut self, value: &Value, name: &str, known: &[&str]) -> Option<Vec<Field>> {
        let fields = match value.as_struct() {
            Some((found, fields)) if found.is_none_or(|found| found.value == name) => fields.to_vec(),
            _ => {
                let found = match value.as_struct() {
                    Some((Some(found), _)) => format!("{}(...)", found.value),
                    _ => value.describe().to_owned(),
                };
                self.error(format!("expected {name}(...), found {found}"), value.span(), None);
                return None;
            }
        };
        let mut seen = BTreeSet::new();
        for field in &fields {
            let own = field.name.value.as_str();
            if !known.contains(&own) {
                let help = suggestion(own, "fields", known.iter().copied());
                self.error(format!("{name} has no field `{own}`"), field.name.span(), Some(help));
            } else if !seen.insert(own) {
                self.error(format!("`{own}` is given twice"), field.name.span(), None);
            }
        }
        Some(fields.into_iter().filter(|field| known.contains(&field.name.value.as_str())).collect())
    }

    /// The entries of a map with texts as keys.
    fn entries(&mut self, value: &Value, name: &str, example: &str) -> Vec<Entry> {
        let Some(entries) = value.as_map() else {
            if !value.is_error() {
                let message =
                    format!("`{name}` takes a map such as {{{example}}}, found {}", value.describe());
                self.error(message, value.span(), None);
            }
            return Vec::new();
        };
        let mut seen = BTreeSet::new();
        for entry in entries {
            match entry.key.as_str() {
                None if entry.key.is_error() => {}
                None => {
                    let message =
                        format!("a name in `{name}` is text in quotes, found {}", entry.key.describe());
                    self.error(message, entry.key.span(), None);
                }
                Some(key) if !seen.insert(key) => {
                    self.error(format!("`{key}` is given twice"), entry.key.span(), None);
                }
                Some(_) => {}
            }
        }
        entries.iter().filter(|entry| entry.key.as_str().is_some()).cloned().collect()
    }

    fn case(&mut self, entry: &Entry) -> Option<Case> {
        let name = entry.key.as_str()?.to_owned();
        let fields = self.fields(&entry.value, "Case", &["set", "seed", "until", "outputs"])?;
        let mut case = Case { name, sets: Vec::new(), seed: None, until: None, outputs: Vec::new() };
        for Field { name, value, .. } in &fields {
            match name.value.as_str() {
                "set" => {
                    for entry in self.entries(value, "set", "\"gain\": 0.5") {
                        let target = entry.key.as_str().unwrap_or_default().to_owned();
                        let value = self.text[entry.value.span()].to_owned();
                        case.sets.push(Override { target, value });
                    }
                }
                "seed" => match value.as_int().and_then(|seed| u64::try_from(seed).ok()) {
                    Some(seed) => case.seed = Some(seed),
                    None => {
                        let message =
                            format!("`seed` takes a whole number from 0 on, found {}", value.describe());
                        self.error(message, value.span(), None);
                    }
                },
                "until" => match value.as_f64().filter(|until| (1e-6..=1e7).contains(until)) {
                    Some(until) => case.until = Some(until),
                    None => {
                        let message =
                            format!("`until` takes a time above 0 in seconds, found {}", value.describe());
                        self.error(message, value.span(), None);
                    }
                },
                _ => {
                    for entry in self.entries(value, "outputs", "\"out.wav\": [Finite]") {
                        case.outputs.extend(self.expected(&entry));
                    }
                }
            }
        }
        if case.outputs.iter().all(|output| output.checks.is_empty()) && self.errors.is_empty() {
            let help = "write outputs: { \"out.wav\": [Finite] }".to_owned();
            self.error("the case has no checks", entry.span.clone(), Some(help));
        }
        Some(case)
    }

    fn expected(&mut self, entry: &Entry) -> Option<Expected> {
        let output = entry.key.as_str()?.to_owned();
        let Some(list) = entry.value.as_list() else {
            if !entry.value.is_error() {
                let found = entry.value.describe();
                self.error(
                    format!("an output has a list of checks, found {found}"),
                    entry.value.span(),
                    None,
                );
            }
            return None;
        };
        let mut checks = Vec::new();
        for value in list.iter().filter(|value| !value.is_error()) {
            match Check::read(value, self.file) {
                Ok(check) => checks.push(check),
                Err(errors) => self.errors.extend(errors),
            }
        }
        Some(Expected { output, span: entry.key.span(), checks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Kind;

    fn read(text: &str) -> Result<Vec<Case>, Vec<(String, Option<String>)>> {
        let reader = Reader { text, file: 0, errors: Vec::new() };
        reader.read().map_err(|errors| errors.into_iter().map(|e| (e.message, e.help)).collect())
    }

    #[test]
    fn a_file_holds_cases_with_checks_of_outputs() {
        let text = "#![schema = \"foley:test/1\"]
Test(cases: {
    \"loud\": Case(
        set: { \"gain\": 0.5, \"wind.colour\": Pink, \"file\": \"a.wav\" },
        seed: 3,
        until: 2.0,
        outputs: {
            \"out.wav\": [Peak(db: -12.0..-1.0, during: 0.0..0.5), Finite, Onsets(times: [0.0, 1])],
            \"beat\": [Events(count: 3..=5)],
        },
    ),
})";
        let cases = read(text).unwrap();
        let case = &cases[0];
        assert_eq!((case.name.as_str(), case.seed, case.until), ("loud", Some(3), Some(2.0)));
        let values: Vec<&str> = case.sets.iter().map(|set| set.value.as_str()).collect();
        assert_eq!(values, ["0.5", "Pink", "\"a.wav\""]);
        let kinds: Vec<Kind> = case.outputs[0].checks.iter().map(|check| check.kind).collect();
        assert_eq!(kinds, [Kind::Peak, Kind::Finite, Kind::Onsets]);
        assert_eq!(case.outputs[0].checks[0].during(), [0.0, 0.5]);
        assert_eq!(case.outputs[1].checks[0].bounds("count").unwrap().to_string(), "from 3 to 5");
    }

    #[test]
    fn each_mistake_says_what_would_be_right() {
        let file =
            |body: &str| format!("#![schema = \"foley:test/1\"]\nTest(cases: {{ \"a\": Case({body}) }})");
        for (body, message) in [
            ("outputs: { \"o\": [Peek(db: 1)] }", "there is no check `Peek`"),
            ("outputs: { \"o\": [Peak(lufs: 1)] }", "Peak has no field `lufs`"),
            ("outputs: { \"o\": [Peak()] }", "Peak needs `db`"),
            ("outputs: { \"o\": [Peak(db: \"x\")] }", "`db` takes a number or a range"),
            ("outputs: { \"o\": [Onsets(during: 0.0..1.0)] }", "Onsets needs `count` or `times`"),
            ("outputs: { \"o\": Finite }", "an output has a list of checks, found a name"),
            ("output: {}", "Case has no field `output`"),
            ("seed: -1, outputs: { \"o\": [Finite] }", "`seed` takes a whole number"),
            ("until: 0, outputs: { \"o\": [Finite] }", "`until` takes a time"),
            ("outputs: {}", "the case has no checks"),
        ] {
            let errors = read(&file(body)).unwrap_err();
            assert!(errors.iter().any(|(found, _)| found.starts_with(message)), "{body}: {errors:?}");
        }
        let (_, help) = read(&file("outputs: { \"o\": [Peek(db: 1)] }")).unwrap_err().remove(0);
        assert!(help.unwrap().starts_with("did you mean `Peak`?"));
        let wrong = read("#![schema = \"foley:graph/1\"]\nTest(cases: {})").unwrap_err();
        assert!(wrong[0].0.contains("is not that of a test file"), "{wrong:?}");
    }

    #[test]
    fn a_test_file_lies_beside_its_graph() {
        assert_eq!(test_file_of(Path::new("a/b.ron")), Path::new("a/b.test.ron"));
        assert_eq!(test_file_of(Path::new("a/b.test.ron")), Path::new("a/b.test.ron"));
        assert_eq!(graph_of(Path::new("a/b.test.ron")), Path::new("a/b.ron"));
    }
}
