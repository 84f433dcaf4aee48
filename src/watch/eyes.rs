//! Tells, whenever it is asked, whether anything that matters has another content.
//!
//! It never waits itself: whoever does waits for [`Eyes::glances`] beside what else may come, at most as long as [`Eyes::rest`].

use super::{Contents, Events, Glance, Seen};
use crate::graph::Asked;
use crossbeam_channel::{Receiver, unbounded};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Silence after the last event before files are looked at; events are gathered for 30 ms before that.
const QUIET: Duration = Duration::from_millis(20);
/// How long silence is waited for where something is written without end.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often files are looked at without an event, since events can get lost.
const SWEEP: Duration = Duration::from_secs(1);

/// Looks at files when something tells it to, or from time to time.
pub struct Eyes {
    seen: Seen,
    events: Option<Events>,
    received: Receiver<Glance>,
    names: BTreeSet<OsString>,
    folders: BTreeSet<PathBuf>,
    sweep: Duration,
    looked: Instant,
    /// When the events that are under way began, and when the last of them came.
    noise: Option<(Instant, Instant)>,
    /// Why there are no events.
    warning: Option<String>,
}

impl Eyes {
    /// Looks at nothing yet; `poll` seconds between looks in place of events.
    #[must_use]
    pub fn new(poll: Option<f64>) -> Self {
        let (sender, received) = unbounded();
        let (events, warning) = match poll {
            Some(_) => (None, None),
            None => match Events::new(sender, |glance| glance) {
                Ok(events) => (Some(events), None),
                Err(e) => (None, Some(format!("no events of the file system: {e}"))),
            },
        };
        Self {
            seen: Seen::default(),
            events,
            received,
            names: BTreeSet::new(),
            folders: BTreeSet::new(),
            sweep: poll.map_or(SWEEP, Duration::from_secs_f64),
            looked: Instant::now(),
            noise: None,
            warning,
        }
    }

    /// Why there are no events and files are looked at from time to time only; told once.
    pub fn take_warning(&mut self) -> Option<String> {
        self.warning.take()
    }

    /// Looks at what was asked for as well, or `only` at that; gives whether any of it has changed since it was asked for.
    pub fn follow(&mut self, asked: &Asked, only: bool) -> bool {
        if only {
            self.seen.keep(asked);
        }
        let late = self.seen.add(asked);
        self.refresh();
        late
    }

    /// What was found at the last look.
    #[must_use]
    pub fn contents(&self) -> Contents {
        self.seen.contents()
    }

    /// How many files are looked at.
    #[must_use]
    pub fn files(&self) -> usize {
        self.seen.len()
    }

    /// Takes up the watches of folders that were replaced, appeared, or matter only now.
    fn refresh(&mut self) {
        (self.names, self.folders) = self.seen.names();
        let Some(events) = &mut self.events else { return };
        if let Err((folder, e)) = events.follow(&self.seen.folders()) {
            self.warning = Some(format!("no events of {}: {e}", folder.display()));
            self.events = None;
        }
    }

    /// Reasons to look, each to be handed to [`Eyes::note`].
    #[must_use]
    pub fn glances(&self) -> Receiver<Glance> {
        self.received.clone()
    }

    /// Takes a reason to look.
    pub fn note(&mut self, glance: &Glance) {
        if self.heed(glance) {
            let first = self.noise.map_or(glance.at, |(first, _)| first);
            self.noise = Some((first, Instant::now()));
        }
    }

    /// How long nothing has to be asked unless there is a glance.
    #[must_use]
    pub fn rest(&self) -> Duration {
        match self.noise {
            Some((_, last)) => QUIET.saturating_sub(last.elapsed()),
            None => self.sweep.saturating_sub(self.looked.elapsed()),
        }
    }

    /// When something began to change that has another content by now, once it is quiet again.
    pub fn changed(&mut self) -> Option<Instant> {
        while let Ok(glance) = self.received.try_recv() {
            self.note(&glance);
        }
        let at = match self.noise {
            Some((first, last)) if last.elapsed() < QUIET && first.elapsed() < PATIENCE => return None,
            Some((first, _)) => first,
            None if self.looked.elapsed() >= self.sweep => Instant::now(),
            None => return None,
        };
        self.noise = None;
        let start = Instant::now();
        self.refresh();
        let changed = self.seen.look();
        // Without events only another look tells that nobody writes any more.
        while changed && self.events.is_none() && start.elapsed() < PATIENCE {
            std::thread::sleep(QUIET);
            self.refresh();
            if !self.seen.look() {
                break;
            }
        }
        self.looked = Instant::now();
        changed.then_some(at)
    }

    /// Whether an event is about anything that matters.
    fn heed(&mut self, glance: &Glance) -> bool {
        if let Some(events) = &mut self.events {
            glance.paths.iter().for_each(|path| events.doubt(path));
        }
        let matters = |path: &PathBuf| {
            path.file_name().is_none_or(|name| self.names.contains(name))
                || path.parent().is_some_and(|p: &Path| self.folders.contains(p))
        };
        glance.paths.is_empty() || glance.paths.iter().any(matters)
    }
}
