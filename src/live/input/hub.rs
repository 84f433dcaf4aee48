//! Brings messages to the nodes that wait for them.

use super::super::callback::{Shared, tick};
use crossbeam_channel::Sender;
use foley_nodes::core::input::{Inbox, Inputs, Message};
use foley_nodes::core::time::{Rate, Tick, ticks};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering::Acquire, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Messages that a node can have before it reads them.
const ROOM: usize = 1024;

/// A parameter that is to be set, as `--set` would: its name, and a RON value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Set {
    /// `NAME` or `NODE.PARAM`.
    pub target: String,
    /// A RON value.
    pub value: String,
}

type Wire = Producer<(Tick, Message)>;

/// The clock by which messages are timed.
struct Clock {
    shared: Arc<Shared>,
    rate: Rate,
    quantum: usize,
}

/// Where messages arrive and wait.
pub struct Hub {
    wires: Mutex<HashMap<String, Vec<Wire>>>,
    clock: Mutex<Option<Clock>>,
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
            clock: Mutex::default(),
            sets,
            delivered: AtomicU64::new(0),
            malformed: AtomicU64::new(0),
            unclaimed: AtomicU64::new(0),
        }
    }

    /// Tells messages by what is being played from now on.
    pub fn set_clock(&self, shared: Arc<Shared>, rate: Rate, quantum: usize) {
        *self.clock.lock().unwrap_or_else(PoisonError::into_inner) = Some(Clock { shared, rate, quantum });
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
}
