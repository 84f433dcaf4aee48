//! The contract between a node and whatever runs it.

use super::fault::{Fault, Reject};
use super::files::MemoryFiles;
use super::item::{Channels, Described, Item, OfItem};
use super::params::{AnyParams, Datum, FieldError, ParamSpec, Params};
use super::ports::{Arity, In, InKind, Out, OutKind, Port, PortKind, PortSpec, Ports, Stream};
use super::random::Rng;
use super::shape::{Build, NodeShape, RawShape, Shape};
use super::stage::Cx;
use super::state::StateArchive;
use super::time::Rate;
use std::any::Any;
use std::fmt;
use std::marker::PhantomData;

/// Where a node may run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// In the audio callback: no allocation, lock or system call in `run`.
    Audio,
    /// On a live worker thread.
    Worker,
    /// Reads or writes files: on an I/O thread.
    Io,
    /// In offline runs only.
    Offline,
}

impl Class {
    /// The class in one word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Audio => "audio",
            Self::Worker => "worker",
            Self::Io => "io",
            Self::Offline => "offline",
        }
    }
}

/// What a node says of its new parameters while it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retune {
    /// It has taken them over.
    Done,
    /// It has to be built anew.
    Rebuild,
}

/// What a node tells of a finished run: counters and measures for the report.
pub type Summary = Vec<(&'static str, serde_json::Value)>;

/// A node: a thin, typed description around maths on slices.
///
/// Life of a node:
/// 1. `shape` says, from parameters and the shapes of its inputs, what it gives and how far it looks.
/// 2. `build` allocates everything.
/// 3. `run` fills one window after the other without gaps, from time zero or, in a graph that plays already, from
///    wherever it takes over: the views tell.
/// 4. `finish` once, after the last window.
/// 5. `retune` and `adopt` in between, when its graph is edited.
pub trait Node: Sized + Send + 'static {
    /// Its parameters.
    type Params: Params;
    /// Its ports.
    type Ports: Ports;
    /// Its name in graphs.
    const NAME: &'static str;
    /// Goes up whenever the same inputs give another output.
    const VERSION: u32 = 1;
    /// Where it may run.
    const CLASS: Class;
    /// Rough nanoseconds per element of its widest input or output, from which offline runs cut a graph into parallel parts.
    const COST: f64 = 1.0;

    /// Declares rates, formats and lookaround.
    ///
    /// # Errors
    /// When parameters, inputs and assets do not go together.
    fn shape(params: &Self::Params, shape: &mut Shape<'_, '_, Self::Ports>) -> Result<(), Reject>;

    /// Makes the node and allocates all that it needs.
    ///
    /// # Errors
    /// When an asset cannot be read or an output not be made.
    fn build(params: &Self::Params, cx: &Build<'_>) -> Result<Self, Fault>;

    /// Fills one window.
    ///
    /// A node that does next to nothing per item marks its `run` as `#[inline]`: then its views never leave the registers.
    ///
    /// # Errors
    /// When the data make it impossible to go on.
    fn run(&mut self, io: <Self::Ports as Ports>::Io<'_>) -> Result<(), Fault>;

    /// Ends the run: gives folds, completes files, tells its counters.
    ///
    /// # Errors
    /// When that cannot be done.
    fn finish(&mut self, io: <Self::Ports as Ports>::Io<'_>) -> Result<Summary, Fault> {
        let _ = io;
        Ok(Summary::new())
    }

    /// Takes over new parameters while running, or asks to be built anew.
    ///
    /// Whether it can depends on the two sets of parameters alone, and is the same the other way round. Nothing may be
    /// allocated here.
    fn retune(&mut self, new: &Self::Params) -> Retune {
        let _ = new;
        Retune::Rebuild
    }

    /// Takes over the state of the node that it replaces, as far as it fits.
    ///
    /// The old node sounds on until it has been faded out, so it has to stay as it is. Nothing may be allocated here.
    fn adopt(&mut self, old: &mut Self) {
        let _ = old;
    }

    /// Saves what it carries from one window to the next, or puts it back into a node that was just built, which then goes on
    /// with the same bits. Most nodes name their fields with [`archive_state!`](crate::archive_state).
    ///
    /// A node whose windows depend on its inputs and its parameters alone carries nothing.
    ///
    /// # Errors
    /// When what was saved is not of this node.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        let _ = archive;
        Ok(())
    }

    /// Valid parameters and the files they need, for trials.
    fn trial(rng: &mut Rng) -> (Self::Params, MemoryFiles) {
        (Self::Params::trial(rng), MemoryFiles::default())
    }
}

/// A node that only computes values from values and assets, before any stream starts.
pub trait Func: 'static {
    /// Its parameters.
    type Params: Params;
    /// Its ports: `Value` inputs and outputs only.
    type Ports: Ports;
    /// Its name in graphs.
    const NAME: &'static str;
    /// Goes up whenever the same inputs give another output.
    const VERSION: u32 = 1;
    /// Whether the paths of its assets, not only what they hold, stand in its outputs.
    const EXPOSES_PATHS: bool = false;

    /// Looks at parameters and assets before the run.
    ///
    /// # Errors
    /// When they do not go together.
    fn check(params: &Self::Params, shape: &mut Shape<'_, '_, Self::Ports>) -> Result<(), Reject> {
        let _ = (params, shape);
        Ok(())
    }

    /// Computes the outputs.
    ///
    /// # Errors
    /// When the inputs make it impossible.
    fn eval(
        params: &Self::Params,
        cx: &Build<'_>,
        io: <Self::Ports as Ports>::Io<'_>,
    ) -> Result<Summary, Fault>;

    /// Valid parameters and the files they need, for trials.
    fn trial(rng: &mut Rng) -> (Self::Params, MemoryFiles) {
        (Self::Params::trial(rng), MemoryFiles::default())
    }
}

/// A node that makes each output item of the one input item at the same time.
pub trait Each: Sized + Send + 'static {
    /// Its parameters.
    type Params: Params;
    /// What comes in.
    type In: Item;
    /// What goes out.
    type Out: Item;
    /// Its name in graphs.
    const NAME: &'static str;
    /// Goes up whenever the same inputs give another output.
    const VERSION: u32 = 1;
    /// Name and documentation of the input.
    const INPUT: (&'static str, &'static str);
    /// Name and documentation of the output.
    const OUTPUT: (&'static str, &'static str);

    /// The output's format.
    ///
    /// # Errors
    /// When parameters and input do not go together.
    fn format(
        params: &Self::Params,
        input: &<Self::In as Item>::Format,
    ) -> Result<<Self::Out as Item>::Format, Reject>;

    /// Makes the node for items of a format.
    fn new(params: &Self::Params, input: &<Self::In as Item>::Format) -> Self;

    /// Makes one item.
    fn each(&mut self, item: &[<Self::In as Item>::Elem], out: &mut [<Self::Out as Item>::Elem]);

    /// Tells its counters at the end.
    fn summary(&self) -> Summary {
        Summary::new()
    }

    /// As [`Node::archive_state`].
    ///
    /// # Errors
    /// As [`Node::archive_state`].
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        let _ = archive;
        Ok(())
    }

    /// Valid parameters for trials.
    fn trial(rng: &mut Rng) -> Self::Params {
        Self::Params::trial(rng)
    }
}

/// The [`Node`] around an [`Each`].
#[derive(Debug)]
pub struct PerItem<E>(E);

/// The ports of an [`Each`].
#[derive(Debug)]
pub struct EachPorts<E>(PhantomData<E>);

impl<E: Each> Ports for EachPorts<E> {
    type Io<'a> = (In<'a, E::In>, Out<'a, E::Out>);
    const INPUTS: &'static [PortSpec] = &[PortSpec {
        name: E::INPUT.0,
        doc: E::INPUT.1,
        kind: PortKind::Stream(OfItem::<E::In>::INFO),
        arity: Arity::One,
        late: false,
    }];
    const OUTPUTS: &'static [PortSpec] = &[PortSpec {
        name: E::OUTPUT.0,
        doc: E::OUTPUT.1,
        kind: PortKind::Stream(OfItem::<E::Out>::INFO),
        arity: Arity::One,
        late: false,
    }];

    fn open<'a>(cx: &Cx<'a>) -> Self::Io<'a> {
        (<Stream<E::In> as InKind>::view(cx, 0), <Stream<E::Out> as OutKind>::view(cx, 0))
    }
}

impl<E: Each> Node for PerItem<E> {
    type Params = E::Params;
    type Ports = EachPorts<E>;
    const NAME: &'static str = E::NAME;
    const VERSION: u32 = E::VERSION;
    const CLASS: Class = Class::Audio;

    fn shape(params: &E::Params, shape: &mut Shape<'_, '_, EachPorts<E>>) -> Result<(), Reject> {
        let input = shape.input(Port::<Stream<E::In>>::new(0));
        let format = E::format(params, &input.format)?;
        shape.output(Port::<Stream<E::Out>>::new(0), input.rate, format);
        Ok(())
    }

    fn build(params: &E::Params, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self(E::new(params, &cx.input(Port::<Stream<E::In>>::new(0)).format)))
    }

    fn run(&mut self, (input, mut out): (In<'_, E::In>, Out<'_, E::Out>)) -> Result<(), Fault> {
        let (from, to) = (input.width().max(1), out.width().max(1));
        for (item, out) in input.items().chunks_exact(from).zip(out.items().chunks_exact_mut(to)) {
            self.0.each(item, out);
        }
        Ok(())
    }

    fn finish(&mut self, _: (In<'_, E::In>, Out<'_, E::Out>)) -> Result<Summary, Fault> {
        Ok(self.0.summary())
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.0.archive_state(archive)
    }

    fn trial(rng: &mut Rng) -> (E::Params, MemoryFiles) {
        (E::trial(rng), MemoryFiles::default())
    }
}

/// A node whose type only itself knows.
pub trait DynNode: Send {
    /// Fills one window.
    ///
    /// # Errors
    /// As [`Node::run`].
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault>;
    /// Ends the run.
    ///
    /// # Errors
    /// As [`Node::finish`].
    fn finish(&mut self, cx: &Cx<'_>) -> Result<Summary, Fault> {
        let _ = cx;
        Ok(Summary::new())
    }
    /// Takes over new parameters.
    fn retune(&mut self, new: &dyn AnyParams) -> Retune {
        let _ = new;
        Retune::Rebuild
    }
    /// Takes over state; nothing happens between different types.
    fn adopt(&mut self, old: &mut dyn DynNode) {
        let _ = old;
    }
    /// Saves what it carries from one window to the next, or puts it back.
    ///
    /// # Errors
    /// As [`Node::archive_state`].
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        let _ = archive;
        Ok(())
    }
    /// Downcast.
    fn as_any_mut(&mut self) -> &mut dyn Any;
}

struct Wrap<N>(N);

impl<N: Node> DynNode for Wrap<N> {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.0.run(N::Ports::open(cx))
    }

    fn finish(&mut self, cx: &Cx<'_>) -> Result<Summary, Fault> {
        self.0.finish(N::Ports::open(cx))
    }

    fn retune(&mut self, new: &dyn AnyParams) -> Retune {
        new.as_any().downcast_ref().map_or(Retune::Rebuild, |new| self.0.retune(new))
    }

    fn adopt(&mut self, old: &mut dyn DynNode) {
        if let Some(old) = old.as_any_mut().downcast_mut::<Self>() {
            self.0.adopt(&mut old.0);
        }
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.0.archive_state(archive)
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

type ReadParams = fn(&dyn Fn(&str) -> Option<Datum>) -> Result<Box<dyn AnyParams>, Vec<FieldError>>;
type Make = fn(&dyn AnyParams, &Build<'_>) -> Result<Box<dyn DynNode>, Fault>;
type Eval = fn(&dyn AnyParams, &Build<'_>, &Cx<'_>) -> Result<Summary, Fault>;

/// A node type as the registry lists it: everything that the runtime, the documentation and the editors know of it.
pub struct NodeType {
    /// Its name in graphs.
    pub name: &'static str,
    /// Version of its output.
    pub version: u32,
    /// Whether the paths of its assets, not only what they hold, stand in its outputs.
    pub exposes_paths: bool,
    /// Where it may run.
    pub class: Class,
    /// Rough nanoseconds per element of its widest input or output.
    pub cost: f64,
    /// What it does; the first line is its summary.
    pub doc: &'static str,
    /// The family of nodes that it belongs to.
    pub family: &'static str,
    /// Input ports.
    pub inputs: &'static [PortSpec],
    /// Output ports.
    pub outputs: &'static [PortSpec],
    /// Declared parameters.
    pub params: fn() -> Vec<ParamSpec>,
    /// Reads parameters.
    pub read: ReadParams,
    /// Valid parameters and the files they need, for trials.
    pub trial: fn(&mut Rng) -> (Box<dyn AnyParams>, MemoryFiles),
    /// Computes values; `None` for nodes with streams.
    pub eval: Option<Eval>,
    shape: fn(&dyn AnyParams, &mut RawShape<'_>) -> Result<(), Reject>,
    build: Make,
}

impl NodeType {
    /// The type of a [`Node`].
    #[must_use]
    pub fn of<N: Node>(family: &'static str) -> Self {
        Self {
            name: N::NAME,
            version: N::VERSION,
            exposes_paths: false,
            class: N::CLASS,
            cost: N::COST,
            doc: N::Params::DOC,
            family,
            inputs: N::Ports::INPUTS,
            outputs: N::Ports::OUTPUTS,
            params: N::Params::specs,
            read: |get| Ok(Box::new(N::Params::read(get)?)),
            trial: |rng| {
                let (params, files) = N::trial(rng);
                (Box::new(params), files)
            },
            eval: None,
            shape: |params, raw| N::shape(known(params)?, &mut Shape::new(raw)),
            build: |params, cx| Ok(Box::new(Wrap(N::build(known(params)?, cx)?))),
        }
    }

    /// The type of an [`Each`].
    #[must_use]
    pub fn each<E: Each>(family: &'static str) -> Self {
        Self::of::<PerItem<E>>(family)
    }

    /// The type of a [`Func`].
    #[must_use]
    pub fn func<F: Func>(family: &'static str) -> Self {
        Self {
            name: F::NAME,
            version: F::VERSION,
            exposes_paths: F::EXPOSES_PATHS,
            class: Class::Offline,
            cost: 0.0,
            doc: F::Params::DOC,
            family,
            inputs: F::Ports::INPUTS,
            outputs: F::Ports::OUTPUTS,
            params: F::Params::specs,
            read: |get| Ok(Box::new(F::Params::read(get)?)),
            trial: |rng| {
                let (params, files) = F::trial(rng);
                (Box::new(params), files)
            },
            eval: Some(|params, cx, io| F::eval(known(params)?, cx, F::Ports::open(io))),
            shape: |params, raw| F::check(known(params)?, &mut Shape::new(raw)),
            build: |_, _| Err(Fault::new("F099", "a value node has no streams to run")),
        }
    }

    /// Declares rates, formats and lookaround over known links.
    ///
    /// # Errors
    /// As [`Node::shape`], all that can be told at once.
    pub fn shape(&self, params: &dyn AnyParams, mut raw: RawShape<'_>) -> Result<NodeShape, Vec<Reject>> {
        let declared = (self.shape)(params, &mut raw);
        let shape = raw.close(declared)?;
        for (spec, output) in self.outputs.iter().zip(&shape.outputs) {
            debug_assert_eq!(matches!(spec.kind, PortKind::Stream(_)), output.is_some(), "{}", self.name);
        }
        Ok(shape)
    }

    /// Makes the node.
    ///
    /// # Errors
    /// As [`Node::build`].
    pub fn build(&self, params: &dyn AnyParams, cx: &Build<'_>) -> Result<Box<dyn DynNode>, Fault> {
        (self.build)(params, cx)
    }

    /// The first line of its documentation.
    #[must_use]
    pub fn summary(&self) -> &'static str {
        self.doc.trim().lines().next().unwrap_or_default().trim()
    }
}

impl fmt::Debug for NodeType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NodeType({})", self.name)
    }
}

fn known<P: Params>(params: &dyn AnyParams) -> Result<&P, Reject> {
    let known = params.as_any().downcast_ref();
    known.ok_or_else(|| Reject::new("F099", "parameters of another node type: a defect in foley"))
}

/// Refuses a stream whose rate is not that of another input, and names the node that would change it.
///
/// # Errors
/// When `found` is not `wanted`.
pub fn same_rate(field: &str, found: Rate, other: &str, wanted: Rate) -> Result<(), Reject> {
    if wanted == found {
        return Ok(());
    }
    let message = format!("`{field}` runs at {found}, {other} at {wanted}");
    Err(Reject::new("F045", message)
        .at(field)
        .help(format!("put Resample(rate: {wanted}) before `{field}`").replace(" Hz", "")))
}

/// Refuses audio of another channel count than another input.
///
/// # Errors
/// When `found` is not `wanted`.
pub fn same_channels(field: &str, found: Channels, other: &str, wanted: Channels) -> Result<(), Reject> {
    if wanted == found {
        return Ok(());
    }
    let message = format!("`{field}` has {} channels, {other} {}", found.0, wanted.0);
    Err(Reject::new("F046", message).at(field).help("put Channels, Mono or Pan before one of them"))
}
