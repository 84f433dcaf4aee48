//! Diagnostics as an error value.

use crate::diag::{Diagnostic, Sources, render};
use std::fmt;

/// Diagnostics with the texts that they point into; shown as the command shows them, without colour.
#[derive(Clone, Debug)]
pub struct Errors {
    /// The diagnostics, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
    /// Notes of nodes about their files: the id of each node, and a text.
    pub notes: Vec<(String, String)>,
    /// The texts.
    pub sources: Sources,
}

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(render(&self.diagnostics, &self.sources, false).trim_end())
    }
}

impl std::error::Error for Errors {}
