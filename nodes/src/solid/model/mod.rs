//! The modes of an object with their shapes on its surface, and the sound of impacts at contact points.

pub mod analytic;
pub mod analytic_modes;
pub mod cull;
pub mod modal_analysis;
pub mod modal_model;
pub mod modal_model_file;
pub mod model_modes;
pub mod radiance;
pub mod surface;

#[cfg(test)]
mod tests;
