//! Graphs that play.

mod commands;
mod edits;
mod incoming;
mod late_events;
mod mistakes;
mod playback;
mod recovery;
mod soak;
mod stand;
mod untrusted;
