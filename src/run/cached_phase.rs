//! Runs a phase with the cache: known folds are not computed, cached streams are read in place of their nodes and all nodes
//! upstream, and streams that are worth caching are written while they run. Those of later phases that need no fold of this one are written
//! in this phase already, so that a phase of little work uses all threads.

use super::partial_phase::{PartialPhase, Skipped};
use super::values::take_cached;
use super::{Job, Report, Values};
use crate::diag::Diagnostic;
use crate::memo::{self, NodeSummary, RunCache};
use crate::plan::Phase;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Runs a phase.
///
/// # Errors
/// The faults of the nodes that failed.
pub fn run(
    job: &Job<'_>,
    (number, phase): (usize, &Phase),
    values: &mut Values,
    report: &mut Report,
    cache: &mut RunCache<'_>,
    skipped: &mut Skipped,
) -> Result<(), Vec<Diagnostic>> {
    let ty = |n: usize| &*job.graph.nodes[n].ty;
    let folds: Vec<usize> =
        phase.nodes.iter().copied().filter(|&n| memo::has_cacheable_values(ty(n))).collect();
    let hits: Vec<_> = folds.iter().map(|&n| cache.look_up(n, values)).collect();
    let missed: Vec<usize> =
        folds.iter().zip(&hits).filter(|(_, hit)| hit.is_none()).map(|(n, _)| *n).collect();
    let mut part = PartialPhase::new(job, phase, cache);
    let root = |n: &usize| memo::writes_files(ty(*n)) || part.is_tapped(*n) || missed.contains(n);
    let roots = phase.nodes.iter().copied().filter(root).collect();
    part.find_needed(roots, cache, values);
    part.find_hoisted(number, &missed, cache, values);
    part.follow_checkpoint(number, cache, values);
    for (n, hit) in folds.iter().copied().zip(hits) {
        if let Some(hit) = hit.filter(|_| !part.needed.contains(&n)) {
            take_cached(n, hit, values, report);
        }
    }
    part.add_skipped(skipped);
    if part.needed.is_empty() {
        let windows = phase.windows * phase.regions.len() as u64;
        job.progress.done.fetch_add(windows, Ordering::Relaxed);
        return Ok(());
    }
    let (start, notes) = (Instant::now(), report.notes.len());
    let before: Vec<Duration> = report.nodes.iter().map(|n| n.time).collect();
    let streams = part.run(number, values, report, cache)?;
    for &n in &missed {
        // Without its cached value, a fold costs the time of the whole phase.
        let summary = report.nodes[n].summary.clone();
        cache.store_values(n, values, start.elapsed(), summary, report.warnings_since(n, notes));
    }
    let seconds = |n: usize| report.nodes[n].time.saturating_sub(before[n]).as_secs_f64();
    let summary = |n: usize| {
        skipped.get(&n).cloned().unwrap_or_else(|| NodeSummary {
            node: job.graph.nodes[n].id.clone(),
            summary: report.nodes[n].summary.clone(),
            warnings: report.warnings_since(n, notes),
        })
    };
    part.note_costs(cache, &seconds);
    part.store_streams(streams, cache, &seconds, &summary);
    Ok(())
}
