//! Saves the state of a phase between two windows from time to time, and restores it in a later run.

use super::{DirOutputs, Job, Values};
use crate::graph::written;
use crate::memo::{Checkpoint, CheckpointHeader, CheckpointStore, PartialFile, PhaseSubset, RunCache};
use crate::plan::Phase;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::stage::Stage;
use foley_nodes::core::state::StateArchive;
use foley_nodes::core::time::Tick;
use std::collections::HashSet;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use std::{fs, io};

/// Saves and restores the checkpoints of one phase.
pub struct Checkpointer<'a> {
    store: &'a CheckpointStore,
    phase: usize,
    key: String,
    subset: PhaseSubset,
    outputs: &'a DirOutputs,
    /// Files of earlier phases; a resumed run writes them again.
    earlier_files: HashSet<PathBuf>,
    found: Option<Checkpoint>,
    /// Windows done at the last checkpoint.
    saved_windows: Option<u64>,
}

/// A fault of a region, with the index of the node if a node raised it.
pub type RestoreFault = (usize, Option<usize>, Fault);

/// The part of a phase that runs, and its layout: with the graph, all that the state of the phase depends on.
#[derive(Clone, Copy)]
pub struct PhaseRun<'a> {
    /// Number of the phase.
    pub number: usize,
    /// Its layout.
    pub phase: &'a Phase,
    /// Nodes that run, and nodes whose streams are read in their place.
    pub subset: &'a PhaseSubset,
}

/// Computes the key of a checkpoint: the hash of all that the state of a phase depends on; `None` if a file cannot be read.
pub fn checkpoint_key(
    job: &Job<'_>,
    cache: &RunCache<'_>,
    run: PhaseRun<'_>,
    values: &Values,
) -> Option<String> {
    let known = |(id, _): &(String, bool)| job.graph.find(id);
    let nodes: Vec<usize> = run.subset.nodes.iter().filter_map(known).collect();
    let paths = nodes.iter().map(|&n| &job.graph.nodes[n]).flat_map(|n| written(&n.ty, &*n.params));
    let paths: Vec<_> = paths.collect();
    // Data collected in memory is lost when a run resumes.
    let taps: Vec<_> = job.taps.iter().map(|tap| tap.path()).collect::<Option<_>>()?;
    let Phase { regions, windows, .. } = run.phase;
    let (window, subset, build) = (job.plan.window, run.subset, build());
    let layout = format!("{build:?} {regions:?} {windows} {window} {paths:?} {taps:?} {subset:?}");
    cache.run_key(&nodes, values, &layout)
}

/// Size and time of the program's file: the states of nodes may have another form in another build.
fn build() -> Option<(u64, SystemTime)> {
    let file = std::env::current_exe().and_then(fs::metadata).ok()?;
    Some((file.len(), file.modified().ok()?))
}

impl<'a> Checkpointer<'a> {
    /// A checkpointer for a phase; partial files of a checkpoint that fits are resumed when they are created again.
    pub fn new(job: &Job<'a>, cache: &RunCache<'a>, run: PhaseRun<'_>, values: &Values) -> Option<Self> {
        let store = cache.memo().checkpoints().filter(|_| !job.outputs.is_memory())?;
        let key = checkpoint_key(job, cache, run, values)?;
        let (phase, outputs) = (run.number, job.outputs);
        let found = store.find(phase, &key);
        if let Some(found) = &found {
            outputs.resume(found.header.outputs.clone());
            outputs.retain(&found.header.outputs);
        }
        let (earlier_files, subset) = (outputs.partial_paths(), run.subset.clone());
        Some(Self { store, phase, key, subset, outputs, earlier_files, found, saved_windows: None })
    }

    /// Time between two checkpoints.
    pub fn interval(&self) -> Duration {
        self.store.interval()
    }

    /// Restores the state that an earlier run saved, and returns the windows that it had done.
    ///
    /// # Errors
    /// The fault of a node or buffer whose state does not fit.
    pub fn restore(&mut self, stages: &mut [Stage]) -> Result<u64, RestoreFault> {
        let Some(found) = self.found.take() else { return Ok(0) };
        for (r, (stage, state)) in stages.iter_mut().zip(&found.states).enumerate() {
            stage
                .archive_state(&mut StateArchive::restore(state))
                .map_err(|(node, fault)| (r, node, fault))?;
        }
        self.saved_windows = Some(found.header.windows);
        Ok(found.header.windows)
    }

    /// Saves a phase whose regions have all done the same number of windows.
    ///
    /// # Errors
    /// When a state or a file cannot be written.
    pub fn save<'s>(&mut self, stages: impl Iterator<Item = &'s mut Stage>, windows: u64) -> io::Result<()> {
        let mut states = Vec::new();
        for stage in stages {
            let mut state = Vec::new();
            let saved = stage.archive_state(&mut StateArchive::save(&mut state));
            saved.map_err(|(_, fault)| io::Error::other(fault.message))?;
            states.push(state);
        }
        let outputs: Vec<PartialFile> = self.outputs.sync(&self.earlier_files)?;
        let (key, subset) = (self.key.clone(), self.subset.clone());
        let header = CheckpointHeader { key, subset, windows, outputs, ..CheckpointHeader::default() };
        let checkpoint = Checkpoint { header, states };
        if self.store.save(self.phase, &checkpoint)? {
            self.outputs.retain(&checkpoint.header.outputs);
            self.saved_windows = Some(windows);
        }
        Ok(())
    }

    /// Returns the time of the last checkpoint, if there is one.
    pub fn saved_until(&self, window: Tick) -> Option<Tick> {
        Some(i64::try_from(self.saved_windows?).ok()?.saturating_mul(window))
    }
}
