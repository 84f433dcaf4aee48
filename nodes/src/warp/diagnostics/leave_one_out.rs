//! Leave-one-out residuals of correspondences.
//!
//! # Source
//! Wahba, "Spline Models for Observational Data" (1990), section 4.2, for residuals of points that are left out, here of whole blocks.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::warp::fit::nodes::rank;
use crate::warp::fit::problem::Problem;
use crate::warp::fit::{FitError, Stiffness, fit};
use crate::warp::spline::linear::solve_dense;
use crate::warp::spline::{Pair, Tps};

/// lambda that stands for 0 where pairs may start in one place, relative to the squared spread of the nodes.
const MIN_LAMBDA: f64 = 1e-9;

/// Leave-one-out score of a correspondence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Suspicion {
    /// Index in the set.
    pub correspondence: usize,
    /// Decrease without it of the squared errors of predicting the others from each other; the largest is the suspect.
    pub score: f64,
    /// Place by score, from 1.
    pub rank: usize,
    /// Error of its own mean when predicted from all others.
    pub surprise: f64,
    /// Correspondences that start near it and lead elsewhere.
    pub conflicts: Vec<usize>,
}

/// Mean of the columns of a block, and its squared length.
fn squared_mean(block: &[Vec<f64>], rows: std::ops::Range<usize>) -> f64 {
    let count = rows.len().max(1) as f64;
    block.iter().map(|output| (output[rows.clone()].iter().sum::<f64>() / count).powi(2)).sum()
}

/// A factored problem from which blocks of nodes are left out: `M = Q2 (Q2^T K Q2 + lambda)^-1 Q2^T` and `M v`.
///
/// Without the rows B the fit predicts them wrong by `M_BB^-1 (M v)_B`, for any lambda.
#[derive(Debug)]
pub struct LeaveOut<'a> {
    pairs: &'a [(usize, Pair)],
    d: usize,
    /// Requested lambda, and the lambda in use.
    lambda: f64,
    used: f64,
    problem: Problem,
    n: usize,
    matrix: Vec<f64>,
    /// `M v` per output.
    moved: Vec<Vec<f64>>,
    roots: Vec<f64>,
    /// Nodes per correspondence, with its index in the set.
    blocks: Vec<(usize, Vec<usize>)>,
}

impl<'a> LeaveOut<'a> {
    /// Factors the problem of all pairs, each with its correspondence.
    ///
    /// # Errors
    /// As [`fit`](crate::warp::fit()).
    pub fn new(pairs: &'a [(usize, Pair)], d: usize, lambda: f64) -> Result<Self, FitError> {
        let plain: Vec<Pair> = pairs.iter().map(|(_, pair)| pair.clone()).collect();
        let problem = Problem::unmerged(&plain, d)?;
        let used = lambda.max(MIN_LAMBDA * problem.squared_scale());
        let (matrix, moved) = problem.inverse(used).ok_or(FitError::Singular { lambda: used })?;
        let mut blocks: Vec<(usize, Vec<usize>)> = Vec::new();
        for (row, (correspondence, _)) in pairs.iter().enumerate() {
            match blocks.iter_mut().find(|(index, _)| index == correspondence) {
                Some((_, rows)) => rows.push(row),
                None => blocks.push((*correspondence, vec![row])),
            }
        }
        Ok(Self {
            pairs,
            d,
            lambda,
            used,
            problem,
            n: pairs.len(),
            matrix,
            moved,
            roots: plain.iter().map(|p| p.weight.sqrt()).collect(),
            blocks,
        })
    }

    /// The same with the lambda that a fit of all pairs would have.
    ///
    /// # Errors
    /// As [`fit`](crate::warp::fit()).
    pub fn as_stiff(pairs: &'a [(usize, Pair)], d: usize, stiffness: Stiffness) -> Result<Self, FitError> {
        let plain: Vec<Pair> = pairs.iter().map(|(_, pair)| pair.clone()).collect();
        let lambda = Problem::new(&plain, d)?.lambda(stiffness)?;
        Self::new(pairs, d, lambda)
    }

    fn rows(&self, blocks: &[usize]) -> Vec<usize> {
        blocks.iter().flat_map(|b| &self.blocks[*b].1).copied().collect()
    }

    /// Errors of predicting the rows of `blocks` from all others, per output; `None` if the others are too few.
    fn errors(&self, blocks: &[usize]) -> Option<Vec<Vec<f64>>> {
        let rows = self.rows(blocks);
        let mut errors = self.scaled_errors(&rows)?;
        for output in &mut errors {
            output.iter_mut().zip(&rows).for_each(|(e, row)| *e /= self.roots[*row]);
        }
        Some(errors)
    }

    /// The same times the roots of the weights.
    fn scaled_errors(&self, rows: &[usize]) -> Option<Vec<Vec<f64>>> {
        if self.n < rows.len() + self.d + 1 {
            return None;
        }
        let mut matrix: Vec<f64> =
            rows.iter().flat_map(|i| rows.iter().map(move |j| self.matrix[i * self.n + j])).collect();
        let mut right: Vec<Vec<f64>> =
            self.moved.iter().map(|moved| rows.iter().map(|row| moved[*row]).collect()).collect();
        let determinant = solve_dense(&mut matrix, rows.len(), &mut right);
        let usable = determinant.is_finite() && right.iter().flatten().all(|x| x.is_finite());
        usable.then_some(right)
    }

    /// The warp without one correspondence, in O(n^2) where its nodes do not hold a direction of their own.
    ///
    /// # Errors
    /// As [`fit`](crate::warp::fit()).
    pub fn without(&self, correspondence: usize) -> Result<Tps, FitError> {
        let quick = || {
            let block = self.blocks.iter().position(|(index, _)| *index == correspondence)?;
            let rows = self.rows(&[block]);
            let others = self.pairs.iter().filter(|(index, _)| *index != correspondence);
            let rest: Vec<Pair> = others.map(|(_, pair)| pair.clone()).collect();
            if rank(&rest, self.d) < self.problem.rank() {
                return None;
            }
            let errors = self.scaled_errors(&rows)?;
            Some(self.problem.without(&rows, &errors, (&self.matrix, &self.moved), self.used))
        };
        quick().map_or_else(|| without(self.pairs, correspondence, self.d, self.lambda), Ok)
    }

    /// The warp through all, and its degrees of freedom.
    ///
    /// # Errors
    /// As [`fit`](crate::warp::fit()).
    pub fn all(&self) -> Result<(Tps, f64), FitError> {
        if self.used == self.lambda {
            // Nothing is left out, in each of the outputs.
            let none = vec![Vec::new(); self.d];
            let tps = self.problem.without(&[], &none, (&self.matrix, &self.moved), self.used);
            return Ok((tps, self.problem.freedom(&self.matrix, self.used)));
        }
        let plain: Vec<Pair> = self.pairs.iter().map(|(_, pair)| pair.clone()).collect();
        fit(&plain, self.d, Stiffness::Lambda(self.lambda)).map(|(tps, report)| (tps, report.freedom))
    }

    /// Requested lambda.
    #[must_use]
    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// Squared error of the predicted mean of each of two blocks, if both are left out.
    fn both_left_out(&self, [a, b]: [usize; 2]) -> Option<[f64; 2]> {
        let errors = self.errors(&[a, b])?;
        let (first, all) = (self.blocks[a].1.len(), self.blocks[a].1.len() + self.blocks[b].1.len());
        Some([squared_mean(&errors, 0..first), squared_mean(&errors, first..all)])
    }

    /// Sum of the squared errors of all others, each predicted without block `k` as well; `None` if they are too few.
    fn left_without_each(&self) -> Vec<Option<f64>> {
        let count = self.blocks.len();
        let pairs: Vec<[usize; 2]> = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b])).collect();
        let found: Vec<Option<[f64; 2]>> = pairs.par_iter().map(|pair| self.both_left_out(*pair)).collect();
        let mut sums = vec![Some(0.0); count];
        for ([a, b], found) in pairs.into_iter().zip(found) {
            // The first is an error of a without b, so it counts for b.
            for (k, own) in [(b, 0), (a, 1)] {
                sums[k] = sums[k].zip(found).map(|(sum, found)| sum + found[own]);
            }
        }
        sums
    }

    /// Ranks correspondences; see [`suspicions`].
    #[must_use]
    pub fn suspicions(&self, near: f64) -> Vec<Suspicion> {
        let count = self.blocks.len();
        let left_out = |q: usize| Some(squared_mean(&self.errors(&[q])?, 0..self.blocks[q].1.len()));
        let alone: Vec<Option<f64>> = (0..count).into_par_iter().map(left_out).collect();
        let total: f64 = alone.iter().flatten().sum();
        let left = self.left_without_each();
        let centroids_of: Vec<[Vec<f64>; 2]> =
            self.blocks.iter().map(|(index, _)| centroids(self.pairs, *index, self.d)).collect();
        let suspicion = |k: usize| {
            let conflicts = (0..count).filter(|q| *q != k).filter(|q| {
                distance(&centroids_of[*q][0], &centroids_of[k][0]) < near
                    && distance(&centroids_of[*q][1], &centroids_of[k][1]) > 3.0 * near
            });
            Suspicion {
                correspondence: self.blocks[k].0,
                score: left[k].map_or(0.0, |left| total - left),
                rank: 0,
                surprise: alone[k].map_or(0.0, f64::sqrt),
                conflicts: conflicts.map(|q| self.blocks[q].0).collect(),
            }
        };
        let mut found: Vec<Suspicion> = (0..count).map(suspicion).collect();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| found[*b].score.total_cmp(&found[*a].score));
        for (index, k) in order.into_iter().enumerate() {
            found[k].rank = index + 1;
        }
        found
    }
}

fn centroids(pairs: &[(usize, Pair)], correspondence: usize, d: usize) -> [Vec<f64>; 2] {
    let own: Vec<&Pair> =
        pairs.iter().filter(|(index, _)| *index == correspondence).map(|(_, p)| p).collect();
    let centroid = |side: fn(&Pair) -> &Vec<f64>| {
        (0..d).map(|i| own.iter().map(|p| side(p)[i]).sum::<f64>() / own.len().max(1) as f64).collect()
    };
    [centroid(|p| &p.from), centroid(|p| &p.to)]
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Ranks correspondences by how much better the others predict each other without each.
///
/// A bad pair spoils the predictions of its neighbours, so its own prediction error shows less than the improvement
/// without it. Two correspondences are in conflict if their middles start nearer than `near` and lead farther apart
/// than `3 near`.
///
/// # Errors
/// As [`fit`](crate::warp::fit()).
///
/// # Complexity
/// O(n^3) once for all, then one small system per pair of correspondences.
pub fn suspicions(
    pairs: &[(usize, Pair)],
    d: usize,
    lambda: f64,
    near: f64,
) -> Result<Vec<Suspicion>, FitError> {
    Ok(LeaveOut::new(pairs, d, lambda)?.suspicions(near))
}

/// The warp without one correspondence.
///
/// # Errors
/// As [`fit`](crate::warp::fit()).
pub fn without(
    pairs: &[(usize, Pair)],
    correspondence: usize,
    d: usize,
    lambda: f64,
) -> Result<Tps, FitError> {
    let rest: Vec<Pair> =
        pairs.iter().filter(|(index, _)| *index != correspondence).map(|(_, pair)| pair.clone()).collect();
    fit(&rest, d, Stiffness::Lambda(lambda)).map(|(tps, _)| tps)
}

#[cfg(test)]
mod tests;
