//! `foley plan`.

use super::Exit;
use super::args::PlanArgs;
use super::run::prepare;

/// Shows a plan.
///
/// # Errors
/// When standard output goes away.
pub fn plan(args: &PlanArgs) -> anyhow::Result<Exit> {
    let Some(ready) = prepare(&args.graph, &args.engine, args.json) else { return Ok(Exit::Wrong) };
    if args.json {
        println!("{:#}", ready.plan.json(&ready.graph));
    } else {
        print!("{}", ready.plan.text(&ready.graph));
    }
    Ok(Exit::Done)
}
