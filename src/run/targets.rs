//! The files that a run writes, checked before it starts: no file is written twice, overwrites an input or lies outside the
//! output folder.

use super::{DirOutputs, Tap};
use crate::diag::{Diagnostic, SourceLocation};
use crate::graph::{Asked, Graph, written};
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

/// One file to be written.
struct Target<'a> {
    /// Its path.
    path: PathBuf,
    /// The node or flag that writes it.
    writer: String,
    /// The node that writes it, and the source location of its path.
    node: Option<(&'a str, SourceLocation)>,
}

impl Target<'_> {
    fn given(flag: &str, path: &Path) -> Self {
        Self { path: path.to_owned(), writer: flag.to_owned(), node: None }
    }

    fn error(&self, code: &'static str, message: String) -> Diagnostic {
        match &self.node {
            Some((id, location)) => Diagnostic::error(code, message, location.clone()).node(id),
            None => Diagnostic::general(code, message),
        }
    }
}

/// Finds targets outside the output folder, targets with the same path, and targets that overwrite a file in `asked`.
#[must_use]
pub fn check(
    graph: &Graph,
    taps: &[Tap],
    report: Option<&Path>,
    outputs: &DirOutputs,
    asked: &Asked,
) -> Vec<Diagnostic> {
    let (mut targets, mut errors) = (Vec::new(), Vec::new());
    for (n, node) in graph.nodes.iter().enumerate() {
        for (field, path) in written(&node.ty, &*node.params) {
            let location = graph.location(n, Some(field));
            match outputs.resolve(&path) {
                Ok(path) => targets.push(Target {
                    path,
                    writer: format!("`{}`", node.id),
                    node: Some((&node.id, location)),
                }),
                Err(e) => errors.push(Diagnostic::error(e.code, e.message, location).node(&node.id)),
            }
        }
    }
    targets.extend(taps.iter().filter_map(Tap::path).map(|path| Target::given("--tap", path)));
    targets.extend(report.map(|path| Target::given("--report", path)));
    errors.extend(conflicts(&targets, asked));
    errors
}

/// Checks files that are named on the command line only, each with its flag.
#[must_use]
pub fn check_given(given: &[(&str, &Path)], asked: &Asked) -> Vec<Diagnostic> {
    let targets: Vec<Target<'_>> = given.iter().map(|(flag, path)| Target::given(flag, path)).collect();
    conflicts(&targets, asked)
}

fn conflicts(targets: &[Target<'_>], asked: &Asked) -> Vec<Diagnostic> {
    let mut errors = Vec::new();
    let read: HashSet<PathBuf> = asked
        .files
        .keys()
        .flat_map(|path| [fs::canonicalize(path).ok(), resolved_path(path)])
        .flatten()
        .collect();
    let mut first: HashMap<PathBuf, usize> = HashMap::new();
    for (k, target) in targets.iter().enumerate() {
        let (writer, shown) = (&target.writer, target.path.display());
        let Some(real) = resolved_path(&target.path) else { continue };
        if read.contains(&real) {
            let found = target.error("F085", format!("{writer} would replace {shown}, which this run reads"));
            errors.push(found.help("write to another name or, with --out, to another folder"));
        }
        match first.get(&real).map(|&k| &targets[k]) {
            // Outputs of the graph come first, so the target with a source location, if any, is the earlier one.
            Some(earlier) => {
                errors.push(
                    earlier.error("F081", format!("{} and {writer} both write {shown}", earlier.writer)),
                );
            }
            None => drop(first.insert(real, k)),
        }
    }
    errors
}

/// The path of a file with its folder resolved, but without following a link at its own name; `None` for a folder.
fn resolved_path(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let existing =
        folder.ancestors().find_map(|ancestor| Some((ancestor, fs::canonicalize(nonempty(ancestor)).ok()?)));
    let (ancestor, real) = existing?;
    Some(real.join(folder.strip_prefix(ancestor).ok()?).join(name))
}

fn nonempty(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}
