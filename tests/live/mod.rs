//! Graphs that play.

mod commands;
mod playback;
mod recovery;
mod soak;
mod untrusted;
