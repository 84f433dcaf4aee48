//! Why a log of contacts or poses cannot be read.

use thiserror::Error;

/// Where in a file, what was found there and what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogFault {
    /// Line of the file, from 1.
    pub line: u64,
    /// Column, or key, where it is one.
    pub column: Option<String>,
    /// What was found and what would be right.
    pub message: String,
}

impl LogFault {
    pub(super) fn new(line: u64, message: impl Into<String>) -> Self {
        Self { line, column: None, message: message.into() }
    }

    pub(super) fn at(line: u64, column: &str, message: impl Into<String>) -> Self {
        Self { line, column: Some(shown(column)), message: message.into() }
    }
}

impl std::fmt::Display for LogFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.column {
            Some(column) => write!(f, "line {}, column `{column}`: {}", self.line, self.message),
            None => write!(f, "line {}: {}", self.line, self.message),
        }
    }
}

/// Why a log of contacts cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LogError {
    /// The contacts are wrong.
    #[error("{0}")]
    Contacts(LogFault),
    /// The poses are wrong.
    #[error("{0}")]
    Poses(LogFault),
}

/// Shortened for a message.
pub(super) fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

/// What the `csv` crate found wrong.
pub(super) fn csv_fault(e: &csv::Error) -> LogFault {
    let message = match e.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} field(s) where the header has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "not UTF-8 text".into(),
        _ => "not comma-separated text".into(),
    };
    LogFault::new(e.position().map_or(1, csv::Position::line), message)
}
