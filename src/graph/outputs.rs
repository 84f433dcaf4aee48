//! Checks of the files that a graph writes: allowed folders, and no path twice.

use super::checked_node::CheckedNode;
use super::raw_node::RawNode;
use crate::diag::{Diagnostic, SourceLocation};
use foley_nodes::core::files::FileError;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{AnyParams, Datum, ParamKind};
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

/// Maximum bytes of the name of an output: file systems have 255, of which the ending of a temporary name takes some.
const MAX_NAME_BYTES: usize = 230;
/// Maximum bytes of the path of an output below its folder.
const MAX_PATH_BYTES: usize = 3000;

/// The path of an output below the output folder, without detours.
///
/// # Errors
/// When it does not name a file below that folder.
pub fn output_path(path: &str) -> Result<PathBuf, FileError> {
    let plain = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    let folder = path.ends_with(std::path::is_separator);
    if path.is_empty() || !plain || folder || Path::new(path).file_name().is_none() {
        let message = format!("{path:?} does not name a file below the output folder");
        return Err(FileError { code: "F082", message });
    }
    if path.contains('\0') {
        let message = format!("{path:?} cannot be the name of a file: it holds a zero character");
        return Err(FileError { code: "F082", message });
    }
    let longest = path.split(std::path::is_separator).map(str::len).max().unwrap_or(0);
    if longest > MAX_NAME_BYTES || path.len() > MAX_PATH_BYTES {
        let shown: String = path.chars().take(40).collect();
        let message = format!(
            "the path {shown:?}... is too long: a name has at most {MAX_NAME_BYTES} bytes, a path {MAX_PATH_BYTES}"
        );
        return Err(FileError { code: "F082", message });
    }
    Ok(Path::new(path).components().filter(|c| matches!(c, Component::Normal(_))).collect())
}

/// The paths of a node's output files, with the fields that name them.
pub fn written(ty: &NodeType, params: &dyn AnyParams) -> impl Iterator<Item = (&'static str, String)> {
    let specs = (ty.params)();
    let output = move |name| specs.iter().any(|s| s.name == name && *s.kind.innermost() == ParamKind::Output);
    params.write().into_iter().filter_map(move |(name, value)| match value {
        Datum::Text(path) if output(name) => Some((name, path)),
        _ => None,
    })
}

/// Finds output paths outside the output folder, and those that occur twice.
pub(super) fn check(raw: &[RawNode], checked: &[Option<CheckedNode>], found: &mut Vec<Diagnostic>) {
    let mut first: HashMap<PathBuf, SourceLocation> = HashMap::new();
    for (node, checked_node) in raw.iter().zip(checked) {
        let Some(CheckedNode { outputs, fields, .. }) = checked_node else { continue };
        for (name, path) in outputs {
            let location = fields.get(*name).unwrap_or(&node.location).clone();
            let full = match output_path(path) {
                Ok(full) => full,
                Err(e) => {
                    found.push(Diagnostic::error(e.code, e.message, location).node(&node.id));
                    continue;
                }
            };
            if let Some(earlier) = first.get(&full) {
                let message = format!("two outputs have the path {}", full.display());
                let reported = Diagnostic::error("F081", message, location).node(&node.id);
                found.push(reported.label(earlier.clone(), "first here"));
            } else {
                first.insert(full, location);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_no_file_can_have_are_refused_before_the_run() {
        assert_eq!(output_path("a/./b.wav").unwrap(), Path::new("a/b.wav"));
        let wrong =
            ["a\0b.wav".to_owned(), "ä".repeat(116), "a/".repeat(1600) + "b.wav", "../b.wav".to_owned()];
        for wrong in wrong {
            assert_eq!(output_path(&wrong).unwrap_err().code, "F082", "{wrong:?}");
        }
    }
}
