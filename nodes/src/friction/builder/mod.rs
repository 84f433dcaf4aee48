//! Friction models made from recordings: of a roller with an encoder ([`roller`]), or of cloth whose speeds were not
//! measured ([`mod@from_clips`]).

mod analysis;
pub mod encoder;
pub mod friction_model_builder;
pub mod friction_model_from_clips;
pub mod from_clips;
mod mono_recording;
pub mod psd;
pub mod roller;
pub mod synthetic_roller;

pub use analysis::BuildError;
pub use encoder::{EncoderError, EncoderTrack, Reading, Signal};
pub use from_clips::{ClipModelParams, Recording, SpeedLaw, from_clips};
pub use roller::{BuilderParams, build};
