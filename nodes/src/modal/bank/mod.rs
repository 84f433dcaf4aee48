//! The modal bank: damped sines in parallel.

mod coefficients;
mod dampings;
mod kernel;
pub mod loudness;
pub mod modal_bank;
mod moving_points;
pub mod resonators;
