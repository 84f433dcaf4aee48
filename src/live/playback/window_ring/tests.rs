//! Tests of windows that arrive too late.

use super::*;
use foley_nodes::core::buffer::{Budget, EventBuffer, Pad};
use foley_nodes::core::stage::Clock;

/// Ticks of a window.
const WINDOW: i64 = 10;

/// A stage that has a buffer of events and nothing else.
fn stage() -> Stage {
    let clock = Clock { rate: None, delay: 0, end: None, from: 0 };
    Stage::new(vec![Box::new(EventBuffer::<u32>::new(WINDOW, &Budget::default()))], vec![clock], Vec::new())
}

/// A worker and a callback with a ring of 2 windows between them.
struct Pair {
    worker: Stage,
    callback: Stage,
    sender: RingSender,
    receiver: RingReceiver,
}

impl Pair {
    fn new() -> Self {
        let (worker, callback) = (stage(), stage());
        let make = || worker.with_buffer(0, |buffer| buffer.sibling(0));
        let (sender, receiver) = ring(2, (0, 0), (0, 0), None, make);
        Self { worker, callback, sender, receiver }
    }

    /// Runs a window of the worker, in which the events are at the last ticks.
    fn work(&mut self, window: u64, events: &[u32], in_time: bool) {
        let end = (window as i64 + 1) * WINDOW;
        self.worker.advance(end);
        self.worker.with_buffer_mut(0, |buffer| {
            let buffer = buffer.typed_mut::<EventBuffer<u32>>().unwrap();
            let ticks = end - events.len() as i64..;
            ticks.zip(events).for_each(|(tick, event)| buffer.push(tick.max(end - WINDOW), *event));
            buffer.advance(end);
        });
        if in_time {
            self.sender.send(&self.worker, window);
        } else {
            self.sender.send_late(&self.worker);
        }
    }

    /// Receives a window: its events by their ticks after its start, and what the receiver reports.
    fn play(&mut self, window: u64) -> (Vec<(i64, u32)>, Received) {
        let from = window as i64 * WINDOW;
        self.callback.advance(from + WINDOW);
        let received = self.receiver.receive(&mut self.callback, window);
        let events = self.callback.with_buffer(0, |buffer| {
            let buffer = buffer.typed::<EventBuffer<u32>>().unwrap();
            buffer.view(from, from + WINDOW).iter().map(|(tick, event)| (tick - from, *event)).collect()
        });
        (events, received)
    }
}

const ARRIVED: Received = Received { missed: false, lost_events: 0 };
const MISSED: Received = Received { missed: true, lost_events: 0 };

#[test]
fn events_of_a_window_that_arrives_too_late_begin_the_next_one() {
    let mut pair = Pair::new();
    assert_eq!(pair.play(0), (vec![], MISSED));
    pair.work(0, &[1, 2], true);
    pair.work(1, &[3], true);
    assert_eq!(pair.play(1), (vec![(0, 1), (0, 2), (9, 3)], ARRIVED));
    assert_eq!(pair.play(2), (vec![], MISSED));
}

#[test]
fn events_of_windows_that_are_not_sent_arrive_later_in_their_order() {
    let mut pair = Pair::new();
    (0..4).for_each(|window| drop(pair.play(window)));
    for window in 0..4 {
        pair.work(window, &[2 * window as u32, 2 * window as u32 + 1], false);
    }
    assert!(!pair.sender.has_room(), "the slot that is free is for the events that wait");
    assert_eq!(pair.play(4), (vec![(0, 0), (0, 1)], MISSED));
    pair.work(4, &[8], false);
    assert_eq!(pair.play(5), (vec![(0, 2), (0, 3), (0, 4), (0, 5), (0, 6), (0, 7), (0, 8)], MISSED));
    pair.work(5, &[9], false);
    pair.work(6, &[10], true);
    assert_eq!(pair.play(6), (vec![(0, 9), (9, 10)], ARRIVED));
}

#[test]
fn late_events_without_room_are_counted() {
    let mut pair = Pair::new();
    let room = EventBuffer::<u32>::ROOM as u32 / 2;
    let events: Vec<u32> = (0..room + 3).collect();
    assert_eq!(pair.play(0), (vec![], MISSED));
    pair.work(0, &events, false);
    let (played, received) = pair.play(1);
    assert_eq!((played.len() as u32, received), (room, Received { missed: true, lost_events: 3 }));
    assert!(played.iter().zip(&events).all(|(a, b)| *a == (0, *b)));
    assert_eq!(pair.play(2), (vec![], MISSED));
}

#[test]
fn a_late_window_of_a_stream_is_left_out() {
    let mut ends =
        ring(2, (0, 0), (0, 0), None, || Box::new(StreamBuffer::<f32>::new(1, 4, 0, Pad::Silence)));
    ends.0.send_late(&stage());
    assert!(ends.0.has_room() && ends.1.full.is_empty());
}
