//! Contact logs of physics engines: rows of contact points become contacts that last over frames.

mod bodies;
mod circulation;
mod columns;
pub mod contact_log;
mod contact_tracker;
mod error;
mod frame_interval;
mod poses;
mod reader;
mod row;
mod table;
mod track;

pub use bodies::{Bodies, MAX_BODIES};
pub use contact_tracker::Manifold;
pub use error::{LogError, LogFault};
pub use reader::{ContactTrack, LogOptions, read_contacts};
pub use row::{KEYS, MAX_ROWS};
