//! Caches results from one run to the next, in memory and on disk, under a key of all that they depend on: the values of value
//! nodes and of folds, and the streams that are expensive to compute for their size.
//!
//! [`Keys`] makes the keys, [`Store`] holds the entries on disk and [`Memory`] the most recent ones, [`choose_streams`] selects
//! the streams, [`stream`] is their file format, and [`Index`] holds the parts of the last keys. [`RunCache`] is the cache
//! during one run.

mod atomic_file;
mod cacheable;
mod checkpoint_store;
mod entry;
mod graph_memo;
mod index;
mod key;
mod memory;
mod plain_file;
mod run_cache;
mod store;
pub mod stream;
mod stream_selection;

pub use atomic_file::temporary_path;
pub use cacheable::{has_cacheable_streams, has_cacheable_values, writes_files};
pub use checkpoint_store::{Checkpoint, CheckpointHeader, CheckpointStore, PartialFile, PhaseSubset};
pub use entry::{Entry, NodeSummary, Output, Unusable};
pub use graph_memo::{CAP, Memo, default_dir};
pub use index::{Index, KeyHistory};
pub use key::{Key, KeyPart, Keys, changes};
pub use memory::{CachedEntry, Hit, MEMORY, Memory};
pub use run_cache::{CachedStream, RunCache, Values};
pub use store::{Store, StoredFile};
pub use stream_selection::{CachePolicy, choose_streams};
