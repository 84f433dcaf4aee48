//! `foley graph`.

use super::Exit;
use super::args::DrawArgs;
use super::run::{read, show, write_whole};
use crate::draw::{Drawing, svg};
use crate::plan::{Plan, PlanOptions};
use std::io::{Write as _, stdout};

/// Draws a graph; rates and formats are there where the graph can be planned.
///
/// # Errors
/// When the drawing cannot be written.
pub fn draw(args: &DrawArgs) -> anyhow::Result<Exit> {
    let graph = &args.graph;
    // A graph without end is planned up to some end: its rates are the same.
    let until = Some(foley_nodes::core::time::TICKS_PER_SECOND);
    let (loaded, files) = read(&graph.graph, &graph.sets, &graph.allow_read, graph.limits.limits(), until);
    show(&loaded.diagnostics, &loaded.sources);
    let Some(found) = loaded.graph else { return Ok(Exit::Wrong) };
    let options = PlanOptions { until, memory: usize::MAX, ..PlanOptions::default() };
    let plan = Plan::new(&found, &files, &options).ok();
    let text = svg(&Drawing::of(&found, plan.as_ref()));
    match &args.svg {
        Some(path) => write_whole(path, &text)?,
        None => write!(stdout(), "{text}")?,
    }
    Ok(Exit::Done)
}
