//! Modes from recordings.

pub mod extract;
pub mod modal_from_recording;
