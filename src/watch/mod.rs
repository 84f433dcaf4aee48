//! Notices that a graph, or anything that it reads, has another content than before, and says what became different.
//!
//! Events only say when to look ([`Events`]); whether something has changed is decided by content ([`Seen`]), and what
//! that means for the graph by comparing node by node ([`Changes`]).

mod changes;
mod events;
mod eyes;
mod seen;

pub use changes::{Changes, list};
pub use events::{Events, Glance};
pub use eyes::Eyes;
pub use seen::{Content, Contents, Key, Seen};
