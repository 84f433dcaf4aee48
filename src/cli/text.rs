//! `foley fmt`, `foley upgrade`, `foley explain` and `foley completions`.

use super::Exit;
use super::args::{Args, CompletionsArgs, ExplainArgs, FmtArgs, UpgradeArgs};
use super::console::stdout;
use super::run::{show, write_whole};
use crate::diag::{Diagnostic, Sources, codes};
use crate::graph::{self, Limits, nearest, read_text};
use crate::lang::SyntaxError;
use crate::lang::fmt::format;
use anyhow::Context as _;
use clap::CommandFactory as _;
use std::fs;
use std::io::Write as _;

/// Lays out graph files.
///
/// # Errors
/// When a file cannot be read or written.
pub fn fmt(args: &FmtArgs) -> anyhow::Result<Exit> {
    let mut exit = Exit::Done;
    for path in &args.graphs {
        let name = path.display().to_string();
        let text =
            read_text(path, &name, Limits::default().graph_bytes).map_err(|e| anyhow::anyhow!(e.message))?;
        match format(&text) {
            Ok(laid_out) if laid_out == text => {}
            Ok(_) if args.check => {
                writeln!(stdout(), "{name} is not formatted")?;
                exit = Exit::Failed;
            }
            Ok(laid_out) => {
                // A link stays a link.
                let real = fs::canonicalize(path).with_context(|| name.clone())?;
                write_whole(&real, &laid_out)?;
                writeln!(stdout(), "formatted {name}")?;
            }
            Err(errors) => {
                show_syntax(&name, text, &errors);
                exit = Exit::Wrong;
            }
        }
    }
    Ok(exit)
}

/// Prints the syntax errors of a file.
fn show_syntax(name: &str, text: String, errors: &[SyntaxError]) {
    let mut sources = Sources::default();
    let file = sources.add(name, text);
    let found: Vec<Diagnostic> = errors.iter().map(|e| Diagnostic::of_syntax(e, file)).collect();
    show(&found, &sources);
}

/// Changes graph files of older versions to the present node types and fields.
///
/// # Errors
/// When a file cannot be read or written.
pub fn upgrade(args: &UpgradeArgs) -> anyhow::Result<Exit> {
    let mut exit = Exit::Done;
    for path in &args.graphs {
        let name = path.display().to_string();
        let text =
            read_text(path, &name, Limits::default().graph_bytes).map_err(|e| anyhow::anyhow!(e.message))?;
        match graph::upgrade(&text) {
            Ok(upgraded) => {
                for (line, what) in &upgraded.changes {
                    writeln!(stdout(), "{name}:{line}: {what}")?;
                }
                if args.check {
                    exit = if upgraded.changes.is_empty() { exit } else { Exit::Failed };
                } else if upgraded.text != text {
                    // A link stays a link.
                    let real = fs::canonicalize(path).with_context(|| name.clone())?;
                    write_whole(&real, &upgraded.text)?;
                }
            }
            Err(errors) => {
                show_syntax(&name, text, &errors);
                exit = Exit::Wrong;
            }
        }
    }
    Ok(exit)
}

/// Explains a code.
///
/// # Errors
/// None at present.
pub fn explain(args: &ExplainArgs) -> anyhow::Result<Exit> {
    let wanted = args.code.to_uppercase();
    match codes::find(&wanted) {
        Some(code) => {
            writeln!(stdout(), "{}: {}\n\n{}", code.code, code.title, code.text.trim())?;
            Ok(Exit::Done)
        }
        None => {
            let near = nearest(&wanted, codes::all().iter().map(|c| c.code));
            let hint = near.map(|n| format!("; did you mean {n}?")).unwrap_or_default();
            super::console::print_message(format_args!("there is no code {wanted}{hint}"));
            Ok(Exit::Wrong)
        }
    }
}

/// Prints completions for a shell.
///
/// # Errors
/// None at present.
pub fn completions(args: &CompletionsArgs) -> anyhow::Result<Exit> {
    // Into memory first: the generator panics where standard output goes away.
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "foley", &mut text);
    stdout().write_all(&text)?;
    Ok(Exit::Done)
}
