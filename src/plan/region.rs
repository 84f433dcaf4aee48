//! Regions: nodes that one thread runs together, with their buffers, clocks and links to other regions.

use foley_nodes::core::buffer::Pad;
use foley_nodes::core::item::{EventType, ItemType};
use foley_nodes::core::stage::{Clock, InWire, OutWire};
use foley_nodes::core::time::Tick;

/// Windows by which a region may be ahead of the regions that read it.
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
        /// Items that it holds.
        capacity: usize,
        /// Items of padding before item 0.
        front: usize,
        /// Content of the padding.
        pad: Pad,
        /// Position of its first item.
        first: i64,
    },
    /// For events.
    Events {
        /// Their type.
        event: &'static EventType,
        /// Ticks that it holds.
        capacity: Tick,
        /// Its first tick.
        first: Tick,
    },
}

impl BufferPlan {
    fn bytes(&self) -> usize {
        match self {
            Self::Items { item, width, capacity, front, .. } => {
                (item.buffer_bytes)(*width, (*capacity).max(*front))
            }
            Self::Events { event, .. } => (event.buffer_bytes)(),
        }
    }
}

/// The source of one link of an input: for a value the node of the graph that gives it, and its output port.
pub type PlanInput = InWire<(usize, usize)>;

/// The destination of an output.
pub type PlanOutput = OutWire<()>;

/// A node of the graph, or the writer of a tap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Runnable {
    /// Node of the graph.
    Node(usize),
    /// Tap of the options.
    Tap(usize),
}

/// A runnable with its wires.
#[derive(Clone, Debug)]
pub struct PlanNode {
    /// The runnable.
    pub runnable: Runnable,
    /// Clock of its ticks.
    pub clock: usize,
    /// Links per input port.
    pub inputs: Vec<Vec<PlanInput>>,
    /// Outputs.
    pub outputs: Vec<PlanOutput>,
    /// Buffers that receive a copy of another: from, to, clock.
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
    /// Maximum number of items in one window.
    pub items: usize,
}

/// A buffer that another region fills.
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
    /// True if it reads or writes files.
    pub io: bool,
    /// Nodes and taps, in the order in which they run.
    pub nodes: Vec<PlanNode>,
    /// Its buffers.
    pub buffers: Vec<BufferPlan>,
    /// The output that feeds each buffer, as node and port.
    pub origins: Vec<(usize, usize)>,
    /// Its clocks.
    pub clocks: Vec<Clock>,
    /// Buffers that it sends.
    pub exports: Vec<Export>,
    /// Buffers that it receives.
    pub imports: Vec<Import>,
}

impl Region {
    /// Returns the bytes of its buffers and of the windows in transit to other regions.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let own: usize = self.buffers.iter().map(BufferPlan::bytes).sum();
        own + self.exports.iter().map(|e| self.bytes_in_transit(e)).sum::<usize>()
    }

    /// Returns the bytes that one output takes in this region: its buffers, and the windows in transit to other regions.
    #[must_use]
    pub fn bytes_of(&self, node: usize, port: usize) -> usize {
        let of = |buffer: &usize| self.origins[*buffer] == (node, port);
        let own: usize = (0..self.buffers.len()).filter(of).map(|b| self.buffers[b].bytes()).sum();
        let exports = self.exports.iter().filter(|e| of(&e.buffer));
        own + exports.map(|e| self.bytes_in_transit(e)).sum::<usize>()
    }

    fn bytes_in_transit(&self, export: &Export) -> usize {
        match &self.buffers[export.buffer] {
            BufferPlan::Items { item, width, .. } => DEPTH * (item.buffer_bytes)(*width, export.items),
            BufferPlan::Events { event, .. } => DEPTH * (event.buffer_bytes)(),
        }
    }

    pub(super) fn add_buffer(&mut self, buffer: BufferPlan, origin: (usize, usize)) -> usize {
        self.buffers.push(buffer);
        self.origins.push(origin);
        self.buffers.len() - 1
    }

    pub(super) fn add_clock(&mut self, clock: Clock) -> usize {
        self.clocks.iter().position(|c| *c == clock).unwrap_or_else(|| {
            self.clocks.push(clock);
            self.clocks.len() - 1
        })
    }
}
