//! Declarations of a node before a run: rates, formats, look-around and end.

use super::computation::{Background, Monitor, Partial};
use super::fault::{Fault, Reject};
use super::files::{FileError, Files, Outputs, ReadSeek, WriteSeek, too_large};
use super::input::Inputs;
pub use super::item::LinkShape;
use super::item::{Data, Item, StreamShape};
use super::ports::{Delayed, Events, Many, Port, Stream, Value};
use super::random::Random;
use super::time::{Rate, Tick};
use std::any::Any;
use std::marker::PhantomData;
use std::sync::Arc;

/// Effect of the end of an input stream on a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Ends {
    /// The node ends with it.
    Stop,
    /// It continues as silence while the other inputs last.
    #[default]
    Silence,
    /// It continues as its last item; before its start it is its first item.
    Hold,
    /// It must not end before the others.
    Error,
}

/// Declarations of a node about one input port.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lookaround {
    /// Items (ticks for events) before the window.
    pub behind: usize,
    /// Items (ticks for events) after the window.
    pub ahead: usize,
    /// Items by which the whole input is delayed; a delayed input may close a loop.
    pub delay: usize,
    /// Effect of its end.
    pub ends: Ends,
}

/// Shape of a node with its parameters and inputs.
#[derive(Clone, Debug, Default)]
pub struct NodeShape {
    /// Per input port.
    pub lookaround: Vec<Lookaround>,
    /// Per output port; `None` for events and values.
    pub outputs: Vec<Option<StreamShape>>,
    /// Lag of its outputs behind its window.
    pub lag: Tick,
    /// Tick at which it ends; `None` for a node without end.
    pub end: Option<Tick>,
    /// Warnings for people.
    pub notes: Vec<String>,
    /// Data for the construction of the node.
    pub prepared: Option<Arc<dyn Any + Send + Sync>>,
    /// Files that were opened.
    pub opened: Vec<String>,
}

/// Collects a node's declaration, without types.
pub struct RawShape<'a> {
    /// Links per input port.
    pub links: &'a [Vec<LinkShape>],
    /// Opens assets.
    pub files: &'a dyn Files,
    /// The declaration.
    pub shape: NodeShape,
    tail: Tick,
    end: Option<Option<Tick>>,
    /// Bytes that the node will hold of files.
    held: u64,
    /// Errors so far.
    wrong: Vec<Reject>,
}

impl<'a> RawShape<'a> {
    /// An empty declaration over these links.
    #[must_use]
    pub fn new(links: &'a [Vec<LinkShape>], outputs: usize, files: &'a dyn Files) -> Self {
        let shape = NodeShape {
            lookaround: vec![Lookaround::default(); links.len()],
            outputs: vec![None; outputs],
            ..NodeShape::default()
        };
        Self { links, files, shape, tail: 0, end: None, held: 0, wrong: Vec::new() }
    }

    /// Completes the declaration: the end of the node follows from its inputs unless it declared one.
    ///
    /// # Errors
    /// All that was found wrong: what the node noted, what it gave up for, and an input that has to last but ends before
    /// the others.
    pub fn close(mut self, declared: Result<(), Reject>) -> Result<NodeShape, Vec<Reject>> {
        let ended = declared.and_then(|()| self.end_with_inputs());
        self.wrong.extend(ended.err());
        if self.wrong.is_empty() { Ok(self.shape) } else { Err(self.wrong) }
    }

    fn end_with_inputs(&mut self) -> Result<(), Reject> {
        let ends = self.links.iter().zip(&self.shape.lookaround).flat_map(|(links, lookaround)| {
            links.iter().filter_map(|link| match link {
                LinkShape::Stream(stream) => Some((lookaround.ends, stream.end)),
                LinkShape::Events(end) => Some((lookaround.ends, *end)),
                LinkShape::Value(_) => None,
            })
        });
        let (mut stop, mut longest, mut must): (Option<Tick>, Option<Tick>, Option<Tick>) =
            (None, Some(0), None);
        let mut any = false;
        for (rule, end) in ends {
            any = true;
            longest = longest.zip(end).map(|(a, b)| a.max(b));
            match (rule, end) {
                (Ends::Stop, Some(end)) => stop = Some(stop.map_or(end, |s| s.min(end))),
                (Ends::Error, Some(end)) => must = Some(must.map_or(end, |s| s.min(end))),
                _ => {}
            }
        }
        let end = match self.end {
            Some(end) => end,
            None if !any => None,
            None => stop.or(longest),
        };
        if let Some(must) = must
            && end.is_none_or(|end| end > must)
        {
            return Err(Reject::new("F047", "an input ends before the others of this node"));
        }
        self.shape.end = end.map(|end| end + self.tail);
        for output in self.shape.outputs.iter_mut().flatten() {
            output.end = self.shape.end;
        }
        Ok(())
    }
}

/// A node's declaration, as its `shape` writes it.
pub struct Shape<'s, 'a, P> {
    raw: &'s mut RawShape<'a>,
    ports: PhantomData<P>,
}

/// A port whose stream or events a node may look around in.
pub trait HasLookaround {}
impl<T: Item> HasLookaround for Stream<T> {}
impl<T: super::item::Event> HasLookaround for Events<T> {}
impl<K: HasLookaround> HasLookaround for Option<K> {}
impl<K: HasLookaround> HasLookaround for Many<K> {}
impl<K: HasLookaround> HasLookaround for Delayed<K> {}

/// One input stream, typed.
#[derive(Clone, Debug, PartialEq)]
pub struct Incoming<T: Item> {
    /// Items per second.
    pub rate: Rate,
    /// Constant properties of the stream.
    pub format: T::Format,
    /// End of the stream.
    pub end: Option<Tick>,
}

impl<T: Item> Incoming<T> {
    fn of(link: &LinkShape) -> Option<Self> {
        let LinkShape::Stream(stream) = link else { return None };
        let format = stream.format::<T>()?.clone();
        Some(Self { rate: stream.rate, format, end: stream.end })
    }

    /// Items in it, where it ends.
    #[must_use]
    pub fn items(&self) -> Option<i64> {
        self.end.map(|end| self.rate.first_at(end))
    }
}

impl<'s, 'a, P> Shape<'s, 'a, P> {
    /// Types a declaration.
    pub fn new(raw: &'s mut RawShape<'a>) -> Self {
        Self { raw, ports: PhantomData }
    }

    fn link(&self, port: usize, k: usize) -> Option<&LinkShape> {
        self.raw.links.get(port)?.get(k)
    }

    /// The stream at an input.
    ///
    /// # Panics
    /// When the graph checker let a node through whose input has no link.
    #[must_use]
    pub fn input<T: Item>(&self, port: Port<Stream<T>>) -> Incoming<T> {
        let found = self.link(port.index(), 0).and_then(Incoming::of);
        found.expect("the checker refuses a node whose input has no link")
    }

    /// The stream at an input that may be left open.
    #[must_use]
    pub fn optional<T: Item>(&self, port: Port<Option<Stream<T>>>) -> Option<Incoming<T>> {
        self.link(port.index(), 0).and_then(Incoming::of)
    }

    /// The stream at a delayed input; `None` as long as it comes from a node behind this one.
    #[must_use]
    pub fn delayed_input<T: Item>(&self, port: Port<Delayed<Stream<T>>>) -> Option<Incoming<T>> {
        self.link(port.index(), 0).and_then(Incoming::of)
    }

    /// The streams at an input that takes many.
    #[must_use]
    pub fn many<T: Item>(&self, port: Port<Many<Stream<T>>>) -> Vec<Incoming<T>> {
        self.raw.links[port.index()].iter().filter_map(Incoming::of).collect()
    }

    /// Returns true if anything is linked to an input.
    #[must_use]
    pub fn linked<K>(&self, port: Port<K>) -> bool {
        self.link(port.index(), 0).is_some()
    }

    /// The value at an input, if it is known before the run.
    #[must_use]
    pub fn value<T: Data>(&self, port: Port<Value<T>>) -> Option<Arc<T>> {
        match self.link(port.index(), 0) {
            Some(LinkShape::Value(Some(value))) => value.shared(),
            _ => None,
        }
    }

    /// The value at an input that may be left open, if it is linked and known before the run.
    #[must_use]
    pub fn optional_value<T: Data>(&self, port: Port<Option<Value<T>>>) -> Option<Arc<T>> {
        match self.link(port.index(), 0) {
            Some(LinkShape::Value(Some(value))) => value.shared(),
            _ => None,
        }
    }

    /// Declares how many items (ticks for events) before and after each window the node reads.
    pub fn lookaround<K: HasLookaround>(&mut self, port: Port<K>, behind: usize, ahead: usize) {
        let lookaround = &mut self.raw.shape.lookaround[port.index()];
        (lookaround.behind, lookaround.ahead) = (behind, ahead);
    }

    /// Declares that a stream is read with a delay of `items`: the window shows the items from that many items ago.
    ///
    /// Such an input may close a loop, as long as the delay is no shorter than one window.
    pub fn delay<K: HasLookaround>(&mut self, port: Port<Delayed<K>>, items: usize) {
        self.raw.shape.lookaround[port.index()].delay = items;
    }

    /// Declares the effect of the end of an input.
    pub fn when_ended<K: HasLookaround>(&mut self, port: Port<K>, ends: Ends) {
        self.raw.shape.lookaround[port.index()].ends = ends;
    }

    /// Declares an output stream.
    pub fn output<T: Item>(&mut self, port: Port<Stream<T>>, rate: Rate, format: T::Format) {
        self.raw.shape.outputs[port.index()] = Some(StreamShape::new::<T>(rate, format, None));
    }

    /// Declares that the outputs are this far behind the node's window.
    pub fn lag(&mut self, lag: Tick) {
        self.raw.shape.lag = lag;
    }

    /// Declares that the node continues sounding after its inputs have ended.
    pub fn tail(&mut self, tail: Tick) {
        self.raw.tail = tail;
    }

    /// Declares when the node ends, `None` for never: for sources, and for nodes that cut.
    pub fn ends(&mut self, end: Option<Tick>) {
        self.raw.end = Some(end);
    }

    /// Opens an asset.
    ///
    /// # Errors
    /// When it cannot be had; the error names `field`.
    pub fn open(&mut self, field: &str, path: &str) -> Result<Box<dyn ReadSeek>, Reject> {
        self.raw.shape.opened.push(path.to_owned());
        self.raw.files.open(path).map_err(|e| reject(field, &e))
    }

    /// Reserves memory for data that the node derives from an asset.
    ///
    /// # Errors
    /// When all that it holds is more than the memory limit; the error names `field`.
    pub fn hold(&mut self, field: &str, path: &str, bytes: u64) -> Result<(), Reject> {
        self.raw.held = self.raw.held.saturating_add(bytes);
        let room = self.raw.files.room();
        if self.raw.held > room {
            return Err(reject(field, &too_large(path, self.raw.held, room)));
        }
        Ok(())
    }

    /// Reads a whole asset.
    ///
    /// # Errors
    /// When it cannot be had; the error names `field`.
    pub fn bytes(&mut self, field: &str, path: &str) -> Result<Vec<u8>, Reject> {
        self.raw.shape.opened.push(path.to_owned());
        self.raw.files.bytes(path).map_err(|e| reject(field, &e))
    }

    /// The files of a numbered sequence.
    ///
    /// # Errors
    /// When there is none; the error names `field`.
    pub fn sequence(&mut self, field: &str, pattern: &str) -> Result<Vec<(u64, String)>, Reject> {
        let found = self.raw.files.sequence(pattern).map_err(|e| reject(field, &e))?;
        self.raw.shape.opened.extend(found.iter().map(|(_, path)| path.clone()));
        Ok(found)
    }

    /// The paths of the files in a folder, in order of their names.
    ///
    /// # Errors
    /// When it cannot be listed; the error names `field`.
    pub fn folder(&mut self, field: &str, path: &str) -> Result<Vec<String>, Reject> {
        self.raw.files.folder(path).map_err(|e| reject(field, &e))
    }

    /// Adds an error, if there is one, and continues, so that all errors of a node are found at once.
    pub fn check<T>(&mut self, found: Result<T, Reject>) -> Option<T> {
        found.map_err(|reject| self.wrong(reject)).ok()
    }

    /// Adds an error and continues.
    pub fn wrong(&mut self, reject: Reject) {
        self.raw.wrong.push(reject);
    }

    /// A warning for people that does not stop the graph.
    pub fn note(&mut self, note: impl Into<String>) {
        self.raw.shape.notes.push(note.into());
    }

    /// Stores data for [`Build::prepared`].
    pub fn prepare<T: Send + Sync + 'static>(&mut self, thing: T) {
        self.raw.shape.prepared = Some(Arc::new(thing));
    }
}

fn reject(field: &str, e: &FileError) -> Reject {
    Reject::new(e.code, e.message.clone()).at(field)
}

/// Context for the construction of a node.
pub struct Build<'a> {
    /// Randomness of this node.
    pub random: Random,
    /// Links per input port.
    pub links: &'a [Vec<LinkShape>],
    /// The node's own shape.
    pub shape: &'a NodeShape,
    /// Longest window, ticks.
    pub window: Tick,
    /// Opens assets.
    pub files: &'a dyn Files,
    /// Starts outputs.
    pub outputs: &'a dyn Outputs,
    /// External inputs.
    pub inputs: &'a dyn Inputs,
    /// Watches a long computation.
    pub monitor: &'a Monitor<'a>,
    /// Partial result of an interrupted computation of the same value.
    pub partial: &'a dyn Partial,
    /// Runs work beside the graph.
    pub background: &'a Background,
}

impl Build<'_> {
    /// The stream at an input.
    ///
    /// # Panics
    /// As [`Shape::input`].
    #[must_use]
    pub fn input<T: Item>(&self, port: Port<Stream<T>>) -> Incoming<T> {
        let found = self.links[port.index()].first().and_then(Incoming::of);
        found.expect("the checker refuses a node whose input has no link")
    }

    /// The stream at an input that may be left open.
    #[must_use]
    pub fn optional<T: Item>(&self, port: Port<Option<Stream<T>>>) -> Option<Incoming<T>> {
        self.links[port.index()].first().and_then(Incoming::of)
    }

    /// The streams at an input that takes many.
    #[must_use]
    pub fn many<T: Item>(&self, port: Port<Many<Stream<T>>>) -> Vec<Incoming<T>> {
        self.links[port.index()].iter().filter_map(Incoming::of).collect()
    }

    /// The values at an input that takes many, in the order of the links.
    #[must_use]
    pub fn many_values<T: Data>(&self, port: Port<Many<Value<T>>>) -> Vec<Arc<T>> {
        let value = |link: &LinkShape| match link {
            LinkShape::Value(Some(value)) => value.shared(),
            _ => None,
        };
        self.links[port.index()].iter().filter_map(value).collect()
    }

    /// The value at an input.
    ///
    /// # Panics
    /// When a node is built before its values are known, which the runtime never does.
    #[must_use]
    pub fn value<T: Data>(&self, port: Port<Value<T>>) -> Arc<T> {
        match self.links[port.index()].first() {
            Some(LinkShape::Value(Some(value))) => value.shared(),
            _ => None,
        }
        .expect("values are ready before streams are built")
    }

    /// The value at an input that may be left open.
    #[must_use]
    pub fn optional_value<T: Data>(&self, port: Port<Option<Value<T>>>) -> Option<Arc<T>> {
        match self.links[port.index()].first() {
            Some(LinkShape::Value(Some(value))) => value.shared(),
            _ => None,
        }
    }

    /// The rate and format of an output.
    ///
    /// # Panics
    /// When the node's shape did not declare it.
    #[must_use]
    pub fn output<T: Item>(&self, port: Port<Stream<T>>) -> Incoming<T> {
        let stream = self.shape.outputs[port.index()].clone().map(LinkShape::Stream);
        stream.as_ref().and_then(Incoming::of).expect("the node's own shape declares its outputs")
    }

    /// The most items of a rate that one window can hold.
    #[must_use]
    pub fn items_per_window(&self, rate: Rate) -> usize {
        rate.first_at(self.window) as usize + 1
    }

    /// Returns the data that `shape` stored.
    #[must_use]
    pub fn prepared<T: Send + Sync + 'static>(&self) -> Option<Arc<T>> {
        self.shape.prepared.clone()?.downcast().ok()
    }

    /// Opens an asset.
    ///
    /// # Errors
    /// When it cannot be had; the error names `field`.
    pub fn open(&self, field: &str, path: &str) -> Result<Box<dyn ReadSeek>, Fault> {
        self.files.open(path).map_err(|e| reject(field, &e).into())
    }

    /// Reads a whole asset.
    ///
    /// # Errors
    /// When it cannot be had; the error names `field`.
    pub fn bytes(&self, field: &str, path: &str) -> Result<Vec<u8>, Fault> {
        self.files.bytes(path).map_err(|e| reject(field, &e).into())
    }

    /// The paths of the files in a folder, in order of their names.
    ///
    /// # Errors
    /// When it cannot be listed; the error names `field`.
    pub fn folder(&self, field: &str, path: &str) -> Result<Vec<String>, Fault> {
        self.files.folder(path).map_err(|e| reject(field, &e).into())
    }

    /// Starts an output file.
    ///
    /// # Errors
    /// When it cannot be written; the error names `field`.
    pub fn create(&self, field: &str, path: &str) -> Result<Box<dyn WriteSeek>, Fault> {
        self.outputs.create(path).map_err(|e| reject(field, &e).into())
    }
}
