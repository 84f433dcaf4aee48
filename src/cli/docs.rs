//! `foley docs`.

use super::Exit;
use super::args::{Args, DocsArgs};
use super::console::stdout;
use super::run::write_whole;
use crate::docs::{page, page_names, pages};
use anyhow::Context as _;
use clap::CommandFactory as _;
use foley_nodes::registry::{Registry, omitted_features};
use std::fs;
use std::io::Write as _;

/// Prints a page of the book or lists all, writes the pages that come from the code, or checks that they are up to date.
///
/// # Errors
/// When a page cannot be read or written.
pub fn docs(args: &DocsArgs, registry: &Registry) -> anyhow::Result<Exit> {
    if args.write || args.check { generate(args, registry) } else { print(args, registry) }
}

/// Prints a page of the book, or a list of all.
fn print(args: &DocsArgs, registry: &Registry) -> anyhow::Result<Exit> {
    let all = page_names(registry);
    let Some(name) = &args.page else {
        let width = all.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        for (name, title) in &all {
            writeln!(stdout(), "{name:<width$}  {title}")?;
        }
        writeln!(stdout(), "\n`foley docs NAME` prints a page")?;
        return Ok(Exit::Done);
    };
    if let Some(text) = page(name, Args::command(), registry) {
        write!(stdout(), "{text}")?;
        return Ok(Exit::Done);
    }
    let word = name.to_lowercase();
    let near =
        all.iter().filter(|(page, title)| page.contains(&word) || title.to_lowercase().contains(&word));
    let mut near: Vec<&str> = near.map(|(page, _)| page.as_str()).collect();
    near.sort_by_key(|page| !page.starts_with(&word));
    let help = if near.is_empty() {
        "`foley docs` lists all".to_owned()
    } else {
        format!("there are: {}", near.join(", "))
    };
    super::console::print_message(format_args!("the book has no page `{name}`; {help}"));
    Ok(Exit::Wrong)
}

fn generate(args: &DocsArgs, registry: &Registry) -> anyhow::Result<Exit> {
    let omitted: Vec<&str> = omitted_features().collect();
    if !omitted.is_empty() {
        super::console::print_message(format_args!(
            "the reference describes the node types of all features; this build does not have {}",
            omitted.join(", ")
        ));
        return Ok(Exit::Wrong);
    }
    let source = args.root.join("docs/src");
    if !source.join("SUMMARY.md").is_file() {
        super::console::print_message(format_args!(
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
