//! `foley check`.

use super::Exit;
use super::args::CheckArgs;
use super::console::stdout;
use super::run::show;
use crate::diag::json;
use foley_nodes::registry::Registry;
use serde_json::Value;
use std::io::Write as _;
use std::sync::Arc;

/// Checks graphs: text, types, links, and the contents of the files that they read.
///
/// # Errors
/// When standard output goes away.
pub fn check(args: &CheckArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let mut wrong = false;
    let mut all = Vec::new();
    for path in &args.graphs {
        let found = args.session(path, registry).check();
        wrong |= found.any_error();
        if args.json {
            let Value::Array(items) = json(&found.diagnostics, &found.sources) else { continue };
            all.extend(items);
        } else {
            show(&found.diagnostics, &found.sources);
        }
    }
    if args.json {
        writeln!(stdout(), "{:#}", Value::Array(all))?;
    }
    Ok(if wrong { Exit::Wrong } else { Exit::Done })
}
