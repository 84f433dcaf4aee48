//! Graphs that play.

mod commands;
mod incoming;
mod playback;
mod recovery;
mod soak;
mod untrusted;
