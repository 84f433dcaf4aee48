//! Typed ports: what a node declares of its inputs and outputs, and what it sees of them in one window.

mod clock;
mod context;
mod views;

pub use clock::max_items;
pub(super) use context::Shared;
pub use context::{BufferCell, Clock, Cx, InWire, OutWire, Span, Window};
pub use views::{EventsIn, EventsOut, In, Links, Out, Slot};

use super::item::{DataType, EventType, ItemType};
use std::marker::PhantomData;

/// A regular stream: one exact rate, contiguous items.
#[derive(Debug)]
pub struct Stream<T>(PhantomData<T>);
/// Sparse events, sorted by time, complete up to the end of the window.
#[derive(Debug)]
pub struct Events<T>(PhantomData<T>);
/// One shared value that is ready before streams start.
#[derive(Debug)]
pub struct Value<T>(PhantomData<T>);
/// A value that exists once the input streams have ended: a barrier between two phases of a run.
#[derive(Debug)]
pub struct Fold<T>(PhantomData<T>);
/// Any number of links of one kind, in the order in which the graph lists them.
#[derive(Debug)]
pub struct Many<K>(PhantomData<K>);

/// One link that is read with a delay, and therefore may close a loop.
#[derive(Debug)]
pub struct Delayed<K>(PhantomData<K>);

/// Kind and type of a port.
#[derive(Clone, Copy, Debug)]
pub enum PortKind {
    /// A regular stream.
    Stream(&'static ItemType),
    /// Sparse events.
    Events(&'static EventType),
    /// A value known before the streams start.
    Value(&'static DataType),
    /// A value made of whole streams.
    Fold(&'static DataType),
}

impl PortKind {
    /// The name of the item type.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Stream(item) => item.name,
            Self::Events(event) => event.name,
            Self::Value(data) | Self::Fold(data) => data.name,
        }
    }

    /// The kind in one word.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Stream(_) => "stream",
            Self::Events(_) => "events",
            Self::Value(_) => "value",
            Self::Fold(_) => "fold",
        }
    }

    /// Returns true if an output of kind `self` can be linked to an input of kind `input`.
    #[must_use]
    pub fn feeds(&self, input: &Self) -> bool {
        match (self, input) {
            (Self::Stream(a), Self::Stream(b)) => (a.id)() == (b.id)(),
            (Self::Events(a), Self::Events(b)) => (a.id)() == (b.id)(),
            (Self::Value(a) | Self::Fold(a), Self::Value(b)) => (a.id)() == (b.id)(),
            _ => false,
        }
    }
}

/// Number of links of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    /// Exactly one.
    One,
    /// None or one.
    Optional,
    /// A list of one or more.
    Many,
}

/// One declared port.
#[derive(Clone, Copy, Debug)]
pub struct PortSpec {
    /// Its name in graphs.
    pub name: &'static str,
    /// Its content.
    pub doc: &'static str,
    /// Kind and type.
    pub kind: PortKind,
    /// Number of its links; outputs have [`Arity::One`].
    pub arity: Arity,
    /// True if it may close a loop.
    pub delayed: bool,
}

/// A typed name of a port.
#[derive(Debug)]
pub struct Port<K> {
    index: usize,
    kind: PhantomData<K>,
}

impl<K> Port<K> {
    /// Port number `index`; made by [`ports!`](crate::ports).
    #[must_use]
    pub const fn new(index: usize) -> Self {
        Self { index, kind: PhantomData }
    }

    /// Its index in the declaration.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index
    }
}

/// The ports of one node type.
pub trait Ports: 'static {
    /// View of the ports in one window.
    type Io<'a>;
    /// Inputs in order.
    const INPUTS: &'static [PortSpec];
    /// Outputs in order.
    const OUTPUTS: &'static [PortSpec];
    /// Opens all views of one window.
    fn open<'a>(cx: &Cx<'a>) -> Self::Io<'a>;
}

/// A kind that an input can have.
pub trait InKind {
    /// View of the port.
    type View<'a>;
    /// Kind and type.
    const KIND: PortKind;
    /// Number of links.
    const ARITY: Arity;
    /// True if it may close a loop.
    const DELAYED: bool = false;
    /// Opens the view of one window.
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Self::View<'a>;
}

/// A kind of input that takes one link.
pub trait One: InKind {
    /// Opens the view of one link.
    fn link<'a>(cx: &Cx<'a>, wire: &'a InWire) -> Self::View<'a>;
}

/// A kind that an output can have.
pub trait OutKind {
    /// View of the port.
    type View<'a>;
    /// Kind and type.
    const KIND: PortKind;
    /// Opens the view of one window.
    fn view<'a>(cx: &Cx<'a>, port: usize) -> Self::View<'a>;
}

/// Declares the ports of a node: names, kinds and a doc comment each.
///
/// Makes the port names as constants (`GainPorts::audio`) and the struct of views that `run` gets (`GainIo`).
#[macro_export]
macro_rules! ports {
    (
        $(#[$meta:meta])*
        pub struct $name:ident / $io:ident {
            in { $( $(#[doc = $idoc:expr])+ $in:ident : $it:ty, )* }
            out { $( $(#[doc = $odoc:expr])+ $out:ident : $ot:ty, )* }
        }
    ) => {
        $(#[$meta])*
        /// Names of the ports.
        #[derive(Debug)]
        pub struct $name;

        /// The ports in one window.
        #[allow(missing_debug_implementations)]
        pub struct $io<'a> {
            $( $(#[doc = $idoc])+ pub $in: <$it as $crate::core::ports::InKind>::View<'a>, )*
            $( $(#[doc = $odoc])+ pub $out: <$ot as $crate::core::ports::OutKind>::View<'a>, )*
            #[doc(hidden)]
            pub window: $crate::core::ports::Window<'a>,
        }

        #[allow(non_upper_case_globals)]
        impl $name {
            $crate::ports!(@name 0usize; $( $(#[doc = $idoc])+ $in : $it, )*);
            $crate::ports!(@name 0usize; $( $(#[doc = $odoc])+ $out : $ot, )*);
        }

        impl $crate::core::ports::Ports for $name {
            type Io<'a> = $io<'a>;
            const INPUTS: &'static [$crate::core::ports::PortSpec] = &[ $( $crate::core::ports::PortSpec {
                name: stringify!($in),
                doc: concat!($($idoc, "\n",)+),
                kind: <$it as $crate::core::ports::InKind>::KIND,
                arity: <$it as $crate::core::ports::InKind>::ARITY,
                delayed: <$it as $crate::core::ports::InKind>::DELAYED,
            }, )* ];
            const OUTPUTS: &'static [$crate::core::ports::PortSpec] = &[ $( $crate::core::ports::PortSpec {
                name: stringify!($out),
                doc: concat!($($odoc, "\n",)+),
                kind: <$ot as $crate::core::ports::OutKind>::KIND,
                arity: $crate::core::ports::Arity::One,
                delayed: false,
            }, )* ];

            #[inline(always)]
            fn open<'a>(cx: &$crate::core::ports::Cx<'a>) -> $io<'a> {
                $io {
                    $( $in: <$it as $crate::core::ports::InKind>::view(cx, $name::$in.index()), )*
                    $( $out: <$ot as $crate::core::ports::OutKind>::view(cx, $name::$out.index()), )*
                    window: cx.window(),
                }
            }
        }
    };
    (@name $n:expr;) => {};
    (@name $n:expr; $(#[doc = $doc:expr])+ $port:ident : $t:ty, $($rest:tt)*) => {
        $(#[doc = $doc])+
        pub const $port: $crate::core::ports::Port<$t> = $crate::core::ports::Port::new($n);
        $crate::ports!(@name $n + 1usize; $($rest)*);
    };
}
