//! Where everything that a run writes will lie, looked at before it starts: nothing is written twice, over what the run
//! reads, or out of its folder.

use super::{DirOutputs, Tap};
use crate::diag::{Diagnostic, Place};
use crate::graph::{Asked, Graph, written};
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

/// One file to be written.
struct Target<'a> {
    /// Where it will lie.
    path: PathBuf,
    /// Who writes it.
    who: String,
    /// The node that writes it, and where its path stands.
    node: Option<(&'a str, Place)>,
}

impl Target<'_> {
    fn given(flag: &str, path: &Path) -> Self {
        Self { path: path.to_owned(), who: flag.to_owned(), node: None }
    }

    fn error(&self, code: &'static str, message: String) -> Diagnostic {
        match &self.node {
            Some((id, place)) => Diagnostic::error(code, message, place.clone()).node(id),
            None => Diagnostic::general(code, message),
        }
    }
}

/// Finds files that would lie out of the output folder, in one place, or in the place of a file that was `asked` for.
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
            let place = graph.place(n, Some(field));
            match outputs.place(&path) {
                Ok(path) => targets.push(Target {
                    path,
                    who: format!("`{}`", node.id),
                    node: Some((&node.id, place)),
                }),
                Err(e) => errors.push(Diagnostic::error(e.code, e.message, place).node(&node.id)),
            }
        }
    }
    targets.extend(taps.iter().map(|tap| Target::given("--tap", &tap.path)));
    targets.extend(report.map(|path| Target::given("--report", path)));
    errors.extend(clashes(&targets, asked));
    errors
}

/// The same for files that are named on the command line alone, each with the flag that names it.
#[must_use]
pub fn check_given(given: &[(&str, &Path)], asked: &Asked) -> Vec<Diagnostic> {
    let targets: Vec<Target<'_>> = given.iter().map(|(flag, path)| Target::given(flag, path)).collect();
    clashes(&targets, asked)
}

fn clashes(targets: &[Target<'_>], asked: &Asked) -> Vec<Diagnostic> {
    let mut errors = Vec::new();
    let read: HashSet<PathBuf> =
        asked.files.keys().flat_map(|path| [fs::canonicalize(path).ok(), own_name(path)]).flatten().collect();
    let mut first: HashMap<PathBuf, usize> = HashMap::new();
    for (k, target) in targets.iter().enumerate() {
        let (who, shown) = (&target.who, target.path.display());
        let Some(real) = own_name(&target.path) else { continue };
        if read.contains(&real) {
            let found = target.error("F085", format!("{who} would replace {shown}, which this run reads"));
            errors.push(found.help("write to another name or, with --out, to another folder"));
        }
        match first.get(&real).map(|&k| &targets[k]) {
            // Outputs of the graph come first, so the one with a place, if any, is the earlier.
            Some(earlier) => {
                errors.push(earlier.error("F081", format!("{} and {who} both write {shown}", earlier.who)));
            }
            None => drop(first.insert(real, k)),
        }
    }
    errors
}

/// A file by its own name in its folder, wherever links in the file system lead to that folder; `None` for no file.
fn own_name(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // What does not exist yet is below what does.
    let there = folder.ancestors().find_map(|above| Some((above, fs::canonicalize(nonempty(above)).ok()?)));
    let (above, real) = there?;
    Some(real.join(folder.strip_prefix(above).ok()?).join(name))
}

fn nonempty(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}
