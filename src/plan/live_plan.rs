//! The plan of a graph that plays: nodes that run in the audio callback, and nodes that run on workers ahead of it.
//!
//! Nodes that may run in the callback do so, unless a node that must not reads them. The others, with all nodes upstream, are
//! regions without links between them. They run ahead of the callback and pass finished windows on to it; the callback never
//! waits for them.

use super::delays::{self, Continuation, Delays};
use super::offline_plan::{Phase, Plan};
use super::options::{PlanOptions, WINDOW};
use super::phases::{self, LiveSplit};
use super::region::Region;
use super::wiring::{self, Schedule, TapPlan};
use super::{memory, partition, shapes};
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link};
use foley_nodes::core::files::Files;
use foley_nodes::core::item::{Described, OfItem};
use foley_nodes::core::node::Class;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::{Rate, Tick, seconds};
use std::collections::HashMap;

/// End of endless streams, about 50 years: longer than any session, and far from the overflow of ticks.
const ENDLESS: Tick = Tick::MAX / 8;

/// A node that writes sound to a file in an offline run; its sound goes to the device when the graph plays.
#[derive(Clone, Debug, PartialEq)]
pub struct AudioSink {
    /// Index of the node in the graph.
    pub node: usize,
    /// Its id.
    pub id: String,
    /// The link that feeds it.
    pub link: Link,
}

/// The schedule that the sinks of a graph continue in a hot reload.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SinkContinuation {
    /// Minimum delay of all sinks.
    pub delay: Tick,
    /// First tick of the sinks that continue, by id.
    pub sinks: HashMap<String, Tick>,
}

/// The plan of a graph that plays.
#[derive(Debug)]
pub struct LivePlan {
    /// Shapes, values, and the phases that compute folds before it plays.
    pub prelude: Plan,
    /// Nodes that play, in topological order.
    pub nodes: Vec<usize>,
    /// Delay of each node.
    pub delays: Delays,
    /// Regions that run on workers, and last the one that runs in the callback.
    pub regions: Vec<Region>,
    /// Sinks whose sound goes to the device.
    pub sinks: Vec<AudioSink>,
    /// The readers of the outputs that feed the sinks, in the order of `sinks`.
    pub taps: Vec<TapPlan>,
    /// Samples per second.
    pub rate: Rate,
    /// Maximum number of channels of any sink.
    pub channels: usize,
    /// Latency in ticks, without the buffers of the device.
    pub latency: Tick,
    /// Tick of the run at which the piece is over; `None` if it has no end.
    pub end: Option<Tick>,
    /// Bytes of all buffers.
    pub bytes: usize,
    /// Memory limit of the buffers, bytes.
    pub limit: usize,
}

impl LivePlan {
    /// Returns the region that runs in the callback.
    #[must_use]
    pub fn callback_region(&self) -> &Region {
        &self.regions[self.regions.len() - 1]
    }

    /// Returns the regions that run on workers.
    #[must_use]
    pub fn worker_regions(&self) -> &[Region] {
        &self.regions[..self.regions.len() - 1]
    }
}

/// The part of a plan that does not depend on the window or on the graph that plays before.
#[derive(Debug)]
pub struct Draft {
    /// Shapes, values, and the phases that compute folds before it plays.
    pub prelude: Plan,
    /// Nodes that play, in topological order.
    pub nodes: Vec<usize>,
    /// Sinks whose sound goes to the device.
    pub sinks: Vec<AudioSink>,
    /// Samples per second.
    pub rate: Rate,
    /// Maximum number of channels of any sink.
    pub channels: usize,
}

/// The sinks of a graph: nodes without outputs that take audio.
fn audio_sinks(graph: &Graph) -> Vec<AudioSink> {
    let audio = OfItem::<f32>::INFO;
    let is_audio = |link: &Link| match graph.nodes[link.node].ty.outputs[link.port].kind {
        PortKind::Stream(item) => (item.id)() == (audio.id)(),
        _ => false,
    };
    let sinks = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty());
    sinks
        .filter_map(|node| {
            let link = graph.nodes[node].links.iter().flatten().find(|l| is_audio(l))?.clone();
            Some(AudioSink { node, id: graph.nodes[node].id.clone(), link })
        })
        .collect()
}

impl Draft {
    /// Shapes a graph that is to play with buffers of at most `memory` bytes.
    ///
    /// # Errors
    /// Every reason found why it cannot: as [`Plan::new`], no sink, several rates, nodes that run offline only.
    pub fn new(graph: &Graph, files: &dyn Files, memory: usize) -> Result<Self, Vec<Diagnostic>> {
        let shaped = shapes::shape_all(graph, files);
        if !shaped.errors.is_empty() {
            return Err(shaped.errors);
        }
        Self::from_shapes(graph, shaped.shapes, memory)
    }

    /// As [`Draft::new`], for a graph whose shapes are known.
    ///
    /// # Errors
    /// As [`Draft::new`], without those of the shapes.
    pub fn from_shapes(
        graph: &Graph,
        shapes: Vec<NodeShape>,
        memory: usize,
    ) -> Result<Self, Vec<Diagnostic>> {
        let sinks = audio_sinks(graph);
        let mut errors = Vec::new();
        let Some(first) = sinks.first() else {
            let none = Diagnostic::general("F052", "the graph has no output to play");
            return Err(vec![none.help("add a WavOut: in a live run its sound goes to the device")]);
        };
        let rate_of =
            |sink: &AudioSink| shapes[sink.link.node].outputs[sink.link.port].as_ref().map(|s| s.rate);
        let rate = rate_of(first).unwrap_or(Rate::hz(48_000));
        for other in sinks.iter().filter(|sink| rate_of(sink) != Some(rate)) {
            let found = rate_of(other).map_or_else(String::new, |r| r.to_string());
            let message = format!("`{}` runs at {found}, `{}` at {rate}", other.id, first.id);
            let wanted = format!("put Resample(rate: {rate}) before it").replace(" Hz", "");
            let location = graph.nodes[other.node].location.clone();
            errors.push(Diagnostic::error("F045", message, location).node(&other.id).help(wanted));
        }
        let ends: Vec<usize> = sinks.iter().map(|sink| sink.link.node).collect();
        let split = phases::split_live(graph, &ends);
        errors.extend(offline_only(graph, &split.nodes));
        let prelude = prelude(graph, shapes, &split, memory)?;
        if !errors.is_empty() {
            return Err(errors);
        }
        let streams = sinks.iter().filter_map(|s| prelude.shapes[s.link.node].outputs[s.link.port].as_ref());
        let channels = streams.map(|s| s.width).max().unwrap_or(1);
        Ok(Self { prelude, nodes: split.nodes, sinks, rate, channels })
    }

    /// Lays the graph out in windows of `window` ticks, so that it continues a schedule.
    ///
    /// # Errors
    /// A loop shorter than the window, buffers beyond the memory limit.
    ///
    /// # Complexity
    /// O(nodes + links).
    pub fn plan(
        self,
        graph: &Graph,
        window: Tick,
        continuation: &Continuation,
        sink_continuation: &SinkContinuation,
    ) -> Result<LivePlan, Vec<Diagnostic>> {
        let Self { prelude, nodes, sinks, rate, channels } = self;
        let shapes = &prelude.shapes;
        let longest = delays::longest_window(graph, shapes, &nodes)?;
        if longest < window {
            return Err(vec![short_loop(longest, window)]);
        }
        let delays = delays::delays(graph, shapes, &nodes, window, continuation);
        let delay_of = |sink: &AudioSink| delays.of[sink.link.node] + shapes[sink.link.node].lag;
        // Sounds of one time go to the device together: all sinks have the delay of the latest.
        let delay = sinks.iter().map(delay_of).max().unwrap_or(0).max(sink_continuation.delay);
        let taps: Vec<TapPlan> = (0..)
            .zip(&sinks)
            .map(|(tap, AudioSink { id, link, .. })| {
                let continued = sink_continuation.sinks.get(id).copied();
                let from = continued.unwrap_or((continuation.at - delay).max(0));
                TapPlan { tap, node: link.node, port: link.port, delay, from }
            })
            .collect();
        let ends: Option<Vec<Tick>> = sinks.iter().map(|sink| shapes[sink.link.node].end).collect();
        let end = ends.and_then(|ends| ends.into_iter().max()).map(|end| end + delay);
        let duration = ENDLESS;
        let schedule =
            Schedule { graph, shapes, nodes: &nodes, delays: &delays, taps: &taps, duration, window };
        let (region_of, count) = partition::by_callback(graph, &nodes, &taps);
        let mut regions = wiring::wire(&schedule, &region_of);
        regions.resize_with(count, Region::default);
        let bytes = regions.iter().map(Region::bytes).sum();
        memory::check_limit(prelude.limit, bytes, graph, shapes, regions.iter())?;
        Ok(LivePlan {
            limit: prelude.limit,
            prelude,
            nodes,
            delays,
            regions,
            sinks,
            taps,
            rate,
            channels,
            latency: delay,
            end,
            bytes,
        })
    }
}

fn short_loop(longest: Tick, window: Tick) -> Diagnostic {
    let ms = |t: Tick| seconds(t) * 1e3;
    let message = format!(
        "a feedback loop of {:.3} ms is shorter than the quantum of {:.3} ms",
        ms(longest),
        ms(window)
    );
    Diagnostic::general("F049", message).help("make the loop's delay longer, or give a smaller --quantum")
}

/// The plan of the phases that compute folds.
fn prelude(
    graph: &Graph,
    shapes: Vec<NodeShape>,
    split: &LiveSplit,
    memory: usize,
) -> Result<Plan, Vec<Diagnostic>> {
    let options = PlanOptions { memory, ..PlanOptions::default() };
    let mut window = WINDOW;
    for nodes in &split.prelude {
        window = window.min(delays::longest_window(graph, &shapes, nodes)?);
    }
    let mut phases = Vec::new();
    for nodes in split.prelude.iter().filter(|nodes| !nodes.is_empty()) {
        phases.push(Phase::new(graph, &shapes, nodes.clone(), &[], window, &options)?);
    }
    let bytes = phases.iter().map(|p| p.bytes).max().unwrap_or(0);
    memory::check_limit(memory, bytes, graph, &shapes, phases.iter().flat_map(|p| &p.regions))?;
    Ok(Plan {
        shapes,
        values: split.values.clone(),
        phases,
        window,
        bytes,
        unused: Vec::new(),
        limit: options.memory,
    })
}

/// Errors of nodes that need more time or memory than playing permits.
fn offline_only(graph: &Graph, nodes: &[usize]) -> Vec<Diagnostic> {
    let offline = nodes.iter().filter(|&&n| graph.nodes[n].ty.class == Class::Offline);
    offline
        .map(|&n| {
            let node = &graph.nodes[n];
            let message = format!("`{}` ({}) runs offline only", node.id, node.ty.name);
            Diagnostic::error("F053", message, node.location.clone())
                .node(&node.id)
                .help("render it with `foley run`, and play the file that it gives")
        })
        .collect()
}
