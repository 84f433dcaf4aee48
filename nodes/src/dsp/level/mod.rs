//! Gain, and the measurement of levels.

pub mod gain;
pub mod level_meter;
pub mod loudness;
pub mod meter;
pub mod normalize;
pub mod ramp;
