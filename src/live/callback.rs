//! The side that must not wait: runs one window after the other for the device.

use super::link::Receiver;
use super::meter::{Histogram, Meter};
use super::sink::Sink;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::Retune;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::stage::Stage;
use foley_nodes::core::time::{Rate, Tick};
use rtrb::{Consumer, Producer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed, Ordering::Release};
use std::time::{Duration, Instant};

/// What both sides can see.
#[derive(Default)]
pub struct Shared {
    /// Windows that have been played.
    pub window: AtomicU64,
    /// Counters.
    pub meter: Meter,
    /// Whether a node has failed: silence until the next reload.
    pub failed: AtomicBool,
}

/// What plays in the callback.
pub struct Act {
    /// Nodes and buffers.
    pub stage: Stage,
    /// What workers send.
    pub links: Vec<Receiver>,
    /// Places in the stage of what is heard.
    pub sinks: Vec<usize>,
    /// Times of each node, where they are wanted.
    pub times: Vec<Arc<Histogram>>,
}

/// A graph that takes over from the one that plays.
pub struct Swap {
    /// The window before which it does.
    pub at: u64,
    /// What takes over; afterwards what was playing, to be dropped.
    pub act: Act,
    /// Nodes that move: place before, place after.
    pub nodes: Vec<(usize, usize)>,
    /// Buffers whose content moves.
    pub buffers: Vec<(usize, usize)>,
    /// New buffers that get the history of one whose content moves.
    pub seeds: Vec<(usize, usize)>,
    /// Buffers that have moved and get the history of one that goes.
    pub heirs: Vec<(usize, usize)>,
    /// Links that go on.
    pub links: Vec<(usize, usize)>,
    /// New nodes that take over what fits from old ones: place before, place after the move, both in the new act.
    pub adopts: Vec<(usize, usize)>,
    /// New parameters by place in the new act.
    pub retunes: Vec<(usize, Box<dyn AnyParams>)>,
    /// Whether nothing of what sounds goes on, so that what is heard has to be eased over.
    pub cut: bool,
    /// Whether it came too late, and nothing happened.
    pub late: bool,
}

/// What the callback is told.
pub enum Order {
    /// Go on with another graph.
    Swap(Box<Swap>),
    /// New parameters by place.
    Retune(Vec<(usize, Box<dyn AnyParams>)>),
}

/// What comes home from the callback.
pub enum Home {
    /// A swap that was done, or was too late.
    Swap(Box<Swap>),
    /// Parameters that have been taken over.
    Retuned(Vec<(usize, Box<dyn AnyParams>)>),
    /// The fault of the node at this place.
    Fault(usize, Fault),
}

/// Plays a graph, window by window. It never allocates, frees, locks, waits or calls the system.
pub struct Callback {
    act: Act,
    orders: Consumer<Order>,
    home: Producer<Home>,
    shared: Arc<Shared>,
    rate: Rate,
    quantum: usize,
    channels: usize,
    window: u64,
    /// Samples made and not yet taken.
    block: Vec<f32>,
    taken: usize,
    budget: Duration,
}

/// The tick at which window `window` begins.
#[must_use]
pub fn tick(rate: Rate, quantum: usize, window: u64) -> Tick {
    rate.tick(window as i64 * quantum as i64)
}

impl Callback {
    /// Plays `act` from its first window on.
    #[must_use]
    pub fn new(
        act: Act,
        (orders, home): (Consumer<Order>, Producer<Home>),
        shared: Arc<Shared>,
        rate: Rate,
        quantum: usize,
        channels: usize,
    ) -> Self {
        let block = vec![0.0; quantum * channels];
        let budget = Duration::from_secs_f64(quantum as f64 / rate.as_f64());
        let taken = block.len();
        Self { act, orders, home, shared, rate, quantum, channels, window: 0, block, taken, budget }
    }

    /// Samples per second.
    #[must_use]
    pub fn rate(&self) -> Rate {
        self.rate
    }

    /// Interleaved channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Frames per window.
    #[must_use]
    pub fn quantum(&self) -> usize {
        self.quantum
    }

    /// What both sides can see.
    #[must_use]
    pub fn shared(&self) -> &Arc<Shared> {
        &self.shared
    }

    /// Fills a buffer of the device: interleaved samples, any number of frames.
    pub fn fill(&mut self, mut out: &mut [f32]) {
        while !out.is_empty() {
            if self.taken == self.block.len() {
                self.next();
                self.taken = 0;
            }
            let n = out.len().min(self.block.len() - self.taken);
            let (now, rest) = out.split_at_mut(n);
            now.copy_from_slice(&self.block[self.taken..self.taken + n]);
            self.taken += n;
            out = rest;
        }
    }

    /// Makes the next window.
    fn next(&mut self) {
        let start = Instant::now();
        self.take_orders();
        self.block.fill(0.0);
        // A stage that a node has failed in is not whole any more, and is not run again.
        if self.shared.failed.load(Relaxed) {
            self.hear();
        } else {
            self.play();
        }
        self.window += 1;
        self.shared.window.store(self.window, Release);
        let time = start.elapsed();
        self.shared.meter.callback.count(time);
        if time > self.budget {
            self.shared.meter.overruns.fetch_add(1, Relaxed);
        }
    }

    fn play(&mut self) {
        let Act { stage, links, times, .. } = &mut self.act;
        stage.advance(tick(self.rate, self.quantum, self.window + 1));
        let mut missed = 0;
        for link in links {
            missed += u64::from(!link.receive(stage, self.window));
        }
        self.shared.meter.missed.fetch_add(missed, Relaxed);
        if let Err((place, fault)) = stage.run() {
            self.shared.failed.store(true, Relaxed);
            // A ring that is full has told of other faults already; to drop this one here would free its text.
            if let Err(rtrb::PushError::Full(fault)) = self.home.push(Home::Fault(place, fault)) {
                std::mem::forget(fault);
            }
        }
        for (times, spent) in times.iter().zip(stage.spent_mut()) {
            if spent.calls > 0 {
                times.count(spent.time);
                *spent = foley_nodes::core::stage::Spent::default();
            }
        }
        self.hear();
    }

    /// Picks up what is heard; where nothing has come, it fades.
    fn hear(&mut self) {
        let (block, channels) = (&mut self.block, self.channels);
        each_sink(&mut self.act, |sink| sink.add_to(block, channels));
        let (mut peak, mut broken) = (0.0_f32, 0);
        for x in &mut self.block {
            if !x.is_finite() {
                *x = 0.0;
                broken += 1;
            }
            peak = peak.max(x.abs());
        }
        self.shared.meter.note_peak(peak);
        if broken > 0 {
            self.shared.meter.broken.fetch_add(broken, Relaxed);
        }
    }

    fn take_orders(&mut self) {
        // What was taken must be able to go home.
        while self.home.slots() > 1 {
            match self.orders.peek() {
                Ok(Order::Swap(swap)) if swap.at > self.window => return,
                Ok(_) => {}
                Err(_) => return,
            }
            match self.orders.pop() {
                Ok(Order::Swap(mut swap)) => {
                    swap.late = swap.at < self.window;
                    if swap.late {
                        self.shared.meter.late_swaps.fetch_add(1, Relaxed);
                    } else {
                        self.swap(&mut swap);
                    }
                    let _ = self.home.push(Home::Swap(swap));
                }
                Ok(Order::Retune(retunes)) => {
                    retune(&mut self.act.stage, &retunes);
                    let _ = self.home.push(Home::Retuned(retunes));
                }
                Err(_) => return,
            }
        }
    }

    fn swap(&mut self, swap: &mut Swap) {
        let Swap { act, nodes, buffers, seeds, heirs, links, adopts, retunes, cut, .. } = swap;
        let old = &mut self.act.stage;
        seeds.iter().for_each(|&(from, to)| act.stage.seed(old, from, to));
        act.stage.take_over(old, nodes, buffers);
        heirs.iter().for_each(|&(from, to)| act.stage.seed(old, from, to));
        for &(from, to) in links.iter() {
            act.links[to].take_over(&mut self.act.links[from]);
        }
        for &(from, to) in adopts.iter() {
            act.stage.adopt(from, to);
        }
        retune(&mut act.stage, retunes);
        std::mem::swap(&mut self.act, act);
        self.shared.failed.store(false, Relaxed);
        if *cut {
            each_sink(&mut self.act, Sink::cut);
        }
    }
}

/// Does something with everything that is heard.
fn each_sink(act: &mut Act, mut act_on: impl FnMut(&mut Sink)) {
    for &place in &act.sinks {
        let node = act.stage.nodes_mut()[place].node.as_any_mut();
        if let Some(sink) = node.downcast_mut::<Sink>() {
            act_on(sink);
        }
    }
}

fn retune(stage: &mut Stage, retunes: &[(usize, Box<dyn AnyParams>)]) {
    for (place, params) in retunes {
        let told = stage.nodes_mut()[*place].node.retune(&**params);
        debug_assert_eq!(told, Retune::Done, "whether a node can be retuned was asked before");
    }
}
