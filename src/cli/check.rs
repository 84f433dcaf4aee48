//! `foley check`.

use super::Exit;
use super::args::CheckArgs;
use super::console::stdout;
use super::run::{note_lines, show};
use crate::diag::{self, Sources};
use crate::session::Errors;
use crate::testing::{TestFile, test_file_of};
use foley_nodes::registry::Registry;
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

/// All errors of a test file.
fn check_tests(path: &Path) -> Errors {
    let mut sources = Sources::default();
    let diagnostics = TestFile::read(path, &mut sources).err().unwrap_or_default();
    Errors { diagnostics, notes: Vec::new(), sources }
}

/// Checks graphs: text, types, links, and the contents of the files that they read; of a test file its own text.
///
/// # Errors
/// When standard output goes away.
pub fn check(args: &CheckArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let mut wrong = false;
    let mut all = Vec::new();
    for path in &args.graphs.graphs {
        let found = match test_file_of(path) == *path {
            true => check_tests(path),
            false => args.graphs.session(path, registry).check(),
        };
        wrong |= found.any_error();
        if args.json {
            let Value::Array(items) = diag::json(&found.diagnostics, &found.sources) else { continue };
            all.extend(items);
            let note = |(node, text): &(String, String)| json!({ "severity": "note", "node": node, "message": text });
            all.extend(found.notes.iter().map(note));
        } else {
            show(&found.diagnostics, &found.sources);
            note_lines(found.notes.iter()).iter().try_for_each(|line| writeln!(stdout(), "{line}"))?;
        }
    }
    if args.json {
        writeln!(stdout(), "{:#}", Value::Array(all))?;
    }
    Ok(if wrong { Exit::Wrong } else { Exit::Done })
}
