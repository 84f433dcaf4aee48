//! Computes value nodes, or takes their values from the cache.

use super::Values;
use super::job::{Job, stopped};
use super::report::Report;
use super::stages::BuildSite;
use crate::diag::Diagnostic;
use crate::memo::{Hit, RunCache};
use foley_nodes::core::computation::{NotStored, Partial};
use foley_nodes::core::stage::{Cx, InWire, OutWire};
use std::cell::RefCell;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Takes the values of a node from the cache.
pub fn take_cached(n: usize, hit: Hit, values: &mut Values, report: &mut Report) {
    values.extend(hit.values.into_iter().map(|(port, value)| ((n, port), value)));
    report.add_cached(n, hit.summary, hit.warnings);
}

/// Computes the value nodes that run before a phase.
///
/// # Errors
/// The faults of all nodes that failed.
pub fn evaluate(
    job: &Job<'_>,
    phase: usize,
    values: &mut Values,
    report: &mut Report,
    mut cache: Option<&mut RunCache<'_>>,
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
            // A node upstream has failed, and its error is recorded.
            continue;
        }
        if let Some(hit) = cache.as_mut().and_then(|cache| cache.look_up(n, values)) {
            take_cached(n, hit, values, report);
            continue;
        }
        let outputs: Vec<OutWire> =
            node.ty.outputs.iter().map(|_| OutWire::Value(RefCell::default())).collect();
        let monitor = |share: f64| job.progress.watch(&node.id, share);
        let stored = cache.as_ref().and_then(|cache| cache.partial(n, &job.progress.stop));
        let partial: &dyn Partial = stored.as_ref().map_or(&NotStored, |stored| stored);
        let site = BuildSite { monitor: &monitor, partial, ..BuildSite::of(job) };
        let links = site.links(n, values);
        let cx = site.build_cx(n, &links);
        let (start, notes) = (Instant::now(), report.notes.len());
        let result = eval(&*node.params, &cx, &Cx::for_values(&inputs, &outputs));
        let time = start.elapsed();
        let done = result.is_ok();
        job.progress.end_value();
        if let Some(stored) = stored.filter(|_| done) {
            stored.remove();
        }
        match result {
            Ok(summary) => report.add(n, time, 1, summary),
            Err(_) if job.progress.stop.load(Ordering::SeqCst) => return Err(vec![stopped(None)]),
            Err(fault) => {
                let location = job.graph.location(n, fault.field.as_deref());
                errors.push(Diagnostic::of_fault(fault, location, &node.id));
            }
        }
        for (port, out) in outputs.iter().enumerate() {
            if let OutWire::Value(value) = out
                && let Some(value) = value.borrow().clone()
            {
                values.insert((n, port), value);
            }
        }
        if let Some(cache) = cache.as_mut().filter(|_| done) {
            let summary = report.nodes[n].summary.clone();
            cache.store_values(n, values, time, summary, report.warnings_since(n, notes));
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}
