//! Buffers between nodes: a run of items (or events) whose recent part is one contiguous slice.

mod event;
mod stream;
#[cfg(test)]
mod tests;

pub use event::{Budget, EventBuffer};
pub use stream::StreamBuffer;

use super::fault::Fault;
use super::state::StateArchive;
use std::any::Any;

/// Padding of a stream before its first and after its last item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Pad {
    /// The element's default: silence, the origin, no contact.
    Silence,
    /// The first item before the start, the last item after the end.
    Hold,
}

/// Numbers of events that [`AnyBuffer::append_late`] has added, and left out for want of room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LateEvents {
    /// Events that were added.
    pub added: u64,
    /// Events that were left out.
    pub lost: u64,
}

/// A buffer whose type only its ports define.
pub trait AnyBuffer: Any + Send {
    /// First position after the last item: an item index, or the watermark tick for events.
    fn end(&self) -> i64;
    /// Returns true if there are events in `[from, to)`; None for a stream.
    fn has_events(&self, from: i64, to: i64) -> Option<bool> {
        let _ = (from, to);
        None
    }
    /// Moves the end to `to` with items made by the pad rule.
    fn pad_to(&mut self, to: i64);
    /// Appends `[from, to)` of a buffer of the same type, which must hold it.
    fn append_from(&mut self, other: &dyn AnyBuffer, from: i64, to: i64);
    /// Adds the events of `[from, to)` of a buffer of the same type that arrive too late: their times move to the end, in their order.
    ///
    /// Nothing is allocated: late events fill at most half of the room. Streams take nothing.
    fn append_late(&mut self, other: &dyn AnyBuffer, from: i64, to: i64) -> LateEvents {
        let _ = (other, from, to);
        LateEvents::default()
    }
    /// Clears the buffer and starts again at zero, with the padding before it.
    fn reset(&mut self);
    /// Clears the buffer and continues at position `at`, without padding.
    fn restart(&mut self, at: i64);
    /// Clears the buffer and continues at position `at`, with a whole span of padding before it.
    fn begin(&mut self, at: i64);
    /// Continues a buffer of the same type: takes its items over the span, with padding before them.
    ///
    /// Nothing is allocated; the other buffer is of no use afterwards.
    fn take_over(&mut self, old: &mut dyn AnyBuffer);
    /// Replaces the items before the end by those that another buffer of the same type still holds.
    ///
    /// Nothing is allocated. Events stay as they are.
    fn seed(&mut self, other: &dyn AnyBuffer) {
        let _ = other;
    }
    /// Fills in the padding that depends on the first item.
    fn settle(&mut self) {}
    /// Saves the content of the buffer, or restores it into a buffer of the same plan.
    ///
    /// # Errors
    /// If the saved state is of another type or size.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault>;
    /// Bytes that the buffer holds in memory.
    fn bytes(&self) -> usize;
    /// Returns true if its size depends on the input.
    fn grows(&self) -> bool {
        false
    }
    /// Returns true if events were dropped because the [`Budget`] was exhausted.
    fn overrun(&self) -> bool {
        false
    }
    /// An empty buffer of the same type for `items` items.
    fn sibling(&self, items: usize) -> Box<dyn AnyBuffer>;
}

/// A buffer of a stage: audio, by far the most frequent type, without a pointer and a virtual call.
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
