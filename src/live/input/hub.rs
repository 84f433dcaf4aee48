//! Delivers messages to the nodes that wait for them.

use super::meters::Meters;
use super::refusals::{Refusal, Refusals};
use crate::graph::nearest;
use crate::live::playback::callback::Shared;
use crate::live::playback::timing::window_start;
use foley_nodes::core::input::{Display, Frames, Inbox, Inputs, Message, MessageKind};
use foley_nodes::core::time::{Rate, Tick, ticks};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Acquire, Ordering::Relaxed, Ordering::Release};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Maximum number of unread messages of a node: of those that are due, and of those that are ahead.
const MAX_MESSAGES: usize = 1024;
/// Maximum number of messages that a node reads in one window; more of them are read in the next.
const MAX_PER_WINDOW: usize = 1024;
/// Maximum number of unread frames of a node.
const MAX_FRAMES: usize = 16;
/// Maximum number of parameters that wait to be set.
pub const MAX_SETS: usize = 256;
/// Maximum time by which a message may be ahead of the graph that plays.
pub const MAX_AHEAD: Duration = Duration::from_secs(10);
/// Time ahead up to which a message counts as due, s, so that a message that is read at once does not wait behind future ones.
const DUE: f64 = 0.02;

/// A parameter to set, as with `--set`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Set {
    /// `NAME` or `NODE.PARAM`.
    pub target: String,
    /// A RON value.
    pub value: String,
}

/// Messages to a node: those that are due, and those that are ahead.
struct MessageSender {
    kind: MessageKind,
    /// Numbers of a message that the node reads.
    numbers: usize,
    due: QueueSender,
    ahead: QueueSender,
}

impl MessageSender {
    /// Returns true while its node exists.
    fn is_open(&self) -> bool {
        !self.due.ring.is_abandoned()
    }
}

/// One queue of messages, with the number that are unread.
struct QueueSender {
    ring: Producer<(Tick, Message)>,
    unread: Arc<AtomicUsize>,
}

impl QueueSender {
    /// Adds a message; returns false if the queue is full.
    fn push(&mut self, message: (Tick, Message)) -> bool {
        // Only this side adds, so the number does not grow in between.
        let room = self.unread.load(Acquire) < MAX_MESSAGES;
        if room {
            self.unread.fetch_add(1, Release);
        }
        room && self.ring.push(message).is_ok()
    }
}
type Frame = Box<[f32]>;

/// Frames to a node, and empty frames that it returns.
struct FrameSender {
    numbers: usize,
    last: Tick,
    full: Producer<(Tick, Frame)>,
    free: Consumer<Frame>,
}

/// The clock by which messages are timed.
struct Clock {
    shared: Arc<Shared>,
    rate: Rate,
    quantum: usize,
    /// Windows by which workers are ahead.
    depth: u64,
}

/// A time of the graph that plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Number of the piece: ticks of different pieces are not comparable.
    pub piece: u64,
    /// Tick of the run.
    pub tick: Tick,
}

/// Receives messages and queues them for nodes; the number of queued messages is bounded.
#[derive(Default)]
pub struct Hub {
    messages: Mutex<HashMap<String, Vec<MessageSender>>>,
    frames: Mutex<HashMap<String, Vec<FrameSender>>>,
    clock: Mutex<Option<Clock>>,
    pieces: AtomicU64,
    /// Parameters that wait to be set, in the order in which they came.
    sets: Mutex<Vec<Set>>,
    /// Meters of the nodes.
    pub meters: Meters,
    /// Woken when a parameter is to be set.
    set: Condvar,
    /// Messages delivered to a node.
    pub delivered: AtomicU64,
    /// Messages that are not.
    pub refusals: Refusals,
}

impl Hub {
    /// A hub without a clock.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the clock of messages to a graph that begins to play; workers are `depth` windows ahead of it.
    pub fn set_clock(&self, shared: Arc<Shared>, rate: Rate, quantum: usize, depth: u64) {
        let mut clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        *clock = Some(Clock { shared, rate, quantum, depth });
        self.pieces.fetch_add(1, Relaxed);
    }

    /// Returns the next time of the workers; `None` before anything plays.
    pub fn moment(&self) -> Option<Moment> {
        let clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        let Clock { shared, rate, quantum, depth } = clock.as_ref()?;
        let window = shared.window.load(Acquire).saturating_add(*depth);
        Some(Moment { piece: self.pieces.load(Relaxed), tick: window_start(*rate, *quantum, window) })
    }

    /// Returns the channels of frames that nodes wait for, with the numbers per frame.
    pub fn frame_channels(&self) -> Vec<(String, usize)> {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all: Vec<_> = frames
            .iter_mut()
            .flat_map(|(name, frames)| {
                frames.retain(|sender| !sender.full.is_abandoned());
                frames.iter().map(|sender| (name.clone(), sender.numbers))
            })
            .collect();
        all.sort();
        all.dedup();
        all
    }

    /// Delivers a frame to the nodes of a channel; returns false if no node waits for frames of this size.
    ///
    /// A frame that is not later than the one before, or finds all queues full, is dropped.
    pub fn deliver_frame(&self, channel: &str, at: Tick, numbers: &[f32]) -> bool {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut fits, mut taken) = (false, false);
        for sender in frames.get_mut(channel).into_iter().flatten() {
            if sender.numbers != numbers.len() || sender.full.is_abandoned() {
                continue;
            }
            fits = true;
            if at <= sender.last {
                continue;
            }
            if let Ok(mut frame) = sender.free.pop() {
                frame.copy_from_slice(numbers);
                taken |= sender.full.push((at, frame)).is_ok();
                sender.last = at;
            }
        }
        if taken {
            self.delivered.fetch_add(1, Relaxed);
        } else {
            self.refusals.add(if fits { Refusal::Dropped } else { Refusal::Unclaimed });
        }
        fits
    }

    /// Returns the next tick of the callback; 0 before anything plays.
    fn now(&self) -> Tick {
        let clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        clock.as_ref().map_or(0, |c| window_start(c.rate, c.quantum, c.shared.window.load(Acquire)))
    }

    /// Delivers a message to the nodes of a channel, to be read `wait` from now.
    ///
    /// A message more than [`MAX_AHEAD`] ahead is refused, as is one that no node reads, one of another kind than the node reads, and one
    /// that finds all queues full.
    pub fn deliver(&self, channel: &str, message: Message, wait: Duration) {
        let now = self.now();
        let wait = wait.min(2 * MAX_AHEAD).as_secs_f64();
        self.queue(channel, message, now, now.saturating_add(ticks(wait)));
    }

    /// Delivers a message to the nodes of a channel, to be read at a tick, or at the next window if that is past.
    ///
    /// It is counted as that of [`Hub::deliver`].
    pub fn deliver_at(&self, channel: &str, message: Message, at: Tick) {
        self.queue(channel, message, self.now(), at);
    }

    fn queue(&self, channel: &str, message: Message, now: Tick, at: Tick) {
        let ahead = at.saturating_sub(now);
        let kind = message.kind().word();
        if ahead > ticks(MAX_AHEAD.as_secs_f64()) {
            let most = MAX_AHEAD.as_secs();
            self.refusals.refuse(Refusal::TooEarly, || {
                format!("{kind} for {channel:?}: it is more than {most} s ahead of the graph that plays")
            });
            return;
        }
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut read, mut taken) = (None, false);
        for sender in messages.get_mut(channel).into_iter().flatten().filter(|sender| sender.is_open()) {
            read = read.filter(|read| *read == message.kind()).or(Some(sender.kind));
            if sender.kind == message.kind() {
                let queue = if ahead > ticks(DUE) { &mut sender.ahead } else { &mut sender.due };
                taken |= queue.push((at, message));
                let (found, wanted) = (message.numbers().len(), sender.numbers);
                if found > wanted {
                    self.refusals.note(|| {
                        format!("{kind} for {channel:?}: its node reads {wanted} of the {found} numbers")
                    });
                }
            }
        }
        drop(messages);
        match read {
            _ if taken => drop(self.delivered.fetch_add(1, Relaxed)),
            None => self.refusals.refuse(Refusal::Unclaimed, || {
                let channels = self.channels();
                let near = nearest(channel, channels.iter().map(|(name, _)| name.as_str()));
                let near = near.map(|near| format!("did you mean {near:?}? ")).unwrap_or_default();
                let list: Vec<_> = channels.iter().map(|(name, kind)| format!("{name:?} ({kind})")).collect();
                let list = if list.is_empty() { "none".to_owned() } else { list.join(", ") };
                format!("{kind} for {channel:?}: no node reads this channel; {near}the graph has {list}")
            }),
            Some(read) if read != message.kind() => self.refusals.refuse(Refusal::WrongKind, || {
                format!("{kind} for {channel:?}: the node of this channel reads the kind `{}`", read.word())
            }),
            Some(_) => self.refusals.refuse(Refusal::Dropped, || {
                format!("{kind} for {channel:?}: {MAX_MESSAGES} messages wait already")
            }),
        }
    }

    /// Returns the channels that nodes read, each with its kind, in the order of their names.
    pub fn channels(&self) -> Vec<(String, &'static str)> {
        let messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let open = messages.iter().flat_map(|(name, senders)| {
            let open = senders.iter().filter(|sender| sender.is_open());
            open.map(|sender| (name.clone(), sender.kind.word()))
        });
        let mut all: Vec<_> = open.collect();
        drop(messages);
        all.extend(self.frame_channels().into_iter().map(|(name, _)| (name, "mesh")));
        all.sort();
        all.dedup();
        all
    }

    /// Queues a parameter to set. The newest value of each target counts; a target beyond 256 that wait is dropped.
    pub fn set(&self, target: String, value: String) {
        let mut sets = self.sets.lock().unwrap_or_else(PoisonError::into_inner);
        match sets.iter().position(|set| set.target == target) {
            Some(k) => sets[k].value = value,
            None if sets.len() < MAX_SETS => sets.push(Set { target, value }),
            None => {
                self.refusals
                    .refuse(Refusal::Dropped, || format!("{MAX_SETS} parameters wait to be set already"));
                return;
            }
        }
        self.delivered.fetch_add(1, Relaxed);
        self.set.notify_all();
    }

    /// Takes all parameters to set, in the order in which their targets came first; waits for one for `limit` at most.
    pub fn take_sets(&self, limit: Duration) -> Vec<Set> {
        let mut sets = self.sets.lock().unwrap_or_else(PoisonError::into_inner);
        if sets.is_empty() {
            sets = self.set.wait_timeout(sets, limit).unwrap_or_else(PoisonError::into_inner).0;
        }
        std::mem::take(&mut *sets)
    }
}

impl Inputs for Hub {
    fn open(&self, channel: &str, kind: MessageKind, numbers: usize) -> Option<Box<dyn Inbox>> {
        let ((due, due_receiver), (ahead, ahead_receiver)) = (queue(), queue());
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let messages = messages.entry(channel.to_owned()).or_default();
        messages.retain(MessageSender::is_open);
        messages.push(MessageSender { kind, numbers, due, ahead });
        Some(Box::new(MessageReceiver {
            due: due_receiver,
            ahead: ahead_receiver,
            window: Tick::MIN,
            read: 0,
        }))
    }

    fn open_frames(&self, channel: &str, numbers: usize) -> Option<Box<dyn Frames>> {
        let ((full, received), (mut returned, free)) =
            (RingBuffer::new(MAX_FRAMES), RingBuffer::new(MAX_FRAMES));
        for _ in 0..MAX_FRAMES {
            let _ = returned.push(vec![0.0; numbers].into_boxed_slice());
        }
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let frames = frames.entry(channel.to_owned()).or_default();
        frames.retain(|sender| !sender.full.is_abandoned());
        frames.push(FrameSender { numbers, last: Tick::MIN, full, free });
        Some(Box::new(FrameReceiver { full: received, free: returned }))
    }

    fn open_display(&self, name: &str, rate: f64) -> Option<Box<dyn Display>> {
        Some(self.meters.open(name, rate))
    }
}

/// The end of a channel of frames at a node.
struct FrameReceiver {
    full: Consumer<(Tick, Frame)>,
    free: Producer<Frame>,
}

impl Frames for FrameReceiver {
    fn latest(&mut self, before: Tick, into: &mut [f32]) -> Option<Tick> {
        let mut newest = None;
        while self.full.peek().is_ok_and(|(at, _)| *at < before) {
            let Ok((at, frame)) = self.full.pop() else { break };
            if frame.len() == into.len() {
                into.copy_from_slice(&frame);
                newest = Some(at);
            }
            // The ring has a slot for every frame.
            let _ = self.free.push(frame);
        }
        newest
    }
}

/// The end of one queue of messages at a node.
struct QueueReceiver {
    ring: Consumer<(Tick, Message)>,
    unread: Arc<AtomicUsize>,
    /// In descending order of time; it has room for all that are unread.
    sorted: Vec<(Tick, Message)>,
}

fn queue() -> (QueueSender, QueueReceiver) {
    let (producer, consumer) = RingBuffer::new(MAX_MESSAGES);
    let unread = Arc::new(AtomicUsize::new(0));
    let sender = QueueSender { ring: producer, unread: Arc::clone(&unread) };
    (sender, QueueReceiver { ring: consumer, unread, sorted: Vec::with_capacity(MAX_MESSAGES) })
}

impl QueueReceiver {
    /// Takes in the received messages, and returns the time of the earliest one.
    fn earliest(&mut self) -> Option<Tick> {
        while self.sorted.len() < self.sorted.capacity() {
            let Ok((at, message)) = self.ring.pop() else { break };
            let index = self.sorted.partition_point(|(t, _)| *t > at);
            self.sorted.insert(index, (at, message));
        }
        self.sorted.last().map(|(at, _)| *at)
    }

    fn take(&mut self) -> Option<(Tick, Message)> {
        let message = self.sorted.pop();
        if message.is_some() {
            self.unread.fetch_sub(1, Release);
        }
        message
    }
}

/// The end of a channel of messages at a node.
struct MessageReceiver {
    due: QueueReceiver,
    ahead: QueueReceiver,
    /// End of the present window.
    window: Tick,
    /// Messages read in it.
    read: usize,
}

impl Inbox for MessageReceiver {
    fn next(&mut self, before: Tick) -> Option<(Tick, Message)> {
        if before != self.window {
            (self.window, self.read) = (before, 0);
        }
        if self.read == MAX_PER_WINDOW {
            return None;
        }
        let (due, ahead) = (self.due.earliest(), self.ahead.earliest());
        let (at, queue) = match (due, ahead) {
            (Some(due), Some(ahead)) if ahead < due => (ahead, &mut self.ahead),
            (Some(due), _) => (due, &mut self.due),
            (None, Some(ahead)) => (ahead, &mut self.ahead),
            (None, None) => return None,
        };
        if at >= before {
            return None;
        }
        self.read += 1;
        queue.take()
    }
}

#[cfg(test)]
mod tests;
