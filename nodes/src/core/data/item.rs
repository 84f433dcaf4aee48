//! The types that travel over links, and their description for the runtime.

use super::buffer::{AnyBuffer, Budget, EventBuffer, Pad, StreamBuffer};
use super::feed::Feed;
use super::random::Rng;
use super::time::{Rate, Tick};
use serde::{Serialize, de::DeserializeOwned};
use std::any::{Any, TypeId};
use std::fmt::{self, Debug};
use std::io::{self, BufWriter};
use std::sync::Arc;

/// The type of the items of a stream.
///
/// The *format* is what is fixed for a whole stream when the graph is planned: a channel count, the faces of a mesh.
pub trait Item: 'static {
    /// One element; an item is `width` of them in a row.
    type Elem: Copy + Default + PartialEq + Debug + Serialize + DeserializeOwned + Send + Sync + 'static;
    /// Properties that are constant over a stream.
    type Format: Clone + PartialEq + Debug + Send + Sync + 'static;
    /// The name that people see, such as `audio`.
    const NAME: &'static str;
    /// Names of the numbers in one element; one empty name where it is one number.
    const COLUMNS: &'static [&'static str];
    /// True if it is a waveform: tapped as a WAV file.
    const WAVE: bool = false;
    /// Elements per item.
    fn width(format: &Self::Format) -> usize;
    /// The format for people: `2 channels`.
    fn describe(format: &Self::Format) -> String;
    /// A small format for trials.
    fn trial_format(rng: &mut Rng) -> Self::Format;
    /// A valid element at index `place` of an item of this format, for trials.
    fn trial(format: &Self::Format, place: usize, rng: &mut Rng) -> Self::Elem;
    /// Returns true if every number in it is finite.
    fn finite(elem: &Self::Elem) -> bool;
    /// An element that no node writes, to find those left unwritten.
    fn poison() -> Self::Elem;
    /// The numbers of an element, one per column.
    fn numbers(elem: &Self::Elem, out: &mut Vec<f32>);
}

/// Audio: samples with full scale at +-1, interleaved by channel.
impl Item for f32 {
    type Elem = f32;
    type Format = Channels;
    const NAME: &'static str = "audio";
    const COLUMNS: &'static [&'static str] = &[""];
    const WAVE: bool = true;

    fn width(format: &Channels) -> usize {
        usize::from(format.0)
    }

    fn describe(format: &Channels) -> String {
        match format.0 {
            1 => "mono".into(),
            2 => "stereo".into(),
            n => format!("{n} channels"),
        }
    }

    fn trial_format(rng: &mut Rng) -> Channels {
        Channels(1 + rng.below(3) as u16)
    }

    fn trial(_: &Channels, _: usize, rng: &mut Rng) -> f32 {
        rng.between(-1.0, 1.0) as f32
    }

    fn finite(elem: &f32) -> bool {
        elem.is_finite()
    }

    fn poison() -> f32 {
        f32::NAN
    }

    fn numbers(elem: &f32, out: &mut Vec<f32>) {
        out.push(*elem);
    }
}

/// Number of channels of an audio stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Channels(pub u16);

/// The type of an event.
pub trait Event: Clone + PartialEq + Debug + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// The name that people see.
    const NAME: &'static str;
    /// A valid event for trials.
    fn trial(rng: &mut Rng) -> Self;
}

/// A thing that is ready before streams start, shared and never changed.
pub trait Data: Debug + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// The name that people see, such as `friction model`.
    const NAME: &'static str;
    /// True if its values have drawings, except empty ones.
    const PLOTS: bool = false;
    /// True if they have a file format of their own.
    const FILES: bool = false;
    /// A valid value for trials.
    fn trial(rng: &mut Rng) -> Self;
    /// A drawing of it as SVG, where it has one.
    fn plot(&self) -> Option<String> {
        None
    }
    /// Its binary file, for types that are too large as text.
    fn file(&self) -> Option<Vec<u8>> {
        None
    }
}

/// A number that was found before streams start, such as a gain.
impl Data for f64 {
    const NAME: &'static str = "number";

    fn trial(rng: &mut Rng) -> Self {
        rng.between(-10.0, 10.0)
    }
}

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
    pub trial: fn(&mut Rng, Rate, i64) -> Feed,
    /// The same with the rate and the format of another stream of the type.
    pub trial_like: fn(&mut Rng, &StreamShape, i64) -> Option<Feed>,
}

impl Debug for ItemType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Describes a type to the runtime.
pub trait Described {
    /// The type of the description.
    type Info: 'static;
    /// The one instance of it.
    const INFO: &'static Self::Info;
}

/// Marker for [`Described`] streams.
#[derive(Debug)]
pub struct OfItem<T>(std::marker::PhantomData<T>);
/// Marker for [`Described`] events.
#[derive(Debug)]
pub struct OfEvent<T>(std::marker::PhantomData<T>);
/// Marker for [`Described`] values.
#[derive(Debug)]
pub struct OfData<T>(std::marker::PhantomData<T>);

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

fn trial_stream<T: Item>(rng: &mut Rng, rate: Rate, format: T::Format, items: i64) -> Feed {
    let width = T::width(&format);
    let count = width * items.max(0) as usize;
    let data = (0..count).map(|k| T::trial(&format, k % width.max(1), rng)).collect();
    Feed::stream::<T>(rate, format, data)
}

/// Converts the events of a part of a buffer to JSON.
pub type EventsJson = fn(&dyn AnyBuffer, Tick, Tick) -> Vec<(Tick, serde_json::Value)>;

/// Adds a part of a buffer to bytes; `None` where the buffer is of another type.
pub type EncodeBuffer = fn(&dyn AnyBuffer, i64, i64, &mut Vec<u8>) -> Option<()>;

/// Appends the items in bytes to a buffer; `None` if they are malformed or the buffer has another type.
pub type DecodeBuffer = fn(&mut dyn AnyBuffer, &[u8]) -> Option<()>;

fn encode<T: Serialize>(what: &T, out: &mut Vec<u8>) -> Option<()> {
    postcard::to_io(what, out).ok().map(|_| ())
}

fn decode<T: DeserializeOwned>(bytes: &mut &[u8]) -> Option<T> {
    let (what, rest) = postcard::take_from_bytes(bytes).ok()?;
    *bytes = rest;
    Some(what)
}

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
    pub trial: fn(&mut Rng, Tick) -> Feed,
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
            Feed::events(times.into_iter().map(|tick| (tick, T::trial(rng))).collect(), end)
        },
    };
}

/// The runtime's view of a [`Data`] type.
pub struct DataType {
    /// The name that people see.
    pub name: &'static str,
    /// Identity.
    pub id: fn() -> TypeId,
    /// Writes the value as JSON without a tree, which would take many times the memory of a large value.
    pub json: fn(&AnyValue, &mut dyn io::Write) -> io::Result<()>,
    /// True if its values have drawings.
    pub plots: bool,
    /// True if they have a file format of their own.
    pub files: bool,
    /// The value drawn as SVG.
    pub plot: fn(&AnyValue) -> Option<String>,
    /// The value as a file of its own kind.
    pub file: fn(&AnyValue) -> Option<Vec<u8>>,
    /// The value as bytes, for the memo.
    pub encode: fn(&AnyValue) -> Option<Vec<u8>>,
    /// The value from its bytes.
    pub decode: fn(&[u8]) -> Option<AnyValue>,
    /// A valid value for trials.
    pub trial: fn(&mut Rng) -> AnyValue,
}

impl Debug for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl<T: Data> Described for OfData<T> {
    type Info = DataType;
    const INFO: &'static DataType = &DataType {
        name: T::NAME,
        id: TypeId::of::<T>,
        json: |value, to| match value.get::<T>() {
            Some(v) => Ok(serde_json::to_writer_pretty(to, v)?),
            None => Ok(()),
        },
        plots: T::PLOTS,
        files: T::FILES,
        plot: |value| value.get::<T>().and_then(T::plot),
        file: |value| value.get::<T>().and_then(T::file),
        encode: |value| value.get::<T>().and_then(|v| postcard::to_allocvec(v).ok()),
        decode: |bytes| postcard::from_bytes::<T>(bytes).ok().map(AnyValue::new),
        trial: |rng| AnyValue::new(T::trial(rng)),
    };
}

/// A shared value with the hash of its content.
#[derive(Clone)]
pub struct AnyValue {
    data: Arc<dyn Any + Send + Sync>,
    hash: [u8; 32],
    kind: &'static DataType,
}

impl AnyValue {
    /// Shares a value.
    #[must_use]
    pub fn new<T: Data>(value: T) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(T::NAME.as_bytes()).update(&[0]);
        // A value may be large: its bytes are never there at once. A hasher takes all that is written.
        let _ = postcard::to_io(&value, BufWriter::with_capacity(1 << 16, &mut hasher));
        Self { data: Arc::new(value), hash: *hasher.finalize().as_bytes(), kind: OfData::<T>::INFO }
    }

    /// The value, where it is a `T`.
    #[must_use]
    pub fn get<T: Data>(&self) -> Option<&T> {
        self.data.downcast_ref()
    }

    /// The value as a shared pointer, where it is a `T`.
    #[must_use]
    pub fn shared<T: Data>(&self) -> Option<Arc<T>> {
        Arc::clone(&self.data).downcast().ok()
    }

    /// The value as JSON text.
    #[must_use]
    pub fn json(&self) -> String {
        let mut text = Vec::new();
        // Writing to memory cannot fail; a value without JSON writes none.
        let _ = (self.kind.json)(self, &mut text);
        String::from_utf8(text).unwrap_or_default()
    }

    /// Hash of the content: equal values have equal hashes.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        self.hash
    }

    /// Its type.
    #[must_use]
    pub fn kind(&self) -> &'static DataType {
        self.kind
    }
}

impl Debug for AnyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}#{:02x}{:02x}{:02x}{:02x}",
            self.kind.name, self.hash[0], self.hash[1], self.hash[2], self.hash[3]
        )
    }
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

/// Shape of one link of an input.
#[derive(Clone, Debug)]
pub enum LinkShape {
    /// A stream.
    Stream(StreamShape),
    /// Events that end at a time.
    Events(Option<Tick>),
    /// A value; absent as long as the run has not computed it.
    Value(Option<AnyValue>),
}
