//! The plan of a graph that plays: what runs in the audio callback, and what on threads ahead of it.
//!
//! Nodes that may run in the callback do, unless a node that may not reads what they give; such nodes and all above them are
//! cut into parts without links between them, which run ahead of the callback and hand it finished windows. Nothing in the
//! callback ever waits for them.

use super::layout::{self, Parts, Region, TapPlan, What};
use super::schedule::{self, Delays, Resume};
use super::show;
use super::{Phase, Plan, PlanOptions, WINDOW, phases};
use crate::diag::Diagnostic;
use crate::graph::{Graph, Link};
use foley_nodes::core::files::Files;
use foley_nodes::core::item::{Described, OfItem};
use foley_nodes::core::node::Class;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::time::{Rate, Tick};
use std::collections::HashMap;

/// When streams end that have no end: long after anybody has stopped listening, and far from where ticks overflow.
const ENDLESS: Tick = Tick::MAX / 8;

/// A node that writes sound to a file in an offline run, and is heard in a live one.
#[derive(Clone, Debug, PartialEq)]
pub struct Heard {
    /// Place of the node in the graph.
    pub sink: usize,
    /// Its id.
    pub id: String,
    /// The link that it hears.
    pub link: Link,
}

/// Where the sinks of a graph take over from one that plays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SinksResume {
    /// The least delay of any of them.
    pub delay: Tick,
    /// First ticks by id.
    pub kept: HashMap<String, Tick>,
}

/// Everything known of a graph before it plays.
#[derive(Debug)]
pub struct LivePlan {
    /// Shapes, values, and the passes that make folds before it plays.
    pub prelude: Plan,
    /// Nodes that play, in topological order.
    pub nodes: Vec<usize>,
    /// How far behind each works.
    pub delays: Delays,
    /// Parts that run ahead on threads, and last the one that runs in the callback.
    pub regions: Vec<Region>,
    /// What is heard.
    pub heard: Vec<Heard>,
    /// The readers of what is heard, in the order of `heard`.
    pub taps: Vec<TapPlan>,
    /// Samples per second.
    pub rate: Rate,
    /// Most channels of anything that is heard.
    pub channels: usize,
    /// Ticks from what happens to what is heard of it, without the device's own buffers.
    pub latency: Tick,
    /// When the piece has been heard to its end, where it has one.
    pub end: Option<Tick>,
    /// Bytes in buffers.
    pub bytes: usize,
    /// Most bytes that they may take.
    pub limit: usize,
}

impl LivePlan {
    /// The part that runs in the callback.
    #[must_use]
    pub fn callback(&self) -> &Region {
        &self.regions[self.regions.len() - 1]
    }

    /// The parts that run ahead of it.
    #[must_use]
    pub fn ahead(&self) -> &[Region] {
        &self.regions[..self.regions.len() - 1]
    }
}

/// What is known of a graph as soon as its nodes have been shaped.
#[derive(Debug)]
pub struct Draft {
    /// Shapes, values, and the passes that make folds before it plays.
    pub prelude: Plan,
    /// Nodes that play, in topological order.
    pub nodes: Vec<usize>,
    /// What is heard.
    pub heard: Vec<Heard>,
    /// Samples per second.
    pub rate: Rate,
    /// Most channels of anything that is heard.
    pub channels: usize,
}

/// The nodes that are heard: those without outputs that take audio.
fn heard(graph: &Graph) -> Vec<Heard> {
    let audio = OfItem::<f32>::INFO;
    let is_audio = |link: &Link| match graph.nodes[link.node].ty.outputs[link.port].kind {
        PortKind::Stream(item) => (item.id)() == (audio.id)(),
        _ => false,
    };
    let sinks = (0..graph.nodes.len()).filter(|&n| graph.nodes[n].ty.outputs.is_empty());
    sinks
        .filter_map(|sink| {
            let link = graph.nodes[sink].links.iter().flatten().find(|l| is_audio(l))?.clone();
            Some(Heard { sink, id: graph.nodes[sink].id.clone(), link })
        })
        .collect()
}

impl Draft {
    /// Shapes a graph that is to play with buffers of at most `memory` bytes.
    ///
    /// # Errors
    /// Every reason found why it cannot: as [`Plan::new`], nothing to hear, several rates, nodes that run offline only.
    pub fn new(graph: &Graph, files: &dyn Files, memory: usize) -> Result<Self, Vec<Diagnostic>> {
        let shaped = schedule::shape_all(graph, files);
        if !shaped.errors.is_empty() {
            return Err(shaped.errors);
        }
        Self::of_shapes(graph, shaped.shapes, memory)
    }

    /// As [`Draft::new`], for a graph whose shapes are known.
    ///
    /// # Errors
    /// As [`Draft::new`], but for those of the shapes.
    pub fn of_shapes(graph: &Graph, shapes: Vec<NodeShape>, memory: usize) -> Result<Self, Vec<Diagnostic>> {
        let heard = heard(graph);
        let mut errors = Vec::new();
        let Some(first) = heard.first() else {
            let none = Diagnostic::general("F052", "the graph has nothing to hear");
            return Err(vec![none.help("add a WavOut: in a live run its sound goes to the device")]);
        };
        let rate_of = |h: &Heard| shapes[h.link.node].outputs[h.link.port].as_ref().map(|s| s.rate);
        let rate = rate_of(first).unwrap_or(Rate::hz(48_000));
        for other in heard.iter().filter(|h| rate_of(h) != Some(rate)) {
            let found = rate_of(other).map_or_else(String::new, |r| r.to_string());
            let message = format!("`{}` runs at {found}, `{}` at {rate}", other.id, first.id);
            let wanted = format!("put Resample(rate: {rate}) before it").replace(" Hz", "");
            let place = graph.nodes[other.sink].place.clone();
            errors.push(Diagnostic::error("F045", message, place).node(&other.id).help(wanted));
        }
        let ends: Vec<usize> = heard.iter().map(|h| h.link.node).collect();
        let split = phases::split_live(graph, &ends);
        errors.extend(offline_only(graph, &split.nodes));
        let prelude = prelude(graph, shapes, &split, memory)?;
        if !errors.is_empty() {
            return Err(errors);
        }
        let widths = heard.iter().filter_map(|h| prelude.shapes[h.link.node].outputs[h.link.port].as_ref());
        let channels = widths.map(|s| s.width).max().unwrap_or(1);
        Ok(Self { prelude, nodes: split.nodes, heard, rate, channels })
    }

    /// Lays the graph out in windows of `window` ticks, from where it takes over.
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
        resume: &Resume,
        sinks: &SinksResume,
    ) -> Result<LivePlan, Vec<Diagnostic>> {
        let Self { prelude, nodes, heard, rate, channels } = self;
        let shapes = &prelude.shapes;
        let longest = schedule::longest_window(graph, shapes, &nodes)?;
        if longest < window {
            return Err(vec![short_loop(longest, window)]);
        }
        let delays = schedule::delays(graph, shapes, &nodes, window, resume);
        let behind = |h: &Heard| delays.of[h.link.node] + shapes[h.link.node].lag;
        // What is heard together has to be as late as the latest of it.
        let delay = heard.iter().map(behind).max().unwrap_or(0).max(sinks.delay);
        let taps: Vec<TapPlan> = (0..)
            .zip(&heard)
            .map(|(tap, h)| {
                let from = sinks.kept.get(&h.id).copied().unwrap_or((resume.at - delay).max(0));
                TapPlan { tap, node: h.link.node, port: h.link.port, delay, from }
            })
            .collect();
        let ends: Option<Vec<Tick>> = heard.iter().map(|h| shapes[h.link.node].end).collect();
        let end = ends.and_then(|ends| ends.into_iter().max()).map(|end| end + delay);
        let parts =
            Parts { graph, shapes, nodes: &nodes, delays: &delays, taps: &taps, duration: ENDLESS, window };
        let (region_of, count) = cut(graph, &nodes, &taps);
        let mut regions = layout::regions(&parts, &region_of);
        regions.resize_with(count, Region::default);
        let bytes = regions.iter().map(Region::bytes).sum();
        show::within(prelude.limit, bytes, graph, shapes, regions.iter())?;
        Ok(LivePlan {
            limit: prelude.limit,
            prelude,
            nodes,
            delays,
            regions,
            heard,
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
    let ms = |t: Tick| foley_nodes::core::time::seconds(t) * 1e3;
    let message = format!(
        "a feedback loop of {:.3} ms is shorter than the quantum of {:.3} ms",
        ms(longest),
        ms(window)
    );
    Diagnostic::general("F049", message).help("make the loop's delay longer, or give a smaller --quantum")
}

/// The passes that make folds, as a plan of its own.
fn prelude(
    graph: &Graph,
    shapes: Vec<NodeShape>,
    split: &phases::LiveSplit,
    memory: usize,
) -> Result<Plan, Vec<Diagnostic>> {
    let options = PlanOptions { memory, ..PlanOptions::default() };
    let mut window = WINDOW;
    for nodes in &split.prelude {
        window = window.min(schedule::longest_window(graph, &shapes, nodes)?);
    }
    let mut passes = Vec::new();
    for nodes in split.prelude.iter().filter(|nodes| !nodes.is_empty()) {
        passes.push(Phase::new(graph, &shapes, nodes.clone(), &[], window, &options)?);
    }
    let bytes = passes.iter().map(|p| p.bytes).max().unwrap_or(0);
    show::within(memory, bytes, graph, &shapes, passes.iter().flat_map(|p| &p.regions))?;
    Ok(Plan {
        shapes,
        values: split.values.clone(),
        phases: passes,
        window,
        bytes,
        idle: Vec::new(),
        limit: options.memory,
    })
}

/// Refuses nodes that need more time or memory than playing leaves.
fn offline_only(graph: &Graph, nodes: &[usize]) -> Vec<Diagnostic> {
    let offline = nodes.iter().filter(|&&n| graph.nodes[n].ty.class == Class::Offline);
    offline
        .map(|&n| {
            let node = &graph.nodes[n];
            let message = format!("`{}` ({}) runs offline only", node.id, node.ty.name);
            Diagnostic::error("F053", message, node.place.clone())
                .node(&node.id)
                .help("render it with `foley run`, and play the file that it gives")
        })
        .collect()
}

/// The links of a node that carry streams or events.
fn streams(graph: &Graph, n: usize) -> impl Iterator<Item = &Link> {
    let node = &graph.nodes[n];
    let pairs = node.ty.inputs.iter().zip(&node.links);
    pairs.filter(|(spec, _)| !matches!(spec.kind, PortKind::Value(_))).flat_map(|(_, links)| links)
}

/// Which nodes run ahead of the callback: those that may not run in it, and all that they hear.
#[must_use]
pub fn ahead(graph: &Graph, nodes: &[usize]) -> Vec<bool> {
    let mut ahead = vec![false; graph.nodes.len()];
    let waits = |n: &&usize| graph.nodes[**n].ty.class != Class::Audio;
    let mut stack: Vec<usize> = nodes.iter().filter(waits).copied().collect();
    while let Some(n) = stack.pop() {
        if !std::mem::replace(&mut ahead[n], true) {
            stack.extend(streams(graph, n).map(|l| l.node));
        }
    }
    ahead
}

/// Which part each node is in: parts ahead of the callback first, the callback last.
fn cut(graph: &Graph, nodes: &[usize], taps: &[TapPlan]) -> (HashMap<What, usize>, usize) {
    let ahead = ahead(graph, nodes);
    // Nodes that are linked are in one part: the smallest node of it stands for it.
    let mut part: Vec<usize> = (0..graph.nodes.len()).collect();
    fn root(part: &[usize], mut n: usize) -> usize {
        while part[n] != n {
            n = part[n];
        }
        n
    }
    for &n in nodes.iter().filter(|&&n| ahead[n]) {
        for link in streams(graph, n) {
            let (a, b) = (root(&part, n), root(&part, link.node));
            part[a.max(b)] = a.min(b);
        }
    }
    let mut numbers = HashMap::new();
    let mut region_of = HashMap::new();
    for &n in nodes.iter().filter(|&&n| ahead[n]) {
        let next = numbers.len();
        let number = *numbers.entry(root(&part, n)).or_insert(next);
        region_of.insert(What::Node(n), number);
    }
    let last = numbers.len();
    region_of.extend(nodes.iter().filter(|&&n| !ahead[n]).map(|&n| (What::Node(n), last)));
    region_of.extend(taps.iter().map(|t| (What::Tap(t.tap), last)));
    (region_of, last + 1)
}
