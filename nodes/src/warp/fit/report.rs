//! Stiffness, report and errors of a fit.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Maximum number of nodes of one fit: the time is proportional to their cube.
pub const MAX_NODES: usize = 3000;
/// Stiffness of a spline.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Stiffness {
    /// lambda itself, in squared units of the vectors: 0 passes through every pair.
    Lambda(f64),
    /// lambda over the squared mean distance of the nodes, which does not depend on the units.
    ScaleFree(f64),
    /// The one of least generalised cross-validation among lambda = 1e-2 .. 1e7.
    Auto,
}

impl Stiffness {
    /// The stiffness of the parameters `lambda` and `scale_free`.
    pub(in crate::warp) fn of(lambda: Option<f64>, scale_free: bool) -> Self {
        match (lambda, scale_free) {
            (None, _) => Self::Auto,
            (Some(lambda), false) => Self::Lambda(lambda),
            (Some(lambda), true) => Self::ScaleFree(lambda),
        }
    }
}

/// Figures of a fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Number of pairs.
    pub pairs: usize,
    /// Nodes after pairs that start in one place were merged.
    pub nodes: usize,
    /// Independent directions in which the nodes spread, at most the dimensions.
    pub rank: usize,
    /// lambda as used.
    pub lambda: f64,
    /// Effective degrees of freedom per output: from the number of nodes (passes through all) down to rank + 1 (affine).
    pub freedom: f64,
    /// Root mean square of the residuals at the nodes.
    pub residual: f64,
    /// Largest distance between merged pairs and their mean: they contradict each other by that much.
    pub conflict: f64,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Reasons why a spline cannot be fitted.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FitError {
    /// A pair that is not finite, of another length, or without weight.
    #[error("pair {pair}: {message}")]
    Pair {
        /// Index of the pair.
        pair: usize,
        /// Description of the mistake, and of the correct form.
        message: String,
    },
    /// More than [`MAX_NODES`].
    #[error("{found} nodes are more than {MAX_NODES}; mark less, or take the middle of each correspondence")]
    TooMany {
        /// Nodes found.
        found: usize,
    },
    /// A negative or infinite lambda.
    #[error("lambda is {found}; a finite number from 0 on is needed")]
    Lambda {
        /// The number found.
        found: f64,
    },
    /// Kernels that cannot be distinguished.
    #[error("nodes lie too close together for lambda {lambda}; a larger one is needed")]
    Singular {
        /// lambda as used.
        lambda: f64,
    },
}
