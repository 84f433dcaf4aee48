//! Diagnostics: an error, its location and the correct form, as data and as text.

pub mod codes;
mod fix;
mod render;

pub use fix::{Change, Fix};
pub use render::{json, plain, render};

use crate::lang::{ErrorKind, SyntaxError};
use foley_nodes::core::fault::{Fault, Reject};
use foley_nodes::core::time::{Tick, seconds};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// True if a diagnostic stops the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The graph cannot run.
    Error,
    /// The graph runs, but perhaps not as intended.
    Warning,
}

/// A location in one of the [`Sources`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceLocation {
    /// The file.
    pub file: usize,
    /// Byte range in it.
    pub span: Range<usize>,
}

/// A further location that explains a diagnostic.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Location.
    pub location: SourceLocation,
    /// The text of the label.
    pub text: String,
}

/// One finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Stable code; `foley explain CODE` explains it.
    pub code: &'static str,
    /// True if it stops the run.
    pub severity: Severity,
    /// Description of the mistake.
    pub message: String,
    /// Location; `None` for mistakes outside of files, such as those of an argument.
    pub location: Option<SourceLocation>,
    /// The label of the location.
    pub note: String,
    /// Further locations.
    pub labels: Vec<Label>,
    /// The node that it is about.
    pub node: Option<String>,
    /// Advice on the correct form.
    pub help: Option<String>,
    /// Time in the piece, for faults while running.
    pub time: Option<Tick>,
    /// Corrections, the most probable first.
    pub fixes: Vec<Fix>,
}

impl Diagnostic {
    /// An error at a location.
    #[must_use]
    pub fn error(code: &'static str, message: impl Into<String>, location: SourceLocation) -> Self {
        Self { location: Some(location), ..Self::general(code, message) }
    }

    /// A warning at a location.
    #[must_use]
    pub fn warning(code: &'static str, message: impl Into<String>, location: SourceLocation) -> Self {
        Self { severity: Severity::Warning, ..Self::error(code, message, location) }
    }

    /// An error without a location.
    #[must_use]
    pub fn general(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: Severity::Error,
            message: message.into(),
            location: None,
            note: String::new(),
            labels: Vec::new(),
            node: None,
            help: None,
            time: None,
            fixes: Vec::new(),
        }
    }

    /// A syntax error of a file, with its correction where there is only one.
    #[must_use]
    pub fn of_syntax(error: &SyntaxError, file: usize) -> Self {
        let location = SourceLocation { file, span: error.span.clone() };
        let mut diagnostic = Self::error("F001", &error.message, location.clone());
        diagnostic.help = error.expected.as_ref().map(|expected| format!("expected {expected}"));
        let fix = match error.code {
            ErrorKind::MissingComma => Some(Fix::replace("insert `,`", location, ",")),
            ErrorKind::MissingColon if error.span.is_empty() => {
                Some(Fix::replace("insert `:`", location, ":"))
            }
            ErrorKind::StrayBracket => Some(Fix::replace("remove the bracket", location, "")),
            _ => None,
        };
        diagnostic.fixes(fix)
    }

    /// A rejection by a node, at the location of the field that it names.
    #[must_use]
    pub fn of_reject(reject: Reject, location: SourceLocation, node: &str) -> Self {
        Self::of_fault(reject.into(), location, node)
    }

    /// A node's fault at the location of the field that it names.
    #[must_use]
    pub fn of_fault(fault: Fault, location: SourceLocation, node: &str) -> Self {
        let message = match fault.time {
            Some(time) => format!("at {:.6} s: {}", seconds(time), fault.message),
            None => fault.message,
        };
        let mut diagnostic = Self::error(fault.code, message, location).node(node);
        diagnostic.help = fault.help;
        diagnostic.time = fault.time;
        diagnostic
    }

    /// Names the node.
    #[must_use]
    pub fn node(mut self, id: &str) -> Self {
        self.node = Some(id.to_owned());
        self
    }

    /// Adds advice on the correct form.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds corrections.
    #[must_use]
    pub fn fixes(mut self, fixes: impl IntoIterator<Item = Fix>) -> Self {
        self.fixes.extend(fixes);
        self
    }

    /// Sets the label of the location.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a further location.
    #[must_use]
    pub fn label(mut self, location: SourceLocation, text: impl Into<String>) -> Self {
        self.labels.push(Label { location, text: text.into() });
        self
    }
}

/// One text that diagnostics point into.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its name for people: the path as the user wrote it.
    pub name: String,
    /// Its content.
    pub text: Arc<str>,
}

/// The texts that a graph was read from.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: Vec<Source>,
}

impl Sources {
    /// Adds a text.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<Arc<str>>) -> usize {
        self.files.push(Source { name: name.into(), text: text.into() });
        self.files.len() - 1
    }

    /// One text.
    #[must_use]
    pub fn get(&self, file: usize) -> Option<&Source> {
        self.files.get(file)
    }

    /// All texts.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.files.iter()
    }

    /// Line and column of a byte, from 1; columns count characters.
    #[must_use]
    pub fn line_column(&self, file: usize, byte: usize) -> (usize, usize) {
        let Some(source) = self.files.get(file) else { return (1, 1) };
        let before = &source.text.as_bytes()[..byte.min(source.text.len())];
        let line = before.iter().filter(|&&b| b == b'\n').count();
        let start = before.iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
        // Bytes that continue a character do not count as columns.
        let column = before[start..].iter().filter(|&&b| b & 0xC0 != 0x80).count();
        (line + 1, column + 1)
    }
}

/// Sorts diagnostics in the order of their texts, and removes duplicates of a sub-graph that is used several times and of a value that several
/// nodes use. The first of these names the others.
pub fn sort(diagnostics: &mut Vec<Diagnostic>, sources: &Sources) {
    diagnostics.sort_by_key(|d| (d.location.as_ref().map(|p| (p.file, p.span.start)), d.code));
    let mut reported = HashMap::new();
    let mut all: Vec<(Diagnostic, Vec<String>)> = Vec::with_capacity(diagnostics.len());
    for found in std::mem::take(diagnostics) {
        let at = found.location.as_ref().and_then(|p| Some((&sources.get(p.file)?.name, p.span.clone())));
        let first =
            at.map(|at| *reported.entry((found.code, at, found.message.clone())).or_insert(all.len()));
        match first.and_then(|first| all.get_mut(first)) {
            Some((first, others)) => {
                let other =
                    found.node.filter(|node| first.node.as_ref() != Some(node) && !others.contains(node));
                others.extend(other);
            }
            None => all.push((found, Vec::new())),
        }
    }
    diagnostics.extend(all.into_iter().map(|(mut first, others)| {
        if !others.is_empty() {
            let shown: Vec<String> = others.iter().take(MAX_USERS).map(|node| format!("`{node}`")).collect();
            let more = others.len().saturating_sub(MAX_USERS);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let users = format!("the same for {}{more}", shown.join(", "));
            first.help = Some(first.help.map_or(users.clone(), |help| format!("{help}; {users}")));
        }
        first
    }));
}

/// Nodes that are named when an error in one value is that of several.
const MAX_USERS: usize = 5;

/// Returns true if any of these stops the run.
#[must_use]
pub fn any_error(diagnostics: &[Diagnostic]) -> bool {
    diagnostics.iter().any(|d| d.severity == Severity::Error)
}
