//! Context of a node in one window: the wires of its ports, and the windows on the clocks of their streams.

use crate::core::buffer::{AnyBuffer, BoxedBuffer};
use crate::core::item::AnyValue;
use crate::core::time::{Rate, Tick};
use std::cell::RefCell;
use std::marker::PhantomData;

/// A buffer that one node writes and others read.
pub type BufferCell = RefCell<BoxedBuffer>;

/// Source of one link of an input; a plan has places of values in place of values.
#[derive(Clone, Debug)]
pub enum InWire<V = AnyValue> {
    /// A stream.
    Stream {
        /// Buffer number.
        buffer: usize,
        /// Clock number of the reader's window at the stream's rate.
        clock: usize,
        /// Items before the window that are shown.
        behind: usize,
        /// Items after the window that are shown.
        ahead: usize,
        /// Items by which the read is delayed.
        delay: usize,
        /// Elements per item.
        width: usize,
        /// Items per second.
        rate: Rate,
    },
    /// Events.
    Events {
        /// Buffer number.
        buffer: usize,
        /// Clock number of the reader's window.
        clock: usize,
        /// Ticks before the window that are shown.
        behind: Tick,
        /// Ticks after the window that are shown.
        ahead: Tick,
    },
    /// A value.
    Value(V),
}

impl<V> InWire<V> {
    /// The same link with its value found; `None` where there is none.
    pub fn with_value<W>(&self, find: impl FnOnce(&V) -> Option<W>) -> Option<InWire<W>> {
        Some(match *self {
            Self::Stream { buffer, clock, behind, ahead, delay, width, rate } => {
                InWire::Stream { buffer, clock, behind, ahead, delay, width, rate }
            }
            Self::Events { buffer, clock, behind, ahead } => InWire::Events { buffer, clock, behind, ahead },
            Self::Value(ref value) => InWire::Value(find(value)?),
        })
    }
}

/// Destination of an output; a plan has no room for values.
#[derive(Clone, Debug)]
pub enum OutWire<V = RefCell<Option<AnyValue>>> {
    /// A stream.
    Stream {
        /// Buffer number.
        buffer: usize,
        /// Clock number of the writer's window at the stream's rate.
        clock: usize,
        /// Elements per item.
        width: usize,
        /// Items per second.
        rate: Rate,
    },
    /// Events.
    Events {
        /// Buffer number.
        buffer: usize,
        /// Clock number of the writer's window.
        clock: usize,
    },
    /// A value, as soon as it exists.
    Value(V),
}

impl OutWire<()> {
    /// The same output with room for a value.
    #[must_use]
    pub fn with_room(&self) -> OutWire {
        match *self {
            Self::Stream { buffer, clock, width, rate } => OutWire::Stream { buffer, clock, width, rate },
            Self::Events { buffer, clock } => OutWire::Events { buffer, clock },
            Self::Value(()) => OutWire::Value(RefCell::default()),
        }
    }
}

/// Converts a window of the run to a range of items: items of `rate` (ticks if it is `None`), delayed by `delay`, until `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Clock {
    /// Items per second; `None` counts ticks.
    pub rate: Option<Rate>,
    /// Delay relative to the run.
    pub delay: Tick,
    /// Tick at which its stream ends.
    pub end: Option<Tick>,
    /// Its first tick: 0, or its start in a graph that plays already.
    pub from: Tick,
}

impl Clock {
    /// The position that a tick of the clock itself stands for.
    #[must_use]
    pub fn position(&self, tick: Tick) -> i64 {
        match self.rate {
            Some(rate) => rate.first_at(tick),
            None => tick,
        }
    }
}

/// One window on one clock.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Span {
    /// First position.
    pub from: i64,
    /// One behind the last position that exists.
    pub to: i64,
    /// One behind the last position, the stream's end ignored.
    pub full: i64,
    /// True for the first window.
    pub first: bool,
}

impl Span {
    /// Returns true if it needs no padding at the start or end of a stream.
    pub(in crate::core) fn steady(&self) -> bool {
        self.full == self.to && !self.first
    }
}

/// A window of the run, for a node.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    /// First tick.
    pub from: Tick,
    /// One behind the last tick.
    pub to: Tick,
    run: PhantomData<&'a ()>,
}

/// Data that all nodes of a stage share in one window.
#[derive(Clone, Copy)]
pub(in crate::core) struct Shared<'a> {
    pub(in crate::core) buffers: &'a [BufferCell],
    pub(in crate::core) spans: &'a [Span],
    pub(in crate::core) poison: bool,
    /// True if the streams have ended; items around the last window may be missing.
    pub(in crate::core) closing: bool,
}

/// Shared data without streams.
const NOTHING: &Shared<'static> = &Shared { buffers: &[], spans: &[], poison: false, closing: false };

/// Everything that the views of one node need to open.
#[derive(Clone, Copy)]
pub struct Cx<'a> {
    pub(in crate::core) shared: &'a Shared<'a>,
    pub(in crate::core) inputs: &'a [Vec<InWire>],
    pub(in crate::core) outputs: &'a [OutWire],
    pub(in crate::core) clock: usize,
}

impl<'a> Cx<'a> {
    #[inline(always)]
    pub(in crate::core) fn span(&self, clock: usize) -> Span {
        self.shared.spans[clock]
    }

    /// The wires of a node that has values only.
    #[must_use]
    pub fn for_values(inputs: &'a [Vec<InWire>], outputs: &'a [OutWire]) -> Self {
        Cx { shared: NOTHING, inputs, outputs, clock: 0 }
    }

    /// Reads the buffer behind one link without knowing its type, with the present window on it.
    pub fn raw_input<R>(&self, port: usize, read: impl FnOnce(&dyn AnyBuffer, Span) -> R) -> Option<R> {
        let (buffer, clock) = match self.inputs.get(port)?.first()? {
            InWire::Stream { buffer, clock, .. } | InWire::Events { buffer, clock, .. } => (*buffer, *clock),
            InWire::Value(_) => return None,
        };
        Some(read(self.shared.buffers[buffer].borrow().any(), self.shared.spans[clock]))
    }

    /// Writes the buffer of one output without its type; the current window is to be appended.
    pub fn raw_output<R>(&self, port: usize, write: impl FnOnce(&mut dyn AnyBuffer, Span) -> R) -> Option<R> {
        let (buffer, clock) = match self.outputs.get(port)? {
            OutWire::Stream { buffer, clock, .. } | OutWire::Events { buffer, clock } => (*buffer, *clock),
            OutWire::Value(_) => return None,
        };
        Some(write(self.shared.buffers[buffer].borrow_mut().any_mut(), self.shared.spans[clock]))
    }

    /// The node's own window; empty for a node that has values only.
    #[inline(always)]
    #[must_use]
    pub fn window(&self) -> Window<'a> {
        let span = self.shared.spans.get(self.clock).copied().unwrap_or_default();
        Window { from: span.from, to: span.to, run: PhantomData }
    }

    /// Ends a run whose wires contradict the declared ports, which only a defect of the planner can bring about.
    #[cold]
    pub(in crate::core) fn miswired(&self, what: &str) -> ! {
        panic!("the plan wired something else to a port of type {what}: a defect in foley, not in the graph")
    }
}
