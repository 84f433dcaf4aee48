//! `foley probe`.

use super::Exit;
use super::args::ProbeArgs;
use super::console::{print_message, stdout};
use super::run::{note_lines, prepare, run_in_memory, show, write_whole};
use crate::probe::{Probe, ProbeOptions};
use crate::run::{ObserverTap, check_given, find_output};
use crate::session::Session;
use foley_nodes::core::time::{Tick, ticks};
use foley_nodes::registry::Registry;
use serde_json::json;
use std::io::Write as _;
use std::sync::Arc;

/// The full name of an output, `NODE.PORT`, if the graph can be loaded and has it; otherwise [`Session::prepare`] has the error.
fn full_name(session: &Session, output: &str) -> Option<String> {
    let graph = session.load().0.graph?;
    let (node, port) = find_output(&graph, output).ok()?;
    Some(format!("{}.{}", graph.nodes[node].id, graph.nodes[node].ty.outputs[port].name))
}

/// Runs the nodes that an output needs, and prints its figures.
///
/// # Errors
/// If the drawing cannot be written, or standard output is closed.
pub fn probe(args: &ProbeArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let to = args.to.map_or(Tick::MAX, ticks);
    if to <= ticks(args.from) {
        print_message("--to is not after --from");
        return Ok(Exit::Wrong);
    }
    let memo = args.memo.memo(&args.graph.graph).map(Arc::new);
    let mut session = args.session(registry).with_memo(memo).with_only(Vec::<String>::new());
    let output = full_name(&session, &args.output).unwrap_or_else(|| args.output.clone());
    let options = ProbeOptions { output: output.clone(), first: args.first, from: ticks(args.from), to };
    let tap = Arc::new(ObserverTap::new(Probe::new(options)));
    session.tap(&args.output, &tap);
    let Some(ready) = prepare(&session) else { return Ok(Exit::Wrong) };
    let given: Vec<_> = args.svg.iter().map(|path| ("--svg", path.as_path())).collect();
    let errors = check_given(&given, &ready.files.asked());
    if !errors.is_empty() {
        show(&errors, &ready.graph.sources);
        return Ok(Exit::Wrong);
    }
    let report = match run_in_memory(&ready, args.quiet || args.json) {
        Ok(report) => report,
        Err(exit) => return Ok(exit),
    };
    let figures = tap.read(Probe::figures);
    let node = &ready.graph.nodes[ready.taps[0].node];
    if args.json {
        let mut all = serde_json::to_value(&figures)?;
        if let Some(fields) = all.as_object_mut() {
            let notes = report.warnings().map(|(id, note)| json!({ "node": id, "message": note }));
            fields.insert("output".into(), output.clone().into());
            fields.insert(
                "node".into(),
                json!({ "type": node.ty.name, "summary": report.nodes[ready.taps[0].node].summary }),
            );
            fields.insert("warnings".into(), notes.collect());
        }
        writeln!(stdout(), "{all:#}")?;
    } else {
        if !args.quiet {
            note_lines(report.warnings()).iter().try_for_each(|line| writeln!(stdout(), "{line}"))?;
        }
        write!(stdout(), "{}", figures.text(&output, args.first))?;
    }
    if let Some(path) = &args.svg {
        match tap.read(Probe::svg) {
            Some(svg) => write_whole(path, &svg)?,
            None => {
                print_message(format_args!("--svg: `{output}` has no drawing"));
                return Ok(Exit::Wrong);
            }
        }
    }
    Ok(Exit::Done)
}
