//! Values of a text: overrides from outside, and references to parameters.

use crate::diag::SourceLocation;
use crate::lang::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// A value from outside the text, for a graph parameter or for `NODE.PARAM`.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// `NAME` or `NODE.PARAM`.
    pub target: String,
    /// A RON value, or text.
    pub value: String,
}

/// Origin of a value, which determines the files that it may name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// A graph file.
    #[default]
    Text,
    /// An argument of the command: a person has named the file.
    CommandLine,
    /// A message that arrived while the graph plays: anybody may have sent it.
    Message,
}

/// A value in a text, with its context.
#[derive(Clone, Debug)]
pub struct Given {
    /// The value.
    pub value: Value,
    /// Its location.
    pub location: SourceLocation,
    /// Folder to which its paths are relative.
    pub folder: PathBuf,
    /// Prefix of the ids that links in it can name.
    pub scope: Scope,
    /// Its origin.
    pub origin: Origin,
}

impl Given {
    /// A value inside this one, without a copy of all of this one.
    pub fn inside(&self, value: &Value) -> Self {
        let location = SourceLocation { file: self.location.file, span: value.span() };
        let (folder, scope, origin) = (self.folder.clone(), self.scope.clone(), self.origin);
        Self { value: value.clone(), location, folder, scope, origin }
    }
}

/// Scope of the names in a text.
#[derive(Clone, Debug, Default)]
pub struct Scope {
    /// Prefix of ids, such as `material.`.
    pub prefix: String,
    /// The parameters of the graph file.
    pub params: Arc<BTreeMap<String, Given>>,
}
