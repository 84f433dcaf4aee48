//! Graphs that play.

mod commands;
mod incoming;
mod late_events;
mod playback;
mod recovery;
mod soak;
mod untrusted;
