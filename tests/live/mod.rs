//! Graphs that play.

mod commands;
mod playback;
mod untrusted;
