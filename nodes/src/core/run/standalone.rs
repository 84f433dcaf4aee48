//! Runs one node on slices, without any runtime: for programs that want a node as it is, and for tests.

use crate::core::buffer::{AnyBuffer, Budget, EventBuffer, Pad, StreamBuffer};
use crate::core::fault::{Fault, Reject};
pub use crate::core::feed::Feed;
use crate::core::files::{MemoryFiles, MemoryOutputs};
use crate::core::input::NoInputs;

use crate::core::computation::{NotStored, foreground, unmonitored};
use crate::core::feed::FeedSource;
use crate::core::item::{AnyValue, Data, Event, Item, StreamShape};
use crate::core::node::{DynNode, Func, Node, NodeType, Summary};
use crate::core::params::AnyParams;
use crate::core::ports::{Events, Many, Port, PortKind, PortSpec, Stream, Value};
use crate::core::random::Random;
use crate::core::shape::{Build, Ends, LinkShape, Lookaround, NodeShape, RawShape};
use crate::core::stage::{Clock, Cx, InWire, OutWire, Stage, StageNode, max_items};
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::{Rate, TICKS_PER_SECOND, Tick};
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

/// One node with its inputs, ready to run.
pub struct Standalone {
    ty: Arc<NodeType>,
    params: Box<dyn AnyParams>,
    links: Vec<Vec<Feed>>,
    /// The files that the node can open.
    pub files: MemoryFiles,
    /// The files that the node writes.
    pub outputs: MemoryOutputs,
    /// Seed of its randomness.
    pub seed: u64,
    /// Length of the windows; the first repeats until the end.
    pub window: Tick,
    /// The node's first tick; no earlier items are made.
    pub begin: Tick,
    /// End of the run of an endless node.
    pub until: Tick,
    /// True to fill windows with unusable numbers before the node writes them.
    pub poison: bool,
}

impl Standalone {
    /// A node with these parameters and no inputs yet.
    #[must_use]
    pub fn new<N: Node>(params: N::Params) -> Self {
        Self::of_type(Arc::new(NodeType::of::<N>("")), Box::new(params))
    }

    /// A value node with these parameters and no inputs yet.
    #[must_use]
    pub fn func<F: Func>(params: F::Params) -> Self {
        Self::of_type(Arc::new(NodeType::func::<F>("")), Box::new(params))
    }

    /// A node whose type is determined at run time.
    #[must_use]
    pub fn of_type(ty: Arc<NodeType>, params: Box<dyn AnyParams>) -> Self {
        let links = ty.inputs.iter().map(|_| Vec::new()).collect();
        Self {
            ty,
            params,
            links,
            files: MemoryFiles::default(),
            outputs: MemoryOutputs::default(),
            seed: 1,
            window: TICKS_PER_SECOND / 10,
            begin: 0,
            until: TICKS_PER_SECOND,
            poison: false,
        }
    }

    /// Links a stream to an input.
    #[must_use]
    pub fn input<T: Item>(
        self,
        port: Port<Stream<T>>,
        rate: Rate,
        format: T::Format,
        data: Vec<T::Elem>,
    ) -> Self {
        self.feed(port.index(), Feed::stream::<T>(rate, format, data))
    }

    /// Links a stream to an optional input.
    #[must_use]
    pub fn optional<T: Item>(
        self,
        port: Port<Option<Stream<T>>>,
        rate: Rate,
        format: T::Format,
        data: Vec<T::Elem>,
    ) -> Self {
        self.feed(port.index(), Feed::stream::<T>(rate, format, data))
    }

    /// Adds a stream to an input that takes many.
    #[must_use]
    pub fn also<T: Item>(
        self,
        port: Port<Many<Stream<T>>>,
        rate: Rate,
        format: T::Format,
        data: Vec<T::Elem>,
    ) -> Self {
        self.feed(port.index(), Feed::stream::<T>(rate, format, data))
    }

    /// Links a value to an input.
    #[must_use]
    pub fn value<T: Data>(self, port: Port<Value<T>>, value: T) -> Self {
        self.feed(port.index(), Feed::value(AnyValue::new(value)))
    }

    /// Links events to an input.
    #[must_use]
    pub fn events<T: Event>(self, port: Port<Events<T>>, events: Vec<(Tick, T)>, end: Tick) -> Self {
        self.feed(port.index(), Feed::events(events, end))
    }

    /// Adds a link to an input by its number.
    #[must_use]
    pub fn feed(mut self, port: usize, feed: Feed) -> Self {
        self.links[port].push(feed);
        self
    }

    /// Sets the window length.
    #[must_use]
    pub fn window(mut self, window: Tick) -> Self {
        self.window = window.max(1);
        self
    }

    /// Returns the shape of the node for these inputs.
    ///
    /// # Errors
    /// As [`Node::shape`]; the first of several.
    pub fn shape(&self) -> Result<NodeShape, Reject> {
        self.shape_or_all().map_err(|mut wrong| wrong.remove(0))
    }

    /// Returns the shape of the node for these inputs, or all errors.
    ///
    /// # Errors
    /// As [`Node::shape`].
    pub fn shape_or_all(&self) -> Result<NodeShape, Vec<Reject>> {
        let links = self.link_shapes();
        self.ty.shape(&*self.params, RawShape::new(&links, self.ty.outputs.len(), &self.files))
    }

    fn link_shapes(&self) -> Vec<Vec<LinkShape>> {
        self.links.iter().map(|feeds| feeds.iter().map(|f| f.shape().clone()).collect()).collect()
    }

    /// The random numbers of the node.
    #[must_use]
    pub fn random(&self) -> Random {
        Random::new(self.seed, "solo")
    }

    /// Wires the node without running it.
    ///
    /// # Errors
    /// As [`Node::shape`] and [`Node::build`].
    pub fn start(&self) -> Result<StandaloneRun, Fault> {
        let links = self.link_shapes();
        let mut shape = self.shape()?;
        let delay = self.delay(&shape);
        shape.end = Some(shape.end.unwrap_or(self.until));
        let cx = Build {
            random: self.random(),
            links: &links,
            shape: &shape,
            window: self.window,
            files: &self.files,
            outputs: &self.outputs,
            inputs: &NoInputs,
            monitor: &unmonitored,
            partial: &NotStored,
            background: &foreground(),
        };
        let end = shape.end.unwrap_or(0);
        let clock = Clock::of_node(delay, shape.lag, Some(end), self.begin.max(0));
        let works = clock.end.unwrap_or(end);
        let mut wiring = Wiring { from: self.begin, ..Wiring::default() };
        let own = wiring.clock(clock);
        let outputs: Vec<OutWire> = (0..self.ty.outputs.len())
            .map(|k| {
                let kind = &self.ty.outputs[k].kind;
                wiring.output(kind, shape.outputs[k].as_ref(), (delay, shape.lag), end)
            })
            .collect();
        if let Some(eval) = self.ty.eval {
            let inputs = self.value_wires();
            let summary = eval(&*self.params, &cx, &Cx::for_values(&inputs, &outputs))?;
            return Ok(StandaloneRun::done(self.ty.outputs, outputs, summary));
        }
        let inputs: Vec<Vec<InWire>> = self
            .links
            .iter()
            .zip(&shape.lookaround)
            .map(|(feeds, lookaround)| {
                feeds.iter().map(|f| wiring.input(f, *lookaround, clock, self.window)).collect()
            })
            .collect();
        let node = self.ty.build(&*self.params, &cx)?;
        wiring.nodes.push(StageNode { node, clock: own, inputs, outputs, copies: Vec::new() });
        let at = wiring.nodes.len() - 1;
        let mut stage = Stage::new(wiring.buffers, wiring.clocks, wiring.nodes);
        stage.set_poison(self.poison);
        stage.set_activity();
        let until = works + delay;
        let specs = self.ty.outputs;
        Ok(StandaloneRun {
            stage,
            specs,
            at,
            window: self.window,
            now: 0,
            until,
            outputs: None,
            summary: Summary::new(),
        })
    }

    /// Runs the node to its end.
    ///
    /// # Errors
    /// As [`Node::shape`], [`Node::build`], [`Node::run`] and [`Node::finish`].
    pub fn run(&self) -> Result<StandaloneRun, Fault> {
        let mut run = self.start()?;
        while run.step()? {}
        run.finish()?;
        Ok(run)
    }

    fn delay(&self, shape: &NodeShape) -> Tick {
        let spans = self.links.iter().zip(&shape.lookaround).flat_map(|(feeds, lookaround)| {
            feeds.iter().map(|feed| match feed.shape() {
                LinkShape::Stream(stream) => stream.rate.span(lookaround.ahead),
                LinkShape::Events(_) => lookaround.ahead as Tick,
                LinkShape::Value(_) => 0,
            })
        });
        spans.max().unwrap_or(0)
    }

    fn value_wires(&self) -> Vec<Vec<InWire>> {
        let wire = |feed: &Feed| match feed.shape() {
            LinkShape::Value(Some(value)) => Some(InWire::Value(value.clone())),
            _ => None,
        };
        self.links.iter().map(|feeds| feeds.iter().filter_map(wire).collect()).collect()
    }
}

#[derive(Default)]
struct Wiring {
    buffers: Vec<Box<dyn AnyBuffer>>,
    clocks: Vec<Clock>,
    nodes: Vec<StageNode>,
    /// The first tick of the node itself.
    from: Tick,
}

impl Wiring {
    fn clock(&mut self, clock: Clock) -> usize {
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

    fn output(
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

    fn input(&mut self, feed: &Feed, lookaround: Lookaround, reader: Clock, window: Tick) -> InWire {
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
                let event = feed.source().and_then(|source| source.event_type());
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

/// A node that is running, or has run.
pub struct StandaloneRun {
    stage: Stage,
    specs: &'static [PortSpec],
    at: usize,
    window: Tick,
    now: Tick,
    until: Tick,
    outputs: Option<Vec<OutWire>>,
    /// Summary of the node.
    pub summary: Summary,
}

impl StandaloneRun {
    fn done(specs: &'static [PortSpec], outputs: Vec<OutWire>, summary: Summary) -> Self {
        let stage = Stage::new(Vec::new(), Vec::new(), Vec::new());
        Self { stage, specs, at: 0, window: 1, now: 0, until: 0, outputs: Some(outputs), summary }
    }

    /// Runs one window; false once there is nothing left.
    ///
    /// # Errors
    /// As [`Node::run`].
    pub fn step(&mut self) -> Result<bool, Fault> {
        if self.now >= self.until {
            return Ok(false);
        }
        self.now = (self.now + self.window).min(self.until);
        self.stage.advance(self.now);
        self.stage.run().map_err(|(_, fault)| fault)?;
        Ok(true)
    }

    /// Saves how far it is.
    ///
    /// # Errors
    /// As [`Node::archive_state`].
    pub fn save(&mut self) -> Result<Vec<u8>, Fault> {
        let mut bytes = Vec::new();
        self.archive_state(&mut StateArchive::save(&mut bytes))?;
        Ok(bytes)
    }

    /// Resumes a saved run of the same node over the same inputs; this one must not have run yet.
    ///
    /// # Errors
    /// As [`Node::archive_state`].
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.archive_state(&mut StateArchive::restore(bytes))
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        Stateful::archive_state(&mut self.now, archive)?;
        self.stage.archive_state(archive).map_err(|(_, fault)| fault)
    }

    /// The node itself, to be retuned or to adopt another.
    pub fn node(&mut self) -> &mut dyn DynNode {
        &mut *self.stage.nodes_mut()[self.at].node
    }

    /// Ends the run.
    ///
    /// # Errors
    /// As [`Node::finish`].
    pub fn finish(&mut self) -> Result<(), Fault> {
        if self.outputs.is_none() {
            let mut all = self.stage.finish().map_err(|(_, fault)| fault)?;
            self.summary = all.pop().unwrap_or_default();
        }
        Ok(())
    }

    fn wires(&self) -> &[OutWire] {
        match &self.outputs {
            Some(outputs) => outputs,
            None => self.stage.outputs(self.at),
        }
    }

    /// Returns true if no output has been active so far; see [`Stage::activity`].
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.stage.activity(self.at) == Some(0)
    }

    /// Returns the items of a stream output so far.
    #[must_use]
    pub fn stream<T: Item>(&self, port: Port<Stream<T>>) -> Vec<T::Elem> {
        let OutWire::Stream { buffer, .. } = &self.wires()[port.index()] else { return Vec::new() };
        self.stage.with_buffer(*buffer, |buffer| {
            let typed = buffer.typed::<StreamBuffer<T::Elem>>();
            typed.map(|typed| typed.view(0, buffer.end()).to_vec()).unwrap_or_default()
        })
    }

    /// The numbers of a stream output of any type, and true if all of them are finite.
    #[must_use]
    pub fn numbers(&self, port: usize) -> (Vec<f32>, bool) {
        let (Some(OutWire::Stream { buffer, .. }), Some(PortKind::Stream(item))) =
            (self.wires().get(port), self.specs.get(port).map(|spec| spec.kind))
        else {
            return (Vec::new(), true);
        };
        self.stage.with_buffer(*buffer, |buffer| {
            let mut out = Vec::new();
            (item.numbers)(buffer, 0, buffer.end(), &mut out);
            (out, (item.finite)(buffer, 0, buffer.end()))
        })
    }

    /// All events that an output has produced so far.
    #[must_use]
    pub fn events<T: Event>(&self, port: Port<Events<T>>) -> Vec<(Tick, T)> {
        let OutWire::Events { buffer, .. } = &self.wires()[port.index()] else { return Vec::new() };
        self.stage.with_buffer(*buffer, |buffer| {
            let typed = buffer.typed::<EventBuffer<T>>();
            typed.map(|typed| typed.view(Tick::MIN, Tick::MAX).to_vec()).unwrap_or_default()
        })
    }

    /// All events of an output so far, of any type.
    #[must_use]
    pub fn events_json(&self, port: usize) -> Vec<(Tick, serde_json::Value)> {
        match (self.wires().get(port), self.specs.get(port).map(|spec| spec.kind)) {
            (Some(OutWire::Events { buffer, .. }), Some(PortKind::Events(event))) => {
                self.stage.with_buffer(*buffer, |buffer| (event.json)(buffer, Tick::MIN, Tick::MAX))
            }
            _ => Vec::new(),
        }
    }

    /// The value at an output, by its number.
    #[must_use]
    pub fn value(&self, port: usize) -> Option<AnyValue> {
        match self.wires().get(port)? {
            OutWire::Value(place) => place.borrow().clone(),
            _ => None,
        }
    }
}
