//! The modal bank: damped sines in parallel.

mod coefficients;
mod dampings;
pub mod fourier_form;
mod hop_fit;
mod kernel;
mod lanes;
pub mod loudness;
pub mod modal_bank;
mod moving_points;
pub mod resonators;
mod two_pole;
