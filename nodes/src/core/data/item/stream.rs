//! Streams: the runtime's view of the type of their items, and their shape.

use super::contract::Item;
use super::described::{DecodeBuffer, Described, EncodeBuffer, OfItem, decode, encode};
use super::source::{FeedSource, Items};
use crate::core::buffer::{AnyBuffer, Pad, StreamBuffer};
use crate::core::random::Rng;
use crate::core::time::{Rate, Tick};
use std::any::{Any, TypeId};
use std::fmt::{self, Debug};
use std::sync::Arc;

/// The shape of a stream with its items.
pub type WholeStream = (StreamShape, Arc<dyn FeedSource>);

/// The runtime's view of an [`Item`] type.
pub struct ItemType {
    /// The name that people see.
    pub name: &'static str,
    /// True if it is a waveform.
    pub wave: bool,
    /// Names of the numbers in an element.
    pub columns: &'static [&'static str],
    /// Identity.
    pub id: fn() -> TypeId,
    /// Makes a buffer: width, span, front padding, pad rule.
    pub buffer: fn(usize, usize, usize, Pad) -> Box<dyn AnyBuffer>,
    /// Bytes of such a buffer: width, span.
    pub buffer_bytes: fn(usize, usize) -> usize,
    /// Numbers of the elements `[from, to)` of a buffer.
    pub numbers: fn(&dyn AnyBuffer, i64, i64, &mut Vec<f32>),
    /// True if all of the elements `[from, to)` are finite.
    pub finite: fn(&dyn AnyBuffer, i64, i64) -> bool,
    /// Bytes of one element in memory; on disk it takes about as many.
    pub elem_bytes: usize,
    /// Adds the elements `[from, to)` of a buffer to bytes, for the disk.
    pub encode: EncodeBuffer,
    /// Appends the elements in such bytes to a buffer; `None` where they are none.
    pub decode: DecodeBuffer,
    /// A stream of valid items for trials: rate, items.
    pub trial: fn(&mut Rng, Rate, i64) -> WholeStream,
    /// The same with the rate and the format of another stream of the type.
    pub trial_like: fn(&mut Rng, &StreamShape, i64) -> Option<WholeStream>,
}

impl Debug for ItemType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl<T: Item> Described for OfItem<T> {
    type Info = ItemType;
    const INFO: &'static ItemType = &ItemType {
        name: T::NAME,
        wave: T::WAVE,
        columns: T::COLUMNS,
        id: TypeId::of::<T>,
        buffer: |width, span, front, pad| Box::new(StreamBuffer::<T::Elem>::new(width, span, front, pad)),
        buffer_bytes: StreamBuffer::<T::Elem>::planned_bytes,
        numbers: |buffer, from, to, out| {
            if let Some(buffer) = buffer.typed::<StreamBuffer<T::Elem>>() {
                buffer.view(from, to).iter().for_each(|elem| T::numbers(elem, out));
            }
        },
        finite: |buffer, from, to| {
            let buffer = buffer.typed::<StreamBuffer<T::Elem>>();
            buffer.is_some_and(|buffer| buffer.view(from, to).iter().all(T::finite))
        },
        elem_bytes: size_of::<T::Elem>(),
        encode: |buffer, from, to, out| {
            let elems = buffer.typed::<StreamBuffer<T::Elem>>()?.view(from, to);
            elems.iter().try_for_each(|elem| encode(elem, out))
        },
        decode: |buffer, mut bytes| {
            let buffer = buffer.typed_mut::<StreamBuffer<T::Elem>>()?;
            let mut elems = Vec::with_capacity(bytes.len() / size_of::<T::Elem>().max(1));
            while !bytes.is_empty() {
                elems.push(decode(&mut bytes)?);
            }
            buffer.append_elements(&elems)
        },
        trial: |rng, rate, items| {
            let format = T::trial_format(rng);
            trial_stream::<T>(rng, rate, format, items)
        },
        trial_like: |rng, like, items| {
            Some(trial_stream::<T>(rng, like.rate, like.format::<T>()?.clone(), items))
        },
    };
}

fn trial_stream<T: Item>(rng: &mut Rng, rate: Rate, format: T::Format, items: i64) -> WholeStream {
    let width = T::width(&format);
    let count = width * items.max(0) as usize;
    let data = (0..count).map(|k| T::trial(&format, k % width.max(1), rng)).collect();
    let items = Items::<T> { format, data };
    (StreamShape::of_items(rate, &items), Arc::new(items))
}

/// Everything that is fixed about one stream before it runs.
#[derive(Clone)]
pub struct StreamShape {
    /// Type of its items.
    pub item: &'static ItemType,
    /// Items per second.
    pub rate: Rate,
    /// Elements per item.
    pub width: usize,
    /// Tick at which it ends; `None` for a stream without end.
    pub end: Option<Tick>,
    /// The format for people.
    pub text: String,
    format: Arc<dyn Any + Send + Sync>,
}

impl StreamShape {
    /// The shape of a stream of `T`.
    #[must_use]
    pub fn new<T: Item>(rate: Rate, format: T::Format, end: Option<Tick>) -> Self {
        Self {
            item: OfItem::<T>::INFO,
            rate,
            width: T::width(&format),
            end,
            text: T::describe(&format),
            format: Arc::new(format),
        }
    }

    /// The shape of a stream of whole items from tick 0 on.
    pub(in crate::core) fn of_items<T: Item>(rate: Rate, items: &Items<T>) -> Self {
        Self::new::<T>(rate, items.format.clone(), Some(rate.tick(items.len() as i64)))
    }

    /// The typed format.
    #[must_use]
    pub fn format<T: Item>(&self) -> Option<&T::Format> {
        self.format.downcast_ref()
    }
}

impl Debug for StreamShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}, {}", self.item.name, self.rate, self.text)
    }
}
