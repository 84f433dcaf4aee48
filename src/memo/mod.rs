//! Keeps values from one run to the next: what value nodes and folds gave, on disk, under a key of all that they depend on.
//!
//! [`Keys`] makes the keys, [`Store`] keeps the entries, [`Index`] remembers what the last keys were made of. Streams are
//! not kept: they are computed again.

mod index;
mod key;
mod session;
mod store;

pub use index::{Index, Trace};
pub use key::{Key, Keys, Part, changes};
pub use session::{Hit, Session};
pub use store::{Entry, Listed, Output, Store, Unusable};

use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::ParamKind;
use foley_nodes::core::params::ParamSpec;
use foley_nodes::core::ports::PortKind;
use std::path::{Path, PathBuf};

/// Most bytes of a store, unless told otherwise.
pub const CAP: u64 = 1 << 30;

/// A store, as seen from one graph.
#[derive(Debug)]
pub struct Memo {
    store: Store,
    graph: String,
}

impl Memo {
    /// The memo of the graph file `graph` in the folder `dir`, which is made when the first entry is written.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, cap: u64, graph: &Path) -> Self {
        let graph = std::fs::canonicalize(graph).unwrap_or_else(|_| graph.to_owned());
        Self { store: Store::new(dir, cap), graph: graph.to_string_lossy().into_owned() }
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

/// Whether what a node gives is kept: the values of value nodes and of folds.
#[must_use]
pub fn keeps(ty: &NodeType) -> bool {
    let fold = ty.outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
    !writes(ty) && (ty.eval.is_some() || fold)
}
