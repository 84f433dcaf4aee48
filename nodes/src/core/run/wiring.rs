//! Wires one node to players of its inputs.

use crate::core::buffer::{AnyBuffer, Budget, Pad};
use crate::core::fault::Fault;
use crate::core::feed::{Feed, FeedSource};
use crate::core::item::StreamShape;
use crate::core::node::DynNode;
use crate::core::ports::PortKind;
use crate::core::shape::{Ends, LinkShape, Lookaround};
use crate::core::stage::{Clock, Cx, InWire, OutWire, StageNode, max_items};
use crate::core::time::{Rate, Tick};
use std::any::Any;
use std::cell::RefCell;
use std::sync::Arc;

/// Plays a [`Feed`] into the buffer of its one output.
struct Player(Arc<dyn FeedSource>);

impl DynNode for Player {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        cx.raw_output(0, |buffer, span| self.0.append_to(buffer, span.from, span.to));
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// The buffers, clocks and nodes of a stage for one node, while it is wired.
#[derive(Default)]
pub(super) struct Wiring {
    pub(super) buffers: Vec<Box<dyn AnyBuffer>>,
    pub(super) clocks: Vec<Clock>,
    pub(super) nodes: Vec<StageNode>,
    /// The first tick of the node itself.
    pub(super) from: Tick,
}

impl Wiring {
    pub(super) fn clock(&mut self, clock: Clock) -> usize {
        self.clocks.push(clock);
        self.clocks.len() - 1
    }

    /// The clock of a [`Player`]: without delay, from tick 0.
    fn feed_clock(&mut self, rate: Option<Rate>, end: Option<Tick>) -> usize {
        self.clock(Clock { rate, delay: 0, end, from: 0 })
    }

    fn buffer(&mut self, buffer: Box<dyn AnyBuffer>) -> usize {
        self.buffers.push(buffer);
        self.buffers.len() - 1
    }

    pub(super) fn output(
        &mut self,
        kind: &PortKind,
        shape: Option<&StreamShape>,
        (delay, lag): (Tick, Tick),
        end: Tick,
    ) -> OutWire {
        match (kind, shape) {
            (PortKind::Stream(item), Some(stream)) => {
                let items = stream.rate.first_at(end) as usize + 1;
                let mut buffer = (item.buffer)(stream.width, items, 0, Pad::Silence);
                let writer = Clock::of_output(Some(stream.rate), delay, lag, Some(end), self.from);
                buffer.begin(writer.first_position());
                let clock = self.clock(writer);
                let buffer = self.buffer(buffer);
                OutWire::Stream { buffer, clock, width: stream.width, rate: stream.rate }
            }
            (PortKind::Events(event), _) => {
                let buffer = self.buffer((event.buffer)(Tick::MAX / 4, &Budget::default()));
                let writer = Clock::of_output(None, delay, lag, Some(end), self.from);
                OutWire::Events { buffer, clock: self.clock(writer) }
            }
            _ => OutWire::Value(RefCell::default()),
        }
    }

    pub(super) fn input(
        &mut self,
        feed: &Feed,
        lookaround: Lookaround,
        reader: Clock,
        window: Tick,
    ) -> InWire {
        let Lookaround { behind, ahead, delay, ends } = lookaround;
        let pad = if ends == Ends::Hold { Pad::Hold } else { Pad::Silence };
        let player = feed.source().map(|source| Box::new(Player(Arc::clone(source))) as Box<dyn DynNode>);
        match feed.shape() {
            LinkShape::Value(value) => InWire::Value(value.clone().expect("a feed holds its value")),
            LinkShape::Stream(stream) => {
                let rate = stream.rate;
                let span = max_items(rate, reader.delay + window) + behind + ahead + delay + 3;
                let buffer = self.buffer((stream.item.buffer)(stream.width, span, behind + delay, pad));
                let write = self.feed_clock(Some(rate), stream.end);
                let clock = self.clock(reader.at_rate(Some(rate)));
                let out = OutWire::Stream { buffer, clock: write, width: stream.width, rate };
                self.play(player, stream.end, out);
                InWire::Stream { buffer, clock, behind, ahead, delay, width: stream.width, rate }
            }
            LinkShape::Events(stop) => {
                let event = feed.event_type();
                let event = event.expect("a feed of events has their type");
                let span = reader.delay + window + behind as Tick + ahead as Tick;
                let buffer = self.buffer((event.buffer)(span, &Budget::default()));
                let write = self.feed_clock(None, *stop);
                let clock = self.clock(reader);
                self.play(player, *stop, OutWire::Events { buffer, clock: write });
                InWire::Events { buffer, clock, behind: behind as Tick, ahead: ahead as Tick }
            }
        }
    }

    fn play(&mut self, player: Option<Box<dyn DynNode>>, end: Option<Tick>, out: OutWire) {
        if let Some(node) = player {
            let clock = self.feed_clock(None, end);
            self.nodes.push(StageNode {
                node,
                clock,
                inputs: Vec::new(),
                outputs: vec![out],
                copies: Vec::new(),
            });
        }
    }
}
