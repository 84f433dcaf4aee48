//! Events of the file system, as hints to compare files.

use crossbeam_channel::Sender;
use notify::event::{AccessKind, AccessMode, ModifyKind, RenameMode};
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

/// A hint that files may have changed.
#[derive(Clone, Debug)]
pub struct ChangeHint {
    /// Paths that may have changed; empty if the system has lost events.
    pub paths: Vec<PathBuf>,
    /// Time of the change.
    pub at: Instant,
    /// True if more is to be expected: the file is being written, or has gone.
    pub open: bool,
}

/// Watches folders for events.
///
/// Folders are watched without their sub-folders: the files of a graph may lie beside a large archive.
pub struct FolderEvents {
    watcher: RecommendedWatcher,
    watched: BTreeMap<PathBuf, Option<Identity>>,
}

/// Distinguishes a folder from another one that replaced it.
type Identity = (u64, u64, Option<SystemTime>);

impl FolderEvents {
    /// Starts to send a hint for each event.
    ///
    /// # Errors
    /// When the system provides no events.
    pub fn new<M: Send + 'static>(
        to: Sender<M>,
        wrap: impl Fn(ChangeHint) -> M + Send + 'static,
    ) -> notify::Result<Self> {
        let send = move |result: notify::Result<Event>| {
            if let Some(hint) = change_hint(result) {
                let _ = to.send(wrap(hint));
            }
        };
        let watcher = notify::recommended_watcher(send)?;
        Ok(Self { watcher, watched: BTreeMap::new() })
    }

    /// Sets the folders that are watched.
    ///
    /// # Errors
    /// The first folder that cannot be watched, with the reason.
    pub fn set_folders(&mut self, folders: &BTreeSet<PathBuf>) -> Result<(), (PathBuf, notify::Error)> {
        let removed: Vec<PathBuf> = self.watched.keys().filter(|f| !folders.contains(*f)).cloned().collect();
        for folder in removed {
            let _ = self.watcher.unwatch(&folder);
            self.watched.remove(&folder);
        }
        let mut failed = Ok(());
        for folder in folders {
            let identity = identity(folder);
            if self.watched.get(folder).is_some_and(|known| *known == identity) {
                continue;
            }
            if self.watched.remove(folder).is_some() {
                let _ = self.watcher.unwatch(folder);
            }
            match self.watcher.watch(folder, RecursiveMode::NonRecursive) {
                Ok(()) => {
                    self.watched.insert(folder.clone(), identity);
                }
                // A folder that was removed meanwhile is no failure: its parent is watched as well.
                Err(_) if !folder.is_dir() => {}
                Err(e) => failed = failed.and(Err((folder.clone(), e))),
            }
        }
        failed
    }

    /// Renews the watch of a folder at the next [`FolderEvents::set_folders`]: an event concerned the folder itself.
    pub fn invalidate(&mut self, path: &Path) {
        if let Some(identity) = self.watched.get_mut(path) {
            *identity = None;
        }
    }
}

fn change_hint(result: notify::Result<Event>) -> Option<ChangeHint> {
    let at = Instant::now();
    let Ok(event) = result else { return Some(ChangeHint { paths: Vec::new(), at, open: false }) };
    let open = match event.kind {
        EventKind::Access(AccessKind::Close(AccessMode::Write)) => false,
        // Read access and attributes are no change of what a file holds.
        EventKind::Access(_) | EventKind::Modify(ModifyKind::Metadata(_)) => return None,
        // Editors that save by a rename have written the whole file before.
        EventKind::Modify(ModifyKind::Name(RenameMode::To | RenameMode::Both)) => false,
        _ => true,
    };
    let paths = if event.need_rescan() { Vec::new() } else { event.paths };
    Some(ChangeHint { paths, at, open })
}

fn identity(folder: &Path) -> Option<Identity> {
    let meta = std::fs::metadata(folder).ok()?;
    #[cfg(unix)]
    let (device, inode) = {
        use std::os::unix::fs::MetadataExt as _;
        (meta.dev(), meta.ino())
    };
    #[cfg(not(unix))]
    let (device, inode) = (0, 0);
    // The system can reuse an inode number for the next folder, but not with the same creation time.
    Some((device, inode, meta.created().ok()))
}
