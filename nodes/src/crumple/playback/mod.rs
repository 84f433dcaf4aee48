//! Playback: the samples of matched events, added up in one channel or at two ears.

pub mod binaural_crumple_player;
pub mod crumple_player;
mod event_player;
mod onset_timing;
mod playback_params;
pub mod voices;

pub use onset_timing::{Jitter, JitterParams};
pub use playback_params::PlaybackParams;
pub use voices::Player;
