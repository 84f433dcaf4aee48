//! The threads that run what must not run in the callback, ahead of it.
//!
//! The callback cannot wake anybody without a system call. A worker therefore sleeps for a part of the time by which it is
//! ahead, and is woken early only by orders.

use super::callback::{Shared, tick};
use super::link::Sender as Link;
use super::meter::Histogram;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded, unbounded};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::stage::{Spent, Stage};
use foley_nodes::core::time::Rate;
use std::sync::Arc;
use std::sync::atomic::Ordering::Acquire;
use std::thread::JoinHandle;
use std::time::Duration;

/// One part of a graph that runs ahead of the callback.
pub struct Gang {
    /// Its number in the plan.
    pub region: usize,
    /// Nodes and buffers.
    pub stage: Stage,
    /// What it sends.
    pub links: Vec<Link>,
    /// The window that it runs next.
    pub window: u64,
    /// Times of each node, where they are wanted.
    pub times: Vec<Arc<Histogram>>,
    /// Whether a node has failed: nothing runs any more then.
    pub failed: bool,
    /// Its place and fault, until it has been told.
    pub fault: Option<(usize, Fault)>,
}

/// How windows follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Samples per second.
    pub rate: Rate,
    /// Frames per window.
    pub quantum: usize,
    /// Windows by which workers are ahead.
    pub depth: u64,
}

impl Pace {
    /// How long a worker sleeps.
    fn nap(&self) -> Duration {
        let ahead = self.quantum as f64 * self.depth as f64 / self.rate.as_f64();
        Duration::from_secs_f64(ahead / 4.0).max(Duration::from_millis(1))
    }
}

impl Gang {
    /// Runs the next window, unless it is far enough ahead of what has been played, or has failed.
    pub fn step(&mut self, pace: &Pace, played: u64) -> bool {
        let ahead = self.window < played + pace.depth;
        if self.failed || !ahead || !self.links.iter().all(Link::has_room) {
            return false;
        }
        self.force(pace);
        true
    }

    /// Runs the next window, whatever the others do.
    fn force(&mut self, pace: &Pace) {
        self.stage.advance(tick(pace.rate, pace.quantum, self.window + 1));
        if let Err(fault) = self.stage.run() {
            (self.failed, self.fault) = (true, Some(fault));
            return;
        }
        for (times, spent) in self.times.iter().zip(self.stage.spent_mut()) {
            if spent.calls > 0 {
                times.count(spent.time);
                *spent = Spent::default();
            }
        }
        for link in &mut self.links {
            link.send(&self.stage, self.window);
        }
        self.window += 1;
    }
}

enum Order {
    Take(Box<Gang>),
    Halt(Sender<Vec<Gang>>),
    Retune(usize, usize, Box<dyn AnyParams>),
    Quit,
}

/// A fault: region, place, what.
pub type GangFault = (usize, usize, Fault);

/// All gangs, on threads or, for tests, in the hands of whoever pumps.
pub struct Crew {
    pace: Pace,
    shared: Arc<Shared>,
    threads: Vec<(Sender<Order>, JoinHandle<()>)>,
    /// The gangs, where there are no threads.
    own: Vec<Gang>,
    faults: (Sender<GangFault>, Receiver<GangFault>),
    /// The thread that has each region.
    place: Vec<(usize, usize)>,
}

impl Crew {
    /// A crew without work; `threads` 0 leaves the work to [`Crew::pump`].
    #[must_use]
    pub fn new(pace: Pace, shared: Arc<Shared>, threads: usize) -> Self {
        let faults = unbounded();
        let threads = (0..threads)
            .map(|k| {
                let (sender, receiver) = unbounded();
                let (shared, faults) = (Arc::clone(&shared), faults.0.clone());
                let name = format!("foley-live-{k}");
                let body = move || work(&pace, &shared, &receiver, &faults);
                std::thread::Builder::new().name(name).spawn(body).map(|handle| (sender, handle))
            })
            // Where no thread can be had, the work is left to whoever pumps.
            .filter_map(Result::ok)
            .collect();
        Self { pace, shared, threads, own: Vec::new(), faults, place: Vec::new() }
    }

    /// Takes up work.
    pub fn take(&mut self, gangs: Vec<Gang>) {
        self.place.clear();
        for (k, gang) in gangs.into_iter().enumerate() {
            let Some(thread) = k.checked_rem(self.threads.len()) else {
                self.own.push(gang);
                continue;
            };
            self.place.push((gang.region, thread));
            let _ = self.threads[thread].0.send(Order::Take(Box::new(gang)));
        }
    }

    /// Gives all work back, in the order of the regions.
    pub fn halt(&mut self) -> Vec<Gang> {
        let mut gangs = std::mem::take(&mut self.own);
        for (thread, _) in &self.threads {
            let (reply, received) = bounded(1);
            if thread.send(Order::Halt(reply)).is_ok() {
                gangs.extend(received.recv().unwrap_or_default());
            }
        }
        gangs.sort_by_key(|g| g.region);
        gangs
    }

    /// Runs whatever can run, where there are no threads.
    pub fn pump(&mut self) {
        let played = self.shared.window.load(Acquire);
        for gang in &mut self.own {
            while gang.step(&self.pace, played) {}
            if let Some((place, fault)) = gang.fault.take() {
                let _ = self.faults.0.send((gang.region, place, fault));
            }
        }
    }

    /// Brings halted gangs to one window.
    pub fn align(&self, gangs: &mut [Gang], window: u64) {
        for gang in gangs {
            while gang.window < window && !gang.failed {
                gang.force(&self.pace);
            }
        }
    }

    /// Gives new parameters to a node.
    pub fn retune(&mut self, region: usize, place: usize, params: Box<dyn AnyParams>) {
        if let Some(gang) = self.own.iter_mut().find(|g| g.region == region) {
            gang.stage.nodes_mut()[place].node.retune(&*params);
        } else if let Some(&(_, thread)) = self.place.iter().find(|(r, _)| *r == region) {
            let _ = self.threads[thread].0.send(Order::Retune(region, place, params));
        }
    }

    /// The next fault that nobody has been told of.
    pub fn fault(&self) -> Option<GangFault> {
        self.faults.1.try_recv().ok()
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        for (thread, handle) in self.threads.drain(..) {
            let _ = thread.send(Order::Quit);
            let _ = handle.join();
        }
    }
}

fn work(pace: &Pace, shared: &Shared, orders: &Receiver<Order>, faults: &Sender<GangFault>) {
    let mut gangs: Vec<Gang> = Vec::new();
    loop {
        let order = if gangs.is_empty() {
            orders.recv().map_err(|_| RecvTimeoutError::Disconnected)
        } else {
            orders.recv_timeout(pace.nap())
        };
        match order {
            Ok(Order::Take(gang)) => gangs.push(*gang),
            Ok(Order::Halt(reply)) => {
                let _ = reply.send(std::mem::take(&mut gangs));
            }
            Ok(Order::Retune(region, place, params)) => {
                if let Some(gang) = gangs.iter_mut().find(|g| g.region == region) {
                    gang.stage.nodes_mut()[place].node.retune(&*params);
                }
            }
            Ok(Order::Quit) | Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {}
        }
        let played = shared.window.load(Acquire);
        // One window each in turn, so that no part starves another; an order is looked at in between.
        let mut any = true;
        while any && orders.is_empty() {
            any = false;
            for gang in &mut gangs {
                any |= gang.step(pace, played);
            }
        }
        for gang in &mut gangs {
            if let Some((place, fault)) = gang.fault.take() {
                let _ = faults.send((gang.region, place, fault));
            }
        }
    }
}
