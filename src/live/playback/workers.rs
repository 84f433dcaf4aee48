//! Workers: threads that run nodes ahead of the callback.
//!
//! The callback cannot wake a thread without a system call. A worker therefore sleeps for a part of the time by which it is
//! ahead; only commands wake it earlier.

use super::callback::{REPORT_INTERVAL, RegionSurvey, Shared};
use super::meter::Histogram;
use super::timing::WindowTiming;
use super::window_ring::RingSender;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded, unbounded};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::stage::{NodeTime, Stage};
use std::sync::Arc;
use std::sync::atomic::Ordering::Acquire;
use std::thread::JoinHandle;

/// A region that runs ahead of the callback.
pub struct WorkerRegion {
    /// Its number in the plan.
    pub number: usize,
    /// Nodes and buffers.
    pub stage: Stage,
    /// Windows to the callback.
    pub links: Vec<RingSender>,
    /// The next window.
    pub window: u64,
    /// Times of each node; empty if they are not measured.
    pub times: Vec<Arc<Histogram>>,
    /// True after a fault of a node: the region does not run again.
    pub failed: bool,
    /// The fault with the index of the node, until it is reported.
    pub fault: Option<(usize, Fault)>,
    /// The late state that the nodes were last given; `None` before the first.
    pub late: Option<bool>,
    /// A node whose output is not finite, until it is reported.
    pub not_finite: Option<usize>,
    /// First window at which such a node is reported again.
    pub next_report: u64,
}

impl WorkerRegion {
    /// Runs the next window, unless it is far enough ahead of the callback or has failed; returns true if it ran.
    pub fn step(&mut self, timing: &WindowTiming, played: u64) -> bool {
        let ahead = self.window < played + timing.depth;
        // Of a window that has begun only events are sent.
        let late = self.window < played;
        if self.failed || !ahead || !(late || self.links.iter().all(RingSender::has_room)) {
            return false;
        }
        // Once late, the nodes stay so until they are as far ahead as they can be: otherwise the next expensive window would be late
        // at once.
        let caught_up = self.window + 1 >= played + timing.depth;
        let hurries = late || (self.late == Some(true) && !caught_up);
        if self.late != Some(hurries) {
            self.late = Some(hurries);
            self.stage.set_late(hurries);
        }
        self.run_window(timing, !late);
        true
    }

    /// Runs the next window, and sends it to the callback: its events alone unless it is in time.
    fn run_window(&mut self, timing: &WindowTiming, in_time: bool) {
        self.stage.advance(timing.window_start(self.window + 1));
        if let Err(fault) = self.stage.run() {
            (self.failed, self.fault) = (true, Some(fault));
            return;
        }
        for (times, spent) in self.times.iter().zip(self.stage.spent_mut()) {
            if spent.calls > 0 {
                times.count(spent.time);
                *spent = NodeTime::default();
            }
        }
        for link in &mut self.links {
            if in_time {
                link.send(&self.stage, self.window);
            } else {
                link.send_late(&self.stage);
            }
        }
        if let Some(node) = self.stage.take_not_finite()
            && self.window >= self.next_report
        {
            self.next_report = self.window + REPORT_INTERVAL;
            self.not_finite = Some(node);
        }
        self.window += 1;
    }
}

impl WorkerRegion {
    /// Sends the fault of a node.
    fn report(&mut self, to: &Sender<WorkerFault>) {
        if let Some((node, fault)) = self.fault.take() {
            let _ = to.send((self.number, node, Some(fault)));
        }
        if let Some(node) = self.not_finite.take() {
            let _ = to.send((self.number, node, None));
        }
    }
}

enum Command {
    Add(Box<WorkerRegion>),
    Halt(Sender<Vec<WorkerRegion>>),
    Retune(usize, usize, Box<dyn AnyParams>),
    Renew(usize, usize, Box<dyn DynNode>),
    Survey(Box<RegionSurvey>),
    Quit,
}

/// Region, index of the node, and its fault; without one its output is not finite, and silenced.
pub type WorkerFault = (usize, usize, Option<Fault>);

/// All regions that run ahead, on threads or, for tests, in [`Workers::pump`].
pub struct Workers {
    timing: WindowTiming,
    shared: Arc<Shared>,
    threads: Vec<(Sender<Command>, JoinHandle<()>)>,
    /// The regions, if there are no threads.
    local: Vec<WorkerRegion>,
    faults: (Sender<WorkerFault>, Receiver<WorkerFault>),
    surveys: (Sender<Box<RegionSurvey>>, Receiver<Box<RegionSurvey>>),
    /// The thread of each region.
    thread_of: Vec<(usize, usize)>,
}

impl Workers {
    /// Workers without regions; with 0 threads, [`Workers::pump`] runs them.
    #[must_use]
    pub fn new(timing: WindowTiming, shared: Arc<Shared>, threads: usize) -> Self {
        let faults = unbounded();
        let surveys = unbounded();
        let threads = (0..threads)
            .map(|k| {
                let (sender, receiver) = unbounded();
                let (shared, faults, surveys) = (Arc::clone(&shared), faults.0.clone(), surveys.0.clone());
                let name = format!("foley-live-{k}");
                let body = move || work(&timing, &shared, &receiver, (&faults, &surveys));
                std::thread::Builder::new().name(name).spawn(body).map(|handle| (sender, handle))
            })
            // If no thread can be started, `pump` runs the regions.
            .filter_map(Result::ok)
            .collect();
        Self { timing, shared, threads, local: Vec::new(), faults, surveys, thread_of: Vec::new() }
    }

    /// Starts to run regions.
    pub fn start(&mut self, regions: Vec<WorkerRegion>) {
        self.thread_of.clear();
        for (k, region) in regions.into_iter().enumerate() {
            let Some(thread) = k.checked_rem(self.threads.len()) else {
                self.local.push(region);
                continue;
            };
            self.thread_of.push((region.number, thread));
            let _ = self.threads[thread].0.send(Command::Add(Box::new(region)));
        }
    }

    /// Stops and returns all regions, in their order.
    pub fn halt(&mut self) -> Vec<WorkerRegion> {
        let mut regions = std::mem::take(&mut self.local);
        for (thread, _) in &self.threads {
            let (reply, received) = bounded(1);
            if thread.send(Command::Halt(reply)).is_ok() {
                regions.extend(received.recv().unwrap_or_default());
            }
        }
        regions.sort_by_key(|r| r.number);
        regions
    }

    /// Runs all regions that can run, if there are no threads.
    pub fn pump(&mut self) {
        let played = self.shared.window.load(Acquire);
        for region in &mut self.local {
            while region.step(&self.timing, played) {}
            region.report(&self.faults.0);
        }
    }

    /// Runs stopped regions up to a window.
    pub fn align(&self, regions: &mut [WorkerRegion], window: u64) {
        for region in regions {
            while region.window < window && !region.failed {
                region.run_window(&self.timing, true);
            }
        }
    }

    /// Sets the parameters of a node.
    pub fn retune(&mut self, number: usize, node: usize, params: Box<dyn AnyParams>) {
        if let Some(region) = self.local.iter_mut().find(|r| r.number == number) {
            region.stage.nodes_mut()[node].node.retune(&*params);
        } else if let Some(&(_, thread)) = self.thread_of.iter().find(|(r, _)| *r == number) {
            let _ = self.threads[thread].0.send(Command::Retune(number, node, params));
        }
    }

    /// Replaces a node by a new one of its type and parameters.
    pub fn renew(&mut self, number: usize, node: usize, new: Box<dyn DynNode>) {
        if let Some(region) = self.local.iter_mut().find(|r| r.number == number) {
            drop(region.stage.replace(node, new));
        } else if let Some(&(_, thread)) = self.thread_of.iter().find(|(r, _)| *r == number) {
            let _ = self.threads[thread].0.send(Command::Renew(number, node, new));
        }
    }

    /// Requests a survey of the nodes of a region; [`take_survey`](Self::take_survey) returns it.
    pub fn survey(&mut self, number: usize, mut survey: Box<RegionSurvey>) {
        if let Some(region) = self.local.iter_mut().find(|r| r.number == number) {
            region.stage.survey(&mut survey.survey);
            let _ = self.surveys.0.send(survey);
        } else if let Some(&(_, thread)) = self.thread_of.iter().find(|(r, _)| *r == number) {
            let _ = self.threads[thread].0.send(Command::Survey(survey));
        }
    }

    /// Takes the next answer to a survey.
    pub fn take_survey(&self) -> Option<Box<RegionSurvey>> {
        self.surveys.1.try_recv().ok()
    }

    /// Takes the next fault.
    pub fn take_fault(&self) -> Option<WorkerFault> {
        self.faults.1.try_recv().ok()
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        for (thread, handle) in self.threads.drain(..) {
            let _ = thread.send(Command::Quit);
            let _ = handle.join();
        }
    }
}

fn work(
    timing: &WindowTiming,
    shared: &Shared,
    commands: &Receiver<Command>,
    (faults, surveys): (&Sender<WorkerFault>, &Sender<Box<RegionSurvey>>),
) {
    let mut regions: Vec<WorkerRegion> = Vec::new();
    loop {
        let command = if regions.is_empty() {
            commands.recv().map_err(|_| RecvTimeoutError::Disconnected)
        } else {
            commands.recv_timeout(timing.sleep_time())
        };
        match command {
            Ok(Command::Add(region)) => regions.push(*region),
            Ok(Command::Halt(reply)) => {
                let _ = reply.send(std::mem::take(&mut regions));
            }
            Ok(Command::Retune(number, node, params)) => {
                if let Some(region) = regions.iter_mut().find(|r| r.number == number) {
                    region.stage.nodes_mut()[node].node.retune(&*params);
                }
            }
            Ok(Command::Renew(number, node, new)) => {
                if let Some(region) = regions.iter_mut().find(|r| r.number == number) {
                    drop(region.stage.replace(node, new));
                }
            }
            Ok(Command::Survey(mut survey)) => {
                if let Some(region) = regions.iter_mut().find(|r| Some(r.number) == survey.region) {
                    region.stage.survey(&mut survey.survey);
                    let _ = surveys.send(survey);
                }
            }
            Ok(Command::Quit) | Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {}
        }
        // One window of each region in turn, so that none starves, until all are as far ahead as they can be: the callback plays on meanwhile.
        // Commands are polled in between.
        let mut any = true;
        while any && commands.is_empty() {
            any = false;
            let played = shared.window.load(Acquire);
            for region in &mut regions {
                any |= region.step(timing, played);
                region.report(faults);
            }
        }
    }
}
