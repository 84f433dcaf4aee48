//! Fits a thin-plate spline to pairs of vectors.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::problem::Problem;
use super::tps::Tps;

/// Most nodes of one fit: the time goes with their cube.
pub const MAX_NODES: usize = 3000;
/// How stiff the spline is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Stiffness {
    /// lambda itself, in squared units of the vectors: 0 passes through every pair.
    Lambda(f64),
    /// lambda over the squared mean distance of the nodes, which does not depend on the units.
    ScaleFree(f64),
    /// The one of least generalised cross-validation among lambda = 1e-2 .. 1e7.
    Auto,
}

/// One pair: a vector, where it should go, and how much that counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The vector.
    pub from: Vec<f64>,
    /// Where it should go.
    pub to: Vec<f64>,
    /// Weight, above 0.
    pub weight: f64,
}

/// What a fit tells of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Pairs given.
    pub pairs: usize,
    /// Nodes after pairs that start in one place were merged.
    pub nodes: usize,
    /// Independent directions in which the nodes spread, at most the dimensions.
    pub rank: usize,
    /// lambda as used.
    pub lambda: f64,
    /// Effective degrees of freedom per output: from the number of nodes (passes through all) down to rank + 1 (affine).
    pub freedom: f64,
    /// Root mean square of what is left at the nodes.
    pub residual: f64,
    /// Largest way between merged pairs and their mean: they contradict each other by that much.
    pub conflict: f64,
    /// What somebody should know of.
    pub warnings: Vec<String>,
}

/// Why a spline cannot be fitted.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FitError {
    /// A pair that is not finite, of another length, or without weight.
    #[error("pair {pair}: {message}")]
    Pair {
        /// Index of the pair.
        pair: usize,
        /// What was found and what would be right.
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
    /// Kernels that cannot be told apart.
    #[error("nodes lie too close together for lambda {lambda}; a larger one is needed")]
    Singular {
        /// lambda as used.
        lambda: f64,
    },
}

/// Fits a warp of `d` dimensions to pairs: it minimises `sum weight |W(from) - to|^2 + lambda` times the bending energy.
///
/// Pairs that start in one place (nearer than 1e-9 of the spread) become one node at their mean, which changes nothing for
/// lambda above 0. Directions in which the nodes spread less than a hundredth of the widest are taken as noise: the nodes are
/// put on the line or plane of the others, and the affine part leaves those directions alone. No pair gives the identity, one a
/// shift.
///
/// # Errors
/// Numbers that are not finite, weights or lambda out of range, more than [`MAX_NODES`] nodes, or nodes that double precision
/// cannot tell apart.
///
/// # Complexity
/// O(n^3) once, then O(n) for every lambda tried.
///
/// # Example
/// ```
/// use foley_nodes::warp::{Pair, Stiffness, Warper, fit};
///
/// let pair = |from: [f64; 2], to: [f64; 2]| Pair { from: from.into(), to: to.into(), weight: 1.0 };
/// let pairs = [pair([0.0, 0.0], [1.0, 0.0]), pair([1.0, 0.0], [2.0, 0.0]), pair([0.0, 1.0], [1.0, 1.0])];
/// let (warp, report) = fit(&pairs, 2, Stiffness::Lambda(1.0))?;
/// let mut out = [0.0; 2];
/// Warper::new(&warp).warp(&[3.0, 5.0], &mut out);
/// assert!((out[0] - 4.0).abs() < 1e-5 && (out[1] - 5.0).abs() < 1e-5);
/// assert_eq!(report.nodes, 3);
/// # Ok::<(), foley_nodes::warp::FitError>(())
/// ```
pub fn fit(pairs: &[Pair], d: usize, stiffness: Stiffness) -> Result<(Tps, FitReport), FitError> {
    Problem::new(pairs, d)?.fit(stiffness)
}

#[cfg(test)]
mod tests;
