//! `foley graph`.

use super::Exit;
use super::args::DrawArgs;
use super::console::stdout;
use super::run::{show, write_whole};
use crate::draw::{Drawing, svg, text};
use crate::plan::{Plan, PlanOptions};
use foley_nodes::core::time::ticks;
use foley_nodes::registry::Registry;
use std::io::Write as _;
use std::sync::Arc;

/// Lists or draws a graph; rates and formats are there where the graph can be planned.
///
/// # Errors
/// When the drawing cannot be written.
pub fn draw(args: &DrawArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    // A graph without end is planned up to some end: its rates are the same.
    let until = 1.0;
    let (loaded, files) = args.graph.session(registry).with_until(Some(until)).load();
    show(&loaded.diagnostics, &loaded.sources);
    let Some(found) = loaded.graph else { return Ok(Exit::Wrong) };
    let options = PlanOptions { until: Some(ticks(until)), memory: usize::MAX, ..PlanOptions::default() };
    let plan = Plan::new(&found, &files, &options).ok();
    let drawing = Drawing::of(&found, plan.as_ref());
    match &args.svg {
        Some(path) if path.as_os_str() == "-" => write!(stdout(), "{}", svg(&drawing))?,
        Some(path) => write_whole(path, &svg(&drawing))?,
        None => write!(stdout(), "{}", text(&drawing))?,
    }
    Ok(Exit::Done)
}
