//! Taps for outputs of any type, which measure or collect their items as numbers, as JSON or as a value.

use super::memory_tap::{Ignored, MemoryTap};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::item::{AnyValue, EventType, ItemType, StreamShape};
use foley_nodes::core::node::DynNode;
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::stage::Cx;
use foley_nodes::core::time::Tick;
use serde_json::Value;
use std::any::Any;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

/// Receives the items of an output of any type, in the order of time.
pub trait Observer: Debug + Send + 'static {
    /// A stream of this shape, or events, are about to come.
    fn begin(&mut self, kind: PortKind, shape: Option<&StreamShape>);
    /// The numbers of the items of a stream from item `first` on: `width` times the columns of the item type for each.
    fn numbers(&mut self, first: i64, numbers: &[f32]);
    /// Events as JSON, each with its time.
    fn events(&mut self, events: &[(Tick, Value)]);
    /// A value.
    fn value(&mut self, value: &AnyValue);
}

/// A tap that passes its input to an observer.
#[derive(Debug)]
pub struct ObserverTap<O>(Arc<Mutex<O>>);

impl<O: Observer> ObserverTap<O> {
    /// A tap of an observer that has received nothing.
    #[must_use]
    pub fn new(observer: O) -> Self {
        Self(Arc::new(Mutex::new(observer)))
    }

    /// Reads the observer.
    pub fn read<R>(&self, read: impl FnOnce(&O) -> R) -> R {
        read(&self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn update(&self, change: impl FnOnce(&mut O)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl<O: Observer> MemoryTap for ObserverTap<O> {
    fn kind(&self) -> Option<PortKind> {
        None
    }

    fn start(&self, kind: PortKind, shape: Option<&StreamShape>) -> Box<dyn DynNode> {
        self.update(|observer| observer.begin(kind, shape));
        let observer = Arc::clone(&self.0);
        match kind {
            PortKind::Stream(item) => Box::new(NumberReader { item, observer, numbers: Vec::new() }),
            PortKind::Events(event) => Box::new(EventReader { event, observer }),
            PortKind::Value(_) | PortKind::Fold(_) => Box::new(Ignored),
        }
    }

    fn set(&self, value: &AnyValue) {
        self.update(|observer| observer.value(value));
    }
}

struct NumberReader<O> {
    item: &'static ItemType,
    observer: Arc<Mutex<O>>,
    numbers: Vec<f32>,
}

impl<O: Observer> DynNode for NumberReader<O> {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        let first = cx.raw_input(0, |buffer, span| {
            (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers);
            span.from
        });
        if let Some(first) = first.filter(|_| !self.numbers.is_empty()) {
            let mut observer = self.observer.lock().unwrap_or_else(PoisonError::into_inner);
            observer.numbers(first, &self.numbers);
        }
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

struct EventReader<O> {
    event: &'static EventType,
    observer: Arc<Mutex<O>>,
}

impl<O: Observer> DynNode for EventReader<O> {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let events =
            cx.raw_input(0, |buffer, span| (self.event.json)(buffer, span.from, span.to)).unwrap_or_default();
        if !events.is_empty() {
            self.observer.lock().unwrap_or_else(PoisonError::into_inner).events(&events);
        }
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
