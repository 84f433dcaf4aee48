//! Views of the ports in one window.
//!
//! Views are opened for every node in every window, so opening one is always part of its caller: a view that came back
//! through memory would be written word by word and read two words at a time, which stalls a processor for longer than a
//! light node takes.

use super::context::{Cx, InWire, OutWire};
use super::{Arity, Delayed, Events, Fold, InKind, Many, One, OutKind, PortKind, Stream, Value};
use crate::core::buffer::{EventBuffer, StreamBuffer};
use crate::core::item::{AnyValue, Data, Described, Event, Item, OfData, OfEvent, OfItem};
use crate::core::time::{Rate, Tick};
use std::cell::{Ref, RefMut};
use std::marker::PhantomData;

/// Items of one input stream around one window.
///
/// # Shapes
/// `behind + len + ahead` items of `width` elements each; `behind` and `ahead` as the node's shape declared.
#[derive(Debug)]
pub struct In<'a, T: Item> {
    items: Ref<'a, [T::Elem]>,
    width: usize,
    behind: usize,
    len: usize,
    first: i64,
    rate: Rate,
}

impl<T: Item> In<'_, T> {
    /// The items of the window itself.
    #[must_use]
    pub fn items(&self) -> &[T::Elem] {
        &self.items[self.behind * self.width..(self.behind + self.len) * self.width]
    }

    /// The items of the window, with those before and after it that the shape declared.
    #[must_use]
    pub fn around(&self) -> &[T::Elem] {
        &self.items
    }

    /// Item `k` of the window; negative before it, from `len` on after it, within the declared shape.
    #[must_use]
    pub fn item(&self, k: isize) -> &[T::Elem] {
        let at = (self.behind as isize + k) as usize * self.width;
        &self.items[at..at + self.width]
    }

    /// Items in the window.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if the window holds no item.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Elements per item.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Index in the stream of the window's first item.
    #[must_use]
    pub fn first(&self) -> i64 {
        self.first
    }

    /// Items before the window that are visible.
    #[must_use]
    pub fn behind(&self) -> usize {
        self.behind
    }

    /// Items per second.
    #[must_use]
    pub fn rate(&self) -> Rate {
        self.rate
    }
}

/// The part of an output stream that one window has to fill.
#[derive(Debug)]
pub struct Out<'a, T: Item> {
    items: RefMut<'a, [T::Elem]>,
    width: usize,
    first: i64,
    rate: Rate,
}

impl<T: Item> Out<'_, T> {
    /// The items to fill.
    pub fn items(&mut self) -> &mut [T::Elem] {
        &mut self.items
    }

    /// Items in the window.
    #[must_use]
    pub fn len(&self) -> usize {
        self.items.len() / self.width.max(1)
    }

    /// Returns true if the window holds no item.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Elements per item.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Index in the stream of the window's first item.
    #[must_use]
    pub fn first(&self) -> i64 {
        self.first
    }

    /// Items per second.
    #[must_use]
    pub fn rate(&self) -> Rate {
        self.rate
    }
}

/// The events of one window.
#[derive(Debug)]
pub struct EventsIn<'a, T: Event> {
    events: Ref<'a, [(Tick, T)]>,
    from: Tick,
    to: Tick,
}

impl<T: Event> EventsIn<'_, T> {
    /// The events in the window, in order.
    #[must_use]
    pub fn events(&self) -> &[(Tick, T)] {
        &self.events
    }

    /// The window: all events in it are here.
    #[must_use]
    pub fn window(&self) -> (Tick, Tick) {
        (self.from, self.to)
    }
}

/// Takes the events of one window.
#[derive(Debug)]
pub struct EventsOut<'a, T: Event> {
    buffer: RefMut<'a, EventBuffer<T>>,
    from: Tick,
    to: Tick,
}

impl<T: Event> EventsOut<'_, T> {
    /// Adds an event; a time outside the window is moved to its nearest end, so that no watermark is broken.
    pub fn push(&mut self, tick: Tick, event: T) {
        self.buffer.push(tick.clamp(self.from, (self.to - 1).max(self.from)), event);
    }

    /// The window to fill.
    #[must_use]
    pub fn window(&self) -> (Tick, Tick) {
        (self.from, self.to)
    }
}

/// Takes one value.
#[derive(Debug)]
pub struct Slot<'a, T: Data> {
    place: RefMut<'a, Option<AnyValue>>,
    kind: PhantomData<T>,
}

impl<T: Data> Slot<'_, T> {
    /// Sets the value.
    pub fn set(&mut self, value: T) {
        *self.place = Some(AnyValue::new(value));
    }
}

/// The links of an input that takes many.
#[derive(Clone, Copy)]
pub struct Links<'a, K> {
    cx: Cx<'a>,
    wires: &'a [InWire],
    kind: PhantomData<K>,
}

impl<'a, K: One> Links<'a, K> {
    /// Returns their number.
    #[must_use]
    pub fn len(&self) -> usize {
        self.wires.len()
    }

    /// Returns true if there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.wires.is_empty()
    }

    /// Opens each in turn.
    pub fn iter(&self) -> impl Iterator<Item = K::View<'a>> + use<'a, K> {
        let cx = self.cx;
        self.wires.iter().map(move |wire| K::link(&cx, wire))
    }
}

impl<T: Item> InKind for Stream<T> {
    type View<'a> = In<'a, T>;
    const KIND: PortKind = PortKind::Stream(OfItem::<T>::INFO);
    const ARITY: Arity = Arity::One;

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> In<'a, T> {
        Self::link(cx, &cx.inputs[port][0])
    }
}

impl<T: Item> One for Stream<T> {
    #[inline(always)]
    fn link<'a>(cx: &Cx<'a>, wire: &'a InWire) -> In<'a, T> {
        let InWire::Stream { buffer, clock, behind, ahead, delay, width, rate } = wire else {
            cx.miswired("stream")
        };
        let span = cx.span(*clock);
        if cx.shared.closing {
            let items = Ref::map(cx.shared.buffers[*buffer].borrow(), |_| -> &[T::Elem] { &[] });
            return In { items, width: *width, behind: 0, len: 0, first: span.from, rate: *rate };
        }
        let items = Ref::map(cx.shared.buffers[*buffer].borrow(), |buffer| {
            let Some(buffer) = buffer.typed::<StreamBuffer<T::Elem>>() else { cx.miswired(T::NAME) };
            let (from, to) = (span.from - *delay as i64, span.to - *delay as i64);
            buffer.view(from - *behind as i64, to + *ahead as i64)
        });
        let len = (span.to - span.from) as usize;
        In { items, width: *width, behind: *behind, len, first: span.from, rate: *rate }
    }
}

impl<T: Event> InKind for Events<T> {
    type View<'a> = EventsIn<'a, T>;
    const KIND: PortKind = PortKind::Events(OfEvent::<T>::INFO);
    const ARITY: Arity = Arity::One;

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> EventsIn<'a, T> {
        Self::link(cx, &cx.inputs[port][0])
    }
}

impl<T: Event> One for Events<T> {
    #[inline(always)]
    fn link<'a>(cx: &Cx<'a>, wire: &'a InWire) -> EventsIn<'a, T> {
        let InWire::Events { buffer, clock, behind, ahead } = wire else { cx.miswired("events") };
        let span = cx.span(*clock);
        let events = Ref::map(cx.shared.buffers[*buffer].borrow(), |buffer| {
            let Some(buffer) = buffer.typed::<EventBuffer<T>>() else { cx.miswired(T::NAME) };
            buffer.view(span.from - behind, span.to + ahead)
        });
        EventsIn { events, from: span.from, to: span.to }
    }
}

impl<T: Data> InKind for Value<T> {
    type View<'a> = &'a T;
    const KIND: PortKind = PortKind::Value(OfData::<T>::INFO);
    const ARITY: Arity = Arity::One;

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> &'a T {
        Self::link(cx, &cx.inputs[port][0])
    }
}

impl<T: Data> One for Value<T> {
    #[inline(always)]
    fn link<'a>(cx: &Cx<'a>, wire: &'a InWire) -> &'a T {
        let InWire::Value(value) = wire else { cx.miswired("value") };
        match value.get() {
            Some(value) => value,
            None => cx.miswired(T::NAME),
        }
    }
}

impl<K: One> InKind for Option<K> {
    type View<'a> = Option<K::View<'a>>;
    const KIND: PortKind = K::KIND;
    const ARITY: Arity = Arity::Optional;

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Self::View<'a> {
        cx.inputs[port].first().map(|wire| K::link(cx, wire))
    }
}

impl<K: One> InKind for Delayed<K> {
    type View<'a> = K::View<'a>;
    const KIND: PortKind = K::KIND;
    const ARITY: Arity = Arity::One;
    const DELAYED: bool = true;

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Self::View<'a> {
        K::view(cx, port)
    }
}

impl<T: Event> Links<'_, Events<T>> {
    /// Visits the events of all links in the order of time; of equal times those of the first link come first.
    pub fn each_in_order(&self, mut visit: impl FnMut(u32, Tick, &T)) {
        let mut at = Tick::MIN;
        loop {
            let next = self.iter().filter_map(|link| {
                let events = link.events();
                events.get(events.partition_point(|(tick, _)| *tick < at)).map(|(tick, _)| *tick)
            });
            let Some(now) = next.min() else { return };
            for (k, link) in self.iter().enumerate() {
                let events = link.events();
                let first = events.partition_point(|(tick, _)| *tick < now);
                for (tick, event) in events[first..].iter().take_while(|(tick, _)| *tick == now) {
                    visit(k as u32, *tick, event);
                }
            }
            at = now + 1;
        }
    }
}

impl<K: One> InKind for Many<K> {
    type View<'a> = Links<'a, K>;
    const KIND: PortKind = K::KIND;
    const ARITY: Arity = Arity::Many;

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Links<'a, K> {
        Links { cx: *cx, wires: &cx.inputs[port], kind: PhantomData }
    }
}

#[cold]
#[inline(never)]
fn spoil<T: Item>(items: &mut [T::Elem]) {
    items.fill(T::poison());
}

impl<T: Item> OutKind for Stream<T> {
    type View<'a> = Out<'a, T>;
    const KIND: PortKind = PortKind::Stream(OfItem::<T>::INFO);

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Out<'a, T> {
        let OutWire::Stream { buffer, clock, width, rate } = &cx.outputs[port] else { cx.miswired("stream") };
        let span = cx.span(*clock);
        let n = (span.to - span.from) as usize;
        let mut items = RefMut::map(
            cx.shared.buffers[*buffer].borrow_mut(),
            #[inline(always)]
            |buffer| match buffer.typed_mut::<StreamBuffer<T::Elem>>() {
                Some(buffer) => buffer.append(n),
                None => cx.miswired(T::NAME),
            },
        );
        if cx.shared.poison {
            spoil::<T>(&mut items);
        }
        Out { items, width: *width, first: span.from, rate: *rate }
    }
}

impl<T: Event> OutKind for Events<T> {
    type View<'a> = EventsOut<'a, T>;
    const KIND: PortKind = PortKind::Events(OfEvent::<T>::INFO);

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> EventsOut<'a, T> {
        let OutWire::Events { buffer, clock } = &cx.outputs[port] else { cx.miswired("events") };
        let span = cx.span(*clock);
        let mut buffer = RefMut::map(cx.shared.buffers[*buffer].borrow_mut(), |buffer| {
            let Some(buffer) = buffer.typed_mut::<EventBuffer<T>>() else { cx.miswired(T::NAME) };
            buffer
        });
        buffer.advance(span.to);
        EventsOut { buffer, from: span.from, to: span.to }
    }
}

fn slot<'a, T: Data>(cx: &Cx<'a>, port: usize) -> Slot<'a, T> {
    let OutWire::Value(place) = &cx.outputs[port] else { cx.miswired("value") };
    Slot { place: place.borrow_mut(), kind: PhantomData }
}

impl<T: Data> OutKind for Value<T> {
    type View<'a> = Slot<'a, T>;
    const KIND: PortKind = PortKind::Value(OfData::<T>::INFO);

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Slot<'a, T> {
        slot(cx, port)
    }
}

impl<T: Data> OutKind for Fold<T> {
    type View<'a> = Slot<'a, T>;
    const KIND: PortKind = PortKind::Fold(OfData::<T>::INFO);

    #[inline(always)]
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Slot<'a, T> {
        slot(cx, port)
    }
}
