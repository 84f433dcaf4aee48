//! Reports changed files.
//!
//! The watcher never waits itself: the caller waits for [`FileWatcher::hints`], at most [`FileWatcher::timeout`].

use super::events::{ChangeHint, FolderEvents};
use super::snapshot::{Contents, Snapshot};
use crate::graph::Asked;
use crossbeam_channel::{Receiver, unbounded};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time without events before files are compared, if one of them may still be written.
const QUIET: Duration = Duration::from_millis(50);
/// The same if all have been closed or renamed: enough for a program that saves several files.
const SETTLE: Duration = Duration::from_millis(4);
/// Maximum time to wait for the end of the events, if a file is written continuously.
const MAX_WAIT: Duration = Duration::from_secs(10);
/// Interval of comparisons without an event, since events can get lost.
const SCAN_INTERVAL: Duration = Duration::from_secs(1);

/// Compares files when there are events, and at intervals.
pub struct FileWatcher {
    snapshot: Snapshot,
    events: Option<FolderEvents>,
    received: Receiver<ChangeHint>,
    names: BTreeSet<OsString>,
    folders: BTreeSet<PathBuf>,
    scan_interval: Duration,
    last_scan: Instant,
    /// Events since the last comparison.
    burst: Option<Burst>,
    /// The reason why there are no events.
    warning: Option<String>,
}

/// Events of files that are watched.
struct Burst {
    first: Instant,
    last: Instant,
    /// Files that may still be written.
    open: BTreeSet<PathBuf>,
}

impl Burst {
    fn new(at: Instant) -> Self {
        Self { first: at, last: at, open: BTreeSet::new() }
    }

    fn add(&mut self, hint: &ChangeHint) {
        self.last = hint.at;
        for path in &hint.paths {
            if hint.open {
                self.open.insert(path.clone());
            } else {
                self.open.remove(path);
            }
        }
    }

    /// Time left until the files can be compared.
    fn wait(&self) -> Duration {
        let quiet = if self.open.is_empty() { SETTLE } else { QUIET };
        quiet.saturating_sub(self.last.elapsed()).min(MAX_WAIT.saturating_sub(self.first.elapsed()))
    }
}

impl FileWatcher {
    /// A watcher without files; with `poll`, it compares files at this interval in s and uses no events.
    #[must_use]
    pub fn new(poll: Option<f64>) -> Self {
        let (sender, received) = unbounded();
        let (events, warning) = match poll {
            Some(_) => (None, None),
            None => match FolderEvents::new(sender, |hint| hint) {
                Ok(events) => (Some(events), None),
                Err(e) => (None, Some(format!("no events of the file system: {e}"))),
            },
        };
        Self {
            snapshot: Snapshot::default(),
            events,
            received,
            names: BTreeSet::new(),
            folders: BTreeSet::new(),
            scan_interval: poll.map_or(SCAN_INTERVAL, Duration::from_secs_f64),
            last_scan: Instant::now(),
            burst: None,
            warning,
        }
    }

    /// Takes the reason why there are no events and files are compared at intervals only.
    pub fn take_warning(&mut self) -> Option<String> {
        self.warning.take()
    }

    /// Adds files that were opened, or with `only` replaces all others by them; returns true if one has changed since.
    pub fn watch(&mut self, asked: &Asked, only: bool) -> bool {
        if only {
            self.snapshot.retain(asked);
        }
        let changed = self.snapshot.add(asked);
        self.update_folders();
        changed
    }

    /// Returns the contents at the last comparison.
    #[must_use]
    pub fn contents(&self) -> Contents {
        self.snapshot.contents()
    }

    /// Returns the number of files.
    #[must_use]
    pub fn files(&self) -> usize {
        self.snapshot.len()
    }

    /// Watches folders that were replaced, created or added.
    fn update_folders(&mut self) {
        (self.names, self.folders) = self.snapshot.names();
        let Some(events) = &mut self.events else { return };
        if let Err((folder, e)) = events.set_folders(&self.snapshot.folders()) {
            self.warning = Some(format!("no events of {}: {e}", folder.display()));
            self.events = None;
        }
    }

    /// Returns the channel of hints, each to be passed to [`FileWatcher::note`].
    #[must_use]
    pub fn hints(&self) -> Receiver<ChangeHint> {
        self.received.clone()
    }

    /// Notes a hint.
    pub fn note(&mut self, hint: &ChangeHint) {
        if self.is_relevant(hint) {
            self.burst.get_or_insert_with(|| Burst::new(hint.at)).add(hint);
        }
    }

    /// Returns the time until [`FileWatcher::changed`] has to be called, unless there is a hint.
    #[must_use]
    pub fn timeout(&self) -> Duration {
        match &self.burst {
            Some(burst) => burst.wait(),
            None => self.scan_interval.saturating_sub(self.last_scan.elapsed()),
        }
    }

    /// Compares files if there were events and they have ended, or if the interval is over; returns the time of the change.
    pub fn changed(&mut self) -> Option<Instant> {
        while let Ok(hint) = self.received.try_recv() {
            self.note(&hint);
        }
        let at = match &self.burst {
            Some(burst) if !burst.wait().is_zero() => return None,
            Some(burst) => burst.first,
            None if self.last_scan.elapsed() >= self.scan_interval => Instant::now(),
            None => return None,
        };
        self.burst = None;
        let start = Instant::now();
        self.update_folders();
        let changed = self.snapshot.update();
        // Without events, the write has ended when a second comparison finds no change.
        while changed && self.events.is_none() && start.elapsed() < MAX_WAIT {
            std::thread::sleep(QUIET);
            self.update_folders();
            if !self.snapshot.update() {
                break;
            }
        }
        self.last_scan = Instant::now();
        changed.then_some(at)
    }

    /// Returns true if a hint concerns a watched file.
    fn is_relevant(&mut self, hint: &ChangeHint) -> bool {
        if let Some(events) = &mut self.events {
            hint.paths.iter().for_each(|path| events.invalidate(path));
        }
        let watched = |path: &PathBuf| {
            path.file_name().is_none_or(|name| self.names.contains(name))
                || path.parent().is_some_and(|p: &Path| self.folders.contains(p))
        };
        hint.paths.is_empty() || hint.paths.iter().any(watched)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_were_closed_are_compared_soon_and_others_later() {
        let now = Instant::now();
        let mut burst = Burst::new(now);
        let mut note = |names: &[&str], open: bool| {
            let paths = names.iter().map(PathBuf::from).collect();
            burst.add(&ChangeHint { paths, at: Instant::now(), open });
            burst.wait()
        };
        assert!(note(&["a.ron"], true) > SETTLE);
        assert!(note(&["a.ron"], false) <= SETTLE);
        // Another file is still written.
        note(&["a.ron", "b.wav"], true);
        assert!(note(&["a.ron"], false) > SETTLE);
        assert!(note(&["b.wav"], false) <= SETTLE);
        // One that is written for ever holds nothing up.
        if let Some(first) = now.checked_sub(MAX_WAIT) {
            note(&["b.wav"], true);
            burst.first = first;
            assert!(burst.wait().is_zero());
        }
    }
}
