//! Runs a planned graph offline, as fast as the machine allows.
//!
//! `engine` runs the regions of a phase in parallel, window by window; value nodes are computed before the phase that needs
//! them. With a cache, `cached_phase` runs only the nodes of a phase whose results are not known.

mod cached_phase;
mod cached_streams;
mod chart_writer;
mod checkpointer;
mod clipping;
mod columns;
mod engine;
mod envelope;
mod job;
mod memory_tap;
mod node_report;
mod observer;
mod output_files;
mod partial_phase;
mod phase_layout;
mod report;
mod silence;
mod stages;
mod stream_chart;
mod tap;
mod tap_writers;
mod targets;
mod trace;
mod values;

pub use crate::memo::Values;
pub use clipping::{Loudness, advice as clipping_advice};
pub use columns::Columns;
pub use envelope::{Envelope, SILENCE_DB};
pub use job::{Job, Progress};
pub use memory_tap::{EventTap, MemoryTap, StreamData, StreamTap, ValueTap};
pub use node_report::NodeReport;
pub use observer::{Observer, ObserverTap};
pub use output_files::DirOutputs;
pub use report::{OutputReport, Report};
pub use silence::{Period, explain as explain_silence, reads_messages};
pub use stages::{BuildSite, assemble, stage};
pub use stream_chart::StreamChart;
pub use tap::{Tap, TapTarget, check as check_tap, check_memory as check_memory_tap, find as find_output};
pub use targets::{check as check_targets, check_given};
pub use trace::{Extent, Loss, OutputLevel, PortLevel, SilenceTrace, Step, Trace, TracedOutput};

use crate::diag::Diagnostic;
use crate::memo::{Memo, RunCache};
use cached_streams::CachedStreams;
use partial_phase::Skipped;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Runs a graph to its end and completes its output files.
///
/// # Errors
/// The faults of all nodes that failed; no output is left behind then.
pub fn run(job: &Job<'_>) -> Result<Report, Vec<Diagnostic>> {
    let start = Instant::now();
    let checkpoints = job.memo.and_then(Memo::checkpoints);
    let (values, mut report) = run_phases(job).inspect_err(|errors| {
        // Only a run that was stopped, or that found the disk full, can succeed when it resumes.
        let resumable = |e: &Diagnostic| ["F080", "F091"].contains(&e.code);
        if let Some(checkpoints) = checkpoints.filter(|_| !errors.iter().all(resumable)) {
            checkpoints.remove();
        }
    })?;
    tap_writers::write_values(job, &values)?;
    job.outputs.commit().map_err(|e| vec![Diagnostic::general("F080", e.to_string())])?;
    if let Some(checkpoints) = checkpoints {
        checkpoints.remove();
    }
    report.close(job, start.elapsed());
    let taps = job.taps.iter().filter(|tap| !tap.is_observer());
    let tapped: Vec<_> = taps.map(|tap| (tap.node, tap.port)).collect();
    report.notes.extend(silence::explain(job.graph, &report.nodes, &tapped, Period::Run));
    report.notes.extend(clipping::notes(job.graph, &report.nodes));
    Ok(report)
}

/// Runs every phase of a graph and returns all its values; output files are written under temporary names.
///
/// # Errors
/// The faults of all nodes that failed.
pub fn run_phases(job: &Job<'_>) -> Result<(Values, Report), Vec<Diagnostic>> {
    let mut report = Report::new(job.graph, job.plan);
    let mut values = Values::new();
    let windows: u64 = job.plan.phases.iter().map(|p| p.windows * p.regions.len() as u64).sum();
    job.progress.total.store(windows, Ordering::Relaxed);
    let phases = job.plan.phases.len().max(1 + job.plan.values.iter().map(|(_, p)| *p).max().unwrap_or(0));
    let mut cache = job.memo.map(|m| RunCache::new(m, job.graph, job.plan, job.files, job.seed));
    let mut skipped = Skipped::new();
    for phase in 0..phases {
        values::evaluate(job, phase, &mut values, &mut report, cache.as_mut())?;
        let Some(planned) = job.plan.phases.get(phase) else { continue };
        match cache.as_mut() {
            Some(cache) => {
                let numbered = (phase, planned);
                cached_phase::run(job, numbered, &mut values, &mut report, cache, &mut skipped)?;
            }
            None => {
                let streams = CachedStreams::default();
                engine::run_phase(job, planned, &mut values, &mut report, &streams, None)?;
            }
        }
    }
    for (n, node) in skipped {
        if report.nodes[n].calls == 0 && !report.nodes[n].cached {
            report.add_cached(n, node.summary, node.warnings);
        }
    }
    for (n, warning) in cache.iter_mut().flat_map(RunCache::take_warnings) {
        report.notes.push((job.graph.nodes[n].id.clone(), warning));
    }
    Ok((values, report))
}
