//! Estimators of damping and of stiffness as nodes, and the figure of a fit.

pub mod damping_fit;
pub mod damping_from_stream;
pub mod elastic_ratio;
mod figure;
