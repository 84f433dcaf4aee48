//! Runs one node on slices, without any runtime: for programs that want a node as it is, and for tests.

pub use super::standalone_run::StandaloneRun;
pub use crate::core::feed::Feed;

use super::wiring::Wiring;
use crate::core::computation::{NotStored, foreground, unmonitored};
use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, MemoryOutputs};
use crate::core::input::NoInputs;
use crate::core::item::{AnyValue, Data, Event, Item};
use crate::core::node::{Func, Node, NodeType};
use crate::core::params::AnyParams;
use crate::core::ports::{Events, Many, Port, Stream, Value};
use crate::core::random::Random;
use crate::core::shape::{Build, LinkShape, NodeShape, RawShape};
use crate::core::stage::{Clock, Cx, InWire, OutWire, Stage, StageNode};
use crate::core::time::{Rate, TICKS_PER_SECOND, Tick};
use std::sync::Arc;

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
        Ok(StandaloneRun::new(stage, self.ty.outputs, at, self.window, until))
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
