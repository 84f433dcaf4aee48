//! The path of a sound through air: level, delay and absorption by distance.

pub mod air;
pub mod control_interval;
pub mod distance;
pub mod distance_gain;
pub(crate) mod fractional_delay;
