//! The files that a graph has requested, with their stamps.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// All files that were requested while a graph was read and run, also missing ones.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Files and folders, by the requested path, with their stamps before they were first read.
    pub files: BTreeMap<PathBuf, Option<Stamp>>,
    /// Patterns of numbered sequences.
    pub sequences: BTreeSet<String>,
    /// Folders whose files were listed.
    pub folders: BTreeSet<PathBuf>,
}

/// Properties of a file that identify its content without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Bytes.
    pub len: u64,
    /// Time of the last change of its content.
    pub modified: Option<SystemTime>,
    /// Device, inode, and time of the last change of either, if the system has them.
    pub identity: Option<(u64, u64, i64, i64)>,
}

impl Stamp {
    /// The stamp of the file at a path; `None` if there is none.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        fs::metadata(path).ok().map(|meta| Self::from(&meta))
    }
}

impl From<&Metadata> for Stamp {
    fn from(meta: &Metadata) -> Self {
        #[cfg(unix)]
        let identity = {
            use std::os::unix::fs::MetadataExt as _;
            Some((meta.dev(), meta.ino(), meta.ctime(), meta.ctime_nsec()))
        };
        #[cfg(not(unix))]
        let identity = None;
        Self { len: meta.len(), modified: meta.modified().ok(), identity }
    }
}
