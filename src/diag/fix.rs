//! Corrections of a text: changes that resolve a finding, which an editor can apply.

use super::SourceLocation;
use crate::lang::Parse;
use crate::lang::edit::{TextEdit, insert_entry_before, set_field};

/// One correction of a finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Fix {
    /// Its description, such as ``write `Gain` ``.
    pub title: String,
    /// Changes of the text, all in one file.
    pub changes: Vec<Change>,
}

/// One change of a text.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Replaces a part of the text; an empty part is inserted at.
    Replace(SourceLocation, String),
    /// Adds a field to a node, whose type and fields have this location.
    SetField {
        /// Location of the node without its id.
        node: SourceLocation,
        /// Name of the field.
        field: String,
        /// Its value, as RON.
        value: String,
    },
    /// Adds an entry to a map, before the one whose key has this location.
    InsertEntry {
        /// Location of the key.
        before: SourceLocation,
        /// The entry, as RON.
        entry: String,
    },
}

impl Fix {
    /// A correction that replaces one part of the text.
    #[must_use]
    pub fn replace(title: impl Into<String>, location: SourceLocation, text: impl Into<String>) -> Self {
        Self { title: title.into(), changes: vec![Change::Replace(location, text.into())] }
    }

    /// The file whose text it changes.
    #[must_use]
    pub fn file(&self) -> Option<usize> {
        self.changes.first().map(|change| change.location().file)
    }

    /// The edits of the text of its file; `None` if the text does not contain the parts to change.
    #[must_use]
    pub fn edits(&self, parse: &Parse) -> Option<Vec<TextEdit>> {
        let file = self.file();
        let mut edits = Vec::new();
        for change in &self.changes {
            let SourceLocation { file: other, span } = change.location().clone();
            if Some(other) != file {
                return None;
            }
            match change {
                Change::Replace(_, new) => edits.push(TextEdit { span, new_text: new.clone() }),
                Change::SetField { field, value, .. } => {
                    edits.extend(set_field(parse, span, field, value).ok()?);
                }
                Change::InsertEntry { entry, .. } => {
                    edits.extend(insert_entry_before(parse, span, entry).ok()?)
                }
            }
        }
        Some(edits)
    }
}

impl Change {
    fn location(&self) -> &SourceLocation {
        match self {
            Self::Replace(location, _)
            | Self::SetField { node: location, .. }
            | Self::InsertEntry { before: location, .. } => location,
        }
    }
}
