//! Nodes as they are written, before they are checked.

use super::values::Given;
use crate::diag::SourceLocation;

/// Returns true for a text that can be the id of a node: a letter or `_`, then letters, digits, `_` and `-`.
#[must_use]
pub fn valid_id(id: &str) -> bool {
    let start = id.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_');
    start && id.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-')
}

/// A node as written in the text.
#[derive(Debug)]
pub struct RawNode {
    /// Its full id.
    pub id: String,
    /// Name of its type.
    pub type_name: String,
    /// Location of the type's name.
    pub type_location: SourceLocation,
    /// Location of its id.
    pub location: SourceLocation,
    /// End of its text in that file.
    pub end: usize,
    /// Its fields in order: name, location of the name, value.
    pub fields: Vec<(String, SourceLocation, Given)>,
    /// True if its text is complete enough to check.
    pub whole: bool,
    /// True for `None`, which removes the node of a graph that is extended.
    pub removes: bool,
}

impl RawNode {
    /// Takes over the fields of this node in a file that extends this one.
    pub(super) fn extend(&mut self, new: Self) {
        if new.type_name != self.type_name {
            *self = new;
            return;
        }
        self.whole &= new.whole;
        for field in new.fields {
            match self.fields.iter_mut().find(|(name, _, _)| *name == field.0) {
                Some(old) => *old = field,
                None => self.fields.push(field),
            }
        }
    }

    /// Location of its type and fields.
    pub fn body(&self) -> SourceLocation {
        let SourceLocation { file, span } = self.type_location.clone();
        SourceLocation { file, span: span.start..self.end }
    }
}
