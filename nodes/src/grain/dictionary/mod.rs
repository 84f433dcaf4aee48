//! Dictionaries of grains.

mod coding;
pub mod extraction;
mod file;
pub mod grain_dictionary;
pub mod grain_dictionary_file;
mod grain_tracks;
mod grains;
mod subset;
mod taper;

pub use extraction::{ExtractRules, TaperPlacement, extract};
pub use grain_tracks::{GrainTracks, SteadyTracks, TrackLine};
pub use grains::{BYTES_PER_GRAIN, GRAINS_VERSION, Grain, GrainDictionary, GrainError, GrainSource, Run};
pub use taper::TaperShape;
