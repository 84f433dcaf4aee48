//! Runs the regions of one phase in parallel: a task is one region and the windows that it can run now.
//!
//! A region may run window `w` when all regions that feed it have done `w`, and no region that it feeds is more than
//! [`DEPTH`] windows behind. This is decided by counters; nothing waits inside the pool. Regions that read or write files run
//! on threads of their own.
//!
//! For a checkpoint the phase pauses: no window begins until all regions have done the same number of windows, and their
//! states are saved.

use super::cached_streams::CachedStreams;
use super::checkpointer::Checkpointer;
use super::job::stopped;
use super::{Job, Progress, Report, Values, stages};
use crate::diag::Diagnostic;
use crate::plan::{DEPTH, Phase, Region, Runnable};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use foley_nodes::core::buffer::{AnyBuffer, Budget};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::Summary;
use foley_nodes::core::stage::{NodeTime, Stage, StageFault};
use foley_nodes::core::time::{Tick, seconds};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Windows of one link in transit from one region to another.
type Slots = Vec<Mutex<Box<dyn AnyBuffer>>>;

/// A region with its state.
struct Cell {
    stage: Mutex<Stage>,
    done: AtomicU64,
    busy: AtomicBool,
    io: bool,
    /// Regions that feed this one.
    upstream: Vec<usize>,
    /// Regions that this one feeds.
    downstream: Vec<usize>,
}

struct Shared {
    regions: Vec<Region>,
    cells: Vec<Cell>,
    slots: HashMap<usize, Slots>,
    windows: u64,
    /// Windows that may begin: all, or fewer while the phase pauses.
    limit: AtomicU64,
    window: Tick,
    duration: Tick,
    failed: AtomicBool,
    /// True while regions that are behind catch up although the run is to stop.
    catching_up: AtomicBool,
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
    /// The last task has ended, after a failure or because no window may begin.
    Idle,
}

/// Runs one phase to its end and adds the values of its folds.
///
/// # Errors
/// The faults of the nodes that failed.
pub fn run_phase(
    job: &Job<'_>,
    phase: &Phase,
    values: &mut Values,
    report: &mut Report,
    streams: &CachedStreams,
    mut checkpointer: Option<&mut Checkpointer<'_>>,
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
    let done = match checkpointer.as_mut().map_or(Ok(0), |checkpointer| checkpointer.restore(&mut stages)) {
        Ok(done) => done,
        Err((r, Some(node), fault)) => return Err(vec![describe(job, &phase.regions[r], node, fault)]),
        Err((_, None, fault)) => return Err(vec![Diagnostic::general(fault.code, fault.message)]),
    };
    if done > 0 {
        job.progress.done.fetch_add(done * stages.len() as u64, SeqCst);
        report.resumed_at = Some(seconds(done as Tick * job.plan.window));
    }
    // More threads than regions: some nodes divide their own work.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(job.threads.max(1))
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
                // The channel closes when the last task has dropped the shared state.
                while let Ok((shared, region)) = tasks.recv() {
                    shared.task(region);
                }
            })
        })
        .collect();
    drop(io_tasks);
    let shared = Arc::new(Shared::new(job, phase, (stages, done), &budget, outcomes, pool, io));
    shared.run_until(phase.windows);
    let result = collect(job, &shared, &received, values, report, streams, checkpointer);
    // Buffers never shrink: their size at the end is the maximum.
    report.note_buffer_bytes(shared.bytes());
    drop(shared);
    for thread in threads {
        let _ = thread.join();
    }
    result
}

/// Waits for all regions, or for the first failure and the end of the tasks that were running.
fn collect(
    job: &Job<'_>,
    shared: &Arc<Shared>,
    received: &Receiver<Outcome>,
    values: &mut Values,
    report: &mut Report,
    streams: &CachedStreams,
    mut checkpointer: Option<&mut Checkpointer<'_>>,
) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    let mut remaining = shared.cells.len();
    let mut all: Vec<Option<Vec<Summary>>> = shared.cells.iter().map(|_| None).collect();
    let next = |checkpointer: &Checkpointer<'_>| Instant::now().checked_add(checkpointer.interval());
    let mut due = checkpointer.as_deref().and_then(next);
    while remaining > 0 {
        let outcome = match due {
            Some(at) => received.recv_deadline(at),
            None => received.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        match outcome {
            Err(RecvTimeoutError::Timeout) => {
                due = None;
                shared.pause();
            }
            Ok(Outcome::Finished(region, summaries)) => {
                all[region] = Some(summaries);
                remaining -= 1;
            }
            Ok(Outcome::Failed(region, node, fault)) => {
                errors.push(describe(job, &shared.regions[region], node, fault))
            }
            Ok(Outcome::Panicked(region, panic)) => {
                let ids: Vec<&str> =
                    shared.regions[region].nodes.iter().filter_map(|n| node_id(job, n.runnable)).collect();
                let message = format!("a node panicked ({panic}) among: {}", ids.join(", "));
                errors.push(
                    Diagnostic::general("F099", message).help("this is a defect in foley: please report it"),
                );
            }
            // Sent twice if the last task ended while the phase was being paused; the phase runs again since the first.
            Ok(Outcome::Idle) if shared.tasks.load(SeqCst) > 0 => {}
            Ok(Outcome::Idle) => {
                let stopping = job.progress.stop.load(SeqCst);
                // A run that is stopped before its first checkpoint loses little.
                let saves = |checkpointer: &Checkpointer<'_>| {
                    !stopping || checkpointer.saved_until(job.plan.window).is_some()
                };
                let Some(checkpointer) =
                    checkpointer.as_deref_mut().filter(|c| saves(c) && !shared.failed.load(SeqCst))
                else {
                    break;
                };
                if shared.save_checkpoint(checkpointer, report) {
                    if stopping {
                        break;
                    }
                    due = next(checkpointer);
                }
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    if errors.is_empty() && remaining > 0 {
        let saved = checkpointer.and_then(|checkpointer| checkpointer.saved_until(job.plan.window));
        errors.push(stopped(saved));
    }
    for (r, summaries) in all.into_iter().enumerate() {
        let stage = shared.cells[r].stage.lock().unwrap_or_else(PoisonError::into_inner);
        for (k, node) in shared.regions[r].nodes.iter().enumerate() {
            let Runnable::Node(n) = node.runnable else { continue };
            let NodeTime { time, calls } = stage.spent()[k];
            let summary = summaries.as_ref().map(|s| s[k].clone()).unwrap_or_default();
            // A cached stream that is read in place of a node does not count as calls of it.
            if let Some(active) = stage.activity(k) {
                report.add_activity(n, active);
            }
            report.add(n, time, if streams.reads(n) { 0 } else { calls }, summary);
            for port in 0..job.graph.nodes[n].ty.outputs.len() {
                if let Some(value) = stage.value(k, port) {
                    values.insert((n, port), value);
                }
            }
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn node_id<'j>(job: &'j Job<'_>, runnable: Runnable) -> Option<&'j str> {
    match runnable {
        Runnable::Node(n) => Some(&job.graph.nodes[n].id),
        Runnable::Tap(_) => None,
    }
}

/// The diagnostic of a fault, from the index of the node in its region.
fn describe(job: &Job<'_>, region: &Region, node: usize, fault: Fault) -> Diagnostic {
    match region.nodes[node].runnable {
        Runnable::Node(n) => {
            let at = job.graph.location(n, fault.field.as_deref());
            Diagnostic::of_fault(fault, at, &job.graph.nodes[n].id)
        }
        Runnable::Tap(_) => Diagnostic::general(fault.code, fault.message),
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
                upstream: region.imports.iter().map(|i| i.from).collect(),
                downstream: Vec::new(),
            })
            .collect();
        let mut slots = HashMap::new();
        for (r, region) in phase.regions.iter().enumerate() {
            for import in &region.imports {
                cells[import.from].downstream.push(r);
            }
            for export in &region.exports {
                let model = stages::buffer(&region.buffers[export.buffer], budget);
                let make = |_| Mutex::new(model.sibling(export.items));
                slots.insert(export.link, (0..DEPTH).map(make).collect());
            }
        }
        for cell in &mut cells {
            for list in [&mut cell.upstream, &mut cell.downstream] {
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
            catching_up: AtomicBool::new(false),
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

    /// Bytes of all buffers: those of the regions, and windows in transit between them.
    fn bytes(&self) -> usize {
        let in_transit =
            |slot: &Mutex<Box<dyn AnyBuffer>>| slot.lock().unwrap_or_else(PoisonError::into_inner).bytes();
        let in_stage = |cell: &Cell| cell.stage.lock().unwrap_or_else(PoisonError::into_inner).bytes();
        self.slots.values().flatten().map(in_transit).sum::<usize>()
            + self.cells.iter().map(in_stage).sum::<usize>()
    }

    fn halted(&self) -> bool {
        let stopping = self.progress.stop.load(SeqCst) && !self.catching_up.load(SeqCst);
        self.failed.load(SeqCst) || stopping
    }

    /// Lets regions run windows up to a limit.
    fn run_until(self: &Arc<Self>, limit: u64) {
        self.limit.store(limit, SeqCst);
        // This loop counts as a task, so that the run is not idle before all regions have been polled.
        self.tasks.fetch_add(1, SeqCst);
        for r in 0..self.cells.len() {
            self.poll(r);
        }
        self.end_task();
    }

    /// Lets no window begin; an outcome reports the end of the tasks that are running.
    fn pause(&self) {
        self.limit.store(0, SeqCst);
        // If the last task has ended just before, this one reports it.
        self.tasks.fetch_add(1, SeqCst);
        self.end_task();
    }

    /// Saves a checkpoint and continues, or first lets regions that are behind catch up; returns true if it was saved.
    fn save_checkpoint(self: &Arc<Self>, checkpointer: &mut Checkpointer<'_>, report: &mut Report) -> bool {
        let windows = self.common_windows();
        self.catching_up.store(windows.is_err(), SeqCst);
        let windows = match windows {
            Ok(windows) => windows,
            Err(max) => {
                self.run_until(max);
                return false;
            }
        };
        let cells = self.cells.iter();
        let mut stages: Vec<_> =
            cells.map(|cell| cell.stage.lock().unwrap_or_else(PoisonError::into_inner)).collect();
        // A failure to save does not end the run.
        if let Err(e) = checkpointer.save(stages.iter_mut().map(|stage| &mut **stage), windows) {
            report.note_checkpoint_error(&e);
        }
        drop(stages);
        self.run_until(self.windows);
        true
    }

    /// The number of windows that all regions have done, or else the maximum.
    fn common_windows(&self) -> Result<u64, u64> {
        let done = || self.cells.iter().map(|cell| cell.done.load(SeqCst));
        let max = done().max().unwrap_or(0);
        if done().all(|d| d == max) { Ok(max) } else { Err(max) }
    }

    /// Returns true if a region can run its next window.
    fn ready(&self, r: usize) -> bool {
        let cell = &self.cells[r];
        let w = cell.done.load(SeqCst);
        w < self.limit.load(SeqCst)
            && !self.halted()
            && cell.upstream.iter().all(|&a| self.cells[a].done.load(SeqCst) > w)
            && cell.downstream.iter().all(|&b| self.cells[b].done.load(SeqCst) + DEPTH as u64 > w)
    }

    /// Claims a region that can run and is not running.
    ///
    /// A task that releases a region checks it again afterwards, so a window that becomes ready in between is not missed.
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
            let message = panic.downcast_ref::<String>().cloned();
            let message = message.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            self.failed.store(true, SeqCst);
            let _ = self.outcomes.send(Outcome::Panicked(r, message.unwrap_or_default()));
        }
        self.end_task();
    }

    fn end_task(&self) {
        let paused = || self.limit.load(SeqCst) < self.windows;
        if self.tasks.fetch_sub(1, SeqCst) == 1 && (self.halted() || paused()) {
            let _ = self.outcomes.send(Outcome::Idle);
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
                for &other in cell.upstream.iter().chain(&cell.downstream) {
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
