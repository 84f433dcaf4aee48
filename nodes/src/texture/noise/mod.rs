//! Noise of a texture: its statistics, one closed line of it, and its spectrum.

pub mod detail;
pub mod feature_noise_split;
pub mod noise_profile;
pub mod noise_profile_file;
pub mod profile;
pub mod psd;
pub mod spectrum;
pub mod split;
