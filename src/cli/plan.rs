//! `foley plan`.

use super::Exit;
use super::args::PlanArgs;
use super::console::stdout;
use super::run::prepare;
use foley_nodes::registry::Registry;
use std::io::Write as _;
use std::sync::Arc;

/// Shows a plan.
///
/// # Errors
/// When standard output goes away.
pub fn plan(args: &PlanArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let session = args.engine.apply(args.graph.session(registry)).with_quiet(args.json);
    let Some(ready) = prepare(&session) else { return Ok(Exit::Wrong) };
    if args.json {
        writeln!(stdout(), "{:#}", ready.plan.json(&ready.graph))?;
    } else {
        write!(stdout(), "{}", ready.plan.text(&ready.graph))?;
    }
    Ok(Exit::Done)
}
