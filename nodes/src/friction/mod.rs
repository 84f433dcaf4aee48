//! Friction sound: spectra measured against sliding speed, and noise synthesised from them.
//!
//! A [`FrictionModel`] holds one power density per speed ([`model`]). It is made from recordings ([`builder`]) and
//! computes the spectra of noise ([`synthesis`]).

pub mod builder;
pub mod model;
pub mod synthesis;
#[cfg(test)]
mod testing;

pub use builder::{
    BuildError, BuilderParams, ClipModelParams, EncoderError, EncoderTrack, Reading, Recording, Signal,
    SpeedLaw, build, from_clips,
};
pub use model::{
    Conventions, FrictionModel, Gain, ModelError, Origin, Rejections, Source, SpectrumInterpolator,
    SpectrumTable, inferred_pair,
};
pub use synthesis::{
    AreaWeight, ClipInput, ClipStream, Emitters, IftNoise, IftNoiseParams, Magnitude, Mono, NoiseError,
    Receiver, SpeedCoverage, Window,
};
