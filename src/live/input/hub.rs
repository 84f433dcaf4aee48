//! Delivers messages to the nodes that wait for them.

use super::meters::Meters;
use crate::live::playback::callback::Shared;
use crate::live::playback::timing::window_start;
use crossbeam_channel::Sender;
use foley_nodes::core::input::{Display, Frames, Inbox, Inputs, Message};
use foley_nodes::core::time::{Rate, Tick, ticks};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Acquire, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Maximum number of unread messages of a node.
const MAX_MESSAGES: usize = 1024;
/// Maximum number of unread frames of a node.
const MAX_FRAMES: usize = 16;

/// A parameter to set, as with `--set`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Set {
    /// `NAME` or `NODE.PARAM`.
    pub target: String,
    /// A RON value.
    pub value: String,
}

type MessageSender = Producer<(Tick, Message)>;
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

/// Receives messages and queues them for nodes.
pub struct Hub {
    messages: Mutex<HashMap<String, Vec<MessageSender>>>,
    frames: Mutex<HashMap<String, Vec<FrameSender>>>,
    clock: Mutex<Option<Clock>>,
    pieces: AtomicU64,
    sets: Sender<Set>,
    /// Meters of the nodes.
    pub meters: Meters,
    /// Messages delivered to a node.
    pub delivered: AtomicU64,
    /// Packets and lines that cannot be parsed.
    pub malformed: AtomicU64,
    /// Messages without a node that waits for them, or with a full queue.
    pub unclaimed: AtomicU64,
}

impl Hub {
    /// A hub without a clock; parameters to set are sent to `sets`.
    #[must_use]
    pub fn new(sets: Sender<Set>) -> Self {
        Self {
            messages: Mutex::default(),
            frames: Mutex::default(),
            clock: Mutex::default(),
            pieces: AtomicU64::new(0),
            sets,
            meters: Meters::default(),
            delivered: AtomicU64::new(0),
            malformed: AtomicU64::new(0),
            unclaimed: AtomicU64::new(0),
        }
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
    /// A frame that is not later than the one before, or finds all queues full, is counted as unclaimed.
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
        if taken { &self.delivered } else { &self.unclaimed }.fetch_add(1, Relaxed);
        fits
    }

    /// Delivers a message to the nodes of a channel, to be read `wait` from now.
    pub fn deliver(&self, channel: &str, message: Message, wait: Duration) {
        let clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        let now =
            clock.as_ref().map_or(0, |c| window_start(c.rate, c.quantum, c.shared.window.load(Acquire)));
        drop(clock);
        self.deliver_at(channel, message, now.saturating_add(ticks(wait.as_secs_f64().min(3600.0))));
    }

    /// Delivers a message to the nodes of a channel, to be read at a tick, or at the next window if that is past.
    pub fn deliver_at(&self, channel: &str, message: Message, at: Tick) {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let mut taken = false;
        for sender in messages.get_mut(channel).into_iter().flatten() {
            taken |= sender.push((at, message)).is_ok();
        }
        if taken { &self.delivered } else { &self.unclaimed }.fetch_add(1, Relaxed);
    }

    /// Sends a parameter to set.
    pub fn set(&self, target: String, value: String) {
        self.delivered.fetch_add(1, Relaxed);
        let _ = self.sets.send(Set { target, value });
    }

    /// Counts a message that cannot be parsed.
    pub fn reject(&self) {
        self.malformed.fetch_add(1, Relaxed);
    }
}

impl Inputs for Hub {
    fn open(&self, channel: &str) -> Option<Box<dyn Inbox>> {
        let (producer, consumer) = RingBuffer::new(MAX_MESSAGES);
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let messages = messages.entry(channel.to_owned()).or_default();
        messages.retain(|sender| !sender.is_abandoned());
        messages.push(producer);
        Some(Box::new(MessageReceiver { receiver: consumer, sorted: Vec::with_capacity(MAX_MESSAGES) }))
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

/// The end of a channel of messages at a node.
struct MessageReceiver {
    receiver: Consumer<(Tick, Message)>,
    /// In descending order of time.
    sorted: Vec<(Tick, Message)>,
}

impl Inbox for MessageReceiver {
    fn next(&mut self, before: Tick) -> Option<(Tick, Message)> {
        while self.sorted.len() < self.sorted.capacity() {
            let Ok((at, message)) = self.receiver.pop() else { break };
            let index = self.sorted.partition_point(|(t, _)| *t > at);
            self.sorted.insert(index, (at, message));
        }
        self.sorted.pop_if(|(at, _)| *at < before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossbeam_channel::unbounded;

    #[test]
    fn messages_arrive_in_the_order_of_their_times() {
        let hub = Hub::new(unbounded().0);
        let mut inbox = hub.open("a").unwrap();
        for (x, wait) in [(1.0, 30), (2.0, 10), (3.0, 20)] {
            hub.deliver("a", Message::new(&[x]).unwrap(), Duration::from_millis(wait));
        }
        hub.deliver("nobody", Message::new(&[9.0]).unwrap(), Duration::ZERO);
        let mut next = |ms: f64| inbox.next(ticks(ms / 1e3)).map(|(_, m)| m.numbers()[0]);
        assert_eq!(
            [next(15.0), next(15.0), next(25.0), next(99.0), next(99.0)],
            [Some(2.0), None, Some(3.0), Some(1.0), None]
        );
        assert_eq!((hub.delivered.load(Relaxed), hub.unclaimed.load(Relaxed)), (3, 1));
    }

    #[test]
    fn the_latest_due_frame_is_read_and_later_ones_wait() {
        let hub = Hub::new(unbounded().0);
        let mut frames = hub.open_frames("sheet", 3).unwrap();
        let mut shown = [9.0; 3];
        assert_eq!(frames.latest(100, &mut shown), None);
        for (at, x) in [(10, 1.0), (20, 2.0), (30, 3.0), (30, 4.0), (25, 5.0)] {
            assert!(hub.deliver_frame("sheet", at, &[x; 3]));
        }
        let mut latest = |before| frames.latest(before, &mut shown).map(|at| (at, shown));
        assert_eq!(
            [latest(10), latest(21), latest(30), latest(31), latest(99)],
            [None, Some((20, [2.0; 3])), None, Some((30, [3.0; 3])), None]
        );
        assert!(!hub.deliver_frame("sheet", 40, &[0.0; 6]) && !hub.deliver_frame("other", 40, &[0.0; 3]));
        // Two that are not later than the one before, and two without a node.
        assert_eq!((hub.delivered.load(Relaxed), hub.unclaimed.load(Relaxed)), (3, 4));
    }

    #[test]
    fn frames_are_reused_and_those_without_a_slot_are_counted() {
        let hub = Hub::new(unbounded().0);
        let mut frames = hub.open_frames("sheet", 2).unwrap();
        let mut shown = [0.0; 2];
        for round in 0..10 {
            for k in 0..MAX_FRAMES as i64 + 3 {
                assert!(hub.deliver_frame("sheet", 100 * round + k, &[k as f32; 2]));
            }
            assert_eq!(frames.latest(Tick::MAX, &mut shown), Some(100 * round + MAX_FRAMES as i64 - 1));
            assert_eq!(shown, [MAX_FRAMES as f32 - 1.0; 2]);
        }
        assert_eq!((hub.delivered.load(Relaxed), hub.unclaimed.load(Relaxed)), (10 * MAX_FRAMES as u64, 30));
    }

    #[test]
    fn a_channel_exists_as_long_as_its_node() {
        let hub = Hub::new(unbounded().0);
        let (a, b) = (hub.open_frames("a", 3), hub.open_frames("b", 6));
        assert_eq!(hub.frame_channels(), [("a".to_owned(), 3), ("b".to_owned(), 6)]);
        drop(a);
        assert_eq!(hub.frame_channels(), [("b".to_owned(), 6)]);
        assert!(!hub.deliver_frame("a", 1, &[0.0; 3]));
        drop(b);
        assert!(hub.frame_channels().is_empty());
    }
}
