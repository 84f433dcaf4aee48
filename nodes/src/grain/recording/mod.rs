//! Recordings that grains are cut out of.

pub mod grain_recordings;
mod kind;
mod label;
mod recordings;

pub use kind::{SourceKind, guess_kind};
pub use label::{Component, RecordingLabel, matching_tags};
pub use recordings::{GrainRecording, GrainRecordings, Part};
