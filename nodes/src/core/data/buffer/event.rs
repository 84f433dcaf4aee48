//! Buffers of events.

use super::{AnyBuffer, LateEvents};
use crate::core::fault::Fault;
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::Tick;
use serde::{Serialize, de::DeserializeOwned};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bytes by which all buffers of a run together may still grow.
///
/// Memory for events, shared by all buffers: the number of events is unknown before the run.
#[derive(Clone, Debug)]
pub struct Budget(Arc<AtomicUsize>);

impl Default for Budget {
    /// A budget without an effective limit.
    fn default() -> Self {
        Self::new(usize::MAX)
    }
}

impl Budget {
    /// A budget of `bytes` bytes; clones share it.
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        Self(Arc::new(AtomicUsize::new(bytes)))
    }

    /// Takes bytes; takes none and returns false if fewer are left.
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
    /// A buffer that stores the events of the last `span` ticks before its watermark, and grows within the budget.
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

    /// Makes room for `more` events; returns true if there is room.
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
    /// [`AnyBuffer::overrun`] reports it from then on.
    pub fn push(&mut self, tick: Tick, event: E) {
        if !self.grow(1) {
            return;
        }
        let at = self.events.partition_point(|(t, _)| *t <= tick);
        self.events.insert(at, (tick, event));
    }

    /// Declares that all events before `end` have been written.
    pub fn advance(&mut self, end: Tick) {
        self.end = self.end.max(end);
        let keep = self.end - self.span;
        let gone = self.events.partition_point(|(t, _)| *t < keep);
        // Moving the rest pays off only after a large part has been removed.
        if gone * 2 > self.events.len() {
            self.events.drain(..gone);
        }
    }
}

impl<E: Clone + Serialize + DeserializeOwned + Send + 'static> AnyBuffer for EventBuffer<E> {
    fn end(&self) -> i64 {
        self.end
    }

    fn has_events(&self, from: i64, to: i64) -> Option<bool> {
        Some(!self.view(from, to).is_empty())
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

    fn append_late(&mut self, other: &dyn AnyBuffer, from: i64, to: i64) -> LateEvents {
        let Some(other) = other.typed::<Self>() else { return LateEvents::default() };
        let late = other.view(from, to);
        let added = late.len().min((self.events.capacity() / 2).saturating_sub(self.events.len()));
        late[..added].iter().for_each(|(_, event)| self.push(self.end, event.clone()));
        LateEvents { added: added as u64, lost: (late.len() - added) as u64 }
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
