//! `foley plan`.

use super::Exit;
use super::args::PlanArgs;
use super::run::prepare;
use std::io::{Write as _, stdout};

/// Shows a plan.
///
/// # Errors
/// When standard output goes away.
pub fn plan(args: &PlanArgs) -> anyhow::Result<Exit> {
    let Some(ready) = prepare(&args.graph, &args.engine, args.json) else { return Ok(Exit::Wrong) };
    if args.json {
        writeln!(stdout(), "{:#}", ready.plan.json(&ready.graph))?;
    } else {
        write!(stdout(), "{}", ready.plan.text(&ready.graph))?;
    }
    Ok(Exit::Done)
}
