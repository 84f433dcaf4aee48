//! Runs the regions of one phase in parallel: a task is one region and the windows that it can run now.
//!
//! A region may run window `w` when all that feed it have done `w`, and none that it feeds is more than
//! [`DEPTH`] windows behind. Counters say so; nothing waits inside the pool. Regions that read or write files run on a
//! thread of their own.
//!
//! Now and then the phase comes to rest: no window is begun until all regions have done as many, and what they carry is
//! written down for a run that goes on there.

use super::checkpoint::Saver;
use super::kept::Streams;
use super::{Job, Progress, Report, Values, stages};
use crate::diag::Diagnostic;
use crate::plan::{DEPTH, Phase, Region, What};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use foley_nodes::core::buffer::{AnyBuffer, Budget};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::Summary;
use foley_nodes::core::stage::{Spent, Stage, StageFault};
use foley_nodes::core::time::{Tick, seconds};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// The windows of one link that are on their way from one region to another.
type Slots = Vec<Mutex<Box<dyn AnyBuffer>>>;

struct Cell {
    stage: Mutex<Stage>,
    done: AtomicU64,
    busy: AtomicBool,
    io: bool,
    /// Regions that fill this one.
    above: Vec<usize>,
    /// Regions that this one fills.
    below: Vec<usize>,
}

struct Shared {
    regions: Vec<Region>,
    cells: Vec<Cell>,
    slots: HashMap<usize, Slots>,
    windows: u64,
    /// Windows that may be begun: all, or fewer while the phase comes to rest.
    limit: AtomicU64,
    window: Tick,
    duration: Tick,
    failed: AtomicBool,
    /// Whether regions that are behind go on although the run is to stop.
    closing: AtomicBool,
    /// Tasks that are queued or running.
    tasks: AtomicU64,
    outcomes: Sender<Outcome>,
    progress: Arc<Progress>,
    pool: rayon::ThreadPool,
    io: Sender<Task>,
}

/// A region to run on an I/O thread.
type Task = (Arc<Shared>, usize);

enum Outcome {
    /// A region has run its last window.
    Finished(usize, Vec<Summary>),
    /// A node of a region failed.
    Failed(usize, usize, Fault),
    /// A region panicked.
    Panicked(usize, String),
    /// The last task ended after a failure, or because nothing may be begun.
    Quiet,
}

/// Runs one phase to its end and keeps the values of its folds.
///
/// # Errors
/// The faults of the nodes that failed.
pub fn run_phase(
    job: &Job<'_>,
    phase: &Phase,
    values: &mut Values,
    report: &mut Report,
    streams: &Streams,
    mut saver: Option<&mut Saver<'_>>,
) -> Result<(), Vec<Diagnostic>> {
    let mut stages = Vec::new();
    let mut errors = Vec::new();
    let budget = Budget::new(job.plan.limit.saturating_sub(phase.bytes));
    for region in &phase.regions {
        match stages::stage_with(job, region, values, streams, &budget) {
            Ok(stage) => stages.push(stage),
            Err(e) => errors.extend(e),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let done = match saver.as_mut().map_or(Ok(0), |saver| saver.restore(&mut stages)) {
        Ok(done) => done,
        Err((r, Some(place), fault)) => return Err(vec![describe(job, &phase.regions[r], place, fault)]),
        Err((_, None, fault)) => return Err(vec![Diagnostic::general(fault.code, fault.message)]),
    };
    if done > 0 {
        job.progress.done.fetch_add(done * stages.len() as u64, SeqCst);
        report.went_on_at = Some(seconds(done as Tick * job.plan.window));
    }
    // A thread without a region of its own would only look for work, on a core that another thread could use.
    let parts = phase.regions.iter().filter(|r| !r.io).count();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(job.threads.min(parts).max(1))
        .thread_name(|k| format!("foley-{k}"))
        .build()
        .map_err(|e| vec![Diagnostic::general("F090", format!("cannot start threads: {e}"))])?;
    let (outcomes, received) = unbounded();
    let (io, io_tasks) = unbounded::<Task>();
    let workers = phase.regions.iter().filter(|r| r.io).count().min(2);
    let threads: Vec<_> = (0..workers)
        .map(|_| {
            let tasks = io_tasks.clone();
            std::thread::spawn(move || {
                // The channel is closed when the last region has let go of the shared state.
                while let Ok((shared, region)) = tasks.recv() {
                    shared.task(region);
                }
            })
        })
        .collect();
    drop(io_tasks);
    let shared = Arc::new(Shared::new(job, phase, (stages, done), &budget, outcomes, pool, io));
    shared.begin(phase.windows);
    let result = collect(job, &shared, &received, values, report, streams, saver);
    // Buffers never shrink: what they hold at the end is the most that they held.
    report.note_bytes(shared.bytes());
    drop(shared);
    for thread in threads {
        let _ = thread.join();
    }
    result
}

/// Waits for all regions, or for the first failure and the end of what was running by then.
fn collect(
    job: &Job<'_>,
    shared: &Arc<Shared>,
    received: &Receiver<Outcome>,
    values: &mut Values,
    report: &mut Report,
    streams: &Streams,
    mut saver: Option<&mut Saver<'_>>,
) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    let mut left = shared.cells.len();
    let mut all: Vec<Option<Vec<Summary>>> = shared.cells.iter().map(|_| None).collect();
    let next = |saver: &Saver<'_>| Instant::now().checked_add(saver.every());
    let mut due = saver.as_deref().and_then(next);
    while left > 0 {
        let outcome = match due {
            Some(at) => received.recv_deadline(at),
            None => received.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        match outcome {
            Err(RecvTimeoutError::Timeout) => {
                due = None;
                shared.hold();
            }
            Ok(Outcome::Finished(region, summaries)) => {
                all[region] = Some(summaries);
                left -= 1;
            }
            Ok(Outcome::Failed(region, place, fault)) => {
                errors.push(describe(job, &shared.regions[region], place, fault))
            }
            Ok(Outcome::Panicked(region, what)) => {
                let ids: Vec<&str> =
                    shared.regions[region].nodes.iter().filter_map(|n| name(job, n.job)).collect();
                let message = format!("a node panicked ({what}) among: {}", ids.join(", "));
                errors.push(
                    Diagnostic::general("F099", message).help("this is a defect in foley: please report it"),
                );
            }
            // Told twice where the last task ended while the phase was being held: it has been let go since.
            Ok(Outcome::Quiet) if shared.tasks.load(SeqCst) > 0 => {}
            Ok(Outcome::Quiet) => {
                let stops = job.progress.stop.load(SeqCst);
                // A run that is stopped before its first mark would have lost little.
                let may = |saver: &Saver<'_>| !stops || saver.marked(job.plan.window).is_some();
                let Some(saver) = saver.as_deref_mut().filter(|s| may(s) && !shared.failed.load(SeqCst))
                else {
                    break;
                };
                if shared.mark(saver, report) {
                    if stops {
                        break;
                    }
                    due = next(saver);
                }
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    if errors.is_empty() && left > 0 {
        let marked = saver.and_then(|saver| saver.marked(job.plan.window));
        errors.push(super::stopped(marked));
    }
    for (r, summaries) in all.into_iter().enumerate() {
        let stage = shared.cells[r].stage.lock().unwrap_or_else(PoisonError::into_inner);
        for (k, node) in shared.regions[r].nodes.iter().enumerate() {
            let What::Node(n) = node.job else { continue };
            let Spent { time, calls } = stage.spent()[k];
            let summary = summaries.as_ref().map(|s| s[k].clone()).unwrap_or_default();
            // What is read in place of a node does not count as calls of it.
            report.add(n, time, if streams.read(n) { 0 } else { calls }, summary);
            for port in 0..job.graph.nodes[n].ty.outputs.len() {
                if let Some(value) = stage.value(k, port) {
                    values.insert((n, port), value);
                }
            }
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn name<'j>(job: &'j Job<'_>, what: What) -> Option<&'j str> {
    match what {
        What::Node(n) => Some(&job.graph.nodes[n].id),
        What::Tap(_) => None,
    }
}

fn describe(job: &Job<'_>, region: &Region, place: usize, fault: Fault) -> Diagnostic {
    match region.nodes[place].job {
        What::Node(n) => {
            let at = job.graph.place(n, fault.field.as_deref());
            Diagnostic::of_fault(fault, at, &job.graph.nodes[n].id)
        }
        What::Tap(_) => Diagnostic::general(fault.code, fault.message),
    }
}

impl Shared {
    fn new(
        job: &Job<'_>,
        phase: &Phase,
        (stages, done): (Vec<Stage>, u64),
        budget: &Budget,
        outcomes: Sender<Outcome>,
        pool: rayon::ThreadPool,
        io: Sender<Task>,
    ) -> Self {
        let mut cells: Vec<Cell> = stages
            .into_iter()
            .zip(&phase.regions)
            .map(|(stage, region)| Cell {
                stage: Mutex::new(stage),
                done: AtomicU64::new(done),
                busy: AtomicBool::new(false),
                io: region.io,
                above: region.imports.iter().map(|i| i.from).collect(),
                below: Vec::new(),
            })
            .collect();
        let mut slots = HashMap::new();
        for (r, region) in phase.regions.iter().enumerate() {
            for import in &region.imports {
                cells[import.from].below.push(r);
            }
            for export in &region.exports {
                let model = stages::buffer(&region.buffers[export.buffer], budget);
                let make = |_| Mutex::new(model.sibling(export.items));
                slots.insert(export.link, (0..DEPTH).map(make).collect());
            }
        }
        for cell in &mut cells {
            for list in [&mut cell.above, &mut cell.below] {
                list.sort_unstable();
                list.dedup();
            }
        }
        Self {
            regions: phase.regions.clone(),
            cells,
            slots,
            windows: phase.windows,
            limit: AtomicU64::new(phase.windows),
            closing: AtomicBool::new(false),
            window: job.plan.window,
            duration: phase.duration,
            failed: AtomicBool::new(false),
            tasks: AtomicU64::new(0),
            outcomes,
            progress: Arc::clone(&job.progress),
            pool,
            io,
        }
    }

    /// Bytes in all buffers: of the regions, and of what is on its way between them.
    fn bytes(&self) -> usize {
        let way =
            |slot: &Mutex<Box<dyn AnyBuffer>>| slot.lock().unwrap_or_else(PoisonError::into_inner).bytes();
        let own = |cell: &Cell| cell.stage.lock().unwrap_or_else(PoisonError::into_inner).bytes();
        self.slots.values().flatten().map(way).sum::<usize>() + self.cells.iter().map(own).sum::<usize>()
    }

    fn halted(&self) -> bool {
        let stops = self.progress.stop.load(SeqCst) && !self.closing.load(SeqCst);
        self.failed.load(SeqCst) || stops
    }

    /// Lets regions begin windows up to a number of them.
    fn begin(self: &Arc<Self>, limit: u64) {
        self.limit.store(limit, SeqCst);
        // One task stands for this loop, so that the run is not quiet before all regions have been looked at.
        self.tasks.fetch_add(1, SeqCst);
        for r in 0..self.cells.len() {
            self.poll(r);
        }
        self.end_task();
    }

    /// Lets no window begin; the end of what is under way is told as an outcome.
    fn hold(&self) {
        self.limit.store(0, SeqCst);
        // Where the last task has ended a moment ago, nobody else would tell.
        self.tasks.fetch_add(1, SeqCst);
        self.end_task();
    }

    /// Writes down how far the phase is and goes on, or lets those that are behind catch up first; says whether it is done.
    fn mark(self: &Arc<Self>, saver: &mut Saver<'_>, report: &mut Report) -> bool {
        let windows = self.level();
        self.closing.store(windows.is_err(), SeqCst);
        let windows = match windows {
            Ok(windows) => windows,
            Err(most) => {
                self.begin(most);
                return false;
            }
        };
        let cells = self.cells.iter();
        let mut stages: Vec<_> =
            cells.map(|cell| cell.stage.lock().unwrap_or_else(PoisonError::into_inner)).collect();
        // The run is worth more than what tells of it.
        if let Err(e) = saver.save(stages.iter_mut().map(|stage| &mut **stage), windows) {
            report.note_unmarked(&e);
        }
        drop(stages);
        self.begin(self.windows);
        true
    }

    /// The windows that all regions have done, or the most that one has.
    fn level(&self) -> Result<u64, u64> {
        let done = || self.cells.iter().map(|cell| cell.done.load(SeqCst));
        let most = done().max().unwrap_or(0);
        if done().all(|d| d == most) { Ok(most) } else { Err(most) }
    }

    /// Whether a region can run its next window.
    fn ready(&self, r: usize) -> bool {
        let cell = &self.cells[r];
        let w = cell.done.load(SeqCst);
        w < self.limit.load(SeqCst)
            && !self.halted()
            && cell.above.iter().all(|&a| self.cells[a].done.load(SeqCst) > w)
            && cell.below.iter().all(|&b| self.cells[b].done.load(SeqCst) + DEPTH as u64 > w)
    }

    /// Claims a region that can run and that nobody runs.
    ///
    /// Whoever lets go of a region looks again afterwards, so a window that becomes ready in between is not missed.
    fn claim(&self, r: usize) -> bool {
        self.ready(r) && !self.cells[r].busy.swap(true, SeqCst)
    }

    /// Starts a task for a region that can run.
    fn poll(self: &Arc<Self>, r: usize) {
        if !self.claim(r) {
            return;
        }
        self.tasks.fetch_add(1, SeqCst);
        let shared = Arc::clone(self);
        if self.cells[r].io {
            let io = self.io.clone();
            let _ = io.send((shared, r));
        } else {
            self.pool.spawn(move || shared.task(r));
        }
    }

    fn task(self: Arc<Self>, r: usize) {
        let run = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.run_region(r)));
        if let Err(panic) = run {
            let what = panic.downcast_ref::<String>().cloned();
            let what = what.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            self.failed.store(true, SeqCst);
            let _ = self.outcomes.send(Outcome::Panicked(r, what.unwrap_or_default()));
        }
        self.end_task();
    }

    fn end_task(&self) {
        let held = || self.limit.load(SeqCst) < self.windows;
        if self.tasks.fetch_sub(1, SeqCst) == 1 && (self.halted() || held()) {
            let _ = self.outcomes.send(Outcome::Quiet);
        }
    }

    fn run_region(self: &Arc<Self>, r: usize) {
        let cell = &self.cells[r];
        loop {
            let mut stage = cell.stage.lock().unwrap_or_else(PoisonError::into_inner);
            while self.ready(r) {
                let w = cell.done.load(SeqCst);
                let run = self.run_window(r, w, &mut stage);
                let run = run.and_then(|()| {
                    if w + 1 < self.windows {
                        return Ok(());
                    }
                    let summaries = stage.finish()?;
                    let _ = self.outcomes.send(Outcome::Finished(r, summaries));
                    Ok(())
                });
                if let Err((node, fault)) = run {
                    self.failed.store(true, SeqCst);
                    let _ = self.outcomes.send(Outcome::Failed(r, node, fault));
                    return;
                }
                cell.done.store(w + 1, SeqCst);
                self.progress.done.fetch_add(1, SeqCst);
                for &other in cell.above.iter().chain(&cell.below) {
                    self.poll(other);
                }
            }
            drop(stage);
            cell.busy.store(false, SeqCst);
            if !self.claim(r) {
                return;
            }
        }
    }

    fn run_window(&self, r: usize, w: u64, stage: &mut Stage) -> Result<(), StageFault> {
        let region = &self.regions[r];
        let to = (w as Tick + 1).saturating_mul(self.window).min(self.duration);
        stage.advance(to);
        let slot = |link: usize| {
            let slots = &self.slots[&link];
            slots[w as usize % slots.len()].lock().unwrap_or_else(PoisonError::into_inner)
        };
        for import in &region.imports {
            stage.import(import.buffer, import.clock, &**slot(import.link));
        }
        stage.run()?;
        for export in &region.exports {
            stage.export(export.buffer, export.clock, &mut **slot(export.link));
        }
        Ok(())
    }
}
