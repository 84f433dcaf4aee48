//! Buffers of regular streams.

use super::{AnyBuffer, Pad};
use crate::core::fault::Fault;
use crate::core::state::{StateArchive, Stateful, mismatch};
use serde::{Serialize, de::DeserializeOwned};

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
    /// The item at the start of the storage.
    origin: i64,
    /// The first item that the buffer still holds.
    first: i64,
    /// The first item that is no padding.
    start: i64,
    end: i64,
}

impl<E: Copy + Default + Serialize + DeserializeOwned + Send + 'static> StreamBuffer<E> {
    /// A buffer that stores `span` items and starts with `front` padded items before item 0.
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

    /// Index of an item in the storage.
    #[inline(always)]
    pub(super) fn at(&self, item: i64) -> usize {
        (item - self.origin) as usize * self.width
    }

    /// Adds items; returns `None` and adds nothing if the elements are not whole items.
    pub fn append_elements(&mut self, elements: &[E]) -> Option<()> {
        let items = if elements.is_empty() { 0 } else { elements.len().checked_div(self.width)? };
        if items * self.width != elements.len() {
            return None;
        }
        self.append(items).copy_from_slice(elements);
        Some(())
    }

    /// Adds `n` items and returns them for writing; they hold stale values.
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

    /// Moves the items that are still read to the front of the storage, and returns the index of the next `n` items.
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

    /// Replaces the padding before the first item by copies of it, if the rule is to hold.
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
