//! Taps into memory: outputs of nodes collected as typed arrays during a run.

use foley_nodes::core::buffer::{EventBuffer, StreamBuffer};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::item::{AnyValue, Data, Described, Event, Item, OfData, OfEvent, OfItem, StreamShape};
use foley_nodes::core::node::DynNode;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::stage::Cx;
use foley_nodes::core::time::{Rate, Tick};
use std::any::Any;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

/// A receiver of one output of a run.
pub trait MemoryTap: Debug + Send + Sync {
    /// The kind and type of outputs that it receives; `None` for all.
    fn kind(&self) -> Option<PortKind>;
    /// Starts to collect a stream with its shape, or events.
    fn start(&self, kind: PortKind, shape: Option<&StreamShape>) -> Box<dyn DynNode>;
    /// Receives a value.
    fn set(&self, value: &AnyValue);
}

/// A stream that a run has collected.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamData<T: Item> {
    /// Items per second.
    pub rate: Rate,
    /// The format of all items.
    pub format: T::Format,
    /// The elements, `T::width(&format)` per item.
    pub data: Vec<T::Elem>,
}

#[derive(Debug)]
struct Collected<T>(Mutex<Option<T>>);

impl<T> Default for Collected<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Collected<T> {
    fn update<R>(&self, change: impl FnOnce(&mut Option<T>) -> R) -> R {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Collects a stream.
#[derive(Debug)]
pub struct StreamTap<T: Item>(Arc<Collected<StreamData<T>>>);

/// Collects events.
#[derive(Debug)]
pub struct EventTap<T: Event>(Arc<Collected<Vec<(Tick, T)>>>);

/// Receives a value.
#[derive(Debug)]
pub struct ValueTap<T: Data>(Collected<Arc<T>>);

impl<T: Item> StreamTap<T> {
    /// A tap that has collected nothing.
    #[must_use]
    pub fn new() -> Self {
        Self(Arc::default())
    }

    /// Takes the stream of the last run; `None` if none has come to it.
    #[must_use]
    pub fn take(&self) -> Option<StreamData<T>> {
        self.0.update(Option::take)
    }
}

impl<T: Item> Default for StreamTap<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Event> EventTap<T> {
    /// A tap that has collected nothing.
    #[must_use]
    pub fn new() -> Self {
        Self(Arc::default())
    }

    /// Takes the events of the last run; `None` if none has come to it.
    #[must_use]
    pub fn take(&self) -> Option<Vec<(Tick, T)>> {
        self.0.update(Option::take)
    }
}

impl<T: Event> Default for EventTap<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Data> ValueTap<T> {
    /// A tap that has received nothing.
    #[must_use]
    pub fn new() -> Self {
        Self(Collected::default())
    }

    /// Takes the value of the last run; `None` if none has come to it.
    #[must_use]
    pub fn take(&self) -> Option<Arc<T>> {
        self.0.update(Option::take)
    }
}

impl<T: Data> Default for ValueTap<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Item> MemoryTap for StreamTap<T>
where
    T: Debug,
{
    fn kind(&self) -> Option<PortKind> {
        Some(PortKind::Stream(OfItem::<T>::INFO))
    }

    fn start(&self, _: PortKind, shape: Option<&StreamShape>) -> Box<dyn DynNode> {
        let empty = shape.and_then(|shape| {
            Some(StreamData { rate: shape.rate, format: shape.format::<T>()?.clone(), data: Vec::new() })
        });
        self.0.update(|stream| *stream = empty);
        Box::new(StreamCollector::<T>(Arc::clone(&self.0)))
    }

    fn set(&self, _: &AnyValue) {}
}

impl<T: Event> MemoryTap for EventTap<T> {
    fn kind(&self) -> Option<PortKind> {
        Some(PortKind::Events(OfEvent::<T>::INFO))
    }

    fn start(&self, _: PortKind, _: Option<&StreamShape>) -> Box<dyn DynNode> {
        self.0.update(|events| *events = Some(Vec::new()));
        Box::new(EventCollector::<T>(Arc::clone(&self.0)))
    }

    fn set(&self, _: &AnyValue) {}
}

impl<T: Data> MemoryTap for ValueTap<T> {
    fn kind(&self) -> Option<PortKind> {
        Some(PortKind::Value(OfData::<T>::INFO))
    }

    fn start(&self, _: PortKind, _: Option<&StreamShape>) -> Box<dyn DynNode> {
        Box::new(Ignored)
    }

    fn set(&self, value: &AnyValue) {
        self.0.update(|own| *own = value.shared());
    }
}

struct StreamCollector<T: Item>(Arc<Collected<StreamData<T>>>);

impl<T: Item> DynNode for StreamCollector<T> {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        cx.raw_input(0, |buffer, span| {
            let (Some(buffer), true) = (buffer.typed::<StreamBuffer<T::Elem>>(), span.to > span.from) else {
                return;
            };
            self.0.update(|stream| {
                if let Some(stream) = stream {
                    stream.data.extend_from_slice(buffer.view(span.from, span.to));
                }
            });
        });
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

struct EventCollector<T: Event>(Arc<Collected<Vec<(Tick, T)>>>);

impl<T: Event> DynNode for EventCollector<T> {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        cx.raw_input(0, |buffer, span| {
            if let Some(buffer) = buffer.typed::<EventBuffer<T>>() {
                let new = buffer.view(span.from, span.to);
                self.0.update(|events| events.get_or_insert_default().extend_from_slice(new));
            }
        });
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// Stands for the collector of a value, which no stage runs.
pub(super) struct Ignored;

impl DynNode for Ignored {
    fn run(&mut self, _: &Cx<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
