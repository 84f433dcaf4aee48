//! The modes of free vibration below a frequency, with a proof that none is missing.

use super::super::mesh::error::TetMeshError;
use super::super::mesh::tet_mesh::TetMesh;
use super::assembly::Discretisation;
use super::block_matrix::BlockMatrix;
use super::dense;
use super::factor::Symbolic;
use super::lanczos::{BLOCK, Basis, Ritz};
use super::rigid::rigid_motions;
use crate::core::computation::Monitor;
use faer::{Mat, MatRef};
use std::f64::consts::TAU;
use thiserror::Error;

/// Relative distance of two eigenvalues between which a count is possible.
const GAP: f64 = 1e-6;
/// Relative difference up to which eigenvalues count as equal.
const EQUAL: f64 = 1e-9;
/// Rounding errors of `K phi`, in units of the rounding error of its terms, that a residual may have in addition.
const ROUNDING: f64 = 8.0;
/// Unknowns up to which dense matrices are used.
const DENSE: usize = 240;
/// Maximum number of steps, relative to the size of the basis.
const MAX_GROWTH: usize = 12;

/// Modes to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Modes below this frequency, Hz.
    pub highest: f64,
    /// Maximum number of modes: the lowest ones.
    pub max_modes: usize,
    /// Frequency of the shift, Hz: `s = -(2 pi f)^2` makes `K - s M` positive definite.
    pub shift: f64,
    /// Maximum of `|K phi - lambda M phi| / (lambda |M phi|)`, apart from the rounding errors of the product `K phi`.
    pub tolerance: f64,
    /// Maximum bytes of matrices, factors and vectors.
    pub memory: u64,
}

impl Default for Request {
    fn default() -> Self {
        Self { highest: 20_000.0, max_modes: 2000, shift: 100.0, tolerance: 1e-8, memory: 8 << 30 }
    }
}

/// Modes of free vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Eigenmodes {
    /// Squares of the angular frequencies in ascending order, rad^2/s^2.
    pub lambda: Vec<f64>,
    /// Shapes by columns, `[3 nodes, modes]`, orthonormal in the mass, kg^(-1/2); the largest component is positive.
    pub shapes: Mat<f64>,
    /// Number of modes below the highest frequency, by Sylvester's law of inertia.
    pub counted: usize,
    /// Largest `|K phi - lambda M phi| / (lambda |M phi|)`.
    pub residual: f64,
    /// Largest `|K r| / (|K| |r|)` of the motions of rigid bodies.
    pub rigid_residual: f64,
    /// Number of vectors that the iteration made.
    pub iterations: usize,
    /// Most bytes that matrices, factors and vectors took at once.
    pub memory: u64,
}

/// Error of the eigenvalue problem.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EigenError {
    /// A mesh that cannot be computed with.
    #[error(transparent)]
    Mesh(#[from] TetMeshError),
    /// More memory than allowed.
    #[error(
        "{unknowns} unknowns need {gigabytes:.2} GB; the limit is {limit:.2} GB: raise `memory`, lower `highest` or `modes`, or coarsen the mesh"
    )]
    Memory {
        /// Degrees of freedom.
        unknowns: usize,
        /// Required, GB.
        gigabytes: f64,
        /// Limit, GB.
        limit: f64,
    },
    /// A matrix that is not positive definite.
    #[error(
        "the stiffness is not positive definite: elements are too flat, or Poisson's ratio is too close to 0.5"
    )]
    Indefinite,
    /// No modes below the frequency.
    #[error("there is no mode below {highest} Hz: raise `highest`, or check the unit of the mesh")]
    None {
        /// The highest frequency, Hz.
        highest: f64,
    },
    /// The iteration ended before all modes were found.
    #[error("{found} of {wanted} modes have converged; the largest residual is {residual:e}")]
    NotConverged {
        /// Modes that have converged.
        found: usize,
        /// Modes below the highest frequency.
        wanted: usize,
        /// Largest relative residual.
        residual: f64,
    },
    /// The number of modes differs from the count.
    #[error("{found} modes were found, and {counted} counted by the signs of pivots")]
    MissedModes {
        /// Modes found.
        found: usize,
        /// Modes counted.
        counted: usize,
    },
    /// Motions of rigid bodies have elastic energy, or other motions have none.
    #[error("rigid motions have a residual of {residual:e}, where 1e-10 is expected: the mesh is damaged")]
    Rigid {
        /// Largest relative residual.
        residual: f64,
    },
    /// The caller stopped it.
    #[error("stopped")]
    Cancelled,
}

/// The modes of a mesh that are not motions of rigid bodies, below a frequency; `monitor` is called between steps.
///
/// # Errors
/// Memory above the limit before it is taken, modes that do not converge, and a number of modes that differs from the count.
///
/// # Complexity
/// A sparse Cholesky factor, about O(n^2) for solids, and some 2.5 solutions per mode.
pub fn eigenmodes(
    mesh: &TetMesh,
    space: &Discretisation,
    matrix: &BlockMatrix,
    request: &Request,
    monitor: &Monitor<'_>,
) -> Result<Eigenmodes, EigenError> {
    let rigid = rigid_motions(mesh, space, matrix)?;
    let rigid_residual = rigid_residual(matrix, &rigid);
    if rigid_residual > 1e-10 {
        return Err(EigenError::Rigid { residual: rigid_residual });
    }
    let limit = (TAU * request.highest).powi(2);
    let mut modes = if matrix.size() <= DENSE {
        small(matrix, &rigid, limit, request)?
    } else {
        Solver { matrix, rigid: &rigid, limit, request, monitor }.run()?
    };
    modes.rigid_residual = rigid_residual;
    if modes.lambda.is_empty() {
        return Err(EigenError::None { highest: request.highest });
    }
    if align_equal(&modes.lambda, &mut modes.shapes) {
        let all = residuals(matrix, &modes.lambda, modes.shapes.as_ref());
        modes.residual = all.iter().map(|r| r.relative).fold(0.0, f64::max);
    }
    fix_signs(&mut modes.shapes);
    Ok(modes)
}

/// Largest `|K r| / (|K| |r|)`, with `|K| |r|` taken component by component.
fn rigid_residual(matrix: &BlockMatrix, rigid: &Mat<f64>) -> f64 {
    let (force, bound) =
        (matrix.stiffness_times(rigid.as_ref()), matrix.absolute_stiffness_times(rigid.as_ref()));
    (0..rigid.ncols()).map(|j| norm(force.as_ref(), j) / norm(bound.as_ref(), j)).fold(0.0, f64::max)
}

fn norm(m: MatRef<'_, f64>, j: usize) -> f64 {
    m.col(j).iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Modes by dense matrices.
fn small(
    matrix: &BlockMatrix,
    rigid: &Mat<f64>,
    limit: f64,
    request: &Request,
) -> Result<Eigenmodes, EigenError> {
    let (values, vectors) = dense::all_modes(matrix).ok_or(EigenError::Indefinite)?;
    let skip = rigid.ncols();
    let elastic = &values[skip.min(values.len())..];
    let counted = elastic.iter().filter(|x| **x < limit).count();
    let below = values[..skip.min(values.len())].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if elastic.first().is_some_and(|first| below > GAP * first) {
        return Err(EigenError::Rigid { residual: below });
    }
    let count = counted.min(request.max_modes);
    let shapes = vectors.as_ref().subcols(skip, count).to_owned();
    let lambda = elastic[..count].to_vec();
    let residuals = residuals(matrix, &lambda, shapes.as_ref());
    let residual = residuals.iter().map(|r| r.relative).fold(0.0, f64::max);
    // Both matrices, their factor and the vectors.
    let memory = 4 * 8 * (matrix.size() as u64).pow(2);
    Ok(Eigenmodes { lambda, shapes, counted, residual, rigid_residual: 0.0, iterations: 0, memory })
}

struct Residual {
    /// Relative to `lambda |M phi|`.
    relative: f64,
    /// Rounding error of `K phi`, in the same unit.
    rounding: f64,
}

fn residuals(matrix: &BlockMatrix, lambda: &[f64], shapes: MatRef<'_, f64>) -> Vec<Residual> {
    /// Modes at once, which bounds the memory.
    const COLUMNS: usize = 32;
    let mut all = Vec::with_capacity(lambda.len());
    for (chunk, lambda) in lambda.chunks(COLUMNS).enumerate() {
        let x = shapes.subcols(chunk * COLUMNS, lambda.len());
        let mut force = matrix.stiffness_times(x);
        let (mass, bound) = (matrix.mass_times(x), matrix.absolute_stiffness_times(x));
        for (j, lambda) in lambda.iter().enumerate() {
            for i in 0..x.nrows() {
                force[(i, j)] -= lambda * mass[(i, j)];
            }
            let scale = lambda * norm(mass.as_ref(), j);
            all.push(Residual {
                relative: norm(force.as_ref(), j) / scale,
                rounding: f64::EPSILON * norm(bound.as_ref(), j) / scale,
            });
        }
    }
    all
}

/// Rotates the shapes of equal frequencies, as of bodies of revolution, which are determined up to a rotation only; returns true if there
/// are any.
///
/// At the component where they are largest together, all but the first are 0, and so on among the others. Results that depend on single
/// shapes, such as radiance, then follow from the mesh, not from the iteration.
fn align_equal(lambda: &[f64], shapes: &mut Mat<f64>) -> bool {
    let (mut first, mut any) = (0, false);
    while first < lambda.len() {
        let equal = lambda[first..].iter().take_while(|x| **x <= lambda[first] * (1.0 + EQUAL)).count();
        let end = first + equal;
        any |= equal > 1;
        for k in first..end.saturating_sub(1) {
            let square = |i: usize| (k..end).map(|j| shapes[(i, j)].powi(2)).sum::<f64>();
            let largest = (0..shapes.nrows()).map(square).fold(0.0, f64::max);
            // The first of those that are equal up to rounding.
            let Some(at) = (0..shapes.nrows()).find(|i| square(*i) > largest * (1.0 - 1e-6)) else {
                continue;
            };
            for j in k + 1..end {
                let (a, b) = (shapes[(at, k)], shapes[(at, j)]);
                let length = libm::hypot(a, b);
                if length == 0.0 {
                    continue;
                }
                let (c, s) = (a / length, b / length);
                for i in 0..shapes.nrows() {
                    let (x, y) = (shapes[(i, k)], shapes[(i, j)]);
                    shapes[(i, k)] = c * x + s * y;
                    shapes[(i, j)] = c * y - s * x;
                }
            }
        }
        first = end;
    }
    any
}

/// Makes the largest component of each shape positive: the first of those that are equal up to rounding.
fn fix_signs(shapes: &mut Mat<f64>) {
    for j in 0..shapes.ncols() {
        let largest = shapes.col(j).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let first = shapes.col(j).iter().find(|x| x.abs() > largest * (1.0 - 1e-6));
        if first.is_some_and(|x| *x < 0.0) {
            (0..shapes.nrows()).for_each(|i| shapes[(i, j)] = -shapes[(i, j)]);
        }
    }
}

/// Shares of the computation that are done when the first factor is computed, and when all modes have converged.
const FACTORED: f64 = 0.2;
const ITERATED: f64 = 0.9;

struct Solver<'a> {
    matrix: &'a BlockMatrix,
    rigid: &'a Mat<f64>,
    /// Modes below it are wanted, rad^2/s^2.
    limit: f64,
    request: &'a Request,
    monitor: &'a Monitor<'a>,
}

impl Solver<'_> {
    fn run(&self) -> Result<Eigenmodes, EigenError> {
        let size = self.matrix.size();
        let own = self.matrix.bytes();
        let symbolic = Symbolic::new(self.matrix).ok_or_else(|| self.too_large(u64::MAX))?;
        self.allow(own + symbolic.bytes())?;
        let shift = -(TAU * self.request.shift).powi(2);
        let count = || self.count(&symbolic, self.limit, 0.0);
        let factorise = || symbolic.cholesky(self.matrix, shift).ok_or(EigenError::Indefinite);
        // Both factors at once, where the memory and the threads are there.
        let both = own + 2 * symbolic.bytes();
        let together = rayon::current_num_threads() > 1 && self.allow(both).is_ok();
        let (counted, factor) = if together {
            let (counted, factor) = rayon::join(count, factorise);
            (counted?, Some(factor?))
        } else {
            (count()?, None)
        };
        if counted == 0 {
            return Err(EigenError::None { highest: self.request.highest });
        }
        // A few more than the maximum, to find a gap to count in.
        let wanted = if counted <= self.request.max_modes { counted } else { self.request.max_modes + 4 };
        let wanted = wanted.min(counted);
        let capacity = 2 * wanted + 10 * BLOCK;
        if 2 * capacity > size {
            let mut modes = small(self.matrix, self.rigid, self.limit, self.request)?;
            modes.counted = counted;
            let found = modes.lambda.len();
            return if found == counted.min(self.request.max_modes) {
                Ok(modes)
            } else {
                Err(EigenError::MissedModes { found, counted })
            };
        }
        let basis_bytes = 8 * (size * (capacity + wanted + 8 * BLOCK) + 4 * capacity * capacity);
        let iterating = own + symbolic.bytes() + basis_bytes as u64;
        self.allow(iterating)?;
        self.go_on(FACTORED / 2.0)?;
        let factor = factor.map_or_else(factorise, Ok)?;
        let mut basis = Basis::new(self.matrix, self.rigid, &factor, capacity);
        let mut modes = self.iterate(&mut basis, shift, wanted)?;
        drop(basis);
        drop(factor);
        self.prove(&symbolic, &mut modes, counted)?;
        modes.memory = if together { iterating.max(both) } else { iterating };
        Ok(modes)
    }

    fn too_large(&self, bytes: u64) -> EigenError {
        let gigabytes = |bytes: u64| bytes as f64 / f64::from(1 << 30);
        EigenError::Memory {
            unknowns: self.matrix.size(),
            gigabytes: gigabytes(bytes),
            limit: gigabytes(self.request.memory),
        }
    }

    fn allow(&self, bytes: u64) -> Result<(), EigenError> {
        if bytes > self.request.memory { Err(self.too_large(bytes)) } else { Ok(()) }
    }

    fn go_on(&self, done: f64) -> Result<(), EigenError> {
        if (self.monitor)(done) { Err(EigenError::Cancelled) } else { Ok(()) }
    }

    /// Number of elastic modes below an eigenvalue; moves it a little if a pivot is too small.
    fn count(&self, symbolic: &Symbolic, lambda: f64, done: f64) -> Result<usize, EigenError> {
        for attempt in 0..4 {
            self.go_on(done)?;
            let shifted = lambda * (1.0 - 1e-8 * f64::from(attempt));
            if let Some(count) = symbolic.count_below(self.matrix, shifted) {
                return Ok(count.saturating_sub(self.rigid.ncols()));
            }
        }
        Err(EigenError::Indefinite)
    }

    /// Iterates until the lowest `wanted` modes have converged and lie below the limit.
    fn iterate(&self, basis: &mut Basis<'_>, shift: f64, wanted: usize) -> Result<Eigenmodes, EigenError> {
        let (mut iterations, mut tolerance, mut next, mut stirred) = (0, 1e-9, wanted + wanted / 2, 0);
        let limit = MAX_GROWTH * (wanted + 12 * BLOCK);
        let (mut found, mut worst) = (0, f64::INFINITY);
        while iterations < limit {
            self.go_on(FACTORED + (ITERATED - FACTORED) * found as f64 / wanted as f64)?;
            basis.step();
            iterations += BLOCK;
            if !basis.is_full() && basis.len() < next {
                continue;
            }
            next = basis.len() + (wanted / 8).max(BLOCK);
            let Some(ritz) = basis.ritz() else { break };
            found = converged(&ritz, tolerance);
            if found >= wanted {
                let lambda: Vec<f64> = ritz.theta[..wanted].iter().map(|t| shift + 1.0 / t).collect();
                if lambda[wanted - 1] > self.limit && stirred < 2 {
                    // A mode of a frequency that several modes have is still missing.
                    stirred += 1;
                    basis.restart(&ritz, wanted);
                    basis.stir();
                    next = wanted + wanted / 4 + 2 * BLOCK;
                    continue;
                }
                let shapes = basis.vectors(&ritz, wanted);
                let residuals = residuals(self.matrix, &lambda, shapes.as_ref());
                worst = residuals.iter().map(|r| r.relative).fold(0.0, f64::max);
                let good = |r: &Residual| r.relative <= self.request.tolerance + ROUNDING * r.rounding;
                if residuals.iter().all(good) {
                    let (counted, residual) = (wanted, worst);
                    return Ok(Eigenmodes {
                        lambda,
                        shapes,
                        counted,
                        residual,
                        rigid_residual: 0.0,
                        iterations,
                        memory: 0,
                    });
                }
                tolerance *= 1e-2;
            }
            if basis.is_full() {
                let keep = wanted + (basis.len() - wanted) / 3;
                basis.restart(&ritz, keep.min(basis.len() - BLOCK));
                next = basis.len() + 2 * BLOCK;
            }
        }
        Err(EigenError::NotConverged { found: found.min(wanted), wanted, residual: worst })
    }

    /// Drops the modes beyond the limit or the maximum number, and compares the number of the others with a count.
    fn prove(&self, symbolic: &Symbolic, modes: &mut Eigenmodes, counted: usize) -> Result<(), EigenError> {
        let below = modes.lambda.iter().filter(|x| **x < self.limit).count();
        let mut keep = below.min(self.request.max_modes);
        // The count is certain where no eigenvalue is near.
        let above = |k: usize| modes.lambda.get(k).copied().unwrap_or(self.limit);
        while keep > 0 && above(keep) < modes.lambda[keep - 1] * (1.0 + GAP) {
            keep -= 1;
        }
        let certain = if keep == below && below == modes.lambda.len() {
            counted
        } else if keep == 0 {
            0
        } else {
            self.count(symbolic, 0.5 * (above(keep) + modes.lambda[keep - 1]), ITERATED)?
        };
        if certain != keep {
            return Err(EigenError::MissedModes { found: keep, counted: certain });
        }
        modes.lambda.truncate(keep);
        if modes.shapes.ncols() > keep {
            modes.shapes = modes.shapes.as_ref().subcols(0, keep).to_owned();
        }
        modes.counted = counted;
        Ok(())
    }
}

/// Number of Ritz values from the largest on that have converged without a gap.
fn converged(ritz: &Ritz, tolerance: f64) -> usize {
    ritz.theta.iter().zip(&ritz.error).take_while(|(theta, error)| **error <= tolerance * **theta).count()
}
