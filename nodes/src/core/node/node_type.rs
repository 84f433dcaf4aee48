//! Node types as values, which the runtime, the documentation and the editors read.

use super::{Class, Each, Func, Node, PerItem, Retune, Summary};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::params::{AnyParams, Datum, FieldError, ParamSpec, Params, SourceFile};
use crate::core::ports::{Cx, PortKind, PortSpec, Ports};
use crate::core::random::Rng;
use crate::core::shape::{Build, NodeShape, RawShape, Shape};
use crate::core::silence::Silence;
use crate::core::state::StateArchive;
use std::any::Any;
use std::fmt;

/// A node of an erased type.
pub trait DynNode: Send {
    /// Fills one window.
    ///
    /// # Errors
    /// As [`Node::run`].
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault>;
    /// As [`Node::TAKES_BLOCKS`].
    fn takes_blocks(&self) -> bool {
        false
    }
    /// As [`Node::process_block`].
    fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
        let _ = (input, out);
    }
    /// Ends the run.
    ///
    /// # Errors
    /// As [`Node::finish`].
    fn finish(&mut self, cx: &Cx<'_>) -> Result<Summary, Fault> {
        let _ = cx;
        Ok(Summary::new())
    }
    /// As [`Node::silence`].
    fn silence(&self) -> Option<Silence> {
        None
    }
    /// Takes over new parameters.
    fn retune(&mut self, new: &dyn AnyParams) -> Retune {
        let _ = new;
        Retune::Rebuild
    }
    /// As [`Node::set_late`].
    fn set_late(&mut self, late: bool) {
        let _ = late;
    }
    /// Adopts state; does nothing between different types.
    fn adopt(&mut self, old: &mut dyn DynNode) {
        let _ = old;
    }
    /// Saves or restores its state.
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

    fn takes_blocks(&self) -> bool {
        N::TAKES_BLOCKS
    }

    fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
        self.0.process_block(input, out);
    }

    fn finish(&mut self, cx: &Cx<'_>) -> Result<Summary, Fault> {
        self.0.finish(N::Ports::open(cx))
    }

    fn silence(&self) -> Option<Silence> {
        self.0.silence()
    }

    fn retune(&mut self, new: &dyn AnyParams) -> Retune {
        new.as_any().downcast_ref().map_or(Retune::Rebuild, |new| self.0.retune(new))
    }

    fn adopt(&mut self, old: &mut dyn DynNode) {
        if let Some(old) = old.as_any_mut().downcast_mut::<Self>() {
            self.0.adopt(&mut old.0);
        }
    }

    fn set_late(&mut self, late: bool) {
        self.0.set_late(late);
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

/// A node type as the registry lists it, with everything that the runtime, the documentation and the editors read.
pub struct NodeType {
    /// Its name in graphs.
    pub name: &'static str,
    /// Version of its output.
    pub version: u32,
    /// True if its outputs contain the paths of its assets.
    pub exposes_paths: bool,
    /// Threads that may run it.
    pub class: Class,
    /// Rough nanoseconds per element of its widest input or output.
    pub cost: f64,
    /// Its documentation; the first line is the summary.
    pub doc: &'static str,
    /// The source file that declares it.
    pub source: SourceFile,
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
    /// Names of the parameters that are 0 although their default is not.
    #[must_use]
    pub fn zeros(&self, params: &dyn AnyParams) -> Vec<&'static str> {
        let specs = (self.params)();
        let by_default = |name: &str| {
            specs.iter().any(|spec| spec.name == name && spec.default.as_ref().is_some_and(Datum::is_zero))
        };
        let zeros = params.write().into_iter().filter(|(name, datum)| datum.is_zero() && !by_default(name));
        zeros.map(|(name, _)| name).collect()
    }

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
            source: N::Params::SOURCE,
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
            source: F::Params::SOURCE,
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
    /// As [`Node::shape`], with all errors at once.
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
