//! The modal bank: damped sines in parallel.

mod coefficients;
mod kernel;
pub mod loudness;
pub mod modal_bank;
pub mod resonators;
