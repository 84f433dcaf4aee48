//! Sinusoids of recordings: peaks, tracks, synthesis, and what they leave.

mod peaks;
mod split;
mod synthesis;
mod tracks;

pub use peaks::{PeakFinder, PeakRules, SinePeak};
pub use split::{SteadyTransient, find_tracks, split};
pub use synthesis::add_tracks;
pub use tracks::{PartialTracker, Track, TrackRules};
