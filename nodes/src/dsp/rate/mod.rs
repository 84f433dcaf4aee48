//! Sample rate conversion.

pub mod resample;
pub mod resampler;
mod taps;
