//! Encodes windows of a stream as the payload of blocks, and decodes them.

use super::format::Block;
use foley_nodes::core::buffer::{AnyBuffer, Budget, Pad};
use foley_nodes::core::item::{EventType, ItemType};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::stage::Span;
use foley_nodes::core::time::Tick;

/// Type and end of an output stream.
#[derive(Clone, Copy, Debug)]
pub enum Codec {
    /// Item type, elements per item, and the item at which the stream ends.
    Items(&'static ItemType, usize, i64),
    /// Event type, and the tick at which the events end.
    Events(&'static EventType, Tick),
}

impl Codec {
    /// The codec of an output of a node; `None` for values and for streams without end.
    #[must_use]
    pub fn of(kind: PortKind, shape: &NodeShape, port: usize) -> Option<Self> {
        let end = shape.end?;
        match kind {
            PortKind::Stream(item) => {
                let stream = shape.outputs.get(port)?.as_ref()?;
                (stream.width > 0).then_some(Self::Items(item, stream.width, stream.rate.first_at(end)))
            }
            PortKind::Events(event) => Some(Self::Events(event, end)),
            PortKind::Value(_) | PortKind::Fold(_) => None,
        }
    }

    /// Returns the end: an item, or a tick.
    #[must_use]
    pub fn end(&self) -> i64 {
        let (Self::Items(.., end) | Self::Events(_, end)) = self;
        *end
    }

    /// Returns the estimated bytes of the whole stream.
    #[must_use]
    pub fn bytes(&self) -> f64 {
        match self {
            Self::Items(item, width, end) => item.elem_bytes as f64 * *width as f64 * *end as f64,
            // The number of events is not known before the run; there are few.
            Self::Events(..) => 4096.0,
        }
    }

    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Items(item, ..) => item.name,
            Self::Events(event, _) => event.name,
        }
    }

    pub(super) fn encode(&self, buffer: &dyn AnyBuffer, span: Span, out: &mut Vec<u8>) -> Option<()> {
        let (Self::Items(ItemType { encode, .. }, ..) | Self::Events(EventType { encode, .. }, _)) = self;
        encode(buffer, span.from, span.to, out)
    }

    /// Decodes a block into a buffer.
    pub(super) fn decode(&self, block: &Block) -> Option<Box<dyn AnyBuffer>> {
        let items = usize::try_from(block.to - block.from).ok()?;
        let mut buffer = match self {
            Self::Items(item, width, _) => {
                // A wrong length must not allocate memory: an element takes at least one byte.
                if items.checked_mul(*width)? > block.payload.len() {
                    return None;
                }
                (item.buffer)(*width, items, 0, Pad::Silence)
            }
            Self::Events(event, _) => (event.buffer)(Tick::MAX / 4, &Budget::default()),
        };
        buffer.restart(block.from);
        let (Self::Items(ItemType { decode, .. }, ..) | Self::Events(EventType { decode, .. }, _)) = self;
        decode(&mut *buffer, &block.payload)?;
        if matches!(self, Self::Events(..)) {
            buffer.pad_to(block.to);
        }
        (buffer.end() == block.to).then_some(buffer)
    }
}
