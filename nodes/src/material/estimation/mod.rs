//! Estimators of damping models from points.

pub mod diagnostics;
pub mod elastic_ratio;
pub mod emg;
pub mod erfcx;
pub mod estimate;
pub mod fit;
pub mod gamma_excess;
pub mod hierarchical;
pub(crate) mod lbfgs;
pub mod least_squares;
pub mod likelihood;
pub(crate) mod linear;
pub mod lower_bound;
pub mod mixture;
pub(crate) mod newton;
pub mod nnls;
pub mod point;
pub mod prior;
pub mod reference;
pub mod report;
pub mod scan;
#[cfg(test)]
mod tests;
pub mod uncertainty;
