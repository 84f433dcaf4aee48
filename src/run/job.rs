//! The inputs of a run, and its progress.

use super::{DirOutputs, Tap};
use crate::diag::Diagnostic;
use crate::graph::Graph;
use crate::memo::Memo;
use crate::plan::Plan;
use foley_nodes::core::files::Files;
use foley_nodes::core::time::{Tick, seconds};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The progress of a run, readable from other threads.
#[derive(Debug, Default)]
pub struct Progress {
    /// Windows done, over all regions and phases.
    pub done: AtomicU64,
    /// Windows to do.
    pub total: AtomicU64,
    /// Stops the run when it is set.
    pub stop: AtomicBool,
    /// The node that computes a value, with the share that it reports as done.
    value: Mutex<Option<(String, f64)>>,
}

impl Progress {
    /// Notes the share of a value that is done; returns true if the run is to stop.
    pub(super) fn watch(&self, node: &str, share: f64) -> bool {
        *self.value.lock().unwrap_or_else(PoisonError::into_inner) = Some((node.to_owned(), share));
        self.stop.load(Ordering::SeqCst)
    }

    /// Notes that a value is computed.
    pub(super) fn end_value(&self) {
        *self.value.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// The node that computes a value and has reported how much of it is done, in percent.
    #[must_use]
    pub fn value_text(&self) -> Option<String> {
        let value = self.value.lock().unwrap_or_else(PoisonError::into_inner);
        value.as_ref().map(|(node, share)| format!("{node}: {:.0} %", 100.0 * share.clamp(0.0, 1.0)))
    }
}

/// A graph with everything to run it.
pub struct Job<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Its plan.
    pub plan: &'a Plan,
    /// The files that nodes read.
    pub files: &'a dyn Files,
    /// The files that nodes write.
    pub outputs: &'a DirOutputs,
    /// Outputs to write to files, in the order of the plan's taps.
    pub taps: &'a [Tap],
    /// Threads that compute.
    pub threads: usize,
    /// Seed of the graph.
    pub seed: u64,
    /// The cache of results of earlier runs, if any.
    pub memo: Option<&'a Memo>,
    /// Progress, shared with other threads.
    pub progress: Arc<Progress>,
}

/// The diagnostic of a run that was stopped; it resumes at the time of its last checkpoint, if there is one.
pub fn stopped(checkpoint: Option<Tick>) -> Diagnostic {
    let found = Diagnostic::general("F091", "stopped before the end; no output was written");
    match checkpoint {
        Some(at) => found.help(format!("run the same command again: it resumes at {:.1} s", seconds(at))),
        None => found,
    }
}
