//! Plays a graph: the same plan and the same nodes as offline, in windows as short as a sound card asks for.
//!
//! [`Player`] is the side that may wait: it builds, reloads and reports. [`Callback`] is the side that may not: it runs the
//! nodes that may run in an audio callback, and takes finished windows of all others from rings that worker threads
//! ([`crew`](self)) keep full. The two talk over rings without locks; nothing is allocated or freed in the callback.

mod callback;
#[cfg(feature = "live")]
mod card;
mod crew;
pub mod device;
mod diff;
pub mod input;
mod layout;
mod link;
mod meter;
mod moves;
mod player;
mod ready;
mod sink;
mod union;

pub use callback::{Callback, Shared};
pub use diff::Edit;
pub use meter::{Histogram, Meter, NodeMeter};
pub use player::{Options, Player, Reloaded, Told};
pub use ready::Material;
