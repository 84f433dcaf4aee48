//! Keeps results from one run to the next, in memory and on disk, under a key of all that they depend on: what value nodes
//! and folds gave, and the streams that are dear to compute for their size.
//!
//! [`Keys`] makes the keys, [`Store`] keeps the entries and [`Memory`] the last of them, [`choose`] says which streams are
//! worth it, [`stream`] is what such a stream is on disk, and [`Index`] remembers what the last keys were made of.

mod checkpoints;
mod frontier;
mod index;
mod key;
mod memory;
mod session;
mod store;
pub mod stream;

pub use checkpoints::{Begun, Checkpoint, Checkpoints, Cut, Mark};
pub use frontier::{Rule, choose};
pub use index::{Index, Trace};
pub use key::{Key, Keys, Part, changes};
pub use memory::{Held, MEMORY, Memory};
pub use session::{Hit, Kept, Session};
pub use store::{Entry, Listed, Output, Store, Told, Unusable};

use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::ParamKind;
use foley_nodes::core::params::ParamSpec;
use foley_nodes::core::ports::PortKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Most bytes of a store, unless told otherwise.
pub const CAP: u64 = 1 << 30;

/// Most bytes in memory for a single run, which reads large entries piece by piece.
const ONE_RUN: usize = 16 << 20;

/// A store, as seen from one graph.
#[derive(Debug)]
pub struct Memo {
    store: Store,
    memory: Memory,
    rule: Rule,
    graph: String,
    checkpoints: Option<Checkpoints>,
}

impl Memo {
    /// The memo of the graph file `graph` in the folder `dir`, which is made when the first entry is written.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, cap: u64, graph: &Path) -> Self {
        let graph = std::fs::canonicalize(graph).unwrap_or_else(|_| graph.to_owned());
        let graph = graph.to_string_lossy().into_owned();
        let (store, memory) = (Store::new(dir, cap), Memory::new(ONE_RUN));
        Self { store, memory, rule: Rule::default(), graph, checkpoints: None }
    }

    /// The same, for many runs: it holds up to so many bytes in memory.
    #[must_use]
    pub fn holding(self, bytes: usize) -> Self {
        Self { memory: Memory::new(bytes), ..self }
    }

    /// The same, with another rule of which streams are worth keeping.
    #[must_use]
    pub fn with_rule(self, rule: Rule) -> Self {
        Self { rule, ..self }
    }

    /// The same, for a run into the folder `out` that writes down how far it is each time that it has taken `every`, and goes on
    /// where one like it was interrupted.
    #[must_use]
    pub fn with_checkpoints(self, out: &Path, every: Duration) -> Self {
        let checkpoints = Checkpoints::new(self.store.dir(), &self.graph, out, every);
        Self { checkpoints: Some(checkpoints), ..self }
    }

    /// Where a run writes down how far it is, if at all.
    #[must_use]
    pub fn checkpoints(&self) -> Option<&Checkpoints> {
        self.checkpoints.as_ref()
    }

    /// Which streams are worth keeping.
    #[must_use]
    pub fn rule(&self) -> &Rule {
        &self.rule
    }

    /// What is held in memory of it, for as long as this memo lives.
    #[must_use]
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Where its entries are.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// What the last keys of this graph were made of.
    #[must_use]
    pub fn index(&self) -> Index<'_> {
        Index::new(self.store.dir(), &self.graph)
    }
}

/// The folder of the memo of a graph file: `.foley/cache` beside it.
#[must_use]
pub fn beside(graph: &Path) -> PathBuf {
    graph.parent().unwrap_or(Path::new("")).join(".foley/cache")
}

/// Whether a node writes files, so that it has to run whatever is known.
#[must_use]
pub fn writes(ty: &NodeType) -> bool {
    let output = |spec: &ParamSpec| *spec.kind.innermost() == ParamKind::Output;
    ty.outputs.is_empty() || (ty.params)().iter().any(output)
}

/// Whether the streams of a node may be kept: it has some, gives nothing else and writes nothing.
#[must_use]
pub fn streams(ty: &NodeType) -> bool {
    let stream = |kind: &PortKind| matches!(kind, PortKind::Stream(_) | PortKind::Events(_));
    !writes(ty) && ty.outputs.iter().all(|o| stream(&o.kind))
}

/// Whether what a node gives is kept: the values of value nodes and of folds.
#[must_use]
pub fn keeps(ty: &NodeType) -> bool {
    let fold = ty.outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
    !writes(ty) && (ty.eval.is_some() || fold)
}
