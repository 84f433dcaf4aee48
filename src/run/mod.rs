//! Runs a planned graph offline, as fast as the machine goes.
//!
//! Each phase of the plan is a set of regions; `engine` runs region after region, window after window, wherever the
//! counters say that the inputs are there. Values are computed before the phase that needs them.

mod checkpoint;
mod engine;
mod kept;
mod outputs;
mod report;
mod stages;
mod tap;
mod targets;

pub use outputs::DirOutputs;
pub use report::{NodeReport, OutputReport, Report};
pub use stages::{Site, assemble, stage};
pub use tap::{Tap, check as check_tap};
pub use targets::{check as check_targets, check_given};

use crate::diag::Diagnostic;
use crate::graph::Graph;
use crate::memo::{self, Memo, Session};
use crate::plan::Plan;
use foley_nodes::core::files::Files;
use foley_nodes::core::item::AnyValue;
use foley_nodes::core::stage::{Cx, InWire, OutWire};
use foley_nodes::core::time::{Tick, seconds};
use kept::{Hidden, Streams};
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// How far a run is, readable from other threads.
#[derive(Debug, Default)]
pub struct Progress {
    /// Windows done, over all regions and phases.
    pub done: AtomicU64,
    /// Windows to do.
    pub total: AtomicU64,
    /// Set it to stop the run.
    pub stop: AtomicBool,
}

/// Everything that a run needs beside the plan.
pub struct Job<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Its plan.
    pub plan: &'a Plan,
    /// Where inputs come from.
    pub files: &'a dyn Files,
    /// Where outputs go.
    pub outputs: &'a DirOutputs,
    /// Outputs to write to files, in the order of the plan's taps.
    pub taps: &'a [Tap],
    /// Threads that compute.
    pub threads: usize,
    /// Seed of the graph.
    pub seed: u64,
    /// Where values are kept from run to run, if at all.
    pub memo: Option<&'a Memo>,
    /// Shared with whoever watches.
    pub progress: Arc<Progress>,
}

/// The values made so far, by node and output port.
pub type Values = HashMap<(usize, usize), AnyValue>;

/// Runs a graph to its end; outputs are complete and in their places afterwards.
///
/// # Errors
/// The faults of all nodes that failed; no output is left behind then.
pub fn run(job: &Job<'_>) -> Result<Report, Vec<Diagnostic>> {
    let start = Instant::now();
    let marks = job.memo.and_then(Memo::checkpoints);
    let (values, mut report) = values(job).inspect_err(|errors| {
        // Only what was stopped, or found no room on the disk, can do better from there.
        let again = |e: &Diagnostic| ["F080", "F091"].contains(&e.code);
        if let Some(marks) = marks.filter(|_| !errors.iter().all(again)) {
            marks.forget();
        }
    })?;
    tap::write_values(job, &values)?;
    job.outputs.commit().map_err(|e| vec![Diagnostic::general("F080", e.to_string())])?;
    if let Some(marks) = marks {
        marks.forget();
    }
    report.close(job, start.elapsed());
    Ok(report)
}

/// Runs every phase of a graph and gives all its values; files are written, and not yet in their places.
///
/// # Errors
/// The faults of all nodes that failed.
pub fn values(job: &Job<'_>) -> Result<(Values, Report), Vec<Diagnostic>> {
    let mut report = Report::new(job.graph, job.plan);
    let mut values = Values::new();
    let windows: u64 = job.plan.phases.iter().map(|p| p.windows * p.regions.len() as u64).sum();
    job.progress.total.store(windows, Ordering::Relaxed);
    let phases = job.plan.phases.len().max(1 + job.plan.values.iter().map(|(_, p)| *p).max().unwrap_or(0));
    let mut memo = job.memo.map(|m| Session::new(m, job.graph, job.plan, job.files, job.seed));
    let mut hidden = Hidden::new();
    for phase in 0..phases {
        evaluate(job, phase, &mut values, &mut report, memo.as_mut())?;
        if let Some(planned) = job.plan.phases.get(phase) {
            match memo.as_mut() {
                Some(memo) => {
                    kept::pass(job, (phase, planned), &mut values, &mut report, memo, &mut hidden)?;
                }
                None => engine::run_phase(job, planned, &mut values, &mut report, &Streams::default(), None)?,
            }
        }
    }
    for (n, told) in hidden {
        if report.nodes[n].calls == 0 && !report.nodes[n].cached {
            report.add_cached(n, told.summary, told.warnings);
        }
    }
    for (n, warning) in memo.iter_mut().flat_map(Session::take_warnings) {
        report.notes.push((job.graph.nodes[n].id.clone(), warning));
    }
    Ok((values, report))
}

/// Takes over what the memo has of a node.
fn take(n: usize, hit: memo::Hit, values: &mut Values, report: &mut Report) {
    values.extend(hit.values.into_iter().map(|(port, value)| ((n, port), value)));
    report.add_cached(n, hit.summary, hit.warnings);
}

/// What a run says that was stopped; `marked` is the time from which another one can go on.
fn stopped(marked: Option<Tick>) -> Diagnostic {
    let found = Diagnostic::general("F091", "stopped before the end; no output was written");
    match marked {
        Some(at) => found.help(format!("run the same again: it goes on at {:.1} s", seconds(at))),
        None => found,
    }
}

/// Computes the values that can be had before a phase.
fn evaluate(
    job: &Job<'_>,
    phase: usize,
    values: &mut Values,
    report: &mut Report,
    mut memo: Option<&mut Session<'_>>,
) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    for &(n, _) in job.plan.values.iter().filter(|(_, before)| *before == phase) {
        let node = &job.graph.nodes[n];
        let Some(eval) = node.ty.eval else { continue };
        if job.progress.stop.load(Ordering::SeqCst) {
            return Err(vec![stopped(None)]);
        }
        let wire = |l: &crate::graph::Link| values.get(&(l.node, l.port)).cloned().map(InWire::Value);
        let inputs: Vec<Vec<InWire>> =
            node.links.iter().map(|links| links.iter().filter_map(wire).collect()).collect();
        if inputs.iter().map(Vec::len).ne(node.links.iter().map(Vec::len)) {
            // What it needs has failed, and said so.
            continue;
        }
        if let Some(hit) = memo.as_mut().and_then(|memo| memo.look_up(n, values)) {
            take(n, hit, values, report);
            continue;
        }
        let outputs: Vec<OutWire> =
            node.ty.outputs.iter().map(|_| OutWire::Value(RefCell::default())).collect();
        let site = Site::of(job);
        let links = site.links(n, values);
        let cx = site.build_cx(n, &links);
        let (start, notes) = (Instant::now(), report.notes.len());
        let result = eval(&*node.params, &cx, &Cx::for_values(&inputs, &outputs));
        let took = start.elapsed();
        let done = result.is_ok();
        match result {
            Ok(summary) => report.add(n, took, 1, summary),
            Err(fault) => {
                let place = job.graph.place(n, fault.field.as_deref());
                errors.push(Diagnostic::of_fault(fault, place, &node.id));
            }
        }
        for (port, out) in outputs.iter().enumerate() {
            if let OutWire::Value(place) = out
                && let Some(value) = place.borrow().clone()
            {
                values.insert((n, port), value);
            }
        }
        if let Some(memo) = memo.as_mut().filter(|_| done) {
            memo.keep(n, values, took, report.nodes[n].summary.clone(), report.warned(n, notes));
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}
