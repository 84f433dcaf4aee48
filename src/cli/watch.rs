//! `foley watch`.

use super::Exit;
use super::args::WatchArgs;
use super::console::{print_line, print_message};
use super::run::{print_results, render_files, show};
use crate::diag::{Diagnostic, Severity, Sources};
use crate::graph::Graph;
use crate::memo::{MEMORY, Memo};
use crate::run::Report;
use crate::session::{Preparation, Prepared};
use crate::watch::{Changes, Contents, FileWatcher, list};
use crossbeam_channel::{Receiver, Sender, select, unbounded};
use foley_nodes::registry::Registry;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Time that an error has to persist before it is reported: the file may be half written.
pub(super) const SETTLE: Duration = Duration::from_millis(400);
type Ran = Result<Report, Vec<Diagnostic>>;

enum Message {
    Ran(Box<Ran>),
    Stop,
}

enum Woken {
    /// A content has changed, first noticed at this time.
    Changed(Instant),
    /// The run has ended.
    Ran(Box<Ran>),
    /// The time is over.
    TimedOut,
    /// The user wants to end.
    Stop,
}

/// Result of an attempt to run.
enum Attempt {
    /// Ran to its end, with or without success.
    Over,
    /// A newer save came.
    Changed(Instant),
    /// The user wants to end.
    Stop,
}

struct Session<'a> {
    args: &'a WatchArgs,
    registry: Arc<Registry>,
    watcher: FileWatcher,
    received: Receiver<Message>,
    sender: Sender<Message>,
    /// The cache in memory, from run to run.
    memo: Option<Arc<Memo>>,
    /// The graph of the last good run, and the contents that it came from.
    good: Option<(Graph, Contents)>,
    /// True if the last message was an error.
    wrong: bool,
}

/// Runs a graph, and again after each save.
///
/// # Errors
/// When standard output goes away.
pub fn watch(args: &WatchArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let (sender, received) = unbounded();
    let stop = sender.clone();
    // Only the first handler of a process can be set; a second session in the same process uses the first one.
    let _ = ctrlc::set_handler(move || {
        let _ = stop.send(Message::Stop);
    });
    let session = Session {
        args,
        registry: Arc::clone(registry),
        watcher: FileWatcher::new(args.poll),
        received,
        sender,
        memo: args.run.memo.memo(&args.run.graph.graph).map(|memo| Arc::new(memo.with_memory(MEMORY))),
        good: None,
        wrong: false,
    };
    session.watch()
}

/// Explains why files are polled.
pub(super) fn no_events(watcher: &mut FileWatcher) {
    if let Some(message) = watcher.take_warning() {
        let warning = Diagnostic { severity: Severity::Warning, ..Diagnostic::general("F092", message) };
        let help = "files are compared once a second instead; --poll SECONDS sets how often";
        show(&[warning.help(help)], &Sources::default());
    }
}

impl Session<'_> {
    fn watch(mut self) -> anyhow::Result<Exit> {
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
                let files = self.watcher.files();
                let plural = if files == 1 { "" } else { "s" };
                print_line(&format!("watching {files} file{plural}; Ctrl-C ends"))?;
            }
            at = loop {
                match self.wait(None) {
                    Woken::Changed(at) => break at,
                    Woken::Stop => return Ok(Exit::Done),
                    Woken::Ran(_) | Woken::TimedOut => {}
                }
            };
        }
    }

    /// Runs the graph as it is now, unless a newer save comes.
    fn attempt(&mut self, at: Instant) -> anyhow::Result<Attempt> {
        if !self.wrong && self.good.as_ref().is_some_and(|(_, was)| *was == self.watcher.contents()) {
            return Ok(Attempt::Over);
        }
        let run = &self.args.run;
        let session = run.session(&self.registry).with_memo(self.memo.clone());
        let Preparation { prepared, diagnostics: found, sources, asked } = session.prepare();
        let Some(ready) = prepared else {
            let stale = self.watcher.watch(&asked, false);
            return Ok(self.fail(stale.then_some(at), &found, &sources));
        };
        show(&found, &sources);
        let ready = Arc::new(ready);
        self.start(&ready);
        // Large files are hashed while the run continues.
        let mut newer = self.watcher.watch(&asked, true).then_some(at);
        let contents = self.watcher.contents();
        let mut stop = false;
        let ran = loop {
            if newer.is_some() || stop {
                ready.progress.stop.store(true, Ordering::SeqCst);
            }
            match self.wait(None) {
                Woken::Ran(ran) => break *ran,
                Woken::Changed(at) => newer = Some(newer.unwrap_or(at)),
                Woken::Stop => stop = true,
                Woken::TimedOut => {}
            }
        };
        // The run may have opened more than the plan did.
        let stale = self.watcher.watch(&ready.files.asked(), false);
        let now = self.watcher.contents();
        if stale || contents.iter().any(|(key, content)| now.get(key) != Some(content)) {
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
    fn start(&self, ready: &Arc<Prepared>) {
        let ready = Arc::clone(ready);
        let (args, sender) = (self.args.run.clone(), self.sender.clone());
        std::thread::spawn(move || {
            let run = AssertUnwindSafe(|| render_files(&ready, &args));
            let ran = catch_unwind(run).unwrap_or_else(|_| {
                let defect = Diagnostic::general("F099", "the run panicked");
                Err(vec![defect.help("this is a defect in foley: please report it")])
            });
            // Whoever receives this may want to own the graph.
            drop(ready);
            let _ = sender.send(Message::Ran(Box::new(ran)));
        });
    }

    /// Prints the results of a successful run and the changes.
    fn succeed(
        &mut self,
        report: &Report,
        ready: Arc<Prepared>,
        mut contents: Contents,
        at: Instant,
    ) -> anyhow::Result<()> {
        // Files that were opened only during the run belong to this result as well.
        for (key, content) in self.watcher.contents() {
            contents.entry(key).or_insert(content);
        }
        if let Err(e) = print_results(report, &ready, &self.args.run) {
            if e.downcast_ref::<std::io::Error>().is_some() {
                return Err(e);
            }
            print_message(format_args!("{e:#}"));
        }
        if let Some((old, was)) = &self.good
            && !self.args.run.quiet
        {
            let changes = Changes::between((old, was), (&ready.graph, &contents));
            let (ms, economy) = (at.elapsed().as_millis(), economy(report));
            print_line(&format!("reran in {ms} ms: {changes}, {economy}"))?;
        }
        self.wrong = false;
        if let Some(ready) = Arc::into_inner(ready) {
            self.good = Some((ready.graph, contents));
        }
        Ok(())
    }

    /// Reports errors that persist; a half written file gets time to become complete.
    fn fail(&mut self, changed: Option<Instant>, errors: &[Diagnostic], sources: &Sources) -> Attempt {
        let woken = match changed {
            Some(at) => Woken::Changed(at),
            None => self.wait(Some(SETTLE)),
        };
        match woken {
            Woken::Changed(at) => return Attempt::Changed(at),
            Woken::Stop => return Attempt::Stop,
            Woken::Ran(_) | Woken::TimedOut => {}
        }
        show(errors, sources);
        self.wrong = true;
        match self.good {
            Some(_) => print_message("the last good result stays; waiting for the next save"),
            None => print_message("there is no result yet; waiting for the next save"),
        }
        Attempt::Over
    }

    /// Waits until something has another content, the run has ended, or the time is over.
    fn wait(&mut self, limit: Option<Duration>) -> Woken {
        let (start, hints, received) = (Instant::now(), self.watcher.hints(), self.received.clone());
        loop {
            no_events(&mut self.watcher);
            if let Some(at) = self.watcher.changed() {
                return Woken::Changed(at);
            }
            let left = limit.map(|limit| limit.saturating_sub(start.elapsed()));
            if left.is_some_and(|left| left.is_zero()) {
                return Woken::TimedOut;
            }
            let rest = left.map_or(self.watcher.timeout(), |left| left.min(self.watcher.timeout()));
            select! {
                recv(received) -> message => match message {
                    // This session holds a sender itself, so the channel never closes.
                    Ok(Message::Stop) | Err(_) => return Woken::Stop,
                    // Whoever waits for a run compares the contents after it, so no change is lost here.
                    Ok(Message::Ran(ran)) => return Woken::Ran(ran),
                },
                recv(hints) -> hint => if let Ok(hint) = hint {
                    self.watcher.note(&hint);
                },
                default(rest) => {}
            }
        }
    }
}

/// Number of cached nodes, and the names of the others.
fn economy(report: &Report) -> String {
    let cached = report.nodes.iter().filter(|n| n.cached).count();
    let computed = report.computed();
    let plural = if cached == 1 { "" } else { "s" };
    let names = if computed.is_empty() { String::new() } else { format!(" ({})", list(&computed)) };
    format!("{cached} node{plural} kept, {} recomputed{names}", computed.len())
}
