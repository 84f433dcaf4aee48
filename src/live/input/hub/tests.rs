//! Queues of messages, frames and parameters, and their bounds.

use super::*;

fn control(x: f64) -> Message {
    Message::new(MessageKind::Control, &[x]).unwrap()
}

#[test]
fn messages_arrive_in_the_order_of_their_times() {
    let hub = Hub::new();
    let mut inbox = hub.open("a", MessageKind::Control, 16).unwrap();
    for (x, wait) in [(1.0, 30), (2.0, 10), (3.0, 20)] {
        hub.deliver("a", control(x), Duration::from_millis(wait));
    }
    hub.deliver("nobody", control(9.0), Duration::ZERO);
    let mut next = |ms: f64| inbox.next(ticks(ms / 1e3)).map(|(_, m)| m.numbers()[0]);
    assert_eq!(
        [next(15.0), next(15.0), next(25.0), next(99.0), next(99.0)],
        [Some(2.0), None, Some(3.0), Some(1.0), None]
    );
    assert_eq!((hub.delivered.load(Relaxed), hub.refusals.count(Refusal::Unclaimed)), (3, 1));
}

#[test]
fn the_latest_due_frame_is_read_and_later_ones_wait() {
    let hub = Hub::new();
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
    assert_eq!(refused(&hub, [Refusal::Dropped, Refusal::Unclaimed]), [2, 2]);
    assert_eq!(hub.delivered.load(Relaxed), 3);
}

#[test]
fn frames_are_reused_and_those_without_a_slot_are_counted() {
    let hub = Hub::new();
    let mut frames = hub.open_frames("sheet", 2).unwrap();
    let mut shown = [0.0; 2];
    for round in 0..10 {
        for k in 0..MAX_FRAMES as i64 + 3 {
            assert!(hub.deliver_frame("sheet", 100 * round + k, &[k as f32; 2]));
        }
        assert_eq!(frames.latest(Tick::MAX, &mut shown), Some(100 * round + MAX_FRAMES as i64 - 1));
        assert_eq!(shown, [MAX_FRAMES as f32 - 1.0; 2]);
    }
    assert_eq!(refused(&hub, [Refusal::Dropped]), [30]);
    assert_eq!(hub.delivered.load(Relaxed), 10 * MAX_FRAMES as u64);
}

#[test]
fn a_channel_exists_as_long_as_its_node() {
    let hub = Hub::new();
    let (a, b) = (hub.open_frames("a", 3), hub.open_frames("b", 6));
    assert_eq!(hub.frame_channels(), [("a".to_owned(), 3), ("b".to_owned(), 6)]);
    drop(a);
    assert_eq!(hub.frame_channels(), [("b".to_owned(), 6)]);
    assert!(!hub.deliver_frame("a", 1, &[0.0; 3]));
    drop(b);
    assert!(hub.frame_channels().is_empty());
}

fn refused<const N: usize>(hub: &Hub, kinds: [Refusal; N]) -> [u64; N] {
    kinds.map(|kind| hub.refusals.count(kind))
}

#[test]
fn messages_far_ahead_are_refused_and_due_ones_pass_those_that_wait() {
    let hub = Hub::new();
    let mut inbox = hub.open("a", MessageKind::Control, 16).unwrap();
    let send = |x: f64, wait: u64| hub.deliver("a", control(x), Duration::from_secs(wait));
    (0..1100).for_each(|_| send(1.0, 3500));
    assert_eq!((refused(&hub, [Refusal::TooEarly]), hub.delivered.load(Relaxed)), ([1100], 0));
    (0..1100).for_each(|_| send(1.0, 9));
    assert_eq!((hub.delivered.load(Relaxed), refused(&hub, [Refusal::Dropped])), (1024, [76]));
    send(2.0, 0);
    assert_eq!(inbox.next(ticks(0.01)).map(|(_, m)| m.numbers()[0]), Some(2.0));
    assert!(inbox.next(ticks(0.01)).is_none());
    // Those that counted as delivered are read at their time, however many others come before.
    for _ in 0..2000 {
        send(2.0, 0);
        assert!(inbox.next(ticks(0.01)).is_some() || inbox.next(ticks(0.02)).is_some());
    }
    assert_eq!(std::iter::from_fn(|| inbox.next(ticks(9.5))).count(), 1024);
}

#[test]
fn a_node_reads_1024_messages_in_a_window_and_the_others_in_the_next() {
    let hub = Hub::new();
    let mut inbox = hub.open("a", MessageKind::Control, 16).unwrap();
    let send = || hub.deliver("a", control(1.0), Duration::ZERO);
    (0..900).for_each(|_| send());
    let mut read = 0;
    while inbox.next(10).is_some() {
        read += 1;
        // The sender is as fast as the node.
        send();
    }
    assert_eq!(read, 1024);
    assert_eq!(std::iter::from_fn(|| inbox.next(20)).count(), 900);
}

#[test]
fn of_parameters_to_set_the_newest_counts_and_256_wait() {
    let hub = Hub::new();
    for k in 0..1_000_000 {
        hub.set("level".into(), k.to_string());
    }
    (0..300).for_each(|k| hub.set(format!("t{k}"), "1".into()));
    let sets = hub.take_sets(Duration::ZERO);
    assert_eq!(sets.len(), MAX_SETS);
    assert_eq!(sets[0], Set { target: "level".into(), value: "999999".into() });
    assert_eq!(refused(&hub, [Refusal::Dropped]), [45]);
    assert!(hub.take_sets(Duration::from_millis(1)).is_empty());
}
