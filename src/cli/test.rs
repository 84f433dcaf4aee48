//! `foley test`.

use super::Exit;
use super::args::TestArgs;
use super::console::{print_line, print_message, stdout};
use super::run::{show, write_whole};
use crate::diag::{self, Diagnostic, Sources};
use crate::lang::edit::{TextEdit, apply, set_field};
use crate::lang::parse;
use crate::testing::{Case, CheckResult, Runner, Stored, TestFile, run, test_file_of};
use anyhow::Context as _;
use foley_nodes::registry::Registry;
use serde_json::{Value, json};
use std::fs;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

/// The results so far.
#[derive(Default)]
struct Tally {
    passed: usize,
    failed: usize,
    stored: usize,
    cases: usize,
    /// Cases and files that could not be run.
    wrong: usize,
    exit: Option<Exit>,
    checks: Vec<Value>,
    errors: Vec<Value>,
}

impl Tally {
    fn error(&mut self, args: &TestArgs, name: &str, diagnostics: &[Diagnostic], sources: &Sources) {
        self.wrong += 1;
        // A full disk is no mistake of the graph, but a graph that is wrong outweighs it.
        let exit = Exit::of(diagnostics);
        self.exit = Some(if self.exit == Some(Exit::Wrong) { Exit::Wrong } else { exit });
        if args.json {
            self.errors.push(json!({ "case": name, "errors": diag::json(diagnostics, sources) }));
        } else {
            print_message(format_args!("{name} cannot be run"));
            show(diagnostics, sources);
        }
    }

    fn exit(&self) -> Exit {
        self.exit.unwrap_or(if self.failed > 0 { Exit::Failed } else { Exit::Done })
    }
}

/// The test files that are named: those beside graphs, and all below folders.
fn test_files(given: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in given {
        if !path.is_dir() {
            found.push(test_file_of(path));
            continue;
        }
        let (mut open, mut below) = (vec![path.clone()], Vec::new());
        while let Some(folder) = open.pop() {
            for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
                let entry = entry.with_context(|| folder.display().to_string())?;
                let path = entry.path();
                if entry.file_type().is_ok_and(|ty| ty.is_dir()) {
                    open.push(path);
                } else if path.to_string_lossy().ends_with(".test.ron") {
                    below.push(path);
                }
            }
        }
        below.sort();
        found.extend(below);
    }
    Ok(found)
}

/// Runs the checks that are written beside graphs.
///
/// # Errors
/// If a file cannot be stored, a folder cannot be read, or standard output is closed.
pub fn test(args: &TestArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let runner = Runner { options: args.load_options(registry), threads: args.threads };
    let files = test_files(&args.graphs)?;
    let mut tally = Tally::default();
    for path in &files {
        let mut sources = Sources::default();
        match TestFile::read(path, &mut sources) {
            Ok(file) => test_file(args, &runner, (&file, &sources), &mut tally)?,
            Err(errors) => tally.error(args, &path.display().to_string(), &errors, &sources),
        }
    }
    if args.list {
        return Ok(tally.exit());
    }
    if args.json {
        let all = json!({
            "passed": tally.passed, "failed": tally.failed, "stored": tally.stored,
            "checks": tally.checks, "errors": tally.errors,
        });
        writeln!(stdout(), "{all:#}")?;
        return Ok(tally.exit());
    }
    let mut parts = vec![format!("{} passed", tally.passed), format!("{} failed", tally.failed)];
    if tally.stored > 0 {
        parts.push(format!("{} stored", tally.stored));
    }
    if tally.wrong > 0 {
        parts.push(format!("{} could not be run", tally.wrong));
    }
    print_line(&format!("{} in {} case(s) of {} file(s)", parts.join(", "), tally.cases, files.len()))?;
    if tally.checks.is_empty() && tally.wrong == 0 {
        print_message(match &args.filter {
            Some(word) => format!("no check has {word:?} in its name"),
            None => "there are no test files".to_owned(),
        });
        return Ok(Exit::Wrong);
    }
    Ok(tally.exit())
}

/// The name of a check, by which `--filter` selects.
fn name(file: &TestFile, case: &Case, output: &str, check: &str) -> String {
    format!("{}: {}: {output}: {check}", file.graph.display(), case.name)
}

fn test_file(
    args: &TestArgs,
    runner: &Runner,
    (file, sources): (&TestFile, &Sources),
    tally: &mut Tally,
) -> anyhow::Result<()> {
    let mut edits = Vec::new();
    for case in &file.cases {
        let wanted = |output: &str, check: &str| {
            args.filter.as_ref().is_none_or(|word| name(file, case, output, check).contains(word.as_str()))
        };
        if args.list {
            for expected in &case.outputs {
                let labels = expected.checks.iter().map(crate::testing::Check::label);
                for label in labels.filter(|label| wanted(&expected.output, label)) {
                    print_line(&name(file, case, &expected.output, &label))?;
                }
            }
            continue;
        }
        let chosen = |expected: &crate::testing::Expected, check: &crate::testing::Check| {
            wanted(&expected.output, &check.label())
        };
        match run(runner, (file, sources, 0), case, &chosen) {
            Err(e) => {
                let name = format!("{}: {}", file.graph.display(), case.name);
                tally.error(args, &name, &e.diagnostics, &e.sources);
            }
            Ok(results) => {
                tally.cases += usize::from(!results.is_empty());
                for result in results {
                    let stored = args.write.then(|| result.stored.clone()).flatten();
                    report(args, (file, sources, case), &result, stored.is_some(), tally)?;
                    match stored {
                        Some(Stored::Digest(span, digest)) => edits.push((span, digest)),
                        Some(Stored::File(path, bytes)) => write_whole(&path, &bytes)?,
                        None => {}
                    }
                }
            }
        }
    }
    store_digests(file, &edits)
}

/// Prints the result of a check, and counts it.
fn report(
    args: &TestArgs,
    (file, sources, case): (&TestFile, &Sources, &Case),
    result: &CheckResult,
    is_stored: bool,
    tally: &mut Tally,
) -> anyhow::Result<()> {
    let verdict = &result.verdict;
    let (line, column) = sources.line_column(0, result.span.start);
    let count = match (is_stored, verdict.passed) {
        (true, _) => &mut tally.stored,
        (false, true) => &mut tally.passed,
        (false, false) => &mut tally.failed,
    };
    *count += 1;
    tally.checks.push(json!({
        "graph": file.graph, "case": case.name, "output": result.output, "check": result.check,
        "passed": verdict.passed, "stored": is_stored, "found": verdict.found, "expected": verdict.expected,
        "file": file.path, "line": line, "column": column,
    }));
    if args.json || (args.quiet && verdict.passed) {
        return Ok(());
    }
    let name = name(file, case, &result.output, &result.check);
    match (is_stored, verdict.passed) {
        (true, _) => print_line(&format!("stored  {name}"))?,
        (false, true) => print_line(&format!("ok      {name}: {}", verdict.found))?,
        (false, false) => print_line(&format!(
            "FAILED  {name}: found {}, expected {} ({}:{line}:{column})",
            verdict.found,
            verdict.expected,
            file.path.display()
        ))?,
    }
    Ok(())
}

/// Sets the digests of checks in the test file; comments and layout stay.
fn store_digests(file: &TestFile, digests: &[(std::ops::Range<usize>, String)]) -> anyhow::Result<()> {
    if digests.is_empty() {
        return Ok(());
    }
    let parsed = parse(&file.text);
    let edit = |(span, digest): &(std::ops::Range<usize>, String)| {
        set_field(&parsed, span.clone(), "digest", &format!("{digest:?}"))
    };
    let edits: Vec<TextEdit> =
        digests.iter().map(edit).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    // A link stays a link.
    let real = fs::canonicalize(&file.path).with_context(|| file.path.display().to_string())?;
    write_whole(&real, &apply(&file.text, &edits)?)
}
