//! What the descriptions of all types share.

use crate::core::buffer::AnyBuffer;
use serde::{Serialize, de::DeserializeOwned};

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

/// Adds a part of a buffer to bytes; `None` where the buffer is of another type.
pub type EncodeBuffer = fn(&dyn AnyBuffer, i64, i64, &mut Vec<u8>) -> Option<()>;

/// Appends the items in bytes to a buffer; `None` if they are malformed or the buffer has another type.
pub type DecodeBuffer = fn(&mut dyn AnyBuffer, &[u8]) -> Option<()>;

pub(super) fn encode<T: Serialize>(what: &T, out: &mut Vec<u8>) -> Option<()> {
    postcard::to_io(what, out).ok().map(|_| ())
}

pub(super) fn decode<T: DeserializeOwned>(bytes: &mut &[u8]) -> Option<T> {
    let (what, rest) = postcard::take_from_bytes(bytes).ok()?;
    *bytes = rest;
    Some(what)
}
