//! Plays a graph: the same plan and nodes as offline, in windows as short as a sound card requires.
//!
//! [`Player`] is the side that may wait: it builds, reloads and reports. [`Callback`] is the side that must not: it runs the
//! nodes that may run in an audio callback, and receives the finished windows of all others from workers over rings. The two
//! sides communicate over rings without locks; the callback neither allocates nor frees.

#[doc(hidden)]
pub mod checks;
pub mod device;
pub mod input;
mod levels;
mod playback;
mod player;
mod reload;

pub use levels::{Levels, now};
pub use playback::callback::{CEILING, Callback, Shared};
pub use playback::meter::{Histogram, Meter, NodeMeter};
pub use player::{Options, Player, PlayerEvent, Reloaded};
pub use reload::diff::Edit;
pub use reload::prepared::LiveGraph;
