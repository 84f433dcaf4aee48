//! Renames of nodes, sub-graphs and parameters in all graphs that name them.

use super::names::{Occurrence, Target, occurrences};
use super::workspace::Workspace;
use crate::graph::valid_id;
use foley_nodes::registry::Registry;
use lsp_types::TextEdit;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The edits that rename a target, by file.
///
/// # Errors
/// Reason for which the new name is invalid.
pub fn rename(
    workspace: &Workspace,
    registry: &Registry,
    target: &Target,
    new: &str,
) -> Result<BTreeMap<PathBuf, Vec<TextEdit>>, String> {
    let (path, old, is_id) = match target {
        Target::Node(path, name) | Target::Use(path, name) => (path, name, true),
        Target::Param(path, name) => (path, name, false),
        Target::Port(..) => return Err("the name of a port belongs to the node type".into()),
        Target::File(_) => return Err("a file is renamed in its folder".into()),
    };
    let file = workspace.file(path).ok_or_else(|| format!("{} cannot be read", path.display()))?;
    if is_id && !valid_id(new) {
        return Err(format!(
            "{new:?} cannot be an id: it starts with a letter and continues with letters, digits, `_` and `-`"
        ));
    }
    if !is_id && (new.is_empty() || new.contains(['.', '"', '\\', '$'])) {
        return Err(format!("{new:?} cannot be the name of a parameter"));
    }
    let is_taken = if is_id {
        file.node_entry(new).is_some() || file.use_of(new).is_some()
    } else {
        file.param(new).is_some()
    };
    if is_taken && new != old {
        return Err(format!("the graph has {new:?} already"));
    }
    let mut edits: BTreeMap<PathBuf, Vec<TextEdit>> = BTreeMap::new();
    for (path, Occurrence { span, .. }) in occurrences(workspace, registry, target) {
        let Some(file) = workspace.file(&path) else { continue };
        let edit = TextEdit { range: file.range(&span), new_text: new.to_owned() };
        edits.entry(path).or_default().push(edit);
    }
    Ok(edits)
}
