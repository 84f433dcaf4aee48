//! Whole inputs for a node that runs without a graph.

use super::buffer::{AnyBuffer, EventBuffer, StreamBuffer};
use super::item::{AnyValue, Described, Event, EventType, Item, LinkShape, OfEvent, StreamShape};
use super::random::Rng;
use super::time::{Rate, Tick};
use std::sync::Arc;

/// Whole input data for one link of a node.
#[derive(Clone)]
pub struct Feed {
    shape: LinkShape,
    source: Option<Arc<dyn FeedSource>>,
}

/// The items or events of a [`Feed`].
pub trait FeedSource: Send + Sync {
    /// Appends the items or events of `[from, to)` to a buffer of their type.
    fn append_to(&self, buffer: &mut dyn AnyBuffer, from: i64, to: i64);

    /// Returns true if there is nothing to append.
    fn is_empty(&self) -> bool;

    /// The type of the events; `None` for items.
    fn event_type(&self) -> Option<&'static EventType> {
        None
    }

    /// The same stream with other numbers in one item; `None` for events.
    fn vary(&self, item: usize, rng: &mut Rng) -> Option<Feed> {
        let _ = (item, rng);
        None
    }
}

impl Feed {
    /// A stream of `data.len() / width` items.
    #[must_use]
    pub fn stream<T: Item>(rate: Rate, format: T::Format, data: Vec<T::Elem>) -> Self {
        let items = data.len() / T::width(&format).max(1);
        let shape = StreamShape::new::<T>(rate, format.clone(), Some(rate.tick(items as i64)));
        let source = Items::<T> { rate, format, data };
        Self { shape: LinkShape::Stream(shape), source: Some(Arc::new(source)) }
    }

    /// Events, sorted by time, until `end`.
    #[must_use]
    pub fn events<T: Event>(events: Vec<(Tick, T)>, end: Tick) -> Self {
        Self { shape: LinkShape::Events(Some(end)), source: Some(Arc::new(Sparse { events })) }
    }

    /// A value.
    #[must_use]
    pub fn value(value: AnyValue) -> Self {
        Self { shape: LinkShape::Value(Some(value)), source: None }
    }

    /// The shape that a node receives when it is shaped.
    #[must_use]
    pub fn shape(&self) -> &LinkShape {
        &self.shape
    }

    /// Returns false for a stream without items and for no events.
    #[must_use]
    pub fn has_items(&self) -> bool {
        self.source.as_ref().is_none_or(|source| !source.is_empty())
    }

    /// The items or events; `None` for a value.
    #[must_use]
    pub fn source(&self) -> Option<&Arc<dyn FeedSource>> {
        self.source.as_ref()
    }

    /// The same stream with other numbers in one item, for trials; `None` for events and values.
    #[must_use]
    pub fn vary(&self, item: usize, rng: &mut Rng) -> Option<Self> {
        self.source.as_ref()?.vary(item, rng)
    }
}

struct Items<T: Item> {
    rate: Rate,
    format: T::Format,
    data: Vec<T::Elem>,
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

    fn vary(&self, item: usize, rng: &mut Rng) -> Option<Feed> {
        let width = T::width(&self.format);
        let mut data = self.data.clone();
        for (k, elem) in data.iter_mut().skip(item * width).take(width).enumerate() {
            *elem = T::trial(&self.format, k, rng);
        }
        Some(Feed::stream::<T>(self.rate, self.format.clone(), data))
    }
}

struct Sparse<T> {
    events: Vec<(Tick, T)>,
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

    fn event_type(&self) -> Option<&'static EventType> {
        Some(OfEvent::<T>::INFO)
    }
}
