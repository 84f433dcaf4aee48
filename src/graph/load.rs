//! Loads a graph: reads its files, then checks everything that was read.

use super::check;
use super::load_options::LoadOptions;
use super::loader::{Loaded, Loader};
use super::texts::read_text;
use crate::diag::Diagnostic;
use std::path::Path;

/// Reads and checks the graph at `path`.
///
/// All mistakes are in [`Loaded::diagnostics`].
#[must_use]
pub fn load(path: &Path, options: &LoadOptions) -> Loaded {
    let mut loader = Loader::new(path, options);
    loader.root.note(path);
    for folder in &options.allow_read {
        loader.root.note(folder);
        if let Err(e) = loader.root.allow_folder(folder) {
            let message = format!("--allow-read {}: {e}", folder.display());
            loader.found.push(Diagnostic::general("F060", message));
        }
    }
    let known = options.texts.as_ref().and_then(|texts| texts.get(path)).map(|(_, text)| text);
    let read = || read_text(path, &path.display().to_string(), options.limits.graph_bytes);
    match known.map_or_else(read, Ok) {
        Ok(text) => {
            loader.cache_text(path, path, &text);
            let given = loader.overrides(options);
            let mut chain = vec![std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())];
            loader.file(&path.display().to_string(), text, path, "", given, &mut chain);
        }
        Err(e) => loader.found.push(Diagnostic::general(e.code, e.message)),
    }
    check::check(loader)
}

/// Reads and checks a graph from a text, for editors, programs and tests; paths in it are relative to the folder of `path`.
#[must_use]
pub fn load_text(name: &str, text: &str, path: &Path, options: &LoadOptions) -> Loaded {
    let mut loader = Loader::new(path, options);
    for folder in &options.allow_read {
        if let Err(e) = loader.root.allow_folder(folder) {
            loader.found.push(Diagnostic::general("F060", format!("{}: {e}", folder.display())));
        }
    }
    let given = loader.overrides(options);
    loader.file(name, text.to_owned(), path, "", given, &mut vec![path.to_owned()]);
    check::check(loader)
}
