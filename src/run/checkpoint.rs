//! The state of a phase between two windows, written down now and then, and gone on from.

use super::{DirOutputs, Job};
use crate::graph::written;
use crate::memo::{Checkpoint, Checkpoints, Cut, Mark, Session};
use crate::plan::Phase;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::stage::Stage;
use foley_nodes::core::state::StateArchive;
use foley_nodes::core::time::Tick;
use std::collections::HashSet;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use std::{fs, io};

/// Where one phase of a run is written down.
pub struct Saver<'a> {
    marks: &'a Checkpoints,
    number: usize,
    key: String,
    cut: Cut,
    outputs: &'a DirOutputs,
    /// Files of phases before this one, which are made anew.
    before: HashSet<PathBuf>,
    found: Option<Checkpoint>,
    /// Windows of which a mark tells.
    marked: Option<u64>,
}

/// A fault of the region and, where it is that of a node, its place.
pub type Misfit = (usize, Option<usize>, Fault);

/// What of a phase runs, and how: all that its state depends on beside the graph.
#[derive(Clone, Copy)]
pub struct Laid<'a> {
    /// Number of the phase.
    pub number: usize,
    /// How it runs.
    pub phase: &'a Phase,
    /// Nodes that run, and nodes that are read in their place.
    pub cut: &'a Cut,
}

/// The hash of all that the state of a phase depends on; `None` where a file cannot be read.
pub fn key(job: &Job<'_>, memo: &Session<'_>, laid: Laid<'_>, values: &super::Values) -> Option<String> {
    let known = |(id, _): &(String, bool)| job.graph.find(id);
    let nodes: Vec<usize> = laid.cut.nodes.iter().filter_map(known).collect();
    let paths = nodes.iter().map(|&n| &job.graph.nodes[n]).flat_map(|n| written(&n.ty, &*n.params));
    let paths: Vec<_> = paths.collect();
    let taps: Vec<_> = job.taps.iter().map(|tap| &tap.path).collect();
    let Phase { regions, windows, .. } = laid.phase;
    let (window, cut, build) = (job.plan.window, laid.cut, build());
    let layout = format!("{build:?} {regions:?} {windows} {window} {paths:?} {taps:?} {cut:?}");
    memo.run_key(&nodes, values, &layout)
}

/// Which build of the program this is, as far as its file tells: what nodes carry may be another in the next.
fn build() -> Option<(u64, SystemTime)> {
    let file = std::env::current_exe().and_then(fs::metadata).ok()?;
    Some((file.len(), file.modified().ok()?))
}

impl<'a> Saver<'a> {
    /// For a phase; files that were begun wait to be gone on with.
    pub fn new(job: &Job<'a>, memo: &Session<'a>, laid: Laid<'_>, values: &super::Values) -> Option<Self> {
        let marks = memo.memo().checkpoints()?;
        let key = key(job, memo, laid, values)?;
        let (number, outputs) = (laid.number, job.outputs);
        let found = marks.find(number, &key);
        if let Some(found) = &found {
            outputs.go_on(found.mark.outputs.clone());
            outputs.leave(&found.mark.outputs);
        }
        let (before, cut) = (outputs.parts(), laid.cut.clone());
        Some(Self { marks, number, key, cut, outputs, before, found, marked: None })
    }

    /// Time from one mark to the next.
    pub fn every(&self) -> Duration {
        self.marks.every()
    }

    /// Puts back what an earlier run has left, and gives the windows that it had done.
    pub fn restore(&mut self, stages: &mut [Stage]) -> Result<u64, Misfit> {
        let Some(found) = self.found.take() else { return Ok(0) };
        for (r, (stage, state)) in stages.iter_mut().zip(&found.states).enumerate() {
            stage
                .archive_state(&mut StateArchive::restore(state))
                .map_err(|(place, fault)| (r, place, fault))?;
        }
        self.marked = Some(found.mark.windows);
        Ok(found.mark.windows)
    }

    /// Writes down a phase of which all regions have done as many windows.
    pub fn save<'s>(&mut self, stages: impl Iterator<Item = &'s mut Stage>, windows: u64) -> io::Result<()> {
        let mut states = Vec::new();
        for stage in stages {
            let mut state = Vec::new();
            let saved = stage.archive_state(&mut StateArchive::save(&mut state));
            saved.map_err(|(_, fault)| io::Error::other(fault.message))?;
            states.push(state);
        }
        let outputs = self.outputs.synced(&self.before)?;
        let (key, cut) = (self.key.clone(), self.cut.clone());
        let mark = Mark { key, cut, windows, outputs, ..Mark::default() };
        let checkpoint = Checkpoint { mark, states };
        if self.marks.keep(self.number, &checkpoint)? {
            self.outputs.leave(&checkpoint.mark.outputs);
            self.marked = Some(windows);
        }
        Ok(())
    }

    /// The time up to which the last mark tells, where there is one.
    pub fn marked(&self, window: Tick) -> Option<Tick> {
        Some(i64::try_from(self.marked?).ok()?.saturating_mul(window))
    }
}
