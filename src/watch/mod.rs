//! Reports that a graph, or a file that it reads, has changed, and the differences.
//!
//! Events ([`FolderEvents`]) only trigger a comparison; changes are found by comparing contents ([`Snapshot`]), and their
//! effect on the graph by comparing it node by node ([`Changes`]).

mod changes;
mod events;
mod file_watcher;
mod snapshot;

pub use changes::{Changes, list};
pub use events::{ChangeHint, FolderEvents};
pub use file_watcher::FileWatcher;
pub use snapshot::{Content, Contents, Key, Snapshot};
