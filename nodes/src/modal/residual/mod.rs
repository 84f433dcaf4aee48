//! What of an impact no mode explains: noise in bands that decay.

pub mod modal_residual;
pub mod noise_band;
pub mod noise_bank;
