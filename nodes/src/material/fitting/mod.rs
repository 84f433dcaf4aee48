//! Estimators of damping as a node, and the figure of a fit.

pub mod damping_fit;
mod figure;
