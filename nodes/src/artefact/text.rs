//! RON files that people edit: read with `serde`, with line and column of every record that is wrong, and written with comments.
//!
//! A file is a struct whose lists hold [`RawValue`]s; [`records`] reads these one by one, so that one mistake does not hide
//! the next, and assigns each record its location. Fields that check themselves, such as [`Seconds`], make `ron` report
//! the location of a value that is out of range.

use ron::Options;
use ron::error::{Error as RonError, Position, SpannedError};
use ron::extensions::Extensions;
pub use ron::value::RawValue;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;

use crate::core::files::strip_bom;

/// Latest time in a file, s.
const LATEST: f64 = 86_400.0;

/// Line and column in a text, both from 1, the column in characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Location {
    /// Line.
    pub line: u32,
    /// Column.
    pub column: u32,
}

impl Location {
    /// The location of a byte offset in a text.
    fn of(text: &str, offset: usize) -> Self {
        let before = text.get(..offset).unwrap_or(text);
        let line = before.rsplit('\n').next().unwrap_or_default();
        Self { line: 1 + before.matches('\n').count() as u32, column: 1 + line.chars().count() as u32 }
    }

    /// This location in a text that itself starts at `start`.
    fn after(self, start: Self) -> Self {
        match self.line {
            0 | 1 => Self { line: start.line, column: start.column + self.column.saturating_sub(1) },
            line => Self { line: start.line + line - 1, column: self.column },
        }
    }
}

/// The byte offset of the first character from a position on that is not blank.
fn value_from(text: &str, at: Position) -> usize {
    let line = text.split_inclusive('\n').take(at.line.saturating_sub(1)).map(str::len).sum::<usize>();
    let column: usize = text[line..].chars().take(at.col.saturating_sub(1)).map(char::len_utf8).sum();
    let rest = &text[line + column..];
    line + column + (rest.len() - rest.trim_start().len())
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// A mistake in a text.
#[derive(Clone, Debug, Default, PartialEq, Eq, thiserror::Error)]
#[error("{location}: {message}")]
pub struct TextError {
    /// Its location.
    pub location: Location,
    /// Description of the mistake, and of the correct form.
    pub message: String,
}

impl TextError {
    /// An error at a location.
    #[must_use]
    pub fn new(location: Location, message: impl Into<String>) -> Self {
        Self { location, message: message.into() }
    }

    /// The error of `ron` in a text that starts at `start`; a missing field is missing from the whole text.
    fn of(error: &SpannedError, text: &str, start: Location) -> Self {
        let location = match error.code {
            RonError::MissingStructField { .. } => start,
            _ => Location::of(text, value_from(text, error.span.start)).after(start),
        };
        Self::new(location, describe(&error.code))
    }

    /// Joins errors to one: the first, with the others in its message, at most `limit` in all.
    #[must_use]
    pub fn join(errors: Vec<Self>, limit: usize) -> Option<Self> {
        let count = errors.len();
        let mut errors = errors.into_iter();
        let mut joined = errors.next()?;
        for error in errors.take(limit.saturating_sub(1)) {
            joined.message.push_str(&format!("; {error}"));
        }
        if count > limit {
            joined.message.push_str(&format!("; and {} more", count - limit));
        }
        Some(joined)
    }
}

fn describe(error: &RonError) -> String {
    match error {
        RonError::MissingStructField { field, .. } => format!("`{field}` is missing"),
        RonError::DuplicateStructField { field, .. } => format!("`{field}` is given twice"),
        RonError::NoSuchStructField { expected, found, .. } => {
            format!("there is no field `{found}`; fields are {}", expected.join(", "))
        }
        other => other.to_string(),
    }
}

/// Options may be written without `Some`.
fn options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// Reads a whole text.
///
/// # Errors
/// The first mistake, with its location.
pub fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, TextError> {
    let start = Location { line: 1, column: 1 };
    options().from_str(text).map_err(|e| TextError::of(&e, text, start))
}

/// A text without the byte order mark that some editors write.
///
/// # Errors
/// When the bytes are not UTF-8.
pub fn decode(bytes: &[u8]) -> Result<&str, TextError> {
    std::str::from_utf8(strip_bom(bytes)).map_err(|e| {
        let valid = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        TextError::new(Location::of(&valid, valid.len()), "the text is not UTF-8")
    })
}

/// Reads the records of a list, each with its location.
///
/// # Errors
/// One mistake for each record that is wrong.
pub fn records<T: DeserializeOwned>(
    text: &str,
    list: &[&RawValue],
) -> Result<Vec<(Location, T)>, Vec<TextError>> {
    let (mut all, mut errors) = (Vec::with_capacity(list.len()), Vec::new());
    let mut last = (0, Location { line: 1, column: 1 });
    for raw in list {
        let record_text = raw.trim().get_ron();
        // A record is part of the text, since it is borrowed from it.
        let offset = (record_text.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
        let between = text.get(last.0..offset).unwrap_or_default();
        last = (offset, Location::of(between, between.len()).after(last.1));
        match options().from_str::<T>(record_text) {
            Ok(record) => all.push((last.1, record)),
            Err(e) => errors.push(TextError::of(&e, record_text, last.1)),
        }
    }
    if errors.is_empty() { Ok(all) } else { Err(errors) }
}

/// Reads a number that has to lie in a range.
///
/// # Errors
/// When it does not, or is no number.
pub fn within<'de, D: Deserializer<'de>>(from: D, low: f64, high: f64) -> Result<f64, D::Error> {
    let x = f64::deserialize(from)?;
    if (low..=high).contains(&x) {
        Ok(x)
    } else {
        Err(D::Error::custom(format!("found {x}; a number from {low} to {high} is needed")))
    }
}

/// A time from 0 s to a day, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seconds(pub f64);

impl<'de> Deserialize<'de> for Seconds {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        within(from, 0.0, LATEST).map(Self)
    }
}

/// A length of time from a microsecond to a day, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Duration(pub f64);

impl<'de> Deserialize<'de> for Duration {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        within(from, 1e-6, LATEST).map(Self)
    }
}

/// Version of a format, from `OLDEST` to `NEWEST`; others are refused. A reader converts the older ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Version<const OLDEST: u32, const NEWEST: u32>(pub u32);

impl<'de, const OLDEST: u32, const NEWEST: u32> Deserialize<'de> for Version<OLDEST, NEWEST> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        match u32::deserialize(from)? {
            version if (OLDEST..=NEWEST).contains(&version) => Ok(Self(version)),
            version => {
                let read = if OLDEST == NEWEST {
                    format!("version {NEWEST}")
                } else {
                    format!("versions {OLDEST} to {NEWEST}")
                };
                Err(D::Error::custom(format!("the file has version {version}; this reads {read}")))
            }
        }
    }
}

/// Writer of a file as [`read`] and [`records`] read it: comments, fields, and lists with one record a line.
#[derive(Debug)]
pub struct TextWriter(String);

impl TextWriter {
    /// Begins a file. `comments` are lines before the value, for provenance and units.
    #[must_use]
    pub fn new(comments: &[&str], name: &str, version: u32) -> Self {
        let mut out: String =
            comments.iter().flat_map(|text| text.lines()).map(|line| format!("// {line}\n")).collect();
        out += &format!("{name}(\n    version: {version},\n");
        Self(out)
    }

    /// Adds a field, whose value is RON.
    pub fn field(&mut self, name: &str, value: impl fmt::Display) {
        self.0 += &format!("    {name}: {value},\n");
    }

    /// Adds a list of records.
    pub fn list(&mut self, name: &str, records: impl IntoIterator<Item = RecordWriter>) {
        self.0 += &format!("    {name}: [\n");
        for record in records {
            self.0 += &format!("        ({}),\n", record.0);
        }
        self.0 += "    ],\n";
    }

    /// Ends the file.
    #[must_use]
    pub fn finish(self) -> String {
        self.0 + ")\n"
    }
}

/// Writer of one record of a list.
#[derive(Debug, Default)]
pub struct RecordWriter(String);

impl RecordWriter {
    /// Adds a field, whose value is RON; `None` omits it.
    #[must_use]
    pub fn field(mut self, name: &str, value: Option<impl fmt::Display>) -> Self {
        if let Some(value) = value {
            let comma = if self.0.is_empty() { "" } else { ", " };
            self.0 += &format!("{comma}{name}: {value}");
        }
        self
    }
}

/// A text in quotes, as RON reads it.
#[must_use]
pub fn quote(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '\\' | '"' => out.extend(['\\', c]),
            '\n' => out.push_str("\\n"),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(rename = "Scene", deny_unknown_fields)]
    struct Scene<'a> {
        #[serde(default)]
        gap: Option<Seconds>,
        #[serde(borrow)]
        marks: Vec<&'a RawValue>,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(rename = "Mark", deny_unknown_fields)]
    struct Mark {
        at: f64,
        #[serde(default)]
        name: Option<String>,
    }

    #[test]
    fn records_have_their_locations_and_comments_are_passed() {
        let text = "#![schema = \"x\"]\n// a comment\nScene(\n  marks: [\n    (at: 1_0.5e0, name: \"\u{fc}b\\\"er\"), /* b /* c */ */\n    Mark(at: 2), (at: 3, name: Some(\"x\")),\n  ],\n  gap: Some(2),\n)\n";
        let scene: Scene<'_> = read(text).unwrap();
        assert_eq!(scene.gap, Some(Seconds(2.0)));
        let marks: Vec<(Location, Mark)> = records(text, &scene.marks).unwrap();
        let found: Vec<_> = marks.iter().map(|(at, mark)| (at.to_string(), mark.at)).collect();
        assert_eq!(found, [("5:5".into(), 10.5), ("6:5".into(), 2.0), ("6:18".into(), 3.0)]);
        assert_eq!(marks[0].1.name.as_deref(), Some("\u{fc}b\"er"));
        assert_eq!(marks[2].1.name.as_deref(), Some("x"));
    }

    #[test]
    fn errors_say_where_and_what_would_be_right() {
        for (text, location, part) in [
            ("(marks: [(at: 1)], gap: -1)", "1:25", "found -1; a number from 0 to 86400"),
            ("(marks: [], gap: 1, gap: 2)", "1:21", "`gap` is given twice"),
            ("(marks: [], gab: 1)", "1:13", "no field `gab`; fields are gap, marks"),
            ("(gap: 1)", "1:1", "`marks` is missing"),
            ("(marks: [(at: 1)", "1:16", "xpected comma"),
            ("(marks: [] gap: 1)", "1:12", "xpected comma"),
        ] {
            let e = read::<Scene<'_>>(text).unwrap_err();
            assert!(e.location.to_string() == location && e.message.contains(part), "{text:?}: {e}");
        }
        let text = "(marks: [\n  (at: 1),\n  (name: \"x\"), (at: 1, na: 2),\n  (at: \"1\"),\n])";
        let scene: Scene<'_> = read(text).unwrap();
        let errors = records::<Mark>(text, &scene.marks).unwrap_err();
        let shown: Vec<String> = errors.iter().map(ToString::to_string).collect();
        assert_eq!(errors.len(), 3, "{shown:?}");
        assert_eq!(shown[0], "3:3: `at` is missing");
        assert_eq!(shown[1], "3:24: there is no field `na`; fields are at, name");
        assert!(shown[2].starts_with("4:8: "), "{shown:?}");
        let joined = TextError::join(errors, 2).unwrap().to_string();
        assert!(joined.contains("; 3:24: ") && joined.ends_with("; and 1 more"), "{joined}");
    }

    #[test]
    fn any_text_is_survived() {
        let pieces = [
            "(",
            ")",
            "[",
            "]",
            "a",
            ":",
            ",",
            "\"",
            "\\",
            "1.5",
            "//",
            "/*",
            "*/",
            "\n",
            " ",
            "Some",
            "-",
            "\u{1F600}",
            "#![",
            "marks: [",
            "(at: 1)",
        ];
        let mut state = 1_u32;
        for _ in 0..3000 {
            let mut text = String::new();
            for _ in 0..12 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                text.push_str(pieces[(state >> 16) as usize % pieces.len()]);
            }
            if let Ok(scene) = read::<Scene<'_>>(&text) {
                let _ = records::<Mark>(&text, &scene.marks);
            }
        }
    }

    #[test]
    fn versions_in_a_range_are_read_and_what_is_written_is_read_again() {
        #[derive(Debug, Deserialize)]
        #[serde(rename = "Scene", deny_unknown_fields)]
        struct Versioned<'a> {
            version: Version<1, 3>,
            title: String,
            #[serde(borrow)]
            marks: Vec<&'a RawValue>,
        }
        let mut file = TextWriter::new(&["Made by a test.", "`at` in s."], "Scene", 2);
        file.field("title", quote("a \"b\""));
        let record = |at: f64| RecordWriter::default().field("at", Some(at)).field("gain", None::<f64>);
        file.list("marks", [record(0.5), record(1.5)]);
        let text = file.finish();
        let found: Versioned<'_> = read(&text).unwrap();
        assert_eq!((found.version.0, found.title.as_str(), found.marks.len()), (2, "a \"b\"", 2), "{text}");
        assert!(text.starts_with("// Made by a test.\n// `at` in s.\nScene(\n"), "{text}");
        for version in [0, 4] {
            let error = read::<Versioned<'_>>(&text.replace("version: 2", &format!("version: {version}")))
                .unwrap_err();
            assert!(error.to_string().contains("this reads versions 1 to 3"), "{error}");
        }
    }
}
