//! The cache of one graph.

use super::checkpoint_store::CheckpointStore;
use super::index::Index;
use super::memory::Memory;
use super::store::Store;
use super::stream_selection::CachePolicy;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Default maximum bytes on disk.
pub const CAP: u64 = 1 << 30;

/// Maximum bytes in memory for a single run, which reads large entries block by block.
const SINGLE_RUN_MEMORY: usize = 16 << 20;

/// The cache of one graph: results on disk and in memory, checkpoints, and the policy for streams.
#[derive(Debug)]
pub struct Memo {
    store: Store,
    memory: Memory,
    policy: CachePolicy,
    graph: String,
    checkpoints: Option<CheckpointStore>,
}

impl Memo {
    /// The cache of the graph file `graph` in the folder `dir`, which is created with the first entry.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, cap: u64, graph: &Path) -> Self {
        let graph = std::fs::canonicalize(graph).unwrap_or_else(|_| graph.to_owned());
        let graph = graph.to_string_lossy().into_owned();
        let (store, memory) = (Store::new(dir, cap), Memory::new(SINGLE_RUN_MEMORY));
        Self { store, memory, policy: CachePolicy::default(), graph, checkpoints: None }
    }

    /// Sets the maximum bytes in memory.
    #[must_use]
    pub fn with_memory(self, bytes: usize) -> Self {
        Self { memory: Memory::new(bytes), ..self }
    }

    /// Sets the policy for streams.
    #[must_use]
    pub fn with_policy(self, policy: CachePolicy) -> Self {
        Self { policy, ..self }
    }

    /// Saves checkpoints of runs into the folder `out`, one per `interval`, and resumes interrupted runs.
    #[must_use]
    pub fn with_checkpoints(self, out: &Path, interval: Duration) -> Self {
        let checkpoints = CheckpointStore::new(self.store.dir(), &self.graph, out, interval);
        Self { checkpoints: Some(checkpoints), ..self }
    }

    /// Returns the checkpoints, if runs save any.
    #[must_use]
    pub fn checkpoints(&self) -> Option<&CheckpointStore> {
        self.checkpoints.as_ref()
    }

    /// Returns the policy for streams.
    #[must_use]
    pub fn policy(&self) -> &CachePolicy {
        &self.policy
    }

    /// Returns the entries in memory.
    #[must_use]
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Returns the entries on disk.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Returns the key histories and costs.
    #[must_use]
    pub fn index(&self) -> Index<'_> {
        Index::new(self.store.dir(), &self.graph)
    }
}

/// Returns the default folder of the cache of a graph file: `.foley/cache` beside it.
#[must_use]
pub fn default_dir(graph: &Path) -> PathBuf {
    graph.parent().unwrap_or(Path::new("")).join(".foley/cache")
}
