//! The takes that a node reads.

use super::takes::Take;
use crate::core::fault::Reject;
use crate::core::shape::Shape;
use crate::io::recording_list::MANIFEST;
use crate::io::{ListedRecording, RecordingList};
use std::collections::BTreeSet;

/// The parameters that name takes.
pub(super) struct Sources<'a> {
    pub(super) list: RecordingList<'a>,
    /// Name of the object where the manifest names none.
    pub(super) object: &'a str,
    /// Material of the takes of the manifest that count; empty for all.
    pub(super) material: &'a str,
}

impl Sources<'_> {
    /// The takes of the list; those without an object belong to one object.
    ///
    /// # Errors
    /// A folder or a manifest that cannot be read, no recording, or none of the material.
    pub(super) fn all<P>(&self, s: &mut Shape<'_, '_, P>) -> Result<Vec<ListedRecording<Take>>, Reject> {
        let mut found: Vec<ListedRecording<Take>> = self.list.all(s)?;
        if !self.material.is_empty() {
            let is_listed = |source: &ListedRecording<Take>| source.field == MANIFEST;
            let listed = found.iter().filter(|source| is_listed(source));
            let materials: BTreeSet<String> = listed.map(|s| format!("{:?}", s.entry.material)).collect();
            found.retain(|source| !is_listed(source) || source.entry.material == self.material);
            if !materials.is_empty() && !found.iter().any(is_listed) {
                let list = self.list.manifest.map(|list| list.0.as_str()).unwrap_or_default();
                let message = format!("{list:?}: no take of the material {:?}", self.material);
                let names: Vec<String> = materials.into_iter().collect();
                let help = format!("there are takes of {}", names.join(", "));
                return Err(Reject::new(self.list.code, message).at("material").help(help));
            }
        }
        let first = found.first().map(|source| source.path.clone()).unwrap_or_default();
        for source in &mut found {
            let object = &mut source.entry.object;
            if object.is_empty() {
                self.object.clone_into(object);
            }
            // Objects without a name are one object, as if all recordings were a list.
            if object.is_empty() {
                object.clone_from(&first);
            }
        }
        Ok(found)
    }
}
