//! Text that a node writes when it ends: tables and figures.

use crate::core::fault::Fault;
use crate::core::files::WriteSeek;
use crate::core::node::Summary;
use crate::core::params::OutPath;
use crate::core::shape::Build;
use std::fmt;
use std::io::Write as _;

/// One file of text, opened when the node is built and written when it ends.
pub struct TextOutput {
    field: &'static str,
    path: String,
    file: Box<dyn WriteSeek>,
}

impl fmt::Debug for TextOutput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TextOutput({:?})", self.path)
    }
}

impl TextOutput {
    /// Opens the file of a parameter.
    ///
    /// # Errors
    /// When it cannot be created; the error names `field`.
    pub fn create(cx: &Build<'_>, field: &'static str, path: &OutPath) -> Result<Self, Fault> {
        Ok(Self { field, path: path.0.clone(), file: cx.create(field, &path.0)? })
    }

    /// Opens the file of a parameter; none if the parameter is not set.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    #[cfg(feature = "impact")]
    pub fn open(cx: &Build<'_>, field: &'static str, path: Option<&OutPath>) -> Result<Option<Self>, Fault> {
        path.map(|path| Self::create(cx, field, path)).transpose()
    }

    /// Writes the whole text, and adds the path to the summary.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&mut self, text: &str, summary: &mut Summary) -> Result<(), Fault> {
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.flush());
        written
            .map_err(|e| Fault::new("F080", format!("cannot write {:?}: {e}", self.path)).at(self.field))?;
        summary.push((self.field, self.path.as_str().into()));
        Ok(())
    }
}
