//! Graphs that play.

mod commands;
mod playback;
