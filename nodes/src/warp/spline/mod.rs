//! Thin-plate splines: evaluation, kernel and linear algebra.

pub(crate) mod batch;
pub(crate) mod cholesky;
pub(crate) mod kernel;
pub(crate) mod linear;
pub mod pair;
pub mod tps;

pub use pair::Pair;
pub use tps::{Tps, Warper};
