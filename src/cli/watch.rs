//! `foley watch`.

use super::Exit;
use super::args::WatchArgs;
use super::run::{Prepared, Ready, look, render_files, show, tell};
use crate::diag::{Diagnostic, Severity, Sources};
use crate::graph::{Asked, Graph};
use crate::memo::{MEMORY, Memo};
use crate::run::{Progress, Report};
use crate::watch::{Changes, Contents, Events, Glance, Seen, list};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Silence after the last event before files are looked at; events are gathered for 30 ms before that.
const QUIET: Duration = Duration::from_millis(20);
/// How long an error has to last before it is told: until then the file may be half written.
const SETTLE: Duration = Duration::from_millis(400);
/// How long silence is waited for where something is written without end.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often files are looked at without an event, since events can get lost.
const SWEEP: Duration = Duration::from_secs(1);

type Ran = Result<Report, Vec<Diagnostic>>;

enum Message {
    Events(Glance),
    Ran(Box<Ran>),
    Stop,
}

enum Woken {
    /// Something has another content, first heard of at this time.
    Changed(Instant),
    /// The run has ended.
    Ran(Box<Ran>),
    /// The time is over.
    Late,
    /// The user wants to end.
    Stop,
}

/// How an attempt to run went.
enum Attempt {
    /// To its end, good or bad.
    Over,
    /// A newer save came.
    Changed(Instant),
    /// The user wants to end.
    Stop,
}

struct Session<'a> {
    args: &'a WatchArgs,
    seen: Seen,
    events: Option<Events>,
    names: BTreeSet<OsString>,
    folders: BTreeSet<PathBuf>,
    received: Receiver<Message>,
    sender: Sender<Message>,
    sweep: Duration,
    /// Holds what was kept in memory, from run to run.
    memo: Option<Arc<Memo>>,
    /// The graph of the last good run, and the contents that it came from.
    good: Option<(Graph, Contents)>,
    /// Whether what was told last is an error.
    wrong: bool,
}

/// Runs a graph, and again after each save.
///
/// # Errors
/// When standard output goes away.
pub fn watch(args: &WatchArgs) -> anyhow::Result<Exit> {
    let (sender, received) = unbounded();
    let stop = sender.clone();
    // Only the first handler of a process can be set; a second session in the same process keeps the first.
    let _ = ctrlc::set_handler(move || {
        let _ = stop.send(Message::Stop);
    });
    let mut session = Session {
        args,
        seen: Seen::default(),
        events: None,
        names: BTreeSet::new(),
        folders: BTreeSet::new(),
        received,
        memo: args.run.memo.memo(&args.run.graph.graph).map(|memo| Arc::new(memo.holding(MEMORY))),
        sender: sender.clone(),
        sweep: args.poll.map_or(SWEEP, Duration::from_secs_f64),
        good: None,
        wrong: false,
    };
    if args.poll.is_none() {
        match Events::new(sender, Message::Events) {
            Ok(events) => session.events = Some(events),
            Err(e) => no_events(&e),
        }
    }
    session.watch()
}

fn warn(message: String) {
    let warning = Diagnostic { severity: Severity::Warning, ..Diagnostic::general("F092", message) };
    let help = "files are looked at once a second instead; --poll SECONDS sets how often";
    show(&[warning.help(help)], &Sources::default());
}

fn no_events(e: &dyn std::fmt::Display) {
    warn(format!("no events of the file system: {e}"));
}

impl Session<'_> {
    fn watch(&mut self) -> anyhow::Result<Exit> {
        let mut at = Instant::now();
        let mut first = true;
        loop {
            match self.attempt(at)? {
                Attempt::Stop => return Ok(Exit::Done),
                Attempt::Changed(newer) => {
                    at = newer;
                    continue;
                }
                Attempt::Over => {}
            }
            if std::mem::take(&mut first) && !self.args.run.quiet {
                let files = self.seen.len();
                let plural = if files == 1 { "" } else { "s" };
                say(&format!("watching {files} file{plural}; Ctrl-C ends"))?;
            }
            at = loop {
                match self.wait(None) {
                    Woken::Changed(at) => break at,
                    Woken::Stop => return Ok(Exit::Done),
                    Woken::Ran(_) | Woken::Late => {}
                }
            };
        }
    }

    /// Runs the graph as it is now, unless a newer save comes.
    fn attempt(&mut self, at: Instant) -> anyhow::Result<Attempt> {
        if !self.wrong && self.good.as_ref().is_some_and(|(_, was)| *was == self.seen.contents()) {
            return Ok(Attempt::Over);
        }
        let run = &self.args.run;
        let Prepared { ready, found, sources, asked } = look(&run.graph, &run.engine, run.quiet);
        let Some(ready) = ready else {
            let late = self.follow(&asked);
            return Ok(self.fail(late.then_some(at), &found, &sources));
        };
        show(&found, &sources);
        self.seen.keep(&asked);
        let ready = Arc::new(ready);
        let progress = Arc::new(Progress::default());
        self.start(&ready, &progress);
        // Large files are hashed while the run goes on.
        let mut newer = self.follow(&asked).then_some(at);
        let contents = self.seen.contents();
        let mut stop = false;
        let ran = loop {
            if newer.is_some() || stop {
                progress.stop.store(true, Ordering::SeqCst);
            }
            match self.wait(None) {
                Woken::Ran(ran) => break *ran,
                Woken::Changed(at) => newer = Some(newer.unwrap_or(at)),
                Woken::Stop => stop = true,
                Woken::Late => {}
            }
        };
        // The run may have opened more than the plan did.
        let late = self.follow(&ready.files.asked());
        let now = self.seen.contents();
        if late || contents.iter().any(|(key, content)| now.get(key) != Some(content)) {
            newer = newer.or(Some(at));
        }
        match ran {
            Ok(report) => self.succeed(&report, ready, contents, at)?,
            Err(_) if newer.is_some() || stop => {}
            Err(errors) => return Ok(self.fail(None, &errors, &ready.graph.sources)),
        }
        Ok(match (stop, newer) {
            (true, _) => Attempt::Stop,
            (false, Some(at)) => Attempt::Changed(at),
            (false, None) => Attempt::Over,
        })
    }

    /// Starts the run on a thread of its own.
    fn start(&self, ready: &Arc<Ready>, progress: &Arc<Progress>) {
        let (ready, progress) = (Arc::clone(ready), Arc::clone(progress));
        let (args, sender) = (self.args.run.clone(), self.sender.clone());
        let memo = self.memo.clone();
        std::thread::spawn(move || {
            let run = AssertUnwindSafe(|| render_files(&ready, &args, memo.as_deref(), &progress));
            let ran = catch_unwind(run).unwrap_or_else(|_| {
                let defect = Diagnostic::general("F099", "the run panicked");
                Err(vec![defect.help("this is a defect in foley: please report it")])
            });
            // Whoever receives this may want to own the graph.
            drop(ready);
            let _ = sender.send(Message::Ran(Box::new(ran)));
        });
    }

    /// Tells what a good run gave and what had changed.
    fn succeed(
        &mut self,
        report: &Report,
        ready: Arc<Ready>,
        mut contents: Contents,
        at: Instant,
    ) -> anyhow::Result<()> {
        // What was opened only while running belongs to this result as well.
        for (key, content) in self.seen.contents() {
            contents.entry(key).or_insert(content);
        }
        if let Err(e) = tell(report, &ready, &self.args.run) {
            if e.downcast_ref::<std::io::Error>().is_some() {
                return Err(e);
            }
            eprintln!("foley: {e:#}");
        }
        if let Some((old, was)) = &self.good
            && !self.args.run.quiet
        {
            let changes = Changes::between((old, was), (&ready.graph, &contents));
            let (ms, economy) = (at.elapsed().as_millis(), economy(report));
            say(&format!("reran in {ms} ms: {changes}, {economy}"))?;
        }
        self.wrong = false;
        if let Some(ready) = Arc::into_inner(ready) {
            self.good = Some((ready.graph, contents));
        }
        Ok(())
    }

    /// Tells errors that last; a file that is only half written gets the time to become whole.
    fn fail(&mut self, late: Option<Instant>, errors: &[Diagnostic], sources: &Sources) -> Attempt {
        let woken = match late {
            Some(at) => Woken::Changed(at),
            None => self.wait(Some(SETTLE)),
        };
        match woken {
            Woken::Changed(at) => return Attempt::Changed(at),
            Woken::Stop => return Attempt::Stop,
            Woken::Ran(_) | Woken::Late => {}
        }
        show(errors, sources);
        self.wrong = true;
        match self.good {
            Some(_) => eprintln!("foley: the last good result stays; waiting for the next save"),
            None => eprintln!("foley: there is no result yet; waiting for the next save"),
        }
        Attempt::Over
    }

    /// Waits for what was asked for as well; gives whether any of it has changed since.
    fn follow(&mut self, asked: &Asked) -> bool {
        let late = self.seen.add(asked);
        self.refresh();
        late
    }

    /// Takes up the watches of folders that were replaced, appeared, or matter only now.
    fn refresh(&mut self) {
        (self.names, self.folders) = self.seen.names();
        let Some(events) = &mut self.events else { return };
        if let Err((folder, e)) = events.follow(&self.seen.folders()) {
            warn(format!("no events of {}: {e}", folder.display()));
            self.events = None;
        }
    }

    /// Waits until something has another content, the run has ended, or the time is over.
    fn wait(&mut self, limit: Option<Duration>) -> Woken {
        let start = Instant::now();
        loop {
            let left =
                limit.map_or(self.sweep, |limit| limit.saturating_sub(start.elapsed()).min(self.sweep));
            let at = match self.received.recv_timeout(left) {
                Ok(Message::Stop) => return Woken::Stop,
                Ok(Message::Ran(ran)) => return Woken::Ran(ran),
                Ok(Message::Events(glance)) => match self.heed(&glance) {
                    true => glance.at,
                    false => continue,
                },
                Err(RecvTimeoutError::Timeout) => Instant::now(),
                // This session holds a sender itself.
                Err(RecvTimeoutError::Disconnected) => return Woken::Stop,
            };
            if let Some(other) = self.changed() {
                return match other {
                    Woken::Changed(_) => Woken::Changed(at),
                    other => other,
                };
            }
            if limit.is_some_and(|limit| start.elapsed() >= limit) {
                return Woken::Late;
            }
        }
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

    /// Looks whether anything has another content, once it is quiet.
    fn changed(&mut self) -> Option<Woken> {
        let start = Instant::now();
        let mut changed = false;
        loop {
            let mut noise = false;
            if self.events.is_some() {
                match self.received.recv_timeout(QUIET) {
                    Ok(Message::Stop) => return Some(Woken::Stop),
                    // Whoever waits for a run compares the contents after it, so no change is lost here.
                    Ok(Message::Ran(ran)) => return Some(Woken::Ran(ran)),
                    Ok(Message::Events(glance)) => noise = self.heed(&glance),
                    Err(_) => {}
                }
            } else if changed {
                // Without events only a second look tells that nobody writes any more.
                std::thread::sleep(QUIET);
            }
            if noise && start.elapsed() < PATIENCE {
                continue;
            }
            self.refresh();
            let again = self.seen.look();
            changed |= again;
            // With events it has been quiet already.
            if !again || self.events.is_some() || start.elapsed() >= PATIENCE {
                return changed.then_some(Woken::Changed(start));
            }
        }
    }
}

/// How many nodes came from the memo, and which did not.
fn economy(report: &Report) -> String {
    let kept = report.nodes.iter().filter(|n| n.cached).count();
    let computed = report.computed();
    let plural = if kept == 1 { "" } else { "s" };
    let names = if computed.is_empty() { String::new() } else { format!(" ({})", list(&computed)) };
    format!("{kept} node{plural} kept, {} recomputed{names}", computed.len())
}

fn say(line: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()
}
