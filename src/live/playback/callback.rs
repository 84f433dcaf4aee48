//! The realtime side of playback, which must not wait: runs one window after the other for the device.

use super::device_output::DeviceOutput;
use super::meter::{Histogram, Meter};
use super::timing::window_start;
use super::window_ring::RingReceiver;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::{DynNode, Retune};
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::stage::{NodeTime, Stage, Survey};
use foley_nodes::core::time::Rate;
use rtrb::{Consumer, Producer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed, Ordering::Release};
use std::time::{Duration, Instant};

/// Largest magnitude that a device receives: 120 dB above full scale, far above any force in N that a graph may record.
pub const CEILING: f32 = 1e6;
/// Windows between two reports of a node whose output is not finite.
pub const REPORT_INTERVAL: u64 = 64;

/// Status that both sides share.
#[derive(Default)]
pub struct Shared {
    /// Windows played.
    pub window: AtomicU64,
    /// Counters.
    pub meter: Meter,
    /// True after a fault of a node: silence until the next reload.
    pub failed: AtomicBool,
}

/// The stage of the callback with its links.
pub struct CallbackStage {
    /// Nodes and buffers.
    pub stage: Stage,
    /// Windows from workers.
    pub links: Vec<RingReceiver>,
    /// Indices of the device outputs in the stage.
    pub outputs: Vec<usize>,
    /// Times of each node; empty if they are not measured.
    pub times: Vec<Arc<Histogram>>,
}

/// Parameters of nodes, by index in the stage.
pub type Retunes = Vec<(usize, Box<dyn AnyParams>)>;

/// A graph that replaces the one that plays. Pairs of indices are old index, new index.
pub struct Swap {
    /// The first window of the new graph.
    pub window: u64,
    /// The new stage; after the swap the old one, to be dropped.
    pub next: CallbackStage,
    /// Nodes that move.
    pub nodes: Vec<(usize, usize)>,
    /// Buffers whose contents move.
    pub buffers: Vec<(usize, usize)>,
    /// Buffers of cross-fades that receive the history of an old buffer before buffers move.
    pub fade_seeds: Vec<(usize, usize)>,
    /// Moved buffers that receive the history of the cross-fade that they replace.
    pub successor_seeds: Vec<(usize, usize)>,
    /// Links that continue.
    pub links: Vec<(usize, usize)>,
    /// New nodes that adopt the state of replaced ones; both indices are in the new stage.
    pub adoptions: Vec<(usize, usize)>,
    /// New parameters of nodes of the new stage.
    pub retunes: Retunes,
    /// True if no node continues, so that the output has to be smoothed.
    pub discontinuous: bool,
    /// True if it came too late and was not executed.
    pub late: bool,
}

/// A command to the callback.
pub enum Command {
    /// Replaces the graph.
    Swap(Box<Swap>),
    /// Sets parameters.
    Retune(Retunes),
    /// Replaces the node with this index by a new one of its type and parameters.
    Renew(usize, Box<dyn DynNode>),
    /// Surveys the nodes of the region.
    Survey(Box<RegionSurvey>),
}

/// A survey of the nodes of a region.
pub struct RegionSurvey {
    /// Number of the graph that plays: nodes of different graphs are not comparable.
    pub graph: u64,
    /// The region; `None` for that of the callback.
    pub region: Option<usize>,
    /// Activity or levels of its nodes.
    pub survey: Survey,
}

/// A message from the callback; it returns all memory that is to be freed.
pub enum Reply {
    /// A swap that was executed or too late.
    Swap(Box<Swap>),
    /// Parameters that were set.
    Retuned(Retunes),
    /// The node that was replaced.
    Renewed(Box<dyn DynNode>),
    /// The survey of the nodes of a region.
    Surveyed(Box<RegionSurvey>),
    /// The output of the node with this index is not finite, and silenced.
    NotFinite(usize),
    /// The fault of the node with this index.
    Fault(usize, Fault),
}

/// Plays a graph, window by window; it never allocates, frees, locks, waits or calls the system.
pub struct Callback {
    current: CallbackStage,
    commands: Consumer<Command>,
    replies: Producer<Reply>,
    shared: Arc<Shared>,
    rate: Rate,
    quantum: usize,
    channels: usize,
    window: u64,
    /// Samples of one window.
    block: Vec<f32>,
    /// Samples of the block that the device has taken.
    taken: usize,
    /// Time that one window lasts.
    budget: Duration,
    /// First window at which a node that is not finite is reported again.
    next_report: u64,
}

impl Callback {
    /// A callback that plays `stage` from its first window.
    #[must_use]
    pub fn new(
        stage: CallbackStage,
        (commands, replies): (Consumer<Command>, Producer<Reply>),
        shared: Arc<Shared>,
        rate: Rate,
        quantum: usize,
        channels: usize,
    ) -> Self {
        let block = vec![0.0; quantum * channels];
        let budget = Duration::from_secs_f64(quantum as f64 / rate.as_f64());
        let taken = block.len();
        let current = stage;
        Self {
            current,
            commands,
            replies,
            shared,
            rate,
            quantum,
            channels,
            window: 0,
            block,
            taken,
            budget,
            next_report: 0,
        }
    }

    /// Returns the samples per second.
    #[must_use]
    pub fn rate(&self) -> Rate {
        self.rate
    }

    /// Returns the number of interleaved channels.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Returns the frames per window.
    #[must_use]
    pub fn quantum(&self) -> usize {
        self.quantum
    }

    /// Returns the shared status.
    #[must_use]
    pub fn shared(&self) -> &Arc<Shared> {
        &self.shared
    }

    /// Fills a buffer of the device.
    ///
    /// # Shapes
    /// `out`: interleaved samples, any number of frames.
    pub fn fill(&mut self, mut out: &mut [f32]) {
        while !out.is_empty() {
            if self.taken == self.block.len() {
                self.run_window();
                self.taken = 0;
            }
            let n = out.len().min(self.block.len() - self.taken);
            let (now, rest) = out.split_at_mut(n);
            now.copy_from_slice(&self.block[self.taken..self.taken + n]);
            self.taken += n;
            out = rest;
        }
    }

    /// Computes the next window.
    fn run_window(&mut self) {
        let start = Instant::now();
        self.take_commands();
        self.block.fill(0.0);
        // A stage with a failed node is not run again.
        if !self.shared.failed.load(Relaxed) {
            self.run_stage();
        }
        self.mix_outputs();
        self.window += 1;
        self.shared.window.store(self.window, Release);
        let time = start.elapsed();
        self.shared.meter.callback.count(time);
        if time > self.budget {
            self.shared.meter.overruns.fetch_add(1, Relaxed);
        }
    }

    fn run_stage(&mut self) {
        let CallbackStage { stage, links, times, .. } = &mut self.current;
        stage.advance(window_start(self.rate, self.quantum, self.window + 1));
        let (mut missed, mut lost_events) = (0, 0);
        for link in links {
            let received = link.receive(stage, self.window);
            missed += u64::from(received.missed);
            lost_events += received.lost_events;
        }
        self.shared.meter.count_missed(missed, lost_events);
        if let Err((node, fault)) = stage.run() {
            self.shared.failed.store(true, Relaxed);
            // If the ring is full, it holds other faults already; to drop this one here would free its text.
            if let Err(rtrb::PushError::Full(fault)) = self.replies.push(Reply::Fault(node, fault)) {
                std::mem::forget(fault);
            }
        }
        if let Some(index) = stage.take_not_finite()
            && self.window >= self.next_report
        {
            self.next_report = self.window + REPORT_INTERVAL;
            let _ = self.replies.push(Reply::NotFinite(index));
        }
        for (times, spent) in times.iter().zip(stage.spent_mut()) {
            if spent.calls > 0 {
                times.count(spent.time);
                *spent = NodeTime::default();
            }
        }
    }

    /// Adds the device outputs to the block; an output without a window fades out.
    fn mix_outputs(&mut self) {
        let (block, channels) = (&mut self.block, self.channels);
        for_each_output(&mut self.current, |output| output.add_to(block, channels));
        let (mut peak, mut not_finite, mut cut, mut over) = (0.0_f32, 0, 0, 0);
        for x in &mut self.block {
            if !x.is_finite() {
                *x = 0.0;
                not_finite += 1;
            }
            if x.abs() > CEILING {
                *x = x.clamp(-CEILING, CEILING);
                cut += 1;
            }
            peak = peak.max(x.abs());
            over += u64::from(x.abs() > 1.0);
        }
        self.shared.meter.note_level(self.window, peak, over);
        if cut > 0 {
            self.shared.meter.cut.fetch_add(cut, Relaxed);
        }
        if not_finite > 0 {
            self.shared.meter.not_finite.fetch_add(not_finite, Relaxed);
        }
    }

    fn take_commands(&mut self) {
        // Each command that is taken needs a slot for its reply.
        while self.replies.slots() > 1 {
            match self.commands.peek() {
                Ok(Command::Swap(swap)) if swap.window > self.window => return,
                Ok(_) => {}
                Err(_) => return,
            }
            match self.commands.pop() {
                Ok(Command::Swap(mut swap)) => {
                    swap.late = swap.window < self.window;
                    if swap.late {
                        self.shared.meter.late_swaps.fetch_add(1, Relaxed);
                    } else {
                        self.swap(&mut swap);
                    }
                    let _ = self.replies.push(Reply::Swap(swap));
                }
                Ok(Command::Retune(retunes)) => {
                    retune(&mut self.current.stage, &retunes);
                    let _ = self.replies.push(Reply::Retuned(retunes));
                }
                Ok(Command::Renew(index, node)) => {
                    let old = self.current.stage.replace(index, node);
                    let _ = self.replies.push(Reply::Renewed(old));
                }
                Ok(Command::Survey(mut survey)) => {
                    self.current.stage.survey(&mut survey.survey);
                    let _ = self.replies.push(Reply::Surveyed(survey));
                }
                Err(_) => return,
            }
        }
    }

    fn swap(&mut self, swap: &mut Swap) {
        let Swap { next, nodes, buffers, fade_seeds, successor_seeds, links, adoptions, retunes, .. } = swap;
        let old = &mut self.current.stage;
        fade_seeds.iter().for_each(|&(from, to)| next.stage.seed(old, from, to));
        next.stage.take_over(old, nodes, buffers);
        successor_seeds.iter().for_each(|&(from, to)| next.stage.seed(old, from, to));
        for &(from, to) in links.iter() {
            next.links[to].take_over(&mut self.current.links[from]);
        }
        for &(from, to) in adoptions.iter() {
            next.stage.adopt(from, to);
        }
        retune(&mut next.stage, retunes);
        std::mem::swap(&mut self.current, next);
        self.shared.failed.store(false, Relaxed);
        if swap.discontinuous {
            for_each_output(&mut self.current, DeviceOutput::mark_discontinuity);
        }
    }
}

fn for_each_output(stage: &mut CallbackStage, mut action: impl FnMut(&mut DeviceOutput)) {
    for &index in &stage.outputs {
        let node = stage.stage.nodes_mut()[index].node.as_any_mut();
        if let Some(output) = node.downcast_mut::<DeviceOutput>() {
            action(output);
        }
    }
}

fn retune(stage: &mut Stage, retunes: &[(usize, Box<dyn AnyParams>)]) {
    for (index, params) in retunes {
        let result = stage.nodes_mut()[*index].node.retune(&**params);
        debug_assert_eq!(result, Retune::Done, "only nodes that can be retuned are retuned");
    }
}
