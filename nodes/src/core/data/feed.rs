//! Whole inputs for a node that runs without a graph.

pub use super::item::FeedSource;

use super::item::{
    AnyValue, Described, Event, EventType, Item, ItemType, Items, LinkShape, OfEvent, Sparse, StreamShape,
    WholeStream,
};
use super::random::Rng;
use super::time::{Rate, Tick};
use std::sync::Arc;

/// Whole input data for one link of a node.
#[derive(Clone)]
pub struct Feed {
    shape: LinkShape,
    source: Option<Arc<dyn FeedSource>>,
    /// The type of the events.
    event_type: Option<&'static EventType>,
}

impl Feed {
    /// A stream of `data.len() / width` items.
    #[must_use]
    pub fn stream<T: Item>(rate: Rate, format: T::Format, data: Vec<T::Elem>) -> Self {
        let items = Items::<T> { format, data };
        Self::of_stream((StreamShape::of_items(rate, &items), Arc::new(items)))
    }

    fn of_stream((shape, source): WholeStream) -> Self {
        Self { shape: LinkShape::Stream(shape), source: Some(source), event_type: None }
    }

    /// A stream of valid items, for trials.
    #[must_use]
    pub fn trial_stream(item: &ItemType, rng: &mut Rng, rate: Rate, items: i64) -> Self {
        Self::of_stream((item.trial)(rng, rate, items))
    }

    /// The same with the rate and the format of another stream of the type; `None` for one of another type.
    #[must_use]
    pub fn trial_stream_like(item: &ItemType, rng: &mut Rng, like: &StreamShape, items: i64) -> Option<Self> {
        (item.trial_like)(rng, like, items).map(Self::of_stream)
    }

    /// Events, sorted by time, until `end`.
    #[must_use]
    pub fn events<T: Event>(events: Vec<(Tick, T)>, end: Tick) -> Self {
        Self::of_events(OfEvent::<T>::INFO, Arc::new(Sparse { events }), end)
    }

    fn of_events(event_type: &'static EventType, source: Arc<dyn FeedSource>, end: Tick) -> Self {
        Self { shape: LinkShape::Events(Some(end)), source: Some(source), event_type: Some(event_type) }
    }

    /// Valid events until `end`, for trials.
    #[must_use]
    pub fn trial_events(event_type: &'static EventType, rng: &mut Rng, end: Tick) -> Self {
        Self::of_events(event_type, (event_type.trial)(rng, end), end)
    }

    /// A value.
    #[must_use]
    pub fn value(value: AnyValue) -> Self {
        Self { shape: LinkShape::Value(Some(value)), source: None, event_type: None }
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

    /// The type of the events; `None` for a stream and a value.
    #[must_use]
    pub fn event_type(&self) -> Option<&'static EventType> {
        self.event_type
    }

    /// The same stream with other numbers in one item, for trials; `None` for events and values.
    #[must_use]
    pub fn vary(&self, item: usize, rng: &mut Rng) -> Option<Self> {
        let source = self.source.as_ref()?.vary(item, rng)?;
        Some(Self { source: Some(source), ..self.clone() })
    }
}
