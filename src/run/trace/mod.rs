//! Traces silence: the level of each output on the way to a file or a tap, and the nodes at which the sound is lost.

mod text;

use super::envelope::Envelope;
use super::node_report::NodeReport;
use super::observer::{Observer, ObserverTap};
use super::silence::{self, Output, Period, flows, is_mix};
use super::tap::{Tap, TapTarget};
use crate::graph::{Graph, Link, written};
use foley_nodes::core::item::{AnyValue, StreamShape};
use foley_nodes::core::ports::{PortKind, PortSpec};
use foley_nodes::core::time::{Rate, Tick, seconds, ticks};
use foley_nodes::dsp::linear_to_db;
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Shortest stretch of silence that is traced, s.
const STRETCH: f64 = 0.5;
/// Largest number of stretches of one output that are traced: the longest.
const MAX_STRETCHES: usize = 4;
/// Duration that is left out at both ends of a stretch, where an input may still or already be active, s.
const MARGIN: f64 = 0.1;

/// Observes the outputs of all nodes from which streams or events lead to files and taps.
#[derive(Debug)]
pub struct Trace {
    outputs: BTreeMap<Output, Arc<ObserverTap<Activity>>>,
    tapped: Vec<Output>,
}

/// Activity of one output.
#[derive(Debug, Default)]
struct Activity {
    kind: Option<PortKind>,
    /// Rate, and numbers of an item.
    stream: Option<(Rate, usize)>,
    envelope: Envelope,
    sum_squares: f64,
    /// Numbers, or events.
    count: u64,
    /// Time after the last item, ticks.
    end: Tick,
}

impl Observer for Activity {
    fn begin(&mut self, kind: PortKind, shape: Option<&StreamShape>) {
        let stream = shape.map(|shape| (shape.rate, shape.width * shape.item.columns.len()));
        let envelope = stream.map_or_else(Envelope::default, |(rate, _)| Envelope::of_rate(rate));
        *self = Self { kind: Some(kind), stream, envelope, ..Self::default() };
    }

    fn numbers(&mut self, first: i64, numbers: &[f32]) {
        let Some((rate, width)) = self.stream else { return };
        self.envelope.push(rate, width, first, numbers);
        self.sum_squares +=
            numbers.iter().filter(|x| x.is_finite()).map(|x| f64::from(*x).powi(2)).sum::<f64>();
        self.count += numbers.len() as u64;
        self.end = rate.tick(first + (numbers.len() / width.max(1)) as i64);
    }

    fn events(&mut self, events: &[(Tick, Value)]) {
        for (at, _) in events {
            self.envelope.raise(*at, 1.0);
            self.end = self.end.max(*at);
        }
        self.count += events.len() as u64;
    }

    fn value(&mut self, _: &AnyValue) {}
}

/// Level of an output or input.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutputLevel {
    /// `audio`, another item type, or `events`.
    pub item: &'static str,
    /// Largest magnitude of audio, dB of full scale; `None` for others and for silence.
    pub peak_db: Option<f64>,
    /// Root mean square of audio, dB of full scale.
    pub rms_db: Option<f64>,
    /// Number of events.
    pub events: Option<u64>,
    /// True if there was a number that is not 0, or an event.
    pub active: bool,
    /// Start and end of the part above -80 dB of its peak, s.
    pub span: Option<[f64; 2]>,
}

/// A port of a node, and its level.
#[derive(Clone, Debug, Serialize)]
pub struct PortLevel {
    /// Its name.
    pub port: &'static str,
    /// The output that an input reads, `NODE.PORT`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Its level.
    #[serde(flatten)]
    pub level: OutputLevel,
}

/// A node on the path to a file or tap.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// Its id.
    pub node: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Its links.
    pub inputs: Vec<PortLevel>,
    /// Its outputs that were observed.
    pub outputs: Vec<PortLevel>,
}

/// Part of an output that is silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Extent {
    /// All of it.
    Throughout,
    /// A part of a mix.
    Part,
    /// Some time.
    Stretch,
}

/// A node at which sound is lost.
#[derive(Clone, Debug, Serialize)]
pub struct Loss {
    /// Part of the output that is lost.
    pub extent: Extent,
    /// The output that is silent for it, `NODE.PORT`.
    pub silent: String,
    /// Start and end of a stretch, s.
    pub time: Option<[f64; 2]>,
    /// The first node upstream that gives nothing although it receives something, or that nothing feeds.
    pub node: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The reason.
    pub reason: String,
}

/// A file or tap with the path to it.
#[derive(Clone, Debug, Serialize)]
pub struct TracedOutput {
    /// The file as the graph names it, or the tapped output.
    pub output: String,
    /// Levels of the ports that feed it.
    pub levels: Vec<PortLevel>,
    /// Nodes at which sound is lost.
    pub losses: Vec<Loss>,
    /// The nodes on the path, sources first.
    pub path: Vec<Step>,
}

/// The trace of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SilenceTrace {
    /// Files and taps.
    pub outputs: Vec<TracedOutput>,
}

/// The links of a node over which streams or events run, with the names of their inputs.
fn links(graph: &Graph, n: usize) -> impl Iterator<Item = (&'static str, &Link)> {
    let node = &graph.nodes[n];
    let inputs = node.ty.inputs.iter().zip(&node.links);
    let inputs = inputs.filter(|(spec, _)| flows(spec));
    inputs.flat_map(|(spec, links)| links.iter().map(|link| (spec.name, link)))
}

/// The nodes from which streams or events lead to some nodes, themselves included.
fn upstream(graph: &Graph, ends: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
    let (mut open, mut found) = (Vec::from_iter(ends), BTreeSet::new());
    while let Some(n) = open.pop() {
        if found.insert(n) {
            open.extend(links(graph, n).map(|(_, link)| link.node));
        }
    }
    found
}

impl Trace {
    /// A trace of the files and taps of a graph.
    #[must_use]
    pub fn new(graph: &Graph, taps: &[Tap]) -> Self {
        let flowing = |n: usize, port: usize| flows(&graph.nodes[n].ty.outputs[port]);
        let tapped: Vec<Output> =
            taps.iter().map(|tap| (tap.node, tap.port)).filter(|&(n, port)| flowing(n, port)).collect();
        let sinks = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty());
        let nodes = upstream(graph, sinks.chain(tapped.iter().map(|(n, _)| *n)));
        let ports =
            nodes.iter().flat_map(|&n| (0..graph.nodes[n].ty.outputs.len()).map(move |port| (n, port)));
        let ports = ports.filter(|&(n, port)| flowing(n, port));
        let outputs = ports.map(|output| (output, Arc::new(ObserverTap::new(Activity::default())))).collect();
        Self { outputs, tapped }
    }

    /// The observed outputs.
    pub fn outputs(&self) -> impl Iterator<Item = (usize, usize)> {
        self.outputs.keys().copied()
    }

    /// Their taps, in the same order.
    pub fn taps(&self) -> impl Iterator<Item = Tap> {
        let tap = |(&(node, port), tap): (&Output, &Arc<ObserverTap<Activity>>)| Tap {
            node,
            port,
            target: TapTarget::Observer(Arc::clone(tap) as _),
        };
        self.outputs.iter().map(tap)
    }

    /// Traces where sound is lost, when the run has ended.
    #[must_use]
    pub fn read(&self, graph: &Graph, reports: &[NodeReport]) -> SilenceTrace {
        let reading = Reading { trace: self, graph, reports };
        let mut outputs = Vec::new();
        for (n, node) in graph.nodes.iter().enumerate().filter(|(_, node)| node.ty.outputs.is_empty()) {
            let all: Vec<(&'static str, Output)> =
                links(graph, n).map(|(name, link)| (name, silence::output(link))).collect();
            if !all.is_empty() {
                let path = written(&node.ty, &*node.params).map(|(_, path)| path).next();
                outputs.push(reading.output(path.unwrap_or_else(|| node.id.clone()), &all, Some(n)));
            }
        }
        for &output in &self.tapped {
            outputs.push(reading.output(reading.name(output), &[("tap", output)], None));
        }
        SilenceTrace { outputs }
    }
}

/// A trace whose run has ended.
struct Reading<'a> {
    trace: &'a Trace,
    graph: &'a Graph,
    reports: &'a [NodeReport],
}

impl Reading<'_> {
    fn name(&self, (n, port): Output) -> String {
        format!("{}.{}", self.graph.nodes[n].id, self.graph.nodes[n].ty.outputs[port].name)
    }

    fn activity<R>(&self, output: Output, read: impl FnOnce(&Activity) -> R) -> Option<R> {
        self.trace.outputs.get(&output).map(|tap| tap.read(read))
    }

    fn is_active(&self, output: Output) -> Option<bool> {
        self.activity(output, |activity| activity.envelope.peak() > 0.0)
    }

    fn level(&self, output: Output) -> Option<OutputLevel> {
        self.activity(output, |activity| {
            let audio = matches!(activity.kind, Some(PortKind::Stream(item)) if item.wave);
            let events = matches!(activity.kind, Some(PortKind::Events(_)));
            let active = activity.envelope.peak() > 0.0;
            let rms = (activity.sum_squares / activity.count.max(1) as f64).sqrt();
            OutputLevel {
                item: if events { "events" } else { activity.kind.map_or("nothing", |kind| kind.name()) },
                peak_db: (audio && active).then(|| linear_to_db(activity.envelope.peak().into())),
                rms_db: (audio && active).then(|| linear_to_db(rms)),
                events: events.then_some(activity.count),
                active,
                span: activity
                    .envelope
                    .active_span()
                    .map(|span| span.map(|at| seconds(at.min(activity.end)))),
            }
        })
    }

    /// The nodes that lose an output.
    fn losses(&self, output: Output, extent: Extent, stretch: Option<[Tick; 2]>) -> Vec<Loss> {
        let run = |output: Output| self.is_active(output);
        let within = |output: Output| {
            let [from, to] = stretch?;
            let margin = ticks(MARGIN).min((to - from) / 4);
            self.activity(output, |activity| activity.envelope.is_active(from + margin, to - margin))
        };
        let (graph, whole) = ((self.graph, self.reports), extent != Extent::Part);
        let found = match stretch {
            Some(_) => silence::losses(graph, output, whole, Period::Stretch, &within),
            None => silence::losses(graph, output, whole, Period::Run, &run),
        };
        let loss = |(n, reason): (usize, String)| Loss {
            extent,
            silent: self.name(output),
            time: stretch.map(|stretch| stretch.map(seconds)),
            node: self.graph.nodes[n].id.clone(),
            kind: self.graph.nodes[n].ty.name,
            reason,
        };
        found.into_iter().map(loss).collect()
    }

    /// The longest stretches of silence of an output that is not silent throughout, in the order of time.
    fn stretches(&self, output: Output) -> Vec<[Tick; 2]> {
        let all = self.activity(output, |activity| match activity.kind {
            Some(PortKind::Stream(item)) if item.wave && activity.envelope.peak() > 0.0 => {
                activity.envelope.silent_stretches(ticks(STRETCH), activity.end)
            }
            _ => Vec::new(),
        });
        let mut all = all.unwrap_or_default();
        all.sort_by_key(|[from, to]| from - to);
        all.truncate(MAX_STRETCHES);
        all.sort_unstable();
        all
    }

    fn output(&self, output: String, inputs: &[(&'static str, Output)], sink: Option<usize>) -> TracedOutput {
        let on_path = upstream(self.graph, inputs.iter().map(|(_, (n, _))| *n));
        let mut losses: Vec<Loss> = Vec::new();
        for &(_, input) in inputs {
            match self.is_active(input) {
                Some(false) => losses.extend(self.losses(input, Extent::Throughout, None)),
                Some(true) => {
                    let stretches = self.stretches(input).into_iter();
                    losses.extend(stretches.flat_map(|at| self.losses(input, Extent::Stretch, Some(at))));
                }
                None => {}
            }
        }
        for &n in &on_path {
            let node = &self.graph.nodes[n];
            let active = (0..node.ty.outputs.len()).any(|port| self.is_active((n, port)) == Some(true));
            let mixes = node.ty.inputs.iter().zip(&node.links).filter(|(spec, _)| is_mix(spec) && active);
            let silent = mixes.flat_map(|(_, links)| links).map(silence::output);
            let silent = silent.filter(|input| self.is_active(*input) == Some(false));
            losses.extend(silent.flat_map(|input| self.losses(input, Extent::Part, None)));
        }
        let level = |(port, output): (&'static str, Output)| {
            Some(PortLevel { port, from: Some(self.name(output)), level: self.level(output)? })
        };
        let carried = |n: usize, port: usize, spec: &PortSpec| {
            Some(PortLevel { port: spec.name, from: None, level: self.level((n, port))? })
        };
        let step = |n: usize| {
            let outputs = self.graph.nodes[n].ty.outputs.iter().enumerate();
            Step {
                node: self.graph.nodes[n].id.clone(),
                kind: self.graph.nodes[n].ty.name,
                inputs: links(self.graph, n)
                    .filter_map(|(port, link)| level((port, silence::output(link))))
                    .collect(),
                outputs: outputs.filter_map(|(port, spec)| carried(n, port, spec)).collect(),
            }
        };
        let order = self.graph.order.iter().copied().filter(|n| on_path.contains(n));
        TracedOutput {
            output,
            levels: inputs.iter().copied().filter_map(level).collect(),
            losses,
            path: order.chain(sink).map(step).collect(),
        }
    }
}
