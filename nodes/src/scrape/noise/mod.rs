//! Excitation from noise: a loop of noise is read at the speed of a contact from band-limited versions.

pub(super) mod bands;
mod interpolation;
pub mod noise_excitation;
pub(super) mod noise_force;

pub use bands::NoiseBands;
pub use interpolation::NoiseInterp;
pub use noise_force::{NoiseForce, NoiseVoice};
