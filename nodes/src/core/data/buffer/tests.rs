use super::*;
use crate::core::time::Tick;

#[test]
fn a_track_shows_its_span_after_any_appends() {
    let mut buffer = StreamBuffer::<f32>::new(2, 10, 4, Pad::Silence);
    let mut next = 0;
    for n in [3, 1, 5, 2, 5, 5, 1, 4, 3].into_iter().cycle().take(200) {
        for frame in buffer.append(n).chunks_exact_mut(2) {
            frame.fill(next as f32 + 1.0);
            next += 1;
        }
        let from = (next - 10).max(-4);
        let seen: Vec<f32> = buffer.view(from, next).iter().step_by(2).copied().collect();
        let want: Vec<f32> = (from..next).map(|i| if i < 0 { 0.0 } else { i as f32 + 1.0 }).collect();
        assert_eq!(seen, want);
    }
}

#[test]
fn windows_as_long_as_the_span_stay_in_one_place() {
    let mut buffer = StreamBuffer::<f32>::new(1, 4, 0, Pad::Hold);
    for k in 0..5 {
        buffer.append(4).fill(k as f32);
        assert_eq!(buffer.at(buffer.end()), 4, "window {k} fills the front");
        assert_eq!(buffer.view(4 * k, 4 * k + 4), [k as f32; 4]);
    }
    buffer.pad_to(23);
    assert_eq!(buffer.view(19, 23), [4.0; 4]);
}

#[test]
fn the_shortest_track_can_still_be_padded() {
    let mut buffer = StreamBuffer::<f32>::new(2, 1, 0, Pad::Hold);
    buffer.append(1).copy_from_slice(&[1.0, 2.0]);
    buffer.append(1).copy_from_slice(&[3.0, 4.0]);
    buffer.pad_to(9);
    assert_eq!(buffer.view(8, 9), [3.0, 4.0]);
    assert_eq!(StreamBuffer::<f32>::planned_bytes(2, 1), buffer.bytes());
}

#[test]
fn a_buffer_has_its_type() {
    let samples = BoxedBuffer::new(Box::new(StreamBuffer::<f32>::new(1, 4, 0, Pad::Silence)));
    assert!(matches!(samples, BoxedBuffer::Samples(_)) && samples.typed::<StreamBuffer<f32>>().is_some());
    assert!(samples.typed::<StreamBuffer<u32>>().is_none());
    let other = BoxedBuffer::new(Box::new(EventBuffer::<u32>::new(10, &Budget::default())));
    assert!(matches!(other, BoxedBuffer::Other(_)) && other.typed::<EventBuffer<u32>>().is_some());
}

#[test]
fn hold_repeats_the_first_and_the_last_item() {
    let mut buffer = StreamBuffer::<f32>::new(1, 6, 3, Pad::Hold);
    buffer.append(2).copy_from_slice(&[5.0, 7.0]);
    buffer.settle();
    assert_eq!(buffer.view(-3, 2), [5.0, 5.0, 5.0, 5.0, 7.0]);
    buffer.pad_to(20);
    assert_eq!(buffer.view(14, 20), [7.0; 6]);
}

#[test]
fn a_track_begins_anywhere_and_takes_over_what_another_holds() {
    let mut old = StreamBuffer::<f32>::new(1, 6, 0, Pad::Hold);
    old.begin(100);
    old.append(3).copy_from_slice(&[1.0, 2.0, 3.0]);
    old.settle();
    assert_eq!(old.view(97, 103), [1.0, 1.0, 1.0, 1.0, 2.0, 3.0]);
    for span in [3, 6, 9] {
        let mut buffer = StreamBuffer::<f32>::new(1, span, 0, Pad::Silence);
        let mut copy = StreamBuffer::<f32>::new(1, 6, 0, Pad::Hold);
        copy.append_from(&old, 103, 103);
        copy.begin(100);
        copy.append(3).copy_from_slice(&[1.0, 2.0, 3.0]);
        buffer.take_over(&mut copy);
        buffer.append(1)[0] = 4.0;
        assert_eq!(buffer.end(), 104);
        assert_eq!(buffer.view(102, 104), [3.0, 4.0]);
    }
    let mut seeded = StreamBuffer::<f32>::new(1, 8, 0, Pad::Silence);
    seeded.begin(102);
    seeded.seed(&old);
    assert_eq!(seeded.view(97, 102), [1.0, 1.0, 1.0, 1.0, 2.0]);
    let mut events = EventBuffer::new(50, &Budget::default());
    events.push(3, 'a');
    events.advance(10);
    let mut next = EventBuffer::new(90, &Budget::default());
    next.take_over(&mut events);
    assert_eq!((next.view(0, 10), next.end()), (&[(3, 'a')][..], 10));
}

#[test]
fn events_stay_sorted_and_leave_after_the_span() {
    let mut buffer = EventBuffer::new(100, &Budget::default());
    for t in [5, 1, 9, 5] {
        buffer.push(t, t * 10);
    }
    buffer.advance(10);
    assert_eq!(buffer.view(0, 9), [(1, 10), (5, 50), (5, 50)]);
    buffer.advance(1000);
    assert!(buffer.view(0, 1000).is_empty());
}

#[test]
fn events_grow_until_the_budget_is_spent_and_then_say_so() {
    const EACH: usize = size_of::<(Tick, u64)>();
    let budget = Budget::new(1500 * EACH);
    let mut buffer = EventBuffer::<u64>::new(Tick::MAX / 4, &budget);
    let planned = buffer.bytes();
    let mut other = buffer.sibling(0);
    for k in 0..2000 {
        buffer.push(k, 0);
    }
    assert!(!buffer.overrun() && buffer.bytes() == planned + 1024 * EACH);
    other.append_from(&buffer, 0, 1200);
    assert!(!other.overrun() && other.bytes() == planned + 176 * EACH);
    for k in 2000..4000 {
        buffer.push(k, 0);
    }
    assert!(buffer.overrun() && buffer.view(0, 4000).len() == 2048 + 300);
    assert_eq!(buffer.bytes() + other.bytes(), 2 * planned + 1500 * EACH);
}
