//! The types that travel over links, and their description for the runtime.

mod contract;
mod described;
mod events;
mod link;
mod source;
mod stream;
mod value;

pub use contract::{Channels, Data, Event, Item};
pub use described::{DecodeBuffer, Described, EncodeBuffer, OfData, OfEvent, OfItem};
pub use events::{EventType, EventsJson};
pub use link::LinkShape;
pub use source::FeedSource;
pub(in crate::core) use source::{Items, Sparse};
pub use stream::{ItemType, StreamShape, WholeStream};
pub use value::{AnyValue, DataType};
