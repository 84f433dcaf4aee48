//! Buffers between nodes: a run of items (or events) whose recent part is one contiguous slice.

use super::fault::Fault;
use super::state::{StateArchive, Stateful, mismatch};
use super::time::Tick;
use serde::{Serialize, de::DeserializeOwned};
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What stands in a stream before its first and after its last item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Pad {
    /// The element's default: silence, the origin, no contact.
    Silence,
    /// The first item before the start, the last item after the end.
    Hold,
}

/// A buffer of a type that is known to its ports only.
pub trait AnyBuffer: Any + Send {
    /// First position after the last item: an item index, or the watermark tick for events.
    fn end(&self) -> i64;
    /// Moves the end to `to` with items made by the pad rule.
    fn pad_to(&mut self, to: i64);
    /// Appends `[from, to)` of a buffer of the same type, which must hold it.
    fn append_from(&mut self, other: &dyn AnyBuffer, from: i64, to: i64);
    /// Forgets everything and starts again at zero, with the padding before it.
    fn reset(&mut self);
    /// Forgets everything and goes on at position `at`, without padding.
    fn restart(&mut self, at: i64);
    /// Forgets everything and goes on at position `at`, with a whole span of padding before it.
    fn begin(&mut self, at: i64);
    /// Goes on where a buffer of the same type stopped: with what it holds, as far as the span goes, and padding before that.
    ///
    /// Nothing is allocated; the other buffer is of no use afterwards.
    fn take_over(&mut self, old: &mut dyn AnyBuffer);
    /// Replaces what came before the end by what another buffer of the same type holds of it, as far as that goes.
    ///
    /// Nothing is allocated. Events stay as they are.
    fn seed(&mut self, other: &dyn AnyBuffer) {
        let _ = other;
    }
    /// Fills in what had to wait for the first item.
    fn settle(&mut self) {}
    /// Saves what it still holds, or puts it back into a buffer of the same plan.
    ///
    /// # Errors
    /// When what was saved is of another type or size.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault>;
    /// Bytes that the buffer holds in memory.
    fn bytes(&self) -> usize;
    /// Whether its size depends on what comes in.
    fn grows(&self) -> bool {
        false
    }
    /// Whether something was left out because the [`Budget`] was spent.
    fn overrun(&self) -> bool {
        false
    }
    /// An empty buffer of the same type for `items` items.
    fn sibling(&self, items: usize) -> Box<dyn AnyBuffer>;
}

/// Items of one stream, `width` elements each.
///
/// After an append that ends at `e`, the items `[e - span, e)` are in memory as one slice. Storage is twice the span, so
/// an item is moved at most once on average.
#[derive(Debug)]
pub struct StreamBuffer<E> {
    data: Vec<E>,
    width: usize,
    span: usize,
    front: usize,
    pad: Pad,
    /// The item that stands, or stood, at the start of the storage.
    origin: i64,
    /// The first item that is still there.
    first: i64,
    /// The first item that is no padding.
    start: i64,
    end: i64,
}

impl<E: Copy + Default + Serialize + DeserializeOwned + Send + 'static> StreamBuffer<E> {
    /// A buffer that keeps `span` items and starts with `front` padded items before item 0.
    #[must_use]
    pub fn new(width: usize, span: usize, front: usize, pad: Pad) -> Self {
        let span = span.max(front).max(Self::LEAST);
        let data = vec![E::default(); Self::storage(width, span)];
        let mut buffer = Self { data, width, span, front, pad, origin: 0, first: 0, start: 0, end: 0 };
        buffer.reset();
        buffer
    }

    /// The shortest span: padding reads the item before the one that it writes.
    const LEAST: usize = 2;

    fn storage(width: usize, span: usize) -> usize {
        width.saturating_mul(span).saturating_mul(2)
    }

    /// Bytes that a buffer of this size takes, without making it.
    #[must_use]
    pub fn planned_bytes(width: usize, span: usize) -> usize {
        Self::storage(width, span.max(Self::LEAST)).saturating_mul(size_of::<E>())
    }

    /// Where an item stands in the storage.
    #[inline(always)]
    fn at(&self, item: i64) -> usize {
        (item - self.origin) as usize * self.width
    }

    /// Adds items; `None`, and nothing is added, where the elements do not make whole items.
    pub fn append_elements(&mut self, elements: &[E]) -> Option<()> {
        let items = if elements.is_empty() { 0 } else { elements.len().checked_div(self.width)? };
        if items * self.width != elements.len() {
            return None;
        }
        self.append(items).copy_from_slice(elements);
        Some(())
    }

    /// Adds `n` items and gives them to be filled; they hold stale values.
    #[inline(always)]
    pub fn append(&mut self, n: usize) -> &mut [E] {
        if n >= self.span {
            // Nothing before these items is read again: the same memory serves every window and stays in the cache.
            self.origin = self.end;
            self.first = self.end;
        }
        let count = n * self.width;
        let mut at = self.at(self.end);
        if at + count > self.data.len() {
            at = self.make_room(n);
        }
        self.end += n as i64;
        &mut self.data[at..at + count]
    }

    /// Moves what is still read to the front of the storage, and tells where the next `n` items go.
    #[inline(never)]
    fn make_room(&mut self, n: usize) -> usize {
        let kept = self.span.saturating_sub(n) as i64;
        self.first = self.first.max(self.end - kept);
        let (from, to) = (self.at(self.first), self.at(self.end));
        self.data.copy_within(from..to, 0);
        self.origin = self.first;
        let at = to - from;
        // Only a window longer than planned needs more: grow rather than fail.
        if at + n * self.width > self.data.len() {
            self.data.resize(at + n * self.width, E::default());
        }
        at
    }

    /// Replaces the padding before the first item by copies of it, where the rule is to hold.
    fn hold_front(&mut self) {
        if self.pad == Pad::Hold && self.front > 0 && self.end > self.start && self.first <= self.start {
            let real = self.at(self.start);
            for item in self.first..self.start {
                let at = self.at(item);
                self.data.copy_within(real..real + self.width, at);
            }
            self.front = 0;
        }
    }

    /// The last `n` items, to be changed.
    pub fn last_mut(&mut self, n: usize) -> &mut [E] {
        let from = self.at((self.end - n as i64).max(self.first));
        let to = self.at(self.end);
        &mut self.data[from..to]
    }

    /// Items `[from, to)`.
    #[inline(always)]
    #[must_use]
    pub fn view(&self, from: i64, to: i64) -> &[E] {
        debug_assert!(from >= self.first && to <= self.end, "{from}..{to} of {}..{}", self.first, self.end);
        &self.data[self.at(from)..self.at(to)]
    }
}

/// A buffer in its place in a stage: audio, by far the most frequent, without a pointer and a virtual call in between.
pub enum BoxedBuffer {
    /// Numbers.
    Samples(StreamBuffer<f32>),
    /// Anything else.
    Other(Box<dyn AnyBuffer>),
}

impl BoxedBuffer {
    /// Takes a buffer in.
    #[must_use]
    pub fn new(mut buffer: Box<dyn AnyBuffer>) -> Self {
        match buffer.typed_mut::<StreamBuffer<f32>>() {
            Some(samples) => {
                Self::Samples(std::mem::replace(samples, StreamBuffer::new(0, 0, 0, Pad::Silence)))
            }
            None => Self::Other(buffer),
        }
    }

    /// The buffer without its type.
    #[must_use]
    pub fn any(&self) -> &dyn AnyBuffer {
        match self {
            Self::Samples(buffer) => buffer,
            Self::Other(buffer) => &**buffer,
        }
    }

    /// The buffer without its type, for writing.
    pub fn any_mut(&mut self) -> &mut dyn AnyBuffer {
        match self {
            Self::Samples(buffer) => buffer,
            Self::Other(buffer) => &mut **buffer,
        }
    }

    /// The buffer, where it is a `T`.
    #[inline(always)]
    #[must_use]
    pub fn typed<T: AnyBuffer>(&self) -> Option<&T> {
        match self {
            Self::Samples(buffer) => (buffer as &dyn Any).downcast_ref(),
            Self::Other(buffer) => other(&**buffer),
        }
    }

    /// The buffer for writing, where it is a `T`.
    #[inline(always)]
    pub fn typed_mut<T: AnyBuffer>(&mut self) -> Option<&mut T> {
        match self {
            Self::Samples(buffer) => (buffer as &mut dyn Any).downcast_mut(),
            Self::Other(buffer) => other_mut(&mut **buffer),
        }
    }
}

// Out of line, so that what reads audio stays small enough to become part of its caller.
#[inline(never)]
fn other<T: AnyBuffer>(buffer: &dyn AnyBuffer) -> Option<&T> {
    buffer.typed()
}

#[inline(never)]
fn other_mut<T: AnyBuffer>(buffer: &mut dyn AnyBuffer) -> Option<&mut T> {
    buffer.typed_mut()
}

impl dyn AnyBuffer {
    /// This buffer, where it is a `T`.
    #[must_use]
    pub fn typed<T: AnyBuffer>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }

    /// This buffer for writing, where it is a `T`.
    pub fn typed_mut<T: AnyBuffer>(&mut self) -> Option<&mut T> {
        (self as &mut dyn Any).downcast_mut()
    }
}

impl<E: Copy + Default + Serialize + DeserializeOwned + Send + 'static> AnyBuffer for StreamBuffer<E> {
    fn end(&self) -> i64 {
        self.end
    }

    fn pad_to(&mut self, to: i64) {
        let n = (to - self.end).max(0) as usize;
        if n == 0 {
            return;
        }
        let width = self.width;
        let hold = self.pad == Pad::Hold && self.end > 0;
        let pieces = self.span.saturating_sub(1).max(1);
        let mut left = n;
        while left > 0 {
            let piece = left.min(pieces);
            let fresh = self.append(piece);
            fresh.fill(E::default());
            if hold {
                let at = self.at(self.end - piece as i64);
                for k in 0..piece {
                    self.data.copy_within(at - width..at, at + k * width);
                }
            }
            left -= piece;
        }
    }

    fn append_from(&mut self, other: &dyn AnyBuffer, from: i64, to: i64) {
        if let Some(other) = other.typed::<Self>() {
            let source = other.view(from, to);
            self.append((to - from).max(0) as usize).copy_from_slice(source);
            self.hold_front();
        }
    }

    fn reset(&mut self) {
        self.restart(0);
        self.first = -(self.front as i64);
        self.origin = self.first;
        self.data[..self.front * self.width].fill(E::default());
    }

    fn begin(&mut self, at: i64) {
        self.reset();
        if at > 0 {
            (self.front, self.start, self.end) = (self.span, at, at);
            self.first = at - self.span as i64;
            self.origin = self.first;
            self.data[..self.span * self.width].fill(E::default());
        }
    }

    fn take_over(&mut self, old: &mut dyn AnyBuffer) {
        let Some(old) = old.typed_mut::<Self>() else { return };
        if (old.span, old.width, old.pad) == (self.span, self.width, self.pad) {
            std::mem::swap(self, old);
        } else if old.width == self.width {
            self.begin(old.end);
            self.end = old.end;
            (self.front, self.start) = (old.front, old.start);
            self.seed(old);
        }
    }

    fn seed(&mut self, other: &dyn AnyBuffer) {
        let Some(other) = other.typed::<Self>().filter(|other| other.width == self.width) else { return };
        let (from, to) = (self.first.max(other.first), self.end.min(other.end));
        if from < to {
            let place = self.at(from)..self.at(to);
            self.data[place].copy_from_slice(other.view(from, to));
            self.start = self.start.min(from);
        }
    }

    fn restart(&mut self, at: i64) {
        self.origin = at;
        self.first = at;
        (self.start, self.end) = (at, at);
    }

    fn settle(&mut self) {
        self.hold_front();
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        let mut first = self.first.max(self.end - self.span as i64);
        let mut held = if archive.restores() { Vec::new() } else { self.view(first, self.end).to_vec() };
        let (mut start, mut front) = (self.start, self.front);
        first.archive_state(archive)?;
        held.archive_state(archive)?;
        start.archive_state(archive)?;
        front.archive_state(archive)?;
        if archive.restores() {
            let fits = held.len() <= self.data.len();
            self.restart(first);
            fits.then(|| self.append_elements(&held)).flatten().ok_or_else(mismatch)?;
            (self.first, self.start, self.front) = (first, start, front);
        }
        Ok(())
    }

    fn bytes(&self) -> usize {
        self.data.capacity() * size_of::<E>()
    }

    fn sibling(&self, items: usize) -> Box<dyn AnyBuffer> {
        Box::new(Self::new(self.width, items, 0, Pad::Silence))
    }
}

/// Bytes by which all buffers of a run together may still grow.
///
/// How many events will come is known to nobody before the run; this is what keeps them within the memory limit.
#[derive(Clone, Debug)]
pub struct Budget(Arc<AtomicUsize>);

impl Default for Budget {
    /// As good as no limit.
    fn default() -> Self {
        Self::new(usize::MAX)
    }
}

impl Budget {
    /// A budget of so many bytes; clones share it.
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        Self(Arc::new(AtomicUsize::new(bytes)))
    }

    /// Takes bytes, or nothing where fewer are left.
    fn take(&self, bytes: usize) -> bool {
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes)).is_ok()
    }
}

/// Events of one port, sorted by time, complete up to the watermark `end`.
#[derive(Debug)]
pub struct EventBuffer<E> {
    events: Vec<(Tick, E)>,
    span: Tick,
    end: Tick,
    budget: Budget,
    overrun: bool,
}

impl<E: Clone + Send + 'static> EventBuffer<E> {
    /// A buffer that keeps the events of the last `span` ticks before its watermark, and grows as far as the budget goes.
    #[must_use]
    pub fn new(span: Tick, budget: &Budget) -> Self {
        Self { events: Vec::with_capacity(Self::ROOM), span, end: 0, budget: budget.clone(), overrun: false }
    }

    /// Events that fit without growing.
    pub const ROOM: usize = 1024;

    /// Events of `[from, to)`.
    #[must_use]
    pub fn view(&self, from: Tick, to: Tick) -> &[(Tick, E)] {
        let at = self.events.partition_point(|(t, _)| *t < from);
        let stop = self.events.partition_point(|(t, _)| *t < to);
        &self.events[at..stop.max(at)]
    }

    /// Makes room for `more` events; says whether there is.
    fn grow(&mut self, more: usize) -> bool {
        let (len, held) = (self.events.len(), self.events.capacity());
        if len + more <= held {
            return true;
        }
        let bytes = |room: usize| (room - held).saturating_mul(size_of::<(Tick, E)>());
        let rooms = [(2 * held).max(len + more), len + more];
        let found = rooms.into_iter().find(|room| self.budget.take(bytes(*room)));
        if let Some(room) = found {
            self.events.reserve_exact(room - len);
        }
        self.overrun |= found.is_none();
        found.is_some()
    }

    /// Adds one event; events come in the order of their times. Without room it is left out, which
    /// [`AnyBuffer::overrun`] tells from then on.
    pub fn push(&mut self, tick: Tick, event: E) {
        if !self.grow(1) {
            return;
        }
        let at = self.events.partition_point(|(t, _)| *t <= tick);
        self.events.insert(at, (tick, event));
    }

    /// Says that all events before `end` are in.
    pub fn advance(&mut self, end: Tick) {
        self.end = self.end.max(end);
        let keep = self.end - self.span;
        let gone = self.events.partition_point(|(t, _)| *t < keep);
        // Moving the rest is worth it only once a good part of it has gone.
        if gone * 2 > self.events.len() {
            self.events.drain(..gone);
        }
    }
}

impl<E: Clone + Serialize + DeserializeOwned + Send + 'static> AnyBuffer for EventBuffer<E> {
    fn end(&self) -> i64 {
        self.end
    }

    fn pad_to(&mut self, to: i64) {
        self.advance(to);
    }

    fn append_from(&mut self, other: &dyn AnyBuffer, from: i64, to: i64) {
        if let Some(other) = other.typed::<Self>() {
            let more = other.view(from, to);
            if self.grow(more.len()) {
                self.events.extend_from_slice(more);
            }
            self.overrun |= other.overrun;
            self.advance(to);
        }
    }

    fn reset(&mut self) {
        self.restart(0);
    }

    fn restart(&mut self, at: i64) {
        self.events.clear();
        self.end = at;
    }

    fn begin(&mut self, at: i64) {
        self.restart(at);
    }

    fn take_over(&mut self, old: &mut dyn AnyBuffer) {
        if let Some(old) = old.typed_mut::<Self>() {
            std::mem::swap(&mut self.events, &mut old.events);
            self.end = old.end;
        }
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.end.archive_state(archive)?;
        if !archive.restores() {
            return self.events.archive_state(archive);
        }
        let mut held: Vec<(Tick, E)> = Vec::new();
        held.archive_state(archive)?;
        self.events.clear();
        held.into_iter().for_each(|(tick, event)| self.push(tick, event));
        Ok(())
    }

    fn bytes(&self) -> usize {
        self.events.capacity() * size_of::<(Tick, E)>()
    }

    fn grows(&self) -> bool {
        true
    }

    fn overrun(&self) -> bool {
        self.overrun
    }

    fn sibling(&self, _items: usize) -> Box<dyn AnyBuffer> {
        Box::new(Self::new(Tick::MAX / 4, &self.budget))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert_eq!(buffer.at(buffer.end), 4, "window {k} fills the front");
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
    fn a_buffer_knows_its_type() {
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
}
