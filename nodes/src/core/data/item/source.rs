//! Whole streams and events in memory.

use super::contract::{Event, Item};
use crate::core::buffer::{AnyBuffer, EventBuffer, StreamBuffer};
use crate::core::random::Rng;
use crate::core::time::Tick;
use std::sync::Arc;

/// The items or events of a whole input.
pub trait FeedSource: Send + Sync {
    /// Appends the items or events of `[from, to)` to a buffer of their type.
    fn append_to(&self, buffer: &mut dyn AnyBuffer, from: i64, to: i64);

    /// Returns true if there is nothing to append.
    fn is_empty(&self) -> bool;

    /// The same stream with other numbers in one item; `None` for events.
    fn vary(&self, item: usize, rng: &mut Rng) -> Option<Arc<dyn FeedSource>> {
        let _ = (item, rng);
        None
    }
}

/// The items of a stream.
pub(in crate::core) struct Items<T: Item> {
    pub format: T::Format,
    pub data: Vec<T::Elem>,
}

impl<T: Item> Items<T> {
    /// Number of items.
    pub fn len(&self) -> usize {
        self.data.len() / T::width(&self.format).max(1)
    }
}

impl<T: Item> FeedSource for Items<T> {
    fn append_to(&self, buffer: &mut dyn AnyBuffer, from: i64, to: i64) {
        let width = T::width(&self.format);
        if let Some(buffer) = buffer.typed_mut::<StreamBuffer<T::Elem>>() {
            let items = &self.data[from as usize * width..to as usize * width];
            buffer.append((to - from) as usize).copy_from_slice(items);
        }
    }

    fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    fn vary(&self, item: usize, rng: &mut Rng) -> Option<Arc<dyn FeedSource>> {
        let width = T::width(&self.format);
        let mut data = self.data.clone();
        for (k, elem) in data.iter_mut().skip(item * width).take(width).enumerate() {
            *elem = T::trial(&self.format, k, rng);
        }
        Some(Arc::new(Self { format: self.format.clone(), data }))
    }
}

/// Events with their times, in order.
pub(in crate::core) struct Sparse<T> {
    pub events: Vec<(Tick, T)>,
}

impl<T: Event> FeedSource for Sparse<T> {
    fn append_to(&self, buffer: &mut dyn AnyBuffer, from: i64, to: i64) {
        if let Some(buffer) = buffer.typed_mut::<EventBuffer<T>>() {
            buffer.advance(to);
            for (tick, event) in self.events.iter().filter(|(tick, _)| (from..to).contains(tick)) {
                buffer.push(*tick, event.clone());
            }
        }
    }

    fn is_empty(&self) -> bool {
        self.events.is_empty()
    }
}
