//! Cuts a phase into regions that run in parallel, and lays out their buffers and clocks.

use super::schedule::{Delays, closes_loop};
use crate::graph::{Graph, Link};
use foley_nodes::core::buffer::Pad;
use foley_nodes::core::item::{EventType, ItemType};
use foley_nodes::core::node::Class;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::{Ends, NodeShape};
use foley_nodes::core::stage::Clock;
use foley_nodes::core::time::{Rate, Tick};
use std::collections::HashMap;

/// Windows that a region may be ahead of those that read it.
pub const DEPTH: usize = 4;

/// A buffer to make.
#[derive(Clone, Debug)]
pub enum BufferPlan {
    /// For items.
    Items {
        /// Their type.
        item: &'static ItemType,
        /// Elements per item.
        width: usize,
        /// Items that are kept.
        span: usize,
        /// Padding before item 0.
        front: usize,
        /// What the padding is.
        pad: Pad,
        /// Position of its first item.
        at: i64,
    },
    /// For events.
    Events {
        /// Their type.
        event: &'static EventType,
        /// Ticks that are kept.
        span: Tick,
        /// Its first tick.
        at: Tick,
    },
}

impl BufferPlan {
    fn bytes(&self) -> usize {
        match self {
            Self::Items { item, width, span, front, .. } => (item.buffer_bytes)(*width, (*span).max(*front)),
            Self::Events { event, .. } => (event.buffer_bytes)(),
        }
    }
}

/// Where a link of an input comes from.
#[derive(Clone, Debug)]
pub enum PlanIn {
    /// A stream in a buffer of the region.
    Stream {
        /// Buffer.
        buffer: usize,
        /// Clock of the reader.
        clock: usize,
        /// Items before the window.
        behind: usize,
        /// Items after the window.
        ahead: usize,
        /// Items by which it is read late.
        delay: usize,
        /// Elements per item.
        width: usize,
        /// Items per second.
        rate: Rate,
    },
    /// Events in a buffer of the region.
    Events {
        /// Buffer.
        buffer: usize,
        /// Clock of the reader.
        clock: usize,
        /// Ticks before the window.
        behind: Tick,
        /// Ticks after the window.
        ahead: Tick,
    },
    /// A value of another node.
    Value {
        /// Node of the graph.
        node: usize,
        /// Its output port.
        port: usize,
    },
}

/// Where an output goes.
#[derive(Clone, Debug)]
pub enum PlanOut {
    /// A stream into a buffer of the region.
    Stream {
        /// Buffer.
        buffer: usize,
        /// Clock of the writer.
        clock: usize,
        /// Elements per item.
        width: usize,
        /// Items per second.
        rate: Rate,
    },
    /// Events into a buffer of the region.
    Events {
        /// Buffer.
        buffer: usize,
        /// Clock of the writer.
        clock: usize,
    },
    /// A value.
    Value,
}

/// What runs: a node of the graph, or the writer of a tap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum What {
    /// Node of the graph.
    Node(usize),
    /// Tap of the options.
    Tap(usize),
}

/// One job with its wires.
#[derive(Clone, Debug)]
pub struct PlanNode {
    /// What runs.
    pub job: What,
    /// Clock of its ticks.
    pub clock: usize,
    /// Links per input port.
    pub inputs: Vec<Vec<PlanIn>>,
    /// Outputs.
    pub outputs: Vec<PlanOut>,
    /// Buffers that get a copy of another: from, to, clock.
    pub copies: Vec<(usize, usize, usize)>,
}

/// A buffer whose windows are sent to another region.
#[derive(Clone, Debug)]
pub struct Export {
    /// Number of the link between regions.
    pub link: usize,
    /// Buffer.
    pub buffer: usize,
    /// Clock of the writer.
    pub clock: usize,
    /// Items of one window at most.
    pub items: usize,
}

/// A buffer that is filled by another region.
#[derive(Clone, Debug)]
pub struct Import {
    /// Number of the link between regions.
    pub link: usize,
    /// The region that fills it.
    pub from: usize,
    /// Buffer.
    pub buffer: usize,
    /// Clock of the writer.
    pub clock: usize,
}

/// A part of a phase that one thread runs at a time.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Whether it waits for files rather than computes.
    pub io: bool,
    /// What it runs, in order.
    pub nodes: Vec<PlanNode>,
    /// Its buffers.
    pub buffers: Vec<BufferPlan>,
    /// The output, as node and port, behind each buffer.
    pub origins: Vec<(usize, usize)>,
    /// Its clocks.
    pub clocks: Vec<Clock>,
    /// What it sends.
    pub exports: Vec<Export>,
    /// What it gets.
    pub imports: Vec<Import>,
}

impl Region {
    /// Bytes in its buffers and in those on their way to other regions.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let own: usize = self.buffers.iter().map(BufferPlan::bytes).sum();
        own + self.exports.iter().map(|e| self.sent(e)).sum::<usize>()
    }

    /// Bytes behind one output in this region: its buffers, and what is on its way to other regions.
    #[must_use]
    pub fn bytes_of(&self, node: usize, port: usize) -> usize {
        let of = |buffer: &usize| self.origins[*buffer] == (node, port);
        let own: usize = (0..self.buffers.len()).filter(of).map(|t| self.buffers[t].bytes()).sum();
        own + self.exports.iter().filter(|e| of(&e.buffer)).map(|e| self.sent(e)).sum::<usize>()
    }

    fn sent(&self, export: &Export) -> usize {
        match &self.buffers[export.buffer] {
            BufferPlan::Items { item, width, .. } => DEPTH * (item.buffer_bytes)(*width, export.items),
            BufferPlan::Events { event, .. } => DEPTH * (event.buffer_bytes)(),
        }
    }

    fn buffer(&mut self, buffer: BufferPlan, origin: (usize, usize)) -> usize {
        self.buffers.push(buffer);
        self.origins.push(origin);
        self.buffers.len() - 1
    }

    fn clock(&mut self, clock: Clock) -> usize {
        self.clocks.iter().position(|c| *c == clock).unwrap_or_else(|| {
            self.clocks.push(clock);
            self.clocks.len() - 1
        })
    }
}

/// One reader of an output: which job, what it needs of its history, and how it wants the ends padded.
struct Reader {
    job: What,
    port: usize,
    place: usize,
    pad: Pad,
    front: usize,
    span: Tick,
    items: usize,
}

/// An output that is written to a file, or heard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TapPlan {
    /// Its number.
    pub tap: usize,
    /// The node whose output it is.
    pub node: usize,
    /// The output port.
    pub port: usize,
    /// How far behind the run it works.
    pub delay: Tick,
    /// Its first tick.
    pub from: Tick,
}

/// What regions are made of.
pub struct Parts<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Shapes of its nodes.
    pub shapes: &'a [NodeShape],
    /// The nodes to lay out, in topological order.
    pub nodes: &'a [usize],
    /// How far behind the run each works.
    pub delays: &'a Delays,
    /// Outputs to write.
    pub taps: &'a [TapPlan],
    /// When streams end that have no end of their own.
    pub duration: Tick,
    /// Length of one window.
    pub window: Tick,
}

/// Lays out the parts that `region_of` says.
pub fn regions(parts: &Parts<'_>, region_of: &HashMap<What, usize>) -> Vec<Region> {
    let Parts { graph, shapes, nodes, delays, taps, duration, window } = *parts;
    let mut readers_of: HashMap<_, Vec<_>> = HashMap::new();
    for &v in nodes {
        for (port, links) in graph.nodes[v].links.iter().enumerate() {
            for (place, link) in links.iter().enumerate() {
                readers_of.entry((link.node, link.port)).or_default().push((v, port, place));
            }
        }
    }
    let mut layout =
        Layout { graph, shapes, delays, duration, window, regions: Vec::new(), links: 0, readers_of };
    let count = region_of.values().max().map_or(0, |m| m + 1);
    layout.regions.resize_with(count, Region::default);
    let mut at: HashMap<What, (usize, usize)> = HashMap::new();
    let jobs = nodes.iter().map(|&n| What::Node(n)).chain(taps.iter().map(|t| What::Tap(t.tap)));
    for job in jobs {
        let region = region_of[&job];
        let node = layout.job(job, taps, region);
        layout.regions[region].nodes.push(node);
        at.insert(job, (region, layout.regions[region].nodes.len() - 1));
        if let What::Node(n) = job {
            layout.regions[region].io = graph.nodes[n].ty.class == Class::Io;
        } else {
            layout.regions[region].io = true;
        }
    }
    for &n in nodes {
        for port in 0..graph.nodes[n].ty.outputs.len() {
            layout.wire(n, port, taps, region_of, &at);
        }
    }
    layout.regions
}

/// Cuts the topological order into parts of about equal work, none of them less than `worth`; readers and writers of files
/// stand alone.
pub fn cut(parts: &Parts<'_>, threads: usize, worth: f64) -> HashMap<What, usize> {
    let Parts { graph, shapes, nodes, taps, window, .. } = *parts;
    let work = |n: usize| {
        let ty = &graph.nodes[n].ty;
        let per_window = |rate: Rate, width: usize| rate.first_at(window) as f64 * width as f64;
        let outs = shapes[n].outputs.iter().flatten().map(|s| per_window(s.rate, s.width));
        let ins = graph.nodes[n].links.iter().flatten().filter_map(|l| {
            let s = shapes[l.node].outputs.get(l.port)?.as_ref()?;
            Some(per_window(s.rate, s.width))
        });
        30.0 + ty.cost * outs.fold(0.0, f64::max).max(ins.fold(0.0, f64::max))
    };
    let inner: Vec<usize> = nodes.iter().copied().filter(|&n| graph.nodes[n].ty.class != Class::Io).collect();
    let total: f64 = inner.iter().map(|&n| work(n)).sum();
    let parts = if threads < 2 { 1.0 } else { (total / worth).floor().clamp(1.0, 2.0 * threads as f64) };
    // A loop must not be cut: no boundary between the node that closes it and the end of the loop.
    let mut open_until = 0;
    let mut region_of = HashMap::new();
    let (mut region, mut sum, mut begin) = (0, 0.0, 0.0);
    for (k, &n) in inner.iter().enumerate() {
        let w = work(n);
        let due = sum + w / 2.0 > total * (region + 1) as f64 / parts;
        if due && k > open_until && sum - begin >= worth && total - sum >= worth {
            region += 1;
            begin = sum;
        }
        sum += w;
        region_of.insert(What::Node(n), region);
        for link in graph.nodes[n].links.iter().flatten().filter(|l| closes_loop(graph, n, l)) {
            let end = inner.iter().position(|&m| m == link.node).unwrap_or(0);
            open_until = open_until.max(end);
        }
    }
    let first = if inner.is_empty() { 0 } else { region + 1 };
    let alone = nodes.iter().filter(|&&n| graph.nodes[n].ty.class == Class::Io).map(|&n| What::Node(n));
    region_of.extend(alone.chain(taps.iter().map(|t| What::Tap(t.tap))).zip(first..));
    region_of
}

/// The most items in any span of `ticks`, exactly: [`Rate::first_at`] rounds up, and a sum that is rounded up is never more
/// than the sum of what is rounded up.
fn most_items(rate: Rate, ticks: Tick) -> usize {
    rate.first_at(ticks.max(0)) as usize
}

struct Layout<'g> {
    graph: &'g Graph,
    shapes: &'g [NodeShape],
    delays: &'g Delays,
    duration: Tick,
    window: Tick,
    regions: Vec<Region>,
    links: usize,
    /// For each output the links that read it: node, input port, place in its list.
    readers_of: HashMap<(usize, usize), Vec<(usize, usize, usize)>>,
}

impl Layout<'_> {
    fn end(&self, n: usize) -> Option<Tick> {
        Some(self.shapes[n].end.unwrap_or(self.duration))
    }

    /// A job with its clocks; the buffers of its inputs and outputs follow when outputs are wired.
    fn job(&mut self, job: What, taps: &[TapPlan], region: usize) -> PlanNode {
        match job {
            What::Tap(k) => {
                let tap = taps.iter().find(|t| t.tap == k);
                let (n, delay, from) = tap.map_or((0, 0, 0), |t| (t.node, t.delay, t.from));
                let end = self.end(n);
                let clock = self.regions[region].clock(Clock { rate: None, delay, end, from });
                PlanNode { job, clock, inputs: vec![Vec::new()], outputs: Vec::new(), copies: Vec::new() }
            }
            What::Node(n) => {
                let node = &self.graph.nodes[n];
                // What lags comes after the end of what it is made of: the node works on until all of it is out.
                let end = self.end(n).map(|end| end.saturating_add(self.shapes[n].lag));
                let delay = self.delays.of[n];
                let from = self.delays.from[n];
                let clock = self.regions[region].clock(Clock { rate: None, delay, end, from });
                // Links of streams are replaced when the output that they come from gets its buffer.
                let value = |l: &Link| PlanIn::Value { node: l.node, port: l.port };
                let inputs = node.links.iter().map(|links| links.iter().map(value).collect());
                let outputs = vec![PlanOut::Value; node.ty.outputs.len()];
                PlanNode { job, clock, inputs: inputs.collect(), outputs, copies: Vec::new() }
            }
        }
    }

    /// Gives an output its buffer, and a buffer of their own to readers in other regions or with another pad rule.
    fn wire(
        &mut self,
        u: usize,
        port: usize,
        taps: &[TapPlan],
        region_of: &HashMap<What, usize>,
        at: &HashMap<What, (usize, usize)>,
    ) {
        let kind = self.graph.nodes[u].ty.outputs[port].kind;
        if matches!(kind, PortKind::Value(_) | PortKind::Fold(_)) {
            return;
        }
        let (region, place) = at[&What::Node(u)];
        let lag = self.shapes[u].lag;
        let written = self.delays.of[u] + lag;
        let stream = self.shapes[u].outputs[port].clone();
        let rate = stream.as_ref().map(|s| s.rate);
        let width = stream.as_ref().map_or(1, |s| s.width);
        let from = (self.delays.from[u] - lag).max(0);
        let writer = Clock { rate, delay: written, end: self.end(u), from };
        let at_first = writer.position(writer.from);
        let readers = self.readers(u, port, taps, written, rate);
        // One buffer per region and pad rule; the first in the writer's own region is written directly.
        let mut groups: Vec<(usize, Pad, Vec<Reader>)> = Vec::new();
        for reader in readers {
            let key = (region_of[&reader.job], reader.pad);
            match groups.iter_mut().find(|(r, p, _)| (*r, *p) == key) {
                Some((_, _, group)) => group.push(reader),
                None => groups.push((key.0, key.1, vec![reader])),
            }
        }
        let window_items = rate.map_or(0, |r| most_items(r, self.window));
        let window = self.window;
        let buffer_for = |group: &[Reader]| {
            let front = group.iter().map(|r| r.front).max().unwrap_or(0);
            let pad = group.first().map_or(Pad::Silence, |r| r.pad);
            match kind {
                PortKind::Stream(item) => {
                    let span = group.iter().map(|r| r.items).max().unwrap_or(0).max(window_items);
                    BufferPlan::Items { item, width, span, front, pad, at: at_first }
                }
                PortKind::Events(event) => {
                    let span = group.iter().map(|r| r.span).max().unwrap_or(0).max(window);
                    BufferPlan::Events { event, span, at: at_first }
                }
                PortKind::Value(_) | PortKind::Fold(_) => unreachable!("values have no buffers"),
            }
        };
        groups.sort_by_key(|(r, p, _)| (*r != region, *p == Pad::Hold, *r));
        let own = groups.first().is_some_and(|(r, _, _)| *r == region);
        let first = if own { buffer_for(&groups[0].2) } else { buffer_for(&[]) };
        let written = self.regions[region].buffer(first, (u, port));
        let clock = self.regions[region].clock(writer);
        self.regions[region].nodes[place].outputs[port] = match rate {
            Some(rate) => PlanOut::Stream { buffer: written, clock, width, rate },
            None => PlanOut::Events { buffer: written, clock },
        };
        for (k, (reader_region, _, group)) in groups.iter().enumerate() {
            let buffer = if k == 0 && own {
                written
            } else {
                let buffer = self.regions[*reader_region].buffer(buffer_for(group), (u, port));
                if *reader_region == region {
                    self.regions[region].nodes[place].copies.push((written, buffer, clock));
                } else {
                    let link = self.links;
                    self.links += 1;
                    self.regions[region].exports.push(Export {
                        link,
                        buffer: written,
                        clock,
                        items: window_items,
                    });
                    let there = self.regions[*reader_region].clock(writer);
                    let import = Import { link, from: region, buffer, clock: there };
                    self.regions[*reader_region].imports.push(import);
                }
                buffer
            };
            for reader in group {
                self.attach(reader, buffer, rate, width, at);
            }
        }
    }

    fn readers(
        &self,
        u: usize,
        port: usize,
        taps: &[TapPlan],
        written: Tick,
        rate: Option<Rate>,
    ) -> Vec<Reader> {
        let items = |ticks: Tick| rate.map_or(0, |r| most_items(r, ticks));
        let mut readers = Vec::new();
        for &(v, in_port, place) in self.readers_of.get(&(u, port)).into_iter().flatten() {
            let lookaround = self.shapes[v].lookaround[in_port];
            let distance = self.delays.of[v] - written + self.window + self.delays.early[u];
            let (behind, late) = (lookaround.behind, lookaround.delay);
            readers.push(Reader {
                job: What::Node(v),
                port: in_port,
                place,
                pad: if lookaround.ends == Ends::Hold { Pad::Hold } else { Pad::Silence },
                front: if rate.is_some() { behind + late } else { 0 },
                span: distance + behind as Tick,
                items: items(distance) + behind + late,
            });
        }
        for tap in taps.iter().filter(|t| (t.node, t.port) == (u, port)) {
            let behind = tap.delay - written + self.window + self.delays.early[u];
            readers.push(Reader {
                job: What::Tap(tap.tap),
                port: 0,
                place: 0,
                pad: Pad::Silence,
                front: 0,
                span: behind,
                items: items(behind),
            });
        }
        readers
    }

    fn attach(
        &mut self,
        reader: &Reader,
        buffer: usize,
        rate: Option<Rate>,
        width: usize,
        at: &HashMap<What, (usize, usize)>,
    ) {
        let (region, place) = at[&reader.job];
        let (n, late) = match reader.job {
            What::Node(v) => (Some(v), self.shapes[v].lookaround[reader.port]),
            What::Tap(_) => (None, foley_nodes::core::shape::Lookaround::default()),
        };
        let own = self.regions[region].clocks[self.regions[region].nodes[place].clock];
        let delay = n.map_or(own.delay, |v| self.delays.of[v]);
        let clock = self.regions[region].clock(Clock { rate, delay, end: own.end, from: own.from });
        let wire = match rate {
            Some(rate) => {
                let (behind, ahead, delay) = (late.behind, late.ahead, late.delay);
                PlanIn::Stream { buffer, clock, behind, ahead, delay, width, rate }
            }
            None => PlanIn::Events { buffer, clock, behind: late.behind as Tick, ahead: late.ahead as Tick },
        };
        let links = &mut self.regions[region].nodes[place].inputs[reader.port];
        match links.get_mut(reader.place) {
            Some(link) => *link = wire,
            None => links.push(wire),
        }
    }
}
