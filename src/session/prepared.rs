//! A graph that is loaded, checked and planned.

use super::Errors;
use crate::diag::{Diagnostic, Sources, any_error};
use crate::graph::{Asked, DirFiles, Graph};
use crate::memo::Memo;
use crate::plan::Plan;
use crate::run::{self, DirOutputs, Job, Progress, Report, Tap, Trace, check_targets};
use foley_nodes::core::files::MemoryOutputs;
use std::path::Path;
use std::sync::Arc;

/// A graph with everything to run it.
pub struct Prepared {
    /// The graph.
    pub graph: Graph,
    /// Its files.
    pub files: DirFiles,
    /// Its plan.
    pub plan: Plan,
    /// Outputs to write to files.
    pub taps: Vec<Tap>,
    /// Observers of the outputs, if the run traces where sound is lost.
    pub trace: Option<Trace>,
    /// Number of threads that compute.
    pub threads: usize,
    /// Seed.
    pub seed: u64,
    /// The cache, if there is one.
    pub memo: Option<Arc<Memo>>,
    /// The progress of its runs.
    pub progress: Arc<Progress>,
}

impl Prepared {
    /// Runs the graph to its end; its files appear below `folder`, all of them or none.
    ///
    /// # Errors
    /// The faults of the nodes that failed; no file is left behind then.
    pub fn render(&self, folder: &Path) -> Result<Report, Errors> {
        self.checked_run(&DirOutputs::new(folder))
    }

    /// Runs the graph to its end; its files stay in memory.
    ///
    /// # Errors
    /// As [`Prepared::render`].
    pub fn render_to_memory(&self) -> Result<(Report, MemoryOutputs), Errors> {
        let (outputs, memory) = DirOutputs::in_memory();
        Ok((self.checked_run(&outputs)?, memory))
    }

    fn checked_run(&self, outputs: &DirOutputs) -> Result<Report, Errors> {
        let errors = self.check_targets(None, outputs);
        let result = if errors.is_empty() { self.run(outputs) } else { Err(errors) };
        result.map_err(|diagnostics| Errors {
            diagnostics,
            notes: Vec::new(),
            sources: self.graph.sources.clone(),
        })
    }

    /// Finds outputs that would overwrite each other or an input; `report` is one more file.
    #[must_use]
    pub fn check_targets(&self, report: Option<&Path>, outputs: &DirOutputs) -> Vec<Diagnostic> {
        check_targets(&self.graph, &self.taps, report, outputs, &self.files.asked())
    }

    /// Runs the graph into outputs whose targets are checked.
    ///
    /// # Errors
    /// As [`Prepared::render`].
    pub fn run(&self, outputs: &DirOutputs) -> Result<Report, Vec<Diagnostic>> {
        let mut report = run::run(&Job {
            graph: &self.graph,
            plan: &self.plan,
            files: &self.files,
            outputs,
            taps: &self.taps,
            threads: self.threads,
            seed: self.seed,
            memo: self.memo.as_deref(),
            progress: Arc::clone(&self.progress),
        })?;
        report.trace = self.trace.as_ref().map(|trace| trace.read(&self.graph, &report.nodes));
        Ok(report)
    }
}

/// Result of preparing a graph.
pub struct Preparation {
    /// The graph, if it can run.
    pub prepared: Option<Prepared>,
    /// Errors and warnings.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts that they point into.
    pub sources: Sources,
    /// The files that were requested.
    pub asked: Asked,
}

impl Preparation {
    /// The prepared graph; warnings are dropped.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn into_result(self) -> Result<Prepared, Errors> {
        let Self { prepared, diagnostics, sources, .. } = self;
        debug_assert!(prepared.is_some() || any_error(&diagnostics));
        prepared.ok_or(Errors { diagnostics, notes: Vec::new(), sources })
    }
}
