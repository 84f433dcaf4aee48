//! Sinusoids of recordings: peaks, tracks, synthesis, and the residual.
//!
//! In the order of the data, [`sine_peaks`] finds the sinusoids of each frame, [`partial_tracks`] joins them to tracks, [`additive_resynth`]
//! plays the tracks, and [`transient_residual`] is the rest; [`split`](mod@split) does the same with a recording as a whole.

pub mod additive_resynth;
pub mod item;
pub mod partial_tracks;
mod peaks;
pub mod sine_peaks;
pub mod split;
mod synthesis;
#[cfg(test)]
mod testing;
mod tracks;
pub mod transient_residual;

pub use item::{FrameFormat, PeakFrames, TrackFrames, TrackPoint};
pub use peaks::{PeakFinder, PeakRules, PeakWindow, SinePeak};
pub use split::{SteadyTransient, find_tracks, split};
pub(crate) use synthesis::add_integrated;
pub use synthesis::{TrackSynthesis, add_tracks};
pub use tracks::{PartialTracker, Track, TrackRules};
