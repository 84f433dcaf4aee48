//! The shape of a link.

use super::stream::StreamShape;
use super::value::AnyValue;
use crate::core::time::Tick;

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
