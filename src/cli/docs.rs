//! `foley docs`.

use super::Exit;
use super::args::{Args, DocsArgs};
use super::console::stdout;
use super::run::write_whole;
use crate::docs::pages;
use anyhow::Context as _;
use clap::CommandFactory as _;
use foley_nodes::registry::Registry;
use std::fs;
use std::io::Write as _;

/// Writes the generated pages of the book, or checks that they are up to date.
///
/// # Errors
/// When a page cannot be read or written.
pub fn docs(args: &DocsArgs, registry: &Registry) -> anyhow::Result<Exit> {
    let source = args.root.join("docs/src");
    if !source.join("SUMMARY.md").is_file() {
        super::console::tell(format_args!(
            "there is no book: {} is missing",
            source.join("SUMMARY.md").display()
        ));
        return Ok(Exit::Wrong);
    }
    let pages = pages(&args.root, Args::command(), registry).context("reading the book")?;
    let mut exit = Exit::Done;
    // A page of a family that has gone is no longer wanted.
    let nodes = source.join("reference/nodes");
    for entry in fs::read_dir(&nodes).into_iter().flatten().flatten() {
        let name = format!("reference/nodes/{}", entry.file_name().to_string_lossy());
        if !pages.iter().any(|(path, _)| *path == name) {
            if args.check {
                writeln!(stdout(), "docs/src/{name} is of a family that does not exist")?;
                exit = Exit::Failed;
            } else {
                fs::remove_file(entry.path()).with_context(|| name.clone())?;
                writeln!(stdout(), "removed docs/src/{name}")?;
            }
        }
    }
    for (path, text) in pages {
        let full = source.join(&path);
        if fs::read_to_string(&full).is_ok_and(|old| old == text) {
            continue;
        }
        if args.check {
            writeln!(stdout(), "docs/src/{path} is not up to date")?;
            exit = Exit::Failed;
        } else {
            write_whole(&full, &text)?;
            writeln!(stdout(), "wrote docs/src/{path}")?;
        }
    }
    if exit == Exit::Failed {
        writeln!(stdout(), "run `foley docs --write`")?;
    }
    Ok(exit)
}
