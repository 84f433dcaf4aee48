//! Events of the file system: when to look.

use crossbeam_channel::Sender;
use notify::{EventKind, RecommendedWatcher, RecursiveMode, event::AccessKind, event::AccessMode};
use notify_debouncer_full::{DebounceEventResult, DebouncedEvent, Debouncer, NoCache, new_debouncer_opt};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// How long events are gathered before they are handed on.
const GATHER: Duration = Duration::from_millis(30);

/// A reason to look.
#[derive(Clone, Debug)]
pub struct Glance {
    /// What may have changed; empty where the system lost count.
    pub paths: Vec<PathBuf>,
    /// When the first of it happened.
    pub at: Instant,
}

/// Waits for events in folders.
///
/// Folders are watched one by one, not with what is below them: what a graph reads may lie beside a whole archive.
pub struct Events {
    watcher: Debouncer<RecommendedWatcher, NoCache>,
    watched: BTreeMap<PathBuf, Option<Identity>>,
}

/// What tells a folder from another one that was put in its place.
type Identity = (u64, u64, Option<SystemTime>);

impl Events {
    /// Starts to send a reason to look for each bundle of events.
    ///
    /// # Errors
    /// When the system has no events.
    pub fn new<M: Send + 'static>(
        to: Sender<M>,
        wrap: impl Fn(Glance) -> M + Send + 'static,
    ) -> notify::Result<Self> {
        let hand_on = move |result: DebounceEventResult| {
            if let Some(glance) = glance(result) {
                let _ = to.send(wrap(glance));
            }
        };
        let tick = Some(Duration::from_millis(10));
        let watcher = new_debouncer_opt(GATHER, tick, hand_on, NoCache, notify::Config::default())?;
        Ok(Self { watcher, watched: BTreeMap::new() })
    }

    /// Waits in exactly these folders from now on.
    ///
    /// # Errors
    /// The first of those that cannot be watched, and why.
    pub fn follow(&mut self, folders: &BTreeSet<PathBuf>) -> Result<(), (PathBuf, notify::Error)> {
        let gone: Vec<PathBuf> = self.watched.keys().filter(|f| !folders.contains(*f)).cloned().collect();
        for folder in gone {
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
                // One that has gone meanwhile is no failure: the folder above it is watched as well.
                Err(_) if !folder.is_dir() => {}
                Err(e) => failed = failed.and(Err((folder.clone(), e))),
            }
        }
        failed
    }

    /// Takes up the watch of a folder anew at the next [`Events::follow`]: something happened to the folder itself.
    pub fn doubt(&mut self, path: &Path) {
        if let Some(identity) = self.watched.get_mut(path) {
            *identity = None;
        }
    }
}

fn glance(result: DebounceEventResult) -> Option<Glance> {
    let Ok(events) = result else { return Some(Glance { paths: Vec::new(), at: Instant::now() }) };
    let tells = |e: &&DebouncedEvent| match e.kind {
        // Reading a file is no reason to read it again.
        EventKind::Access(AccessKind::Close(AccessMode::Write)) => true,
        EventKind::Access(_) => false,
        _ => true,
    };
    let told: Vec<&DebouncedEvent> = events.iter().filter(tells).collect();
    let at = told.iter().map(|e| e.time).min()?;
    let lost = told.iter().any(|e| e.need_rescan());
    let paths = if lost { Vec::new() } else { told.iter().flat_map(|e| e.paths.iter().cloned()).collect() };
    Some(Glance { paths, at })
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
    // A number can be used again for the next folder, its birth can not.
    Some((device, inode, meta.created().ok()))
}
