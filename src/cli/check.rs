//! `foley check`.

use super::Exit;
use super::args::CheckArgs;
use super::run::show;
use crate::diag::{any_error, json};
use crate::graph::{DirFiles, load};
use crate::plan::{Plan, PlanOptions};
use serde_json::Value;
use std::io::{Write as _, stdout};

/// Checks graphs: text, types, links, and what the files they read say.
///
/// # Errors
/// When standard output goes away.
pub fn check(args: &CheckArgs) -> anyhow::Result<Exit> {
    let limits = args.limits.limits();
    let options = PlanOptions { memory: limits.memory, ..PlanOptions::default() };
    let mut wrong = false;
    let mut all = Vec::new();
    for path in &args.graphs {
        let loaded = load(path, &args.sets, &args.allow_read, limits);
        let mut found = loaded.diagnostics;
        if let Some(graph) = &loaded.graph {
            let files = DirFiles::new(loaded.root, limits);
            // A graph without end is no mistake: it may be meant to be played live.
            if let Err(errors) = Plan::new(graph, &files, &options) {
                found.extend(errors.into_iter().filter(|e| e.code != "F048"));
            }
        }
        wrong |= any_error(&found);
        if args.json {
            let Value::Array(items) = json(&found, &loaded.sources) else { continue };
            all.extend(items);
        } else {
            show(&found, &loaded.sources);
        }
    }
    if args.json {
        writeln!(stdout(), "{:#}", Value::Array(all))?;
    }
    Ok(if wrong { Exit::Wrong } else { Exit::Done })
}
