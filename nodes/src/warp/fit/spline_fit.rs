//! Fits a thin-plate spline to pairs of vectors.

use super::problem::Problem;
use super::report::{FitError, FitReport, Stiffness};
use crate::warp::spline::{Pair, Tps};

/// Fits a warp of `d` dimensions to pairs: it minimises `sum weight |W(from) - to|^2 + lambda` times the bending energy.
///
/// Pairs that start at one point (nearer than 1e-9 of the spread) become one node at their mean, which changes nothing for
/// lambda above 0. Directions in which the nodes spread less than a hundredth of the widest are taken as noise: the nodes are
/// put on the line or plane of the others, and the affine part leaves those directions unchanged. Without pairs the warp is
/// the identity, with one pair a shift.
///
/// # Errors
/// Numbers that are not finite, weights or lambda out of range, more than `MAX_NODES` nodes, or nodes that double precision
/// cannot separate.
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
