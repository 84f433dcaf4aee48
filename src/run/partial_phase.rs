//! The part of a phase that has to run, where results of earlier runs are cached.

use super::cached_streams::{CachedStreams, Outputs, PendingStream};
use super::{Job, Values};
use crate::graph::{Graph, Link};
use crate::memo::stream::Codec;
use crate::memo::{self, CachedStream, NodeSummary, RunCache};
use crate::plan::{Phase, Runnable};
use foley_nodes::core::ports::{PortKind, PortSpec};
use foley_nodes::core::time::Tick;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::{Arc, PoisonError};

/// Summaries of the nodes that did not run because a stream downstream of them was cached.
pub type Skipped = BTreeMap<usize, NodeSummary>;

/// The part of a phase that has to run.
pub(super) struct PartialPhase<'j> {
    pub(super) job: &'j Job<'j>,
    pub(super) phase: &'j Phase,
    /// Taps of the phase: number, node and port.
    pub(super) taps: Vec<(usize, (usize, usize))>,
    /// Outputs that are read, of the nodes whose streams can be cached.
    pub(super) ports: HashMap<usize, Vec<(usize, Codec)>>,
    /// Node type and ns per element in earlier runs, by id.
    costs: BTreeMap<String, (String, f64)>,
    /// True if the phase takes long enough to look up and store streams.
    pub(super) uses_streams: bool,
    /// Nodes that can run in the phase, in topological order: its own, and those of later phases that need none of its folds.
    pub(super) order: Vec<usize>,
    /// The same nodes.
    pub(super) nodes: HashSet<usize>,
    /// Nodes of later phases whose streams are to be cached, with what is needed and read without them.
    pub(super) hoisted: Vec<usize>,
    pub(super) own: Option<(BTreeSet<usize>, BTreeMap<usize, Outputs<CachedStream>>)>,
    /// Nodes that run, or whose streams are read.
    pub(super) needed: BTreeSet<usize>,
    /// Streams that are read, by node.
    pub(super) cached: BTreeMap<usize, Outputs<CachedStream>>,
    /// The layout of an earlier run that can be resumed.
    pub(super) resumed: Option<PhaseLayout>,
}

/// The outputs of a node that are read, if its streams can be cached.
fn codecs(job: &Job<'_>, n: usize, read: &BTreeSet<(usize, usize)>) -> Option<Vec<(usize, Codec)>> {
    if !memo::has_cacheable_streams(&job.graph.nodes[n].ty) {
        return None;
    }
    let outputs = job.graph.nodes[n].ty.outputs.iter().enumerate();
    let outputs = outputs.filter(|(port, _)| read.contains(&(n, *port)));
    let codecs = outputs.map(|(p, spec)| Some((p, Codec::of(spec.kind, &job.plan.shapes[n], p)?)));
    codecs.collect::<Option<Vec<_>>>().filter(|codecs| !codecs.is_empty())
}

/// The layout of a partial phase.
pub(super) struct PhaseLayout {
    pub(super) streams: CachedStreams,
    /// The graph without the inputs of nodes that are read, and its phase; `None` if the phase runs as planned.
    pub(super) replanned: Option<(Graph, Phase)>,
}

impl<'j> PartialPhase<'j> {
    pub(super) fn new(job: &'j Job<'j>, phase: &'j Phase, cache: &RunCache<'_>) -> Self {
        let tap = |runnable: Runnable| match runnable {
            Runnable::Tap(k) => job.taps.get(k).map(|tap| (k, (tap.node, tap.port))),
            Runnable::Node(_) => None,
        };
        let mut taps: Vec<_> =
            phase.regions.iter().flat_map(|r| &r.nodes).filter_map(|n| tap(n.runnable)).collect();
        // Those that determine the length of the phase come first.
        taps.sort_unstable();
        let links = phase.nodes.iter().flat_map(|&n| job.graph.nodes[n].links.iter().flatten());
        let mut read: BTreeSet<(usize, usize)> = links.map(|l| (l.node, l.port)).collect();
        read.extend(taps.iter().map(|(_, tap)| *tap));
        let ports = phase.nodes.iter().filter_map(|&n| Some((n, codecs(job, n, &read)?)));
        let mut part = Self {
            job,
            phase,
            ports: ports.collect(),
            taps,
            costs: cache.memo().index().costs(),
            uses_streams: false,
            order: phase.nodes.clone(),
            nodes: phase.nodes.iter().copied().collect(),
            hoisted: Vec::new(),
            own: None,
            needed: BTreeSet::new(),
            cached: BTreeMap::new(),
            resumed: None,
        };
        let policy = cache.memo().policy();
        let total: f64 = phase.nodes.iter().map(|&n| part.seconds(n)).sum();
        part.uses_streams = phase.nodes.len() <= policy.max_nodes && total >= policy.min_seconds;
        part
    }

    pub(super) fn is_tapped(&self, n: usize) -> bool {
        self.taps.iter().any(|(_, (node, _))| *node == n)
    }

    /// Maximum number of elements of any input or output stream of a node in the whole run.
    fn elements(&self, n: usize) -> f64 {
        let plan = self.job.plan;
        let end: Tick = plan.shapes[n].end.unwrap_or(self.phase.duration);
        let inputs = self.job.graph.nodes[n].links.iter().flatten();
        let inputs = inputs.filter_map(|l| plan.shapes[l.node].outputs.get(l.port)?.as_ref());
        let all = inputs.chain(plan.shapes[n].outputs.iter().flatten());
        all.map(|s| s.rate.first_at(end) as f64 * s.width as f64).fold(0.0, f64::max)
    }

    /// Estimated time of a node in s: from earlier runs, else from the cost that it declares.
    fn seconds(&self, n: usize) -> f64 {
        let node = &self.job.graph.nodes[n];
        let known = self.costs.get(&node.id).filter(|(kind, _)| kind == node.ty.name);
        known.map_or(node.ty.cost, |(_, nanos)| *nanos) * self.elements(n) * 1e-9
    }

    /// Finds the nodes that `roots` need, and the cached streams in place of nodes.
    pub(super) fn find_needed(&mut self, roots: Vec<usize>, cache: &mut RunCache<'_>, values: &Values) {
        let mut stack = roots;
        while let Some(n) = stack.pop() {
            if !self.needed.insert(n) {
                continue;
            }
            let ports = self.ports.get(&n).filter(|_| self.uses_streams);
            if let Some(streams) = ports.and_then(|ports| cache.look_up_streams(n, ports, values)) {
                self.cached.insert(n, streams);
                continue;
            }
            stack.extend(self.feeding_nodes(n));
        }
    }

    /// Nodes whose streams or events a node reads.
    fn streams_into(&self, n: usize) -> impl Iterator<Item = usize> {
        let node = &self.job.graph.nodes[n];
        let inputs = node.ty.inputs.iter().zip(&node.links);
        let streams = inputs.filter(|(spec, _)| !matches!(spec.kind, PortKind::Value(_)));
        streams.flat_map(|(_, links)| links).map(|l| l.node)
    }

    /// Nodes of this phase whose streams or events a node reads.
    pub(super) fn feeding_nodes(&self, n: usize) -> impl Iterator<Item = usize> {
        self.streams_into(n).filter(|u| self.nodes.contains(u))
    }

    /// Finds the streams of later phases that are worth caching and can be computed in this one, and the nodes that they need.
    ///
    /// Only streams are taken whose reader depends on a fold of this phase that is computed now: that node runs in a later phase for certain.
    pub(super) fn find_hoisted(
        &mut self,
        number: usize,
        folds: &[usize],
        cache: &mut RunCache<'_>,
        values: &Values,
    ) {
        let later: BTreeSet<usize> =
            self.job.plan.phases.iter().skip(number + 1).flat_map(|phase| &phase.nodes).copied().collect();
        if !self.uses_streams || folds.is_empty() || later.len() > cache.memo().policy().max_nodes {
            return;
        }
        let graph = self.job.graph;
        let links = |n: usize| graph.nodes[n].ty.inputs.iter().zip(&graph.nodes[n].links);
        let (mut changed, mut possible) = (HashSet::new(), self.nodes.clone());
        for &n in &graph.order {
            if folds.contains(&n)
                || links(n).any(|(_, links)| links.iter().any(|l| changed.contains(&l.node)))
            {
                changed.insert(n);
            }
            let known = |(spec, links): (&PortSpec, &Vec<Link>)| {
                let is_value = matches!(spec.kind, PortKind::Value(_));
                links.iter().all(|l| {
                    if is_value { values.contains_key(&(l.node, l.port)) } else { possible.contains(&l.node) }
                })
            };
            // What writes files, folds or is tapped belongs to its own phase.
            let outputs = &graph.nodes[n].ty.outputs;
            let streams = !outputs.is_empty() && !outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
            let is_free = later.contains(&n) && streams && !self.is_read_out(n) && !changed.contains(&n);
            if is_free && links(n).all(known) {
                possible.insert(n);
            }
        }
        let read: BTreeSet<(usize, usize)> = later
            .iter()
            .flat_map(|&n| graph.nodes[n].links.iter().flatten())
            .map(|l| (l.node, l.port))
            .collect();
        let ahead: Vec<usize> = possible.difference(&self.nodes).copied().collect();
        self.ports.extend(ahead.iter().filter_map(|&n| Some((n, codecs(self.job, n, &read)?))));
        self.order = graph.order.iter().copied().filter(|n| possible.contains(n)).collect();
        self.nodes = possible;
        // Of the streams that those nodes read, and of all upstream, the ones that are worth caching.
        let readers = later.iter().filter(|n| changed.contains(n)).flat_map(|&n| self.streams_into(n));
        let missing: Vec<usize> = readers.filter(|n| self.nodes.contains(n)).collect();
        let own = (self.needed.clone(), self.cached.clone());
        self.find_needed(missing, cache, values);
        let chosen: Vec<usize> =
            self.chosen(cache).into_iter().filter(|n| !own.0.contains(n) && ahead.contains(n)).collect();
        (self.needed, self.cached) = own.clone();
        self.find_needed(chosen.clone(), cache, values);
        self.own = (!chosen.is_empty()).then_some(own);
        self.hoisted = chosen;
    }

    /// Returns true if a node writes files, or one of its outputs is tapped.
    fn is_read_out(&self, n: usize) -> bool {
        memo::writes_files(&self.job.graph.nodes[n].ty) || self.job.taps.iter().any(|tap| tap.node == n)
    }

    /// Returns true if a node runs in this phase.
    fn runs(&self, n: usize) -> bool {
        self.needed.contains(&n) && !self.cached.contains_key(&n)
    }

    /// Adds the summaries of the nodes that the cached streams replace.
    pub(super) fn add_skipped(&self, skipped: &mut Skipped) {
        for stream in self.cached.values().flatten().map(|(.., stream)| stream) {
            for summary in &stream.entry.upstream {
                if let Some(n) = self.job.graph.find(&summary.node).filter(|&n| !self.runs(n)) {
                    skipped.entry(n).or_insert_with(|| summary.clone());
                }
            }
        }
    }

    /// Nodes that run, in topological order.
    fn running(&self) -> Vec<usize> {
        self.order.iter().copied().filter(|&n| self.runs(n)).collect()
    }

    /// The running nodes whose streams are worth caching by the estimated times.
    pub(super) fn chosen(&self, cache: &RunCache<'_>) -> Vec<usize> {
        if !self.uses_streams {
            return Vec::new();
        }
        let max_bytes = cache.memo().store().cap() as f64 / 4.0;
        let bytes = |n: usize| {
            let all: f64 = self.ports.get(&n)?.iter().map(|(_, codec)| codec.bytes()).sum();
            (all <= max_bytes).then_some(all)
        };
        let policy = *cache.memo().policy();
        let chosen =
            memo::choose_streams(self.job.graph, &self.running(), &policy, &|n| self.seconds(n), &bytes);
        chosen.into_iter().map(|(n, _)| n).collect()
    }

    /// Stores the measured costs of nodes for the estimates of the next run.
    pub(super) fn note_costs(&self, cache: &RunCache<'_>, seconds: &dyn Fn(usize) -> f64) {
        let mut costs = self.costs.clone();
        let mut changed = false;
        for n in self.running() {
            let (node, elements) = (&self.job.graph.nodes[n], self.elements(n));
            let nanos = seconds(n) / elements * 1e9;
            if !self.uses_streams || elements < 1.0 || !nanos.is_finite() {
                continue;
            }
            let cost = (node.ty.name.to_owned(), nanos);
            let same = |(kind, old): &(String, f64)| *kind == cost.0 && (0.6..1.6).contains(&(nanos / old));
            if !costs.get(&node.id).is_some_and(same) {
                changed = true;
                costs.insert(node.id.clone(), cost);
            }
        }
        if changed {
            // Without this file the next run uses the costs that nodes declare.
            let _ = cache.memo().index().note_costs(&costs);
        }
    }

    /// Completes the streams that are worth caching by the measured times; the others are discarded.
    pub(super) fn store_streams(
        &self,
        streams: CachedStreams,
        cache: &mut RunCache<'_>,
        seconds: &dyn Fn(usize) -> f64,
        summary: &dyn Fn(usize) -> NodeSummary,
    ) {
        let mut written: HashMap<usize, Vec<PendingStream>> = HashMap::new();
        for pending in streams.pending {
            written.entry(pending.node).or_default().push(pending);
        }
        let complete = |p: &PendingStream| {
            let file = p.file.lock().unwrap_or_else(PoisonError::into_inner);
            file.complete_bytes(&p.codec).map(|bytes| bytes as f64)
        };
        let bytes = |n: usize| written.get(&n)?.iter().map(complete).sum::<Option<f64>>();
        let policy = *cache.memo().policy();
        let chosen = memo::choose_streams(self.job.graph, &self.running(), &policy, seconds, &bytes);
        let mut unchanged: Vec<usize> = chosen.iter().map(|(n, _)| *n).collect();
        cache.retain_unchanged(&mut unchanged);
        for (n, seconds) in chosen.into_iter().filter(|(n, _)| unchanged.contains(n)) {
            let upstream: Vec<NodeSummary> = cache.upstream(n).chain([n]).map(summary).collect();
            for PendingStream { port, codec, key, file, .. } in written.remove(&n).into_iter().flatten() {
                // The writer node, which shared the file, was dropped with its stage.
                if let Some(file) = Arc::into_inner(file).and_then(|file| file.into_inner().ok()) {
                    cache.store_stream(n, port, &codec, (key, file), seconds, upstream.clone());
                }
            }
        }
    }
}
