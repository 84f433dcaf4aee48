//! Lays out the buffers and clocks of the regions of a phase, and wires their nodes.

use super::delays::Delays;
use super::region::{BufferPlan, Export, Import, PlanInput, PlanNode, PlanOutput, Region, Runnable};
use crate::graph::{Graph, Link};
use foley_nodes::core::buffer::Pad;
use foley_nodes::core::node::Class;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::{Ends, Lookaround, NodeShape};
use foley_nodes::core::stage::{Clock, max_items};
use foley_nodes::core::time::{Rate, Tick};
use std::collections::HashMap;

/// An output that is written to a file, or played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TapPlan {
    /// Its number.
    pub tap: usize,
    /// The node whose output it is.
    pub node: usize,
    /// The output port.
    pub port: usize,
    /// Delay behind the run, ticks.
    pub delay: Tick,
    /// Its first tick.
    pub from: Tick,
}

/// A phase with the delays of its nodes.
pub struct Schedule<'a> {
    /// The graph.
    pub graph: &'a Graph,
    /// Shapes of its nodes.
    pub shapes: &'a [NodeShape],
    /// The nodes to lay out, in topological order.
    pub nodes: &'a [usize],
    /// Delay of each node.
    pub delays: &'a Delays,
    /// Outputs to write.
    pub taps: &'a [TapPlan],
    /// End of streams that have no end of their own.
    pub duration: Tick,
    /// Length of one window.
    pub window: Tick,
}

/// Lays out the regions of a partition.
pub fn wire(schedule: &Schedule<'_>, region_of: &HashMap<Runnable, usize>) -> Vec<Region> {
    let Schedule { graph, shapes, nodes, delays, taps, duration, window } = *schedule;
    let mut readers_of: HashMap<_, Vec<_>> = HashMap::new();
    for &v in nodes {
        for (port, links) in graph.nodes[v].links.iter().enumerate() {
            for (index, link) in links.iter().enumerate() {
                readers_of.entry((link.node, link.port)).or_default().push((v, port, index));
            }
        }
    }
    let mut wiring =
        Wiring { graph, shapes, delays, duration, window, regions: Vec::new(), links: 0, readers_of };
    let count = region_of.values().max().map_or(0, |m| m + 1);
    wiring.regions.resize_with(count, Region::default);
    let mut position: HashMap<Runnable, (usize, usize)> = HashMap::new();
    let nodes_and_taps =
        nodes.iter().map(|&n| Runnable::Node(n)).chain(taps.iter().map(|t| Runnable::Tap(t.tap)));
    for runnable in nodes_and_taps {
        let region = region_of[&runnable];
        let node = wiring.plan_node(runnable, taps, region);
        wiring.regions[region].nodes.push(node);
        position.insert(runnable, (region, wiring.regions[region].nodes.len() - 1));
        wiring.regions[region].io = match runnable {
            Runnable::Node(n) => graph.nodes[n].ty.class == Class::Io,
            Runnable::Tap(_) => true,
        };
    }
    for &n in nodes {
        for port in 0..graph.nodes[n].ty.outputs.len() {
            wiring.wire_output(n, port, taps, region_of, &position);
        }
    }
    wiring.regions
}

/// One reader of an output, with the history and the padding that it needs.
struct Reader {
    runnable: Runnable,
    port: usize,
    /// Index of the link in its input.
    index: usize,
    pad: Pad,
    /// Items of padding before item 0.
    front: usize,
    /// History in ticks, for events.
    ticks: Tick,
    /// History in items, for streams.
    items: usize,
}

struct Wiring<'g> {
    graph: &'g Graph,
    shapes: &'g [NodeShape],
    delays: &'g Delays,
    duration: Tick,
    window: Tick,
    regions: Vec<Region>,
    links: usize,
    /// The links that read each output: node, input port, index in the input.
    readers_of: HashMap<(usize, usize), Vec<(usize, usize, usize)>>,
}

impl Wiring<'_> {
    fn end(&self, n: usize) -> Option<Tick> {
        Some(self.shapes[n].end.unwrap_or(self.duration))
    }

    /// A node or tap with its clocks; the buffers of its inputs and outputs follow when outputs are wired.
    fn plan_node(&mut self, runnable: Runnable, taps: &[TapPlan], region: usize) -> PlanNode {
        match runnable {
            Runnable::Tap(k) => {
                let tap = taps.iter().find(|t| t.tap == k);
                let (n, delay, from) = tap.map_or((0, 0, 0), |t| (t.node, t.delay, t.from));
                let clock = Clock { rate: None, delay, end: self.end(n), from };
                let clock = self.regions[region].add_clock(clock);
                PlanNode {
                    runnable,
                    clock,
                    inputs: vec![Vec::new()],
                    outputs: Vec::new(),
                    copies: Vec::new(),
                }
            }
            Runnable::Node(n) => {
                let node = &self.graph.nodes[n];
                let (delay, from) = (self.delays.of[n], self.delays.from[n]);
                let clock = Clock::of_node(delay, self.shapes[n].lag, self.end(n), from);
                let clock = self.regions[region].add_clock(clock);
                // Links of streams are replaced when the output that feeds them gets its buffer.
                let value = |l: &Link| PlanInput::Value((l.node, l.port));
                let inputs = node.links.iter().map(|links| links.iter().map(value).collect());
                let outputs = vec![PlanOutput::Value(()); node.ty.outputs.len()];
                PlanNode { runnable, clock, inputs: inputs.collect(), outputs, copies: Vec::new() }
            }
        }
    }

    /// Assigns a buffer to an output, and separate buffers to readers in other regions or with another pad rule.
    fn wire_output(
        &mut self,
        u: usize,
        port: usize,
        taps: &[TapPlan],
        region_of: &HashMap<Runnable, usize>,
        position: &HashMap<Runnable, (usize, usize)>,
    ) {
        let kind = self.graph.nodes[u].ty.outputs[port].kind;
        if matches!(kind, PortKind::Value(_) | PortKind::Fold(_)) {
            return;
        }
        let (region, index) = position[&Runnable::Node(u)];
        let stream = self.shapes[u].outputs[port].clone();
        let rate = stream.as_ref().map(|s| s.rate);
        let width = stream.as_ref().map_or(1, |s| s.width);
        let (delay, lag, from) = (self.delays.of[u], self.shapes[u].lag, self.delays.from[u]);
        let writer = Clock::of_output(rate, delay, lag, self.end(u), from);
        let first = writer.first_position();
        let readers = self.readers(u, port, taps, writer.delay, rate);
        // One buffer per region and pad rule; the node writes the first of its own region directly.
        let mut groups: Vec<(usize, Pad, Vec<Reader>)> = Vec::new();
        for reader in readers {
            let key = (region_of[&reader.runnable], reader.pad);
            match groups.iter_mut().find(|(r, p, _)| (*r, *p) == key) {
                Some((_, _, group)) => group.push(reader),
                None => groups.push((key.0, key.1, vec![reader])),
            }
        }
        let window_items = rate.map_or(0, |r| max_items(r, self.window));
        let window = self.window;
        let buffer_for = |group: &[Reader]| {
            let front = group.iter().map(|r| r.front).max().unwrap_or(0);
            let pad = group.first().map_or(Pad::Silence, |r| r.pad);
            match kind {
                PortKind::Stream(item) => {
                    let capacity = group.iter().map(|r| r.items).max().unwrap_or(0).max(window_items);
                    BufferPlan::Items { item, width, capacity, front, pad, first }
                }
                PortKind::Events(event) => {
                    let capacity = group.iter().map(|r| r.ticks).max().unwrap_or(0).max(window);
                    BufferPlan::Events { event, capacity, first }
                }
                PortKind::Value(_) | PortKind::Fold(_) => unreachable!("values have no buffers"),
            }
        };
        groups.sort_by_key(|(r, p, _)| (*r != region, *p == Pad::Hold, *r));
        let own = groups.first().is_some_and(|(r, _, _)| *r == region);
        let written = if own { buffer_for(&groups[0].2) } else { buffer_for(&[]) };
        let written = self.regions[region].add_buffer(written, (u, port));
        let clock = self.regions[region].add_clock(writer);
        self.regions[region].nodes[index].outputs[port] = match rate {
            Some(rate) => PlanOutput::Stream { buffer: written, clock, width, rate },
            None => PlanOutput::Events { buffer: written, clock },
        };
        for (k, (reader_region, _, group)) in groups.iter().enumerate() {
            let buffer = if k == 0 && own {
                written
            } else {
                let buffer = self.regions[*reader_region].add_buffer(buffer_for(group), (u, port));
                if *reader_region == region {
                    self.regions[region].nodes[index].copies.push((written, buffer, clock));
                } else {
                    let link = self.links;
                    self.links += 1;
                    let export = Export { link, buffer: written, clock, items: window_items };
                    self.regions[region].exports.push(export);
                    let clock = self.regions[*reader_region].add_clock(writer);
                    let import = Import { link, from: region, buffer, clock };
                    self.regions[*reader_region].imports.push(import);
                }
                buffer
            };
            for reader in group {
                self.attach(reader, buffer, rate, width, position);
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
        let items = |ticks: Tick| rate.map_or(0, |r| max_items(r, ticks));
        let mut readers = Vec::new();
        for &(v, in_port, index) in self.readers_of.get(&(u, port)).into_iter().flatten() {
            let lookaround = self.shapes[v].lookaround[in_port];
            let ticks = self.delays.of[v] - written + self.window + self.delays.early[u];
            let (behind, delay) = (lookaround.behind, lookaround.delay);
            readers.push(Reader {
                runnable: Runnable::Node(v),
                port: in_port,
                index,
                pad: if lookaround.ends == Ends::Hold { Pad::Hold } else { Pad::Silence },
                front: if rate.is_some() { behind + delay } else { 0 },
                ticks: ticks + behind as Tick,
                items: items(ticks) + behind + delay,
            });
        }
        for tap in taps.iter().filter(|t| (t.node, t.port) == (u, port)) {
            let ticks = tap.delay - written + self.window + self.delays.early[u];
            readers.push(Reader {
                runnable: Runnable::Tap(tap.tap),
                port: 0,
                index: 0,
                pad: Pad::Silence,
                front: 0,
                ticks,
                items: items(ticks),
            });
        }
        readers
    }

    /// Wires an input to a buffer of its region.
    fn attach(
        &mut self,
        reader: &Reader,
        buffer: usize,
        rate: Option<Rate>,
        width: usize,
        position: &HashMap<Runnable, (usize, usize)>,
    ) {
        let (region, node) = position[&reader.runnable];
        let lookaround = match reader.runnable {
            Runnable::Node(v) => self.shapes[v].lookaround[reader.port],
            Runnable::Tap(_) => Lookaround::default(),
        };
        let region = &mut self.regions[region];
        let clock = region.clocks[region.nodes[node].clock].at_rate(rate);
        let clock = region.add_clock(clock);
        let Lookaround { behind, ahead, delay, .. } = lookaround;
        let wire = match rate {
            Some(rate) => PlanInput::Stream { buffer, clock, behind, ahead, delay, width, rate },
            None => PlanInput::Events { buffer, clock, behind: behind as Tick, ahead: ahead as Tick },
        };
        let links = &mut region.nodes[node].inputs[reader.port];
        match links.get_mut(reader.index) {
            Some(link) => *link = wire,
            None => links.push(wire),
        }
    }
}
