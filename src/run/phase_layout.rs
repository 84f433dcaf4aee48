//! Lays out the nodes of a partial phase that run, and runs them: over cached streams, and over writers of the streams that are to be cached.

use super::cached_streams::{CachedStreams, PendingStream};
use super::checkpointer::{Checkpointer, PhaseRun, checkpoint_key};
use super::partial_phase::{PartialPhase, PhaseLayout};
use super::{Job, Report, Values, engine};
use crate::diag::Diagnostic;
use crate::graph::Graph;
use crate::memo::stream::Codec;
use crate::memo::{CachedStream, PhaseSubset, RunCache};
use crate::plan::Phase;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

impl PartialPhase<'_> {
    /// Starts to write an output to the cache.
    fn start_stream(
        &self,
        n: usize,
        port: usize,
        codec: Codec,
        values: &Values,
        cache: &mut RunCache<'_>,
    ) -> Option<PendingStream> {
        let (key, file) = cache.start_stream(n, port, values)?;
        Some(PendingStream { node: n, port, codec, key, file: Arc::new(Mutex::new(file)) })
    }

    /// Starts to write the streams that are worth caching by the estimated times.
    fn start_streams(&self, values: &Values, cache: &mut RunCache<'_>) -> Vec<PendingStream> {
        let mut pending = Vec::new();
        for n in self.chosen(cache) {
            let ports = self.ports.get(&n).into_iter().flatten();
            let mut start =
                |&(port, codec): &(usize, Codec)| self.start_stream(n, port, codec, values, cache);
            pending.extend(ports.map(&mut start).collect::<Option<Vec<_>>>().into_iter().flatten());
            cache.note_stream_key(n, values);
        }
        pending
    }

    /// Selects and lays out the nodes as the run of the last checkpoint did, if its state can be restored.
    ///
    /// The cache may hold more than at that time, but a state does not fit another selection of nodes.
    pub(super) fn follow_checkpoint(&mut self, number: usize, cache: &mut RunCache<'_>, values: &Values) {
        if self.needed.is_empty() || !self.uses_streams {
            return;
        }
        let Some(header) = cache.memo().checkpoints().and_then(|store| store.last_header(number)) else {
            return;
        };
        let find = |id: &str| self.job.graph.find(id).filter(|n| self.nodes.contains(n));
        let nodes: Option<Vec<_>> =
            header.subset.nodes.iter().map(|(id, read)| Some((find(id)?, *read))).collect();
        let writers: Option<Vec<_>> =
            header.subset.writers.iter().map(|(id, port)| Some((find(id)?, *port))).collect();
        let (Some(nodes), Some(writers)) = (nodes, writers) else { return };
        let needed: BTreeSet<usize> = nodes.iter().map(|(n, _)| *n).collect();
        let runs = |n: &usize| !nodes.contains(&(*n, true));
        // The checkpoint may be that of another graph, whose nodes had other inputs.
        let complete =
            needed.iter().filter(|n| runs(n)).all(|&n| self.feeding_nodes(n).all(|u| needed.contains(&u)));
        if !complete || !self.needed.is_subset(&needed) {
            return;
        }
        let mut cached = BTreeMap::new();
        for &(n, _) in nodes.iter().filter(|(_, read)| *read) {
            let ports = self.ports.get(&n).map_or(&[][..], Vec::as_slice);
            let Some(streams) = cache.look_up_streams(n, ports, values) else { return };
            cached.insert(n, streams);
        }
        let mut pending = Vec::new();
        for (n, port) in writers {
            let Some((_, codec)) = self.ports.get(&n).and_then(|all| all.iter().find(|(p, _)| *p == port))
            else {
                return;
            };
            pending.extend(self.start_stream(n, port, *codec, values, cache));
        }
        let previous =
            (std::mem::replace(&mut self.needed, needed), std::mem::replace(&mut self.cached, cached));
        self.resumed = self.lay_out(pending).ok().filter(|layout| {
            let phase = layout.replanned.as_ref().map_or(self.phase, |(_, phase)| phase);
            let subset = self.subset(&layout.streams);
            let run = PhaseRun { number, phase, subset: &subset };
            checkpoint_key(self.job, cache, run, values) == Some(header.key)
        });
        if self.resumed.is_none() {
            (self.needed, self.cached) = previous;
        }
    }

    /// Lays out the nodes that run; streams are not written if their buffers exceed the memory limit.
    fn lay_out(&self, pending: Vec<PendingStream>) -> Result<PhaseLayout, Vec<Diagnostic>> {
        let job = self.job;
        let source = |(port, codec, stream): &(usize, Codec, CachedStream)| {
            (*port, *codec, Arc::clone(&stream.source))
        };
        let sources = self.cached.iter().map(|(n, all)| (*n, all.iter().map(source).collect())).collect();
        let mut streams = CachedStreams { first_tap: job.taps.len(), sources, pending };
        let all_nodes = self.hoisted.is_empty() && self.needed.len() == self.phase.nodes.len();
        if self.cached.is_empty() && streams.pending.is_empty() && all_nodes {
            return Ok(PhaseLayout { streams, replanned: None });
        }
        let graph: Graph = job.graph.without_inputs(&|n| self.cached.contains_key(&n));
        let mut phase = self.replan(&graph, &streams)?;
        if phase.bytes > job.plan.limit {
            streams.pending.clear();
            phase = self.replan(&graph, &streams)?;
        }
        Ok(PhaseLayout { streams, replanned: Some((graph, phase)) })
    }

    fn replan(&self, graph: &Graph, streams: &CachedStreams) -> Result<Phase, Vec<Diagnostic>> {
        let pending = streams.pending.iter().enumerate();
        let pending = pending.map(|(i, p)| (streams.first_tap + i, (p.node, p.port)));
        // Streams of later phases are written to their end, however short this phase is.
        let (hoisted, pending): (Vec<_>, Vec<_>) = pending.partition(|(_, (n, _))| self.hoisted.contains(n));
        let planned = self.taps.iter().filter(|(k, _)| !self.job.taps[*k].is_observer()).count();
        let planned = planned + hoisted.len();
        let taps: Vec<_> = hoisted.into_iter().chain(self.taps.iter().copied()).chain(pending).collect();
        let nodes = self.order.iter().copied().filter(|n| self.needed.contains(n)).collect();
        self.job.plan.replan_phase(graph, nodes, &taps, planned, self.job.threads)
    }

    /// The selection of nodes, for a checkpoint.
    fn subset(&self, streams: &CachedStreams) -> PhaseSubset {
        let id = |n: usize| self.job.graph.nodes[n].id.clone();
        PhaseSubset {
            nodes: self.needed.iter().map(|&n| (id(n), self.cached.contains_key(&n))).collect(),
            writers: streams.pending.iter().map(|p| (id(p.node), p.port)).collect(),
        }
    }

    /// Runs the nodes.
    pub(super) fn run(
        &mut self,
        number: usize,
        values: &mut Values,
        report: &mut Report,
        cache: &mut RunCache<'_>,
    ) -> Result<CachedStreams, Vec<Diagnostic>> {
        let PhaseLayout { streams, replanned } = match self.resumed.take() {
            Some(layout) => layout,
            None => {
                let layout = self.lay_out(self.start_streams(values, cache))?;
                // Without room for all of them in memory, those of later phases stay there.
                match self.own.take().filter(|_| layout.streams.pending.is_empty()) {
                    None => layout,
                    Some(own) => {
                        (self.needed, self.cached) = own;
                        self.hoisted.clear();
                        self.lay_out(self.start_streams(values, cache))?
                    }
                }
            }
        };
        let (graph, phase) = replanned.as_ref().map_or((self.job.graph, self.phase), |(g, p)| (g, p));
        let planned = self.phase.windows * self.phase.regions.len() as u64;
        let total = &self.job.progress.total;
        total.fetch_add(phase.windows * phase.regions.len() as u64, Ordering::Relaxed);
        total.fetch_sub(planned, Ordering::Relaxed);
        report.planned_bytes = report.planned_bytes.max(phase.bytes);
        let job = Job { graph, progress: Arc::clone(&self.job.progress), ..*self.job };
        let subset = self.subset(&streams);
        let run = PhaseRun { number, phase, subset: &subset };
        let checkpointer = self.uses_streams.then(|| Checkpointer::new(self.job, cache, run, values));
        let mut checkpointer = checkpointer.flatten();
        engine::run_phase(&job, phase, values, report, &streams, checkpointer.as_mut())?;
        Ok(streams)
    }
}
