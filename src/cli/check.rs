//! `foley check`.

use super::Exit;
use super::args::CheckArgs;
use super::run::{read, show};
use crate::diag::{any_error, json, sort};
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
        let (loaded, files) = read(path, &args.sets, &args.allow_read, limits, None);
        let mut found = loaded.diagnostics;
        if let Some(graph) = &loaded.graph {
            found.extend(Plan::new(graph, &files, &options).err().into_iter().flatten());
        }
        // A graph without end is no mistake: it may be meant to be played live.
        found.retain(|d| d.code != "F048");
        sort(&mut found, &loaded.sources);
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
