//! Events: the runtime's view of their type.

use super::contract::Event;
use super::described::{DecodeBuffer, Described, EncodeBuffer, OfEvent, decode, encode};
use super::source::{FeedSource, Sparse};
use crate::core::buffer::{AnyBuffer, Budget, EventBuffer};
use crate::core::random::Rng;
use crate::core::time::Tick;
use std::any::TypeId;
use std::fmt::{self, Debug};
use std::sync::Arc;

/// Converts the events of a part of a buffer to JSON.
pub type EventsJson = fn(&dyn AnyBuffer, Tick, Tick) -> Vec<(Tick, serde_json::Value)>;

/// The runtime's view of an [`Event`] type.
pub struct EventType {
    /// The name that people see.
    pub name: &'static str,
    /// Identity.
    pub id: fn() -> TypeId,
    /// Makes a buffer for a span of ticks that grows within the budget.
    pub buffer: fn(Tick, &Budget) -> Box<dyn AnyBuffer>,
    /// Bytes of such a buffer before it grows.
    pub buffer_bytes: fn() -> usize,
    /// Events of `[from, to)` as JSON.
    pub json: EventsJson,
    /// Adds the events of `[from, to)` to bytes, for the disk.
    pub encode: EncodeBuffer,
    /// Adds the events in such bytes to a buffer; `None` where they are none.
    pub decode: DecodeBuffer,
    /// Valid events until a time, for trials.
    pub trial: fn(&mut Rng, Tick) -> Arc<dyn FeedSource>,
}

impl Debug for EventType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl<T: Event> Described for OfEvent<T> {
    type Info = EventType;
    const INFO: &'static EventType = &EventType {
        name: T::NAME,
        id: TypeId::of::<T>,
        buffer: |span, budget| Box::new(EventBuffer::<T>::new(span, budget)),
        buffer_bytes: || EventBuffer::<T>::ROOM * size_of::<(Tick, T)>(),
        json: |buffer, from, to| {
            let Some(buffer) = buffer.typed::<EventBuffer<T>>() else { return Vec::new() };
            let json = |event| serde_json::to_value(event).unwrap_or_default();
            buffer.view(from, to).iter().map(|(tick, event)| (*tick, json(event))).collect()
        },
        encode: |buffer, from, to, out| {
            let events = buffer.typed::<EventBuffer<T>>()?.view(from, to);
            events.iter().try_for_each(|event| encode(event, out))
        },
        decode: |buffer, mut bytes| {
            let buffer = buffer.typed_mut::<EventBuffer<T>>()?;
            while !bytes.is_empty() {
                let (tick, event): (Tick, T) = decode(&mut bytes)?;
                buffer.push(tick, event);
            }
            Some(())
        },
        trial: |rng, end| {
            let count = rng.below(40);
            let mut times: Vec<Tick> = (0..count).map(|_| rng.between(0.0, end as f64) as Tick).collect();
            times.sort_unstable();
            Arc::new(Sparse { events: times.into_iter().map(|tick| (tick, T::trial(rng))).collect() })
        },
    };
}
