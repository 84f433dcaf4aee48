//! Known answers of the estimators.

mod experiments;
mod golden;
mod properties;
mod uncertainty;

pub(super) use crate::material::experiments::synthetic::independent_points as simulated;
