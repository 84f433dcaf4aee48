//! Tells, whenever it is asked, whether anything that matters has another content; never waits.

use super::{Events, Glance, Seen};
use crate::graph::Asked;
use crossbeam_channel::{Receiver, unbounded};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Silence after the last event before files are looked at.
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
}

impl Eyes {
    /// Looks at nothing yet; `poll` seconds between looks in place of events. A system without events is told as a text.
    #[must_use]
    pub fn new(poll: Option<f64>) -> (Self, Option<String>) {
        let (sender, received) = unbounded();
        let (events, warning) = match poll {
            Some(_) => (None, None),
            None => match Events::new(sender, |glance| glance) {
                Ok(events) => (Some(events), None),
                Err(e) => (None, Some(format!("no events of the file system: {e}"))),
            },
        };
        let eyes = Self {
            seen: Seen::default(),
            events,
            received,
            names: BTreeSet::new(),
            folders: BTreeSet::new(),
            sweep: poll.map_or(SWEEP, Duration::from_secs_f64),
            looked: Instant::now(),
            noise: None,
        };
        (eyes, warning)
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

    /// How many files are looked at.
    #[must_use]
    pub fn files(&self) -> usize {
        self.seen.len()
    }

    fn refresh(&mut self) {
        (self.names, self.folders) = self.seen.names();
        if let Some(events) = &mut self.events
            && events.follow(&self.seen.folders()).is_err()
        {
            self.events = None;
        }
    }

    /// When something began to change that has another content by now, once it is quiet again.
    pub fn changed(&mut self) -> Option<Instant> {
        while let Ok(glance) = self.received.try_recv() {
            if self.heed(&glance) {
                let first = self.noise.map_or(glance.at, |(first, _)| first);
                self.noise = Some((first, Instant::now()));
            }
        }
        let at = match self.noise {
            Some((first, last)) if last.elapsed() < QUIET && first.elapsed() < PATIENCE => return None,
            Some((first, _)) => first,
            None if self.looked.elapsed() >= self.sweep => Instant::now(),
            None => return None,
        };
        let heard = self.noise.take().is_some();
        self.looked = Instant::now();
        self.refresh();
        if !self.seen.look() {
            return None;
        }
        if self.events.is_none() && !heard {
            // Without events only a second look tells that nobody writes any more.
            std::thread::sleep(QUIET);
            self.seen.look();
        }
        Some(at)
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
