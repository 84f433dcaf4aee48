//! Residual of an impact without its modes: noise in bands that decay.

pub mod modal_residual;
pub mod noise_band;
pub mod noise_bank;
