//! Brings messages to the nodes that wait for them.

use super::super::callback::{Shared, tick};
use crossbeam_channel::Sender;
use foley_nodes::core::input::{Frames, Inbox, Inputs, Message};
use foley_nodes::core::time::{Rate, Tick, ticks};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Acquire, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Messages that a node can have before it reads them.
const ROOM: usize = 1024;
/// Frames of a mesh that a node can have before it reads them.
const FRAMES: usize = 16;

/// A parameter that is to be set, as `--set` would: its name, and a RON value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Set {
    /// `NAME` or `NODE.PARAM`.
    pub target: String,
    /// A RON value.
    pub value: String,
}

type Wire = Producer<(Tick, Message)>;
type Frame = Box<[f32]>;

/// Frames on their way to a node, and those that come back empty.
struct Reel {
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

/// A moment of what plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// How often something else has begun to play: times of another piece say nothing here.
    pub piece: u64,
    /// When.
    pub tick: Tick,
}

/// Where messages arrive and wait.
pub struct Hub {
    wires: Mutex<HashMap<String, Vec<Wire>>>,
    reels: Mutex<HashMap<String, Vec<Reel>>>,
    clock: Mutex<Option<Clock>>,
    pieces: AtomicU64,
    sets: Sender<Set>,
    /// Messages that were brought to a node.
    pub delivered: AtomicU64,
    /// Packets and lines that could not be understood.
    pub malformed: AtomicU64,
    /// Messages that no node waits for, or has room for.
    pub unclaimed: AtomicU64,
}

impl Hub {
    /// A hub without a clock yet; parameters to be set are handed on.
    #[must_use]
    pub fn new(sets: Sender<Set>) -> Self {
        Self {
            wires: Mutex::default(),
            reels: Mutex::default(),
            clock: Mutex::default(),
            pieces: AtomicU64::new(0),
            sets,
            delivered: AtomicU64::new(0),
            malformed: AtomicU64::new(0),
            unclaimed: AtomicU64::new(0),
        }
    }

    /// Times messages by what is being played from now on; workers are `depth` windows ahead of it.
    pub fn set_clock(&self, shared: Arc<Shared>, rate: Rate, quantum: usize, depth: u64) {
        let mut clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        *clock = Some(Clock { shared, rate, quantum, depth });
        self.pieces.fetch_add(1, Relaxed);
    }

    /// The moment that workers come to next; `None` before anything plays.
    pub fn moment(&self) -> Option<Moment> {
        let clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        let Clock { shared, rate, quantum, depth } = clock.as_ref()?;
        let window = shared.window.load(Acquire).saturating_add(*depth);
        Some(Moment { piece: self.pieces.load(Relaxed), tick: tick(*rate, *quantum, window) })
    }

    /// Numbers in the frames of each channel that nodes wait for.
    pub fn frame_channels(&self) -> Vec<(String, usize)> {
        let mut reels = self.reels.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all: Vec<_> = reels
            .iter_mut()
            .flat_map(|(name, reels)| {
                reels.retain(|reel| !reel.full.is_abandoned());
                reels.iter().map(|reel| (name.clone(), reel.numbers))
            })
            .collect();
        all.sort();
        all.dedup();
        all
    }

    /// Brings a frame to whoever waits for the channel; false where nobody waits for frames of that size.
    ///
    /// A frame that is not later than the one before, or that nobody has room for, is counted and left out.
    pub fn deliver_frame(&self, channel: &str, at: Tick, numbers: &[f32]) -> bool {
        let mut reels = self.reels.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut fits, mut taken) = (false, false);
        for reel in reels.get_mut(channel).into_iter().flatten() {
            if reel.numbers != numbers.len() || reel.full.is_abandoned() {
                continue;
            }
            fits = true;
            if at <= reel.last {
                continue;
            }
            if let Ok(mut frame) = reel.free.pop() {
                frame.copy_from_slice(numbers);
                taken |= reel.full.push((at, frame)).is_ok();
                reel.last = at;
            }
        }
        if taken { &self.delivered } else { &self.unclaimed }.fetch_add(1, Relaxed);
        fits
    }

    /// Brings a message to whoever waits for the channel, to be read `wait` from now.
    pub fn deliver(&self, channel: &str, message: Message, wait: Duration) {
        let clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        let now = clock.as_ref().map_or(0, |c| tick(c.rate, c.quantum, c.shared.window.load(Acquire)));
        drop(clock);
        let at = now.saturating_add(ticks(wait.as_secs_f64().min(3600.0)));
        let mut wires = self.wires.lock().unwrap_or_else(PoisonError::into_inner);
        let mut taken = false;
        for wire in wires.get_mut(channel).into_iter().flatten() {
            taken |= wire.push((at, message)).is_ok();
        }
        if taken { &self.delivered } else { &self.unclaimed }.fetch_add(1, Relaxed);
    }

    /// Hands on a parameter to be set.
    pub fn set(&self, target: String, value: String) {
        self.delivered.fetch_add(1, Relaxed);
        let _ = self.sets.send(Set { target, value });
    }

    /// Counts what could not be understood.
    pub fn reject(&self) {
        self.malformed.fetch_add(1, Relaxed);
    }
}

impl Inputs for Hub {
    fn open(&self, channel: &str) -> Option<Box<dyn Inbox>> {
        let (producer, consumer) = RingBuffer::new(ROOM);
        let mut wires = self.wires.lock().unwrap_or_else(PoisonError::into_inner);
        let wires = wires.entry(channel.to_owned()).or_default();
        wires.retain(|wire| !wire.is_abandoned());
        wires.push(producer);
        Some(Box::new(Waiting { wire: consumer, sorted: Vec::with_capacity(ROOM) }))
    }

    fn open_frames(&self, channel: &str, numbers: usize) -> Option<Box<dyn Frames>> {
        let ((full, come), (mut back, free)) = (RingBuffer::new(FRAMES), RingBuffer::new(FRAMES));
        for _ in 0..FRAMES {
            let _ = back.push(vec![0.0; numbers].into_boxed_slice());
        }
        let mut reels = self.reels.lock().unwrap_or_else(PoisonError::into_inner);
        let reels = reels.entry(channel.to_owned()).or_default();
        reels.retain(|reel| !reel.full.is_abandoned());
        reels.push(Reel { numbers, last: Tick::MIN, full, free });
        Some(Box::new(Showing { come, back }))
    }
}

/// A node's end of a channel of frames.
struct Showing {
    come: Consumer<(Tick, Frame)>,
    back: Producer<Frame>,
}

impl Frames for Showing {
    fn latest(&mut self, before: Tick, into: &mut [f32]) -> Option<Tick> {
        let mut newest = None;
        while self.come.peek().is_ok_and(|(at, _)| *at < before) {
            let Ok((at, frame)) = self.come.pop() else { break };
            if frame.len() == into.len() {
                into.copy_from_slice(&frame);
                newest = Some(at);
            }
            // There is room for every frame that there is.
            let _ = self.back.push(frame);
        }
        newest
    }
}

/// A node's end of a channel.
struct Waiting {
    wire: Consumer<(Tick, Message)>,
    /// Latest first.
    sorted: Vec<(Tick, Message)>,
}

impl Inbox for Waiting {
    fn next(&mut self, before: Tick) -> Option<(Tick, Message)> {
        while self.sorted.len() < self.sorted.capacity() {
            let Ok((at, message)) = self.wire.pop() else { break };
            let place = self.sorted.partition_point(|(t, _)| *t > at);
            self.sorted.insert(place, (at, message));
        }
        self.sorted.pop_if(|(at, _)| *at < before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossbeam_channel::unbounded;

    #[test]
    fn messages_come_in_the_order_of_their_times() {
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
    fn the_newest_frame_that_is_due_is_shown_and_later_ones_wait() {
        let hub = Hub::new(unbounded().0);
        let mut frames = hub.open_frames("sheet", 3).unwrap();
        let mut shown = [9.0; 3];
        assert_eq!(frames.latest(100, &mut shown), None);
        for (at, x) in [(10, 1.0), (20, 2.0), (30, 3.0), (30, 4.0), (25, 5.0)] {
            assert!(hub.deliver_frame("sheet", at, &[x; 3]));
        }
        let mut look = |before| frames.latest(before, &mut shown).map(|at| (at, shown));
        assert_eq!(
            [look(10), look(21), look(30), look(31), look(99)],
            [None, Some((20, [2.0; 3])), None, Some((30, [3.0; 3])), None]
        );
        assert!(!hub.deliver_frame("sheet", 40, &[0.0; 6]) && !hub.deliver_frame("other", 40, &[0.0; 3]));
        // Two that are not later than the one before, and two that nobody waits for.
        assert_eq!((hub.delivered.load(Relaxed), hub.unclaimed.load(Relaxed)), (3, 4));
    }

    #[test]
    fn frames_go_round_and_those_without_room_are_counted() {
        let hub = Hub::new(unbounded().0);
        let mut frames = hub.open_frames("sheet", 2).unwrap();
        let mut shown = [0.0; 2];
        for round in 0..10 {
            for k in 0..FRAMES as i64 + 3 {
                assert!(hub.deliver_frame("sheet", 100 * round + k, &[k as f32; 2]));
            }
            assert_eq!(frames.latest(Tick::MAX, &mut shown), Some(100 * round + FRAMES as i64 - 1));
            assert_eq!(shown, [FRAMES as f32 - 1.0; 2]);
        }
        assert_eq!((hub.delivered.load(Relaxed), hub.unclaimed.load(Relaxed)), (10 * FRAMES as u64, 30));
    }

    #[test]
    fn a_channel_is_known_as_long_as_its_node_lives() {
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
