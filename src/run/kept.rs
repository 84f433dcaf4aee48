//! Runs a phase with what the memo has: folds that are known are not computed, streams that are kept are read in place of all
//! that is above them, and those that are worth it are written as they run by.

use super::checkpoint::{self, Saver};
use super::{Job, Report, Values, engine};
use crate::diag::Diagnostic;
use crate::graph::Graph;
use crate::memo::stream::{Codec, Part, Reader, SharedPart, Source, Writer};
use crate::memo::{self, Kept, Session, Told};
use crate::plan::{Phase, What};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::time::Tick;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A node's outputs, each with what it is and where it comes from.
type Outputs<T> = Vec<(usize, Codec, T)>;

/// The streams that are read and written in place of nodes and taps.
#[derive(Default)]
pub struct Streams {
    /// Number of the first tap that is a writer of this.
    first: usize,
    readers: HashMap<usize, Outputs<Arc<Source>>>,
    writers: Vec<Writing>,
}

struct Writing {
    node: usize,
    port: usize,
    codec: Codec,
    key: String,
    part: SharedPart,
}

impl Streams {
    /// Whether a node's outputs are read instead of computed.
    pub fn read(&self, n: usize) -> bool {
        self.readers.contains_key(&n)
    }

    /// What runs in place of a node.
    pub fn reader(&self, n: usize) -> Option<Result<Box<dyn DynNode>, Fault>> {
        let outputs = self.readers.get(&n)?;
        let failed =
            |e| Fault::new("F084", format!("the streams kept from an earlier run cannot be read: {e}"));
        Some(Reader::open(outputs).map(|r| Box::new(r) as Box<dyn DynNode>).map_err(failed))
    }

    /// What runs as a tap of this number.
    pub fn writer(&self, k: usize) -> Option<Box<dyn DynNode>> {
        let writing = self.writers.get(k.checked_sub(self.first)?)?;
        Some(Box::new(Writer::new(writing.codec, Arc::clone(&writing.part))))
    }
}

/// What nodes have told that did not run, since something below them was kept.
pub type Hidden = BTreeMap<usize, Told>;

/// Runs a phase.
///
/// # Errors
/// The faults of the nodes that failed.
pub fn pass(
    job: &Job<'_>,
    (number, phase): (usize, &Phase),
    values: &mut Values,
    report: &mut Report,
    memo: &mut Session<'_>,
    hidden: &mut Hidden,
) -> Result<(), Vec<Diagnostic>> {
    let ty = |n: usize| &*job.graph.nodes[n].ty;
    let folds: Vec<usize> = phase.nodes.iter().copied().filter(|&n| memo::keeps(ty(n))).collect();
    let hits: Vec<_> = folds.iter().map(|&n| memo.look_up(n, values)).collect();
    let missed: Vec<usize> =
        folds.iter().zip(&hits).filter(|(_, hit)| hit.is_none()).map(|(n, _)| *n).collect();
    let mut cut = Cut::new(job, phase, memo);
    let root = |n: &usize| memo::writes(ty(*n)) || cut.tapped(*n) || missed.contains(n);
    let roots = phase.nodes.iter().copied().filter(root).collect();
    cut.walk(roots, memo, values);
    cut.follow(number, memo, values);
    for (n, hit) in folds.iter().copied().zip(hits) {
        if let Some(hit) = hit.filter(|_| !cut.needed.contains(&n)) {
            super::take(n, hit, values, report);
        }
    }
    cut.hide(hidden);
    if cut.needed.is_empty() {
        let windows = phase.windows * phase.regions.len() as u64;
        job.progress.done.fetch_add(windows, Ordering::Relaxed);
        return Ok(());
    }
    let (start, notes) = (Instant::now(), report.notes.len());
    let before: Vec<Duration> = report.nodes.iter().map(|n| n.time).collect();
    let streams = cut.run(number, values, report, memo)?;
    for &n in &missed {
        // To have the fold again, the whole phase has to run again.
        let summary = report.nodes[n].summary.clone();
        memo.keep(n, values, start.elapsed(), summary, report.warned(n, notes));
    }
    let took = |n: usize| report.nodes[n].time.saturating_sub(before[n]).as_secs_f64();
    let told = |n: usize| {
        hidden.get(&n).cloned().unwrap_or_else(|| Told {
            node: job.graph.nodes[n].id.clone(),
            summary: report.nodes[n].summary.clone(),
            warnings: report.warned(n, notes),
        })
    };
    cut.note_costs(memo, &took);
    cut.keep(streams, memo, &took, &told);
    Ok(())
}

/// A phase, and what of it has to run.
struct Cut<'j> {
    job: &'j Job<'j>,
    phase: &'j Phase,
    /// Taps of the phase: number, node and port.
    taps: Vec<(usize, (usize, usize))>,
    /// Outputs that something reads, of the nodes whose streams may be kept.
    ports: HashMap<usize, Vec<(usize, Codec)>>,
    /// What earlier runs took, by id.
    costs: BTreeMap<String, (String, f64)>,
    /// Whether to look for and to keep streams at all.
    worth: bool,
    /// Nodes of the phase.
    own: HashSet<usize>,
    needed: BTreeSet<usize>,
    found: BTreeMap<usize, Outputs<Kept>>,
    /// How an earlier run was laid out that can be gone on with.
    marked: Option<Laid>,
}

/// What runs of a phase, ready to run.
struct Laid {
    streams: Streams,
    /// The graph without the inputs of what is read, and its phase; `None` where the phase runs as it was planned.
    cut: Option<(Graph, Phase)>,
}

impl<'j> Cut<'j> {
    fn new(job: &'j Job<'j>, phase: &'j Phase, memo: &Session<'_>) -> Self {
        let tap = |what: What| match what {
            What::Tap(k) => job.taps.get(k).map(|tap| (k, (tap.node, tap.port))),
            What::Node(_) => None,
        };
        let taps: Vec<_> = phase.regions.iter().flat_map(|r| &r.nodes).filter_map(|n| tap(n.job)).collect();
        let links = phase.nodes.iter().flat_map(|&n| job.graph.nodes[n].links.iter().flatten());
        let mut read: BTreeSet<(usize, usize)> = links.map(|l| (l.node, l.port)).collect();
        read.extend(taps.iter().map(|(_, tap)| *tap));
        let mut ports: HashMap<usize, Vec<(usize, Codec)>> = HashMap::new();
        for &n in phase.nodes.iter().filter(|&&n| memo::streams(&job.graph.nodes[n].ty)) {
            let outputs = job.graph.nodes[n].ty.outputs.iter().enumerate();
            let own = outputs.filter(|(port, _)| read.contains(&(n, *port)));
            let codecs = own.map(|(p, spec)| Some((p, Codec::of(spec.kind, &job.plan.shapes[n], p)?)));
            if let Some(codecs) = codecs.collect::<Option<Vec<_>>>().filter(|codecs| !codecs.is_empty()) {
                ports.insert(n, codecs);
            }
        }
        let mut cut = Self {
            job,
            phase,
            taps,
            ports,
            costs: memo.memo().index().costs(),
            worth: false,
            own: phase.nodes.iter().copied().collect(),
            needed: BTreeSet::new(),
            found: BTreeMap::new(),
            marked: None,
        };
        let rule = memo.memo().rule();
        let total: f64 = phase.nodes.iter().map(|&n| cut.seconds(n)).sum();
        cut.worth = phase.nodes.len() <= rule.most_nodes && total >= rule.least;
        cut
    }

    fn tapped(&self, n: usize) -> bool {
        self.taps.iter().any(|(_, (node, _))| *node == n)
    }

    /// Elements that a node makes or reads in the whole run, whichever are more.
    fn elements(&self, n: usize) -> f64 {
        let plan = self.job.plan;
        let end: Tick = plan.shapes[n].end.unwrap_or(self.phase.duration);
        let inputs = self.job.graph.nodes[n].links.iter().flatten();
        let inputs = inputs.filter_map(|l| plan.shapes[l.node].outputs.get(l.port)?.as_ref());
        let all = inputs.chain(plan.shapes[n].outputs.iter().flatten());
        all.map(|s| s.rate.first_at(end) as f64 * s.width as f64).fold(0.0, f64::max)
    }

    /// What a node takes, by earlier runs or by what it declares.
    fn seconds(&self, n: usize) -> f64 {
        let node = &self.job.graph.nodes[n];
        let known = self.costs.get(&node.id).filter(|(kind, _)| kind == node.ty.name);
        known.map_or(node.ty.cost, |(_, nanos)| *nanos) * self.elements(n) * 1e-9
    }

    /// Finds what has to run to have `roots`.
    fn walk(&mut self, roots: Vec<usize>, memo: &mut Session<'_>, values: &Values) {
        let mut stack = roots;
        while let Some(n) = stack.pop() {
            if !self.needed.insert(n) {
                continue;
            }
            let kept = self.ports.get(&n).filter(|_| self.worth);
            if let Some(kept) = kept.and_then(|ports| memo.look_up_streams(n, ports, values)) {
                self.found.insert(n, kept);
                continue;
            }
            stack.extend(self.above(n));
        }
    }

    /// Nodes of this phase that a node reads streams or events of.
    fn above(&self, n: usize) -> impl Iterator<Item = usize> {
        let node = &self.job.graph.nodes[n];
        let inputs = node.ty.inputs.iter().zip(&node.links);
        let streams = inputs.filter(|(spec, _)| !matches!(spec.kind, PortKind::Value(_)));
        streams.flat_map(|(_, links)| links).map(|l| l.node).filter(|u| self.own.contains(u))
    }

    /// Whether a node runs in this phase.
    fn runs(&self, n: usize) -> bool {
        self.needed.contains(&n) && !self.found.contains_key(&n)
    }

    /// Takes over what nodes have told that do not run.
    fn hide(&self, hidden: &mut Hidden) {
        for kept in self.found.values().flatten().map(|(.., kept)| kept) {
            for told in &kept.entry.above {
                if let Some(n) = self.job.graph.find(&told.node).filter(|&n| !self.runs(n)) {
                    hidden.entry(n).or_insert_with(|| told.clone());
                }
            }
        }
    }

    /// Nodes that run, in topological order.
    fn running(&self) -> Vec<usize> {
        self.phase.nodes.iter().copied().filter(|&n| self.runs(n)).collect()
    }

    /// Starts to write an output.
    fn start(
        &self,
        n: usize,
        port: usize,
        codec: Codec,
        values: &Values,
        memo: &mut Session<'_>,
    ) -> Option<Writing> {
        let (key, part): (String, Part) = memo.start_stream(n, port, values)?;
        Some(Writing { node: n, port, codec, key, part: Arc::new(Mutex::new(part)) })
    }

    /// Starts to write what seems worth it.
    fn writers(&self, values: &Values, memo: &mut Session<'_>) -> Vec<Writing> {
        let mut writers = Vec::new();
        if !self.worth {
            return writers;
        }
        let most = memo.memo().store().cap() as f64 / 4.0;
        let bytes = |n: usize| {
            let all: f64 = self.ports.get(&n)?.iter().map(|(_, codec)| codec.bytes()).sum();
            (all <= most).then_some(all)
        };
        let rule = *memo.memo().rule();
        let chosen = memo::choose(self.job.graph, &self.running(), &rule, &|n| self.seconds(n), &bytes);
        for (n, _) in chosen {
            let ports = self.ports.get(&n).into_iter().flatten();
            let mut start = |&(port, codec): &(usize, Codec)| self.start(n, port, codec, values, memo);
            writers.extend(ports.map(&mut start).collect::<Option<Vec<_>>>().into_iter().flatten());
            memo.note_stream(n, values);
        }
        writers
    }

    /// Lays out what has to run as an earlier run had it that was interrupted, where that can still be had.
    ///
    /// What is known by now may be more than that run knew, and its state does not fit less work.
    fn follow(&mut self, number: usize, memo: &mut Session<'_>, values: &Values) {
        if self.needed.is_empty() || !self.worth {
            return;
        }
        let Some(mark) = memo.memo().checkpoints().and_then(|marks| marks.last(number)) else { return };
        let find = |id: &str| self.job.graph.find(id).filter(|n| self.own.contains(n));
        let nodes: Option<Vec<_>> =
            mark.cut.nodes.iter().map(|(id, read)| Some((find(id)?, *read))).collect();
        let writers: Option<Vec<_>> =
            mark.cut.writers.iter().map(|(id, port)| Some((find(id)?, *port))).collect();
        let (Some(nodes), Some(writers)) = (nodes, writers) else { return };
        let needed: BTreeSet<usize> = nodes.iter().map(|(n, _)| *n).collect();
        let runs = |n: &usize| !nodes.contains(&(*n, true));
        // The mark may be that of another graph, whose nodes had other inputs.
        let whole = needed.iter().filter(|n| runs(n)).all(|&n| self.above(n).all(|u| needed.contains(&u)));
        if !whole || !self.needed.is_subset(&needed) {
            return;
        }
        let mut found = BTreeMap::new();
        for &(n, _) in nodes.iter().filter(|(_, read)| *read) {
            let ports = self.ports.get(&n).map_or(&[][..], Vec::as_slice);
            let Some(kept) = memo.look_up_streams(n, ports, values) else { return };
            found.insert(n, kept);
        }
        let mut writing = Vec::new();
        for (n, port) in writers {
            let Some((_, codec)) = self.ports.get(&n).and_then(|all| all.iter().find(|(p, _)| *p == port))
            else {
                return;
            };
            writing.extend(self.start(n, port, *codec, values, memo));
        }
        let own = (std::mem::replace(&mut self.needed, needed), std::mem::replace(&mut self.found, found));
        self.marked = self.lay(writing).ok().filter(|laid| {
            let phase = laid.cut.as_ref().map_or(self.phase, |(_, phase)| phase);
            let note = self.note(&laid.streams);
            let asked = checkpoint::Laid { number, phase, cut: &note };
            checkpoint::key(self.job, memo, asked, values) == Some(mark.key)
        });
        if self.marked.is_none() {
            (self.needed, self.found) = own;
        }
    }

    /// Lays out what has to run.
    fn lay(&self, writers: Vec<Writing>) -> Result<Laid, Vec<Diagnostic>> {
        let job = self.job;
        let read = |(port, codec, kept): &(usize, Codec, Kept)| (*port, *codec, Arc::clone(&kept.source));
        let readers = self.found.iter().map(|(n, all)| (*n, all.iter().map(read).collect())).collect();
        let mut streams = Streams { first: job.taps.len(), readers, writers };
        if self.found.is_empty() && streams.writers.is_empty() && self.needed.len() == self.phase.nodes.len()
        {
            return Ok(Laid { streams, cut: None });
        }
        let graph: Graph = job.graph.without_inputs(&|n| self.found.contains_key(&n));
        let mut phase = self.phase_of(&graph, &streams)?;
        if phase.bytes > job.plan.limit {
            streams.writers.clear();
            phase = self.phase_of(&graph, &streams)?;
        }
        Ok(Laid { streams, cut: Some((graph, phase)) })
    }

    /// What runs, for a mark.
    fn note(&self, streams: &Streams) -> memo::Cut {
        let id = |n: usize| self.job.graph.nodes[n].id.clone();
        memo::Cut {
            nodes: self.needed.iter().map(|&n| (id(n), self.found.contains_key(&n))).collect(),
            writers: streams.writers.iter().map(|w| (id(w.node), w.port)).collect(),
        }
    }

    /// Runs what has to run.
    fn run(
        &mut self,
        number: usize,
        values: &mut Values,
        report: &mut Report,
        memo: &mut Session<'_>,
    ) -> Result<Streams, Vec<Diagnostic>> {
        let Laid { streams, cut } = match self.marked.take() {
            Some(laid) => laid,
            None => self.lay(self.writers(values, memo))?,
        };
        let (graph, phase) = cut.as_ref().map_or((self.job.graph, self.phase), |(g, p)| (g, p));
        let planned = self.phase.windows * self.phase.regions.len() as u64;
        let total = &self.job.progress.total;
        total.fetch_add(phase.windows * phase.regions.len() as u64, Ordering::Relaxed);
        total.fetch_sub(planned, Ordering::Relaxed);
        report.planned_bytes = report.planned_bytes.max(phase.bytes);
        let job = Job { graph, progress: Arc::clone(&self.job.progress), ..*self.job };
        let note = self.note(&streams);
        let laid = checkpoint::Laid { number, phase, cut: &note };
        let mut saver = self.worth.then(|| Saver::new(self.job, memo, laid, values)).flatten();
        engine::run_phase(&job, phase, values, report, &streams, saver.as_mut())?;
        Ok(streams)
    }

    fn phase_of(&self, graph: &Graph, streams: &Streams) -> Result<Phase, Vec<Diagnostic>> {
        let more = streams.writers.iter().enumerate().map(|(i, w)| (streams.first + i, (w.node, w.port)));
        let taps: Vec<_> = self.taps.iter().copied().chain(more).collect();
        let nodes = self.phase.nodes.iter().copied().filter(|n| self.needed.contains(n)).collect();
        self.job.plan.again(graph, nodes, &taps, self.taps.len(), self.job.threads)
    }

    /// Notes what nodes took, so that the next run knows better than what they declare.
    fn note_costs(&self, memo: &Session<'_>, took: &dyn Fn(usize) -> f64) {
        let mut costs = self.costs.clone();
        let mut news = false;
        for n in self.running() {
            let (node, elements) = (&self.job.graph.nodes[n], self.elements(n));
            let nanos = took(n) / elements * 1e9;
            if !self.worth || elements < 1.0 || !nanos.is_finite() {
                continue;
            }
            let cost = (node.ty.name.to_owned(), nanos);
            let same = |(kind, was): &(String, f64)| *kind == cost.0 && (0.6..1.6).contains(&(nanos / was));
            if !costs.get(&node.id).is_some_and(same) {
                news = true;
                costs.insert(node.id.clone(), cost);
            }
        }
        if news {
            // Without it the next run goes by what the nodes declare.
            let _ = memo.memo().index().note_costs(&costs);
        }
    }

    /// Keeps of what was written what was worth it.
    fn keep(
        &self,
        streams: Streams,
        memo: &mut Session<'_>,
        took: &dyn Fn(usize) -> f64,
        told: &dyn Fn(usize) -> Told,
    ) {
        let mut written: HashMap<usize, Vec<Writing>> = HashMap::new();
        for writing in streams.writers {
            written.entry(writing.node).or_default().push(writing);
        }
        let whole = |w: &Writing| {
            let part = w.part.lock().unwrap_or_else(PoisonError::into_inner);
            part.whole(&w.codec).map(|bytes| bytes as f64)
        };
        let bytes = |n: usize| written.get(&n)?.iter().map(whole).sum::<Option<f64>>();
        let rule = *memo.memo().rule();
        let chosen = memo::choose(self.job.graph, &self.running(), &rule, took, &bytes);
        let mut same: Vec<usize> = chosen.iter().map(|(n, _)| *n).collect();
        memo.still(&mut same);
        for (n, seconds) in chosen.into_iter().filter(|(n, _)| same.contains(n)) {
            let above: Vec<Told> = memo.above(n).chain([n]).map(told).collect();
            for Writing { port, codec, key, part, .. } in written.remove(&n).into_iter().flatten() {
                // The writer went with its stage.
                if let Some(part) = Arc::into_inner(part).and_then(|part| part.into_inner().ok()) {
                    memo.keep_stream(n, port, &codec, (key, part), seconds, above.clone());
                }
            }
        }
    }
}
