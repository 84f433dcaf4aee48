//! `foley run`.

use super::Exit;
use super::args::RunArgs;
use super::console;
use super::progress::Watch;
use crate::diag::{Diagnostic, Sources, render};
use crate::graph::written;
use crate::run::{DirOutputs, Progress, Report, Tap};
use crate::session::{Prepared, Session};
use foley_nodes::registry::Registry;
use std::io::Write;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Prints diagnostics on standard error.
pub fn show(diagnostics: &[Diagnostic], sources: &Sources) {
    console::print_styled(&render(diagnostics, sources, console::colours()));
}

/// Loads, checks and plans a graph; prints its errors.
pub fn prepare(session: &Session) -> Option<Prepared> {
    let preparation = session.prepare();
    show(&preparation.diagnostics, &preparation.sources);
    preparation.prepared
}

/// The run that the handler of signals stops: a process has one handler, and runs one graph after the other.
static CURRENT: Mutex<Option<Arc<Progress>>> = Mutex::new(None);

/// Stops a run at the first Ctrl-C, and ends the process at the second.
pub(super) fn stop_on_signals(progress: &Arc<Progress>) {
    let current = || CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    *current() = Some(Arc::clone(progress));
    // It fails where the handler is set already.
    let _ = ctrlc::set_handler(move || {
        let Some(run) = current().clone() else { return };
        // The first signal waits for the current computation, so that no partial file remains; the second one does not.
        if run.stop.swap(true, Ordering::SeqCst) {
            console::print_message(
                "stopped at once: unfinished files may remain in the output folder as `.part`",
            );
            std::process::exit(Exit::Again.code().into());
        }
    });
}

/// Runs a graph.
///
/// # Errors
/// If the report cannot be written, which is checked before the run, except for a full disk.
pub fn run(args: &RunArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let mut memo = args.memo.memo(&args.graph.graph);
    // A trace has no state to save.
    if args.checkpoint > 0.0 && !args.trace_silence {
        memo = memo.map(|memo| memo.with_checkpoints(&args.out, Duration::from_secs_f64(args.checkpoint)));
    }
    let session = args.session(registry).with_memo(memo.map(Arc::new));
    let Some(ready) = prepare(&session) else { return Ok(Exit::Wrong) };
    stop_on_signals(session.progress());
    match render_files(&ready, args) {
        Ok(report) => {
            print_results(&report, &ready, args)?;
            Ok(Exit::Done)
        }
        Err(errors) => Ok(failed(&ready, &errors)),
    }
}

/// Prints the errors of a run, and distinguishes a stopped run from a wrong one.
fn failed(ready: &Prepared, errors: &[Diagnostic]) -> Exit {
    show(errors, &ready.graph.sources);
    if ready.progress.stop.load(Ordering::SeqCst) { Exit::Again } else { Exit::of(errors) }
}

/// Runs a graph to its end without writing its files; errors are printed.
pub(super) fn run_in_memory(ready: &Prepared, quiet: bool) -> Result<Report, Exit> {
    stop_on_signals(&ready.progress);
    let watch = Watch::start(&ready.graph.title, Arc::clone(&ready.progress), quiet);
    let (outputs, _) = DirOutputs::in_memory();
    let result = ready.run(&outputs);
    watch.end();
    result.map_err(|errors| failed(ready, &errors))
}

/// Runs a graph and writes its files.
///
/// # Errors
/// As [`run::run`].
pub fn render_files(ready: &Prepared, args: &RunArgs) -> Result<Report, Vec<Diagnostic>> {
    let outputs = DirOutputs::new(&args.out);
    let errors = ready.check_targets(args.report.as_deref(), &outputs);
    if !errors.is_empty() {
        return Err(errors);
    }
    if let Some(path) = &args.report {
        // A path that cannot be written is found before the work that the report is about.
        let probe = DirOutputs::new(".").create_at(path).map(drop);
        probe.map_err(|e| vec![Diagnostic::general(e.code, e.message)])?;
    }
    let watch = Watch::start(&ready.graph.title, Arc::clone(&ready.progress), args.quiet);
    let result = ready.run(&outputs);
    watch.end();
    result
}

/// Prints the results of a run, and writes the report.
///
/// # Errors
/// If standard output is closed, or the report cannot be written.
pub fn print_results(report: &Report, ready: &Prepared, args: &RunArgs) -> anyhow::Result<()> {
    let writes = ready.graph.nodes.iter().any(|n| written(&n.ty, &*n.params).next().is_some());
    if report.outputs.is_empty() && ready.taps.is_empty() && !writes {
        console::print_message("the graph writes nothing: add a WavOut, or give --tap NODE.PORT=FILE");
    }
    if !args.quiet {
        print_report(report, ready)?;
    }
    if let Some(trace) = &report.trace {
        write!(console::stdout(), "{}", trace.text())?;
    }
    if let Some(path) = &args.report {
        write_whole(path, &format!("{:#}\n", report.json()))?;
    }
    Ok(())
}

/// Writes a file under a temporary name and renames it.
pub(super) fn write_whole(
    path: &std::path::Path,
    content: &(impl AsRef<[u8]> + ?Sized),
) -> anyhow::Result<()> {
    use anyhow::Context as _;
    let outputs = DirOutputs::new(".");
    let mut file = outputs.create_at(path).map_err(|e| anyhow::anyhow!(e.message))?;
    file.write_all(content.as_ref())
        .and_then(|()| file.flush())
        .with_context(|| path.display().to_string())?;
    drop(file);
    outputs.commit().with_context(|| path.display().to_string())
}

/// One figure of a summary as text; numbers with four digits.
fn figure(key: &str, value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::String(text) => format!("{key} {text}"),
        serde_json::Value::Number(number) => match number.as_f64().filter(|_| number.is_f64()) {
            Some(x) if x != 0.0 && x.abs() < 0.001 => format!("{key} {x:.3e}"),
            Some(x) => {
                let digits = (3.0 - x.abs().max(1.0).log10().floor()).max(0.0) as usize;
                format!("{key} {x:.digits$}")
            }
            None => format!("{key} {number}"),
        },
        other => format!("{key} {other}"),
    }
}

/// Notes of a node that are shown: one about each of thousands of recordings would hide all others.
const MAX_NOTES: usize = 8;

/// Lines of notes, each of a node and a text, in their order.
pub(super) fn note_lines<'a>(notes: impl Iterator<Item = &'a (String, String)>) -> Vec<String> {
    let (mut lines, mut counts) = (Vec::new(), Vec::<(&str, usize)>::new());
    for (id, note) in notes {
        let at = counts.iter().position(|(node, _)| node == id).unwrap_or_else(|| {
            counts.push((id, 0));
            counts.len() - 1
        });
        counts[at].1 += 1;
        if counts[at].1 <= MAX_NOTES {
            lines.push(format!("note: {id}: {note}"));
        }
    }
    let more = counts.iter().filter(|(_, count)| *count > MAX_NOTES);
    lines.extend(more.map(|(id, count)| {
        let hidden = count - MAX_NOTES;
        format!("note: {id}: {hidden} more notes; `--report FILE.json` lists all")
    }));
    lines
}

fn print_report(report: &Report, ready: &Prepared) -> std::io::Result<()> {
    let mut out = console::stdout();
    for line in note_lines(report.warnings()) {
        writeln!(out, "{line}")?;
    }
    let fact = |facts: &serde_json::Map<String, serde_json::Value>, key: &str| {
        facts.get(key).and_then(|v| v.as_f64())
    };
    for output in &report.outputs {
        write!(out, "wrote {}", output.path)?;
        let get = |key| fact(&output.facts, key);
        if let (Some(frames), Some(rate), Some(channels)) = (get("frames"), get("rate"), get("channels")) {
            write!(out, ": {:.3} s, {rate} Hz, {channels} channel(s)", frames / rate)?;
        }
        if let (Some(peak), Some(rms)) = (get("peak"), get("rms")) {
            write!(out, ", peak {:.4}, rms {:.4}", peak, rms)?;
        }
        if let Some(clipped) = get("clipped").filter(|&c| c > 0.0) {
            write!(out, ", {clipped} samples beyond full scale")?;
        }
        writeln!(out)?;
    }
    // What nodes measured that only measure.
    for node in report.nodes.iter().filter(|n| n.sink && !n.summary.contains_key("path")) {
        let figures: Vec<String> = node.summary.iter().map(|(key, value)| figure(key, value)).collect();
        if !figures.is_empty() {
            writeln!(out, "{}: {}", node.id, figures.join(", "))?;
        }
    }
    for path in ready.taps.iter().filter_map(Tap::path) {
        writeln!(out, "wrote {}", path.display())?;
    }
    if let Some(at) = report.resumed_at {
        writeln!(out, "resumed at {at:.2} s, where an earlier run was interrupted")?;
    }
    let cached = report.nodes.iter().filter(|n| n.cached).count();
    if cached > 0 {
        writeln!(out, "{cached} node(s) from the cache, {} computed", report.computed().len())?;
    }
    let speed = report.length / report.wall.as_secs_f64().max(1e-9);
    writeln!(
        out,
        "{:.2} s of sound in {:.2} s ({speed:.1} times real time), {} of buffers, {} thread(s)",
        report.length,
        report.wall.as_secs_f64(),
        crate::plan::format_bytes(report.buffer_bytes),
        ready.threads
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_of_notes_of_one_node_are_counted_and_do_not_hide_those_of_others() {
        let notes = |node: &str, count: usize| {
            (0..count).map(|k| (node.to_owned(), format!("recording {k} is silent"))).collect::<Vec<_>>()
        };
        let all = [notes("takes", 3000), notes("bank", 2)].concat();
        let lines = note_lines(all.iter());
        assert_eq!(lines.len(), MAX_NOTES + 2 + 1);
        assert_eq!(lines[MAX_NOTES], "note: bank: recording 0 is silent");
        assert!(lines[MAX_NOTES + 2].starts_with("note: takes: 2992 more notes"), "{lines:?}");
        assert_eq!(note_lines(notes("takes", MAX_NOTES).iter()).len(), MAX_NOTES);
    }
}
