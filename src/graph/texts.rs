//! The texts of graph files.

use foley_nodes::core::files::FileError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Texts of graph files as they were first read: loads that share them do not read the files again, so that a half-done edit
/// on the disk stays where it is.
#[derive(Debug, Default)]
pub struct Texts(Mutex<BTreeMap<PathBuf, (PathBuf, String)>>);

impl Texts {
    /// Sets the text of a file that is not to be read from the disk, such as one with unsaved changes in an editor.
    ///
    /// `path` is the path as graphs resolve it: that of the graph, or the folder of the graph joined with the path in the text.
    pub fn set(&self, path: &Path, text: impl Into<String>) {
        let real = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        texts.insert(path.to_owned(), (real, text.into()));
    }

    /// The real path and the text of a file that was read before.
    pub(super) fn get(&self, path: &Path) -> Option<(PathBuf, String)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned()
    }

    /// Caches the text of a file.
    pub(super) fn insert(&self, path: &Path, real: &Path, text: &str) {
        let mut texts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        texts.entry(path.to_owned()).or_insert_with(|| (real.to_owned(), text.to_owned()));
    }
}

/// The text of a graph file of at most `limit` bytes; `show` is its name for people.
///
/// # Errors
/// If it is missing, not a plain file, too large, or not UTF-8.
pub fn read_text(path: &Path, show: &str, limit: u64) -> Result<String, FileError> {
    let error = |code, message: String| FileError { code, message };
    let unreadable = |e: std::io::Error| {
        let code = if e.kind() == std::io::ErrorKind::NotFound { "F060" } else { "F061" };
        error(code, format!("cannot read {show}: {e}"))
    };
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if !meta.is_file() {
        return Err(error("F064", format!("{show} is not a plain file")));
    }
    if meta.len() > limit {
        let message = format!("{show} has {} bytes, a graph file at most {limit}", meta.len());
        return Err(error("F063", message));
    }
    let bytes = std::fs::read(path).map_err(unreadable)?;
    String::from_utf8(bytes).map_err(|e| {
        let message = format!("{show} is not UTF-8 from byte {} on", e.utf8_error().valid_up_to());
        error("F061", message)
    })
}
