//! `foley plan`.

use super::Exit;
use super::args::PlanArgs;
use super::console::{print_message, stdout};
use super::run::show;
use crate::diag::Severity;
use foley_nodes::registry::Registry;
use std::io::Write as _;
use std::sync::Arc;

/// Length for which a graph without end is planned, s.
const UNTIL: f64 = 1.0;

/// Shows a plan.
///
/// # Errors
/// When standard output goes away.
pub fn plan(args: &PlanArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let session = args.engine.apply(args.graph.session(registry)).with_quiet(args.json);
    let mut preparation = session.prepare();
    let mut errors = preparation.diagnostics.iter().filter(|d| d.severity == Severity::Error).peekable();
    if args.engine.until.is_none() && errors.peek().is_some() && errors.all(|d| d.code == "F048") {
        // A graph without end, as those that play live, has the same rates and latencies up to any end.
        preparation = session.with_until(Some(UNTIL)).prepare();
        print_message(format_args!(
            "the graph never ends: this is its plan for {UNTIL} s; --until SECONDS sets another end"
        ));
    }
    show(&preparation.diagnostics, &preparation.sources);
    let Some(ready) = preparation.prepared else { return Ok(Exit::Wrong) };
    if args.json {
        writeln!(stdout(), "{:#}", ready.plan.json(&ready.graph))?;
    } else {
        write!(stdout(), "{}", ready.plan.text(&ready.graph, args.long))?;
    }
    Ok(Exit::Done)
}
