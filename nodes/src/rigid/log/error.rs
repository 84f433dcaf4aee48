//! Errors in logs of contacts and poses.

use crate::io::csv_error;
use thiserror::Error;

/// An error at a position in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogFault {
    /// Line of the file, from 1.
    pub line: u64,
    /// Column or key, if the error is in one.
    pub column: Option<String>,
    /// Found and expected contents.
    pub message: String,
}

impl LogFault {
    pub(super) fn new(line: u64, message: impl Into<String>) -> Self {
        Self { line, column: None, message: message.into() }
    }

    pub(super) fn at(line: u64, column: &str, message: impl Into<String>) -> Self {
        Self { line, column: Some(shorten(column)), message: message.into() }
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

/// An error in one of the files of a contact log.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LogError {
    /// An error in the contacts.
    #[error("{0}")]
    Contacts(LogFault),
    /// An error in the poses.
    #[error("{0}")]
    Poses(LogFault),
}

/// Shortens a text for a message.
pub(super) fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Converts an error of the `csv` crate.
pub(super) fn csv_fault(e: &csv::Error) -> LogFault {
    let (line, message) = csv_error(e);
    LogFault::new(line, message)
}
