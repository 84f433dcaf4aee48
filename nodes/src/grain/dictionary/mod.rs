//! Dictionaries of grains.

mod coding;
mod error;
pub mod extraction;
mod file;
mod grain;
pub mod grain_dictionary;
pub mod grain_dictionary_file;
mod grain_tracks;
mod grains;
mod subset;
mod taper;

pub use error::{GRAINS_VERSION, GrainError};
pub use extraction::{ExtractRules, TaperPlacement, extract};
pub use grain::Grain;
pub use grain_tracks::{GrainTracks, SteadyTracks, TrackLine};
pub use grains::{BYTES_PER_GRAIN, GrainDictionary, GrainSource, Run};
pub use taper::TaperShape;
