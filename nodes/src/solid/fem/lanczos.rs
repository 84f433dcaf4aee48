//! Block Lanczos iteration for the lowest modes.

use super::block_matrix::BlockMatrix;
use super::factor::Cholesky;
use crate::core::random::Random;
use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;
use std::ops::Range;

/// Vectors per step: modes of equal frequency appear together up to this number.
pub(super) const BLOCK: usize = 8;
/// Rows per task of a product; fixed, so that sums do not depend on the number of threads.
const ROWS: usize = 4096;
/// Length after orthogonalisation, relative to that before, at which a vector depends on the others.
const DEPENDENT: f64 = 1e-12;
/// Square of the length of a scaled vector after those before it were taken out, below which a Cholesky factor is too inexact.
const INEXACT: f64 = 1e-10;
/// Share of the vectors in a block below which one more pass leaves rounding errors only.
const ORTHOGONAL: f64 = 1e-6;
/// Maximum number of passes of the orthogonalisation.
const MAX_PASSES: usize = 5;

/// Lanczos basis of `B = (K - s M)^-1 M`, orthonormal in the mass and orthogonal to the motions of rigid bodies.
///
/// # Source
/// Shift and invert: Ericsson and Ruhe, "The spectral transformation Lanczos method" (Math. Comp. 35, 1980). Restarts: Wu and
/// Simon, "Thick-restart Lanczos method for large symmetric eigenvalue problems" (SIAM J. Matrix Anal. 22, 2000).
pub(super) struct Basis<'a> {
    matrix: &'a BlockMatrix,
    rigid: &'a Mat<f64>,
    factor: &'a Cholesky<'a>,
    /// `len` vectors and the next block.
    vectors: Mat<f64>,
    /// Number of vectors whose images are known.
    len: usize,
    /// First vector that has a share in the image of the next block: the last two blocks, or all after a restart.
    coupled: usize,
    /// `V^T M B V`.
    projected: Mat<f64>,
    /// The next block as a combination of the remaining images.
    coupling: Mat<f64>,
    random: Random,
    draws: u64,
}

/// Approximations of eigenvectors: `B x = theta x` up to `error`.
pub(super) struct Ritz {
    /// In descending order.
    pub(super) theta: Vec<f64>,
    /// Norm of `B x - theta x` in the mass.
    pub(super) error: Vec<f64>,
    /// Coefficients of each vector.
    coefficients: Mat<f64>,
}

/// Symmetric eigenvalue problem: values in ascending order, and vectors.
///
/// The matrix is scaled to entries of at most 1: tolerances of the divide-and-conquer method are absolute.
pub(super) fn symmetric(matrix: MatRef<'_, f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = matrix.nrows();
    let (mut values, mut vectors) = (Diag::zeros(n), Mat::zeros(n, n));
    let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    let (u, stack) = (Some(vectors.as_mut()), MemStack::new(&mut memory));
    let largest = (0..n).flat_map(|j| matrix.col(j).iter()).fold(0.0_f64, |m, x| m.max(x.abs()));
    let scale = if largest > 0.0 { largest } else { 1.0 };
    let scaled = Mat::from_fn(n, n, |i, j| matrix[(i, j)] / scale);
    self_adjoint_evd(scaled.as_ref(), values.as_mut(), u, Par::Seq, stack, Default::default()).ok()?;
    Some((values.column_vector().iter().map(|x| x * scale).collect(), vectors))
}

/// The upper `R` of a Gram matrix `R^T R`, and its inverse; `None` if the vectors almost depend on each other.
fn upper_factor(gram: &Mat<f64>) -> Option<(Mat<f64>, Mat<f64>)> {
    let n = gram.nrows();
    let (mut r, mut inverse) = (Mat::<f64>::zeros(n, n), Mat::<f64>::zeros(n, n));
    for j in 0..n {
        for i in 0..=j {
            let sum = gram[(i, j)] - (0..i).map(|k| r[(k, i)] * r[(k, j)]).sum::<f64>();
            if i < j {
                r[(i, j)] = sum / r[(i, i)];
            } else if sum > INEXACT * gram[(j, j)] && sum.is_finite() {
                r[(j, j)] = sum.sqrt();
            } else {
                return None;
            }
        }
    }
    for j in 0..n {
        inverse[(j, j)] = 1.0 / r[(j, j)];
        for i in (0..j).rev() {
            let sum: f64 = (i + 1..=j).map(|k| r[(i, k)] * inverse[(k, j)]).sum();
            inverse[(i, j)] = -sum / r[(i, i)];
        }
    }
    Some((r, inverse))
}

/// `A^T B` for tall matrices.
fn transposed_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let parts: Vec<Mat<f64>> = a
        .par_row_chunks(ROWS)
        .zip(b.par_row_chunks(ROWS))
        .map(|(a, b)| {
            let mut part = Mat::zeros(a.ncols(), b.ncols());
            matmul(part.as_mut(), Accum::Replace, a.transpose(), b, 1.0, Par::Seq);
            part
        })
        .collect();
    let mut sum = Mat::zeros(a.ncols(), b.ncols());
    for part in parts {
        sum += &part;
    }
    sum
}

/// `W + sign V H` in the memory of a tall `W`.
fn add_product(w: MatMut<'_, f64>, v: MatRef<'_, f64>, h: MatRef<'_, f64>, sign: f64) {
    w.par_row_chunks_mut(ROWS)
        .zip(v.par_row_chunks(ROWS))
        .for_each(|(w, v)| matmul(w, Accum::Add, v, h, sign, Par::Seq));
}

fn product(v: MatRef<'_, f64>, h: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(v.nrows(), h.ncols());
    add_product(out.as_mut(), v, h, 1.0);
    out
}

impl<'a> Basis<'a> {
    /// A basis of one block of random vectors, of at most `capacity` vectors.
    pub(super) fn new(
        matrix: &'a BlockMatrix,
        rigid: &'a Mat<f64>,
        factor: &'a Cholesky<'a>,
        capacity: usize,
    ) -> Self {
        let n = matrix.size();
        let mut basis = Self {
            matrix,
            rigid,
            factor,
            vectors: Mat::zeros(n, capacity + BLOCK),
            len: 0,
            coupled: 0,
            projected: Mat::zeros(capacity + BLOCK, capacity + BLOCK),
            coupling: Mat::zeros(BLOCK, BLOCK),
            random: Random::new(0, "lanczos"),
            draws: 0,
        };
        basis.stir();
        basis
    }

    /// Number of vectors.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// True if another step does not fit.
    pub(super) fn is_full(&self) -> bool {
        self.len + 2 * BLOCK > self.vectors.ncols()
    }

    fn noise(&mut self, columns: usize) -> Mat<f64> {
        self.draws += 1;
        let (random, draw) = (self.random, self.draws);
        Mat::from_fn(self.matrix.size(), columns, |i, j| 2.0 * random.uniform(i as u32, draw, j as u32) - 1.0)
    }

    /// Orthogonalises a block against the motions of rigid bodies and a range of the vectors; returns the shares of the vectors.
    fn remove(&self, w: &mut Mat<f64>, range: Range<usize>) -> Mat<f64> {
        let v = self.vectors.as_ref().subcols(range.start, range.len());
        let mass = self.matrix.mass_times(w.as_ref());
        let rigid = transposed_product(self.rigid.as_ref(), mass.as_ref());
        let share = transposed_product(v, mass.as_ref());
        add_product(w.as_mut(), self.rigid.as_ref(), rigid.as_ref(), -1.0);
        add_product(w.as_mut(), v, share.as_ref(), -1.0);
        share
    }

    /// Appends a block `W = V H + Q R` as the orthonormal `Q`, stores `R` and returns `H`.
    ///
    /// Only vectors from `coupled` on have a share in `W` apart from rounding errors; these are taken out by a second pass over all vectors.
    /// Vectors of `W` that have almost no part outside of `V` lose their orthogonality when they are scaled, so passes are repeated.
    fn append(&mut self, mut w: Mat<f64>, coupled: usize) -> Mat<f64> {
        let known = self.len;
        let mut shares = Mat::zeros(known, BLOCK);
        let share = self.remove(&mut w, coupled..known);
        shares.as_mut().subrows_mut(coupled, known - coupled).copy_from(&share);
        let mut r = self.orthonormalise(&mut w);
        for _ in 0..MAX_PASSES {
            let share = self.remove(&mut w, 0..known);
            let again = self.orthonormalise(&mut w);
            shares += &share * &r;
            r = again * r;
            let largest = (0..BLOCK).flat_map(|j| share.col(j).iter()).fold(0.0_f64, |m, x| m.max(x.abs()));
            if largest < ORTHOGONAL {
                break;
            }
        }
        self.vectors.as_mut().subcols_mut(known, BLOCK).copy_from(&w);
        self.coupling = r;
        shares
    }

    /// Makes the vectors of a block orthonormal: `W = Q R`.
    ///
    /// By the Cholesky factor of `W^T M W`, whose error the next pass removes; vectors that almost depend on each other one by one.
    ///
    /// # Source
    /// Yamamoto, Nakatsukasa, Yanagisawa and Fukaya, "Roundoff error analysis of the CholeskyQR2 algorithm" (ETNA 44, 2015).
    fn orthonormalise(&mut self, w: &mut Mat<f64>) -> Mat<f64> {
        let gram = transposed_product(w.as_ref(), self.matrix.mass_times(w.as_ref()).as_ref());
        let Some((r, inverse)) = upper_factor(&gram) else { return self.one_by_one(w) };
        *w = product(w.as_ref(), inverse.as_ref());
        r
    }

    /// [`orthonormalise`](Self::orthonormalise) by Gram and Schmidt. A vector that depends on the others is replaced by a random one.
    fn one_by_one(&mut self, w: &mut Mat<f64>) -> Mat<f64> {
        let mut r = Mat::zeros(BLOCK, BLOCK);
        for j in 0..BLOCK {
            let mut column = w.as_ref().subcols(j, 1).to_owned();
            let before = self.norm(column.as_ref());
            let others = w.as_ref().subcols(0, j);
            let mut length = self.without(&mut column, others, |i, share| r[(i, j)] += share);
            if length <= DEPENDENT * before || length == 0.0 {
                column = self.noise(1);
                length = self.without(&mut column, others, |_, _| {});
            } else {
                r[(j, j)] = length;
            }
            (0..column.nrows()).for_each(|i| w[(i, j)] = column[(i, 0)] / length);
        }
        r
    }

    fn norm(&self, w: MatRef<'_, f64>) -> f64 {
        transposed_product(w, self.matrix.mass_times(w).as_ref())[(0, 0)].max(0.0).sqrt()
    }

    /// Orthogonalises a vector against orthonormal ones, twice; returns the remaining share of its length.
    fn without(
        &self,
        column: &mut Mat<f64>,
        others: MatRef<'_, f64>,
        mut share: impl FnMut(usize, f64),
    ) -> f64 {
        for _ in 0..2 {
            let mass = self.matrix.mass_times(column.as_ref());
            let found = transposed_product(others, mass.as_ref());
            add_product(column.as_mut(), others, found.as_ref(), -1.0);
            (0..others.ncols()).for_each(|i| share(i, found[(i, 0)]));
        }
        self.norm(column.as_ref())
    }

    /// Adds a block.
    pub(super) fn step(&mut self) {
        let first = self.len;
        let mut w = self.matrix.mass_times(self.vectors.as_ref().subcols(first, BLOCK));
        self.factor.solve(w.as_mut());
        self.len += BLOCK;
        let shares = self.append(w, self.coupled);
        self.coupled = first;
        for j in 0..BLOCK {
            for i in 0..=first + j {
                self.projected[(i, first + j)] = shares[(i, j)];
                self.projected[(first + j, i)] = shares[(i, j)];
            }
        }
    }

    /// Ritz vectors of the basis; `None` if the small eigenvalue problem fails.
    pub(super) fn ritz(&self) -> Option<Ritz> {
        let m = self.len;
        let (values, vectors) = symmetric(self.projected.as_ref().submatrix(0, 0, m, m))?;
        let last = self.coupling.as_ref() * vectors.as_ref().subrows(m - BLOCK, BLOCK);
        let norm = |j: usize| (0..BLOCK).map(|i| last[(i, j)].powi(2)).sum::<f64>().sqrt();
        let coefficients = Mat::from_fn(m, m, |i, j| vectors[(i, m - 1 - j)]);
        Some(Ritz {
            theta: values.iter().rev().copied().collect(),
            error: (0..m).rev().map(norm).collect(),
            coefficients,
        })
    }

    /// Restarts with the first `keep` Ritz vectors.
    pub(super) fn restart(&mut self, ritz: &Ritz, keep: usize) {
        let y = ritz.coefficients.as_ref().subcols(0, keep);
        let m = self.len;
        self.vectors.as_mut().par_row_chunks_mut(ROWS).for_each(|mut rows| {
            let mut new = Mat::zeros(rows.nrows(), keep);
            matmul(new.as_mut(), Accum::Replace, rows.as_ref().subcols(0, m), y, 1.0, Par::Seq);
            let next = rows.as_ref().subcols(m, BLOCK).to_owned();
            rows.as_mut().subcols_mut(0, keep).copy_from(&new);
            rows.subcols_mut(keep, BLOCK).copy_from(&next);
        });
        self.projected.fill(0.0);
        (0..keep).for_each(|k| self.projected[(k, k)] = ritz.theta[k]);
        self.len = keep;
        self.coupled = 0;
    }

    /// Replaces the next block by random vectors, to find modes that all vectors so far are orthogonal to.
    pub(super) fn stir(&mut self) {
        let mut w = self.matrix.mass_times(self.noise(BLOCK).as_ref());
        self.factor.solve(w.as_mut());
        self.append(w, 0);
        self.coupled = 0;
    }

    /// The first `count` Ritz vectors, improved by one multiplication with `B`, whose result the basis contains.
    pub(super) fn vectors(&self, ritz: &Ritz, count: usize) -> Mat<f64> {
        let m = self.len;
        let y = ritz.coefficients.as_ref().subcols(0, count);
        let mut x = product(self.vectors.as_ref().subcols(0, m), y);
        let mut next = self.coupling.as_ref() * y.subrows(m - BLOCK, BLOCK);
        for j in 0..count {
            (0..BLOCK).for_each(|i| next[(i, j)] /= ritz.theta[j]);
        }
        add_product(x.as_mut(), self.vectors.as_ref().subcols(m, BLOCK), next.as_ref(), 1.0);
        x
    }
}
