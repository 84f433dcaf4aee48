//! Friction sound: spectra measured against sliding speed, and noise synthesised from them.
//!
//! A [`FrictionModel`] holds one power density per speed, made from a roller recording ([`builder`]) or from plain
//! cloth recordings ([`mod@from_clips`]); [`interpolate`] gives the spectrum at any speed and [`ift_noise`] its sound.

pub mod between;
pub mod binaural_node;
pub mod builder;
pub mod builder_node;
pub mod clip_stream;
mod clusters;
pub mod encoder;
mod figure;
pub mod from_clips;
pub mod ift_noise;
pub mod ift_noise_node;
pub mod interpolate;
pub mod model;
pub mod model_nodes;
pub mod pair;
pub mod pair_node;
mod phasors;
pub mod psd;
pub mod rebin;
pub mod table;
#[cfg(test)]
mod testing;
pub mod window;

pub use builder::{BuildError, BuilderParams, build};
pub use clip_stream::ClipStream;
pub use encoder::{EncoderError, EncoderTrack, Reading, Signal};
pub use from_clips::{ClipModelParams, Recording, SpeedLaw, from_clips};
pub use ift_noise::{
    AreaWeight, ClipInput, Emitters, IftNoise, IftNoiseParams, Magnitude, Mono, NoiseError, Receiver,
    SpeedCoverage,
};
pub use interpolate::{Gain, SpectrumInterpolator};
pub use model::{Conventions, FrictionModel, ModelError, Origin, Rejections, Source};
pub use pair::inferred_pair;
pub use table::SpectrumTable;
pub use window::Window;
