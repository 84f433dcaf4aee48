//! Gain, and the measurement of levels.

pub mod gain;
pub mod level_meter;
pub mod limiter;
pub mod loudness;
pub mod loudness_meter;
pub mod meter;
pub mod normalize;
pub mod ramp;
pub mod reference;
pub mod sound_meter;
pub mod transient_transfer;
pub mod weighting;
