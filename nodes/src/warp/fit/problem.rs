//! The linear algebra of a fit: factored once, solved for any stiffness, and for any nodes left out.

use super::nodes::Nodes;
use super::report::{FitError, FitReport, MAX_NODES, Stiffness};
use crate::warp::spline::cholesky::Cholesky;
use crate::warp::spline::linear::{Reflection, Tridiagonal, dot};
use crate::warp::spline::{Pair, Tps};
use std::sync::OnceLock;

fn check(pairs: &[Pair], d: usize) -> Result<(), FitError> {
    for (pair, p) in pairs.iter().enumerate() {
        let wrong = |message: String| Err(FitError::Pair { pair, message });
        if p.from.len() != d || p.to.len() != d {
            return wrong(format!("vectors of {} and {} numbers; {d} are needed", p.from.len(), p.to.len()));
        }
        if let Some(x) = p.from.iter().chain(&p.to).find(|x| !x.is_finite()) {
            return wrong(format!("a vector holds {x}; only finite numbers can be used"));
        }
        if !(p.weight > 0.0 && p.weight.is_finite()) {
            return wrong(format!("the weight is {}; a finite number above 0 is needed", p.weight));
        }
    }
    Ok(())
}

/// A problem factored once, so that every lambda is then solved in O(n), and any nodes are left out in O(n^2).
///
/// With the roots of the weights multiplied into rows and columns, `K + lambda D` becomes `K + lambda`. Reflections make the
/// columns of P upper triangular; what they leave of K is positive definite, and further ones make it tridiagonal. One lambda alone
/// needs no more than a factor of what is left.
///
/// # Source
/// Wahba, "Spline Models for Observational Data" (1990), sections 1.4 and 2.4, for the null-space form; Golub and Van Loan,
/// section 8.3, for the tridiagonal form.
#[derive(Debug)]
pub(crate) struct Problem {
    d: usize,
    nodes: Nodes,
    /// Roots of the weights.
    roots: Vec<f64>,
    reflections: Vec<Reflection>,
    /// Upper triangle of the reflected P, column by column.
    triangle: Vec<Vec<f64>>,
    /// Reflected kernels: positive definite without the rows and columns of the triangle. In the columns of the triangle
    /// the entries below it are not valid.
    reduced: Vec<f64>,
    form: OnceLock<Form>,
}

/// Further reflections and their remainder, which make every lambda cheap.
#[derive(Debug)]
struct Form {
    matrix: Tridiagonal,
    reflections: Vec<Reflection>,
    /// Reflected moves without the entries of the triangle, `[d][n - p]`.
    moves: Vec<Vec<f64>>,
}

/// One solution: kernel weights times the roots `[d][n]`, and degrees of freedom.
pub(crate) struct Solution {
    pub scaled: Vec<Vec<f64>>,
    pub freedom: f64,
    /// lambda in scaled coordinates.
    lambda: f64,
}

impl Problem {
    pub fn new(pairs: &[Pair], d: usize) -> Result<Self, FitError> {
        Self::of(pairs, d, true)
    }

    /// Creates a problem with one node per pair, for leaving pairs out.
    pub fn unmerged(pairs: &[Pair], d: usize) -> Result<Self, FitError> {
        Self::of(pairs, d, false)
    }

    /// Directions in which the nodes spread.
    pub fn rank(&self) -> usize {
        self.nodes.directions.len()
    }

    /// Square of the unit of the scaled coordinates.
    pub fn squared_scale(&self) -> f64 {
        self.nodes.scale * self.nodes.scale
    }

    /// `M = Q2 (Q2^T (K + lambda) Q2)^-1 Q2^T`, `[n, n]`, and `M v` for each output.
    pub fn inverse(&self, lambda: f64) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let (n, p) = (self.nodes.len(), self.triangle.len());
        let m = n - p;
        let core = self.factored(lambda)?.inverse();
        let mut matrix = vec![0.0; n * n];
        for (row, inverse) in matrix.chunks_exact_mut(n.max(1)).skip(p).zip(core.chunks_exact(m.max(1))) {
            row[p..].copy_from_slice(inverse);
        }
        // Backwards, each reaches all that is not zero.
        self.reflections.iter().rev().for_each(|r| r.apply_both(&mut matrix, n));
        let product = |v: &Vec<f64>| matrix.chunks_exact(n.max(1)).map(|row| dot(row, v)).collect();
        let moved = (0..self.d).map(|i| product(&self.scaled_moves(i))).collect();
        Some((matrix, moved))
    }

    /// `Q2^T (K + lambda) Q2` as a product.
    fn factored(&self, lambda: f64) -> Option<Cholesky> {
        let (n, p) = (self.nodes.len(), self.triangle.len());
        let rows: Vec<&[f64]> = self.reduced.chunks_exact(n.max(1)).skip(p).map(|row| &row[p..]).collect();
        Cholesky::of(&rows, self.scaled_lambda(lambda))
    }

    /// Degrees of freedom, from the matrix of [`Problem::inverse`].
    pub fn freedom(&self, matrix: &[f64], lambda: f64) -> f64 {
        let n = self.nodes.len();
        let trace: f64 = (0..n).filter_map(|k| matrix.get(k * n + k)).sum();
        n as f64 - self.scaled_lambda(lambda) * trace
    }

    fn of(pairs: &[Pair], d: usize, merge: bool) -> Result<Self, FitError> {
        check(pairs, d)?;
        let nodes = Nodes::of(pairs, d, merge);
        let n = nodes.len();
        if n > MAX_NODES {
            return Err(FitError::TooMany { found: n });
        }
        let roots: Vec<f64> = nodes.weights.iter().map(|w| w.sqrt()).collect();
        let mut this = Self {
            d,
            triangle: Vec::new(),
            reflections: Vec::new(),
            reduced: nodes.kernels(d, &roots),
            form: OnceLock::new(),
            roots,
            nodes,
        };
        for k in 0..this.polynomials().min(n) {
            let mut column = this.polynomial(k);
            this.reflections.iter().for_each(|r| r.apply(&mut column));
            let (reflection, onto) = Reflection::onto_axis(k, &column[k..]);
            // The rows above are those of the triangle.
            this.reduced.chunks_exact_mut(n).take(k).for_each(|row| reflection.apply(row));
            reflection.apply_both(&mut this.reduced, n);
            column.truncate(k);
            column.push(onto);
            this.triangle.push(column);
            this.reflections.push(reflection);
        }
        Ok(this)
    }

    /// Form for many lambdas, made at its first use: a single lambda is faster without it.
    fn form(&self) -> &Form {
        self.form.get_or_init(|| {
            let (n, p) = (self.nodes.len(), self.triangle.len());
            let mut reflections = Vec::new();
            let matrix = Tridiagonal::of(&mut self.reduced.clone(), n, p, &mut reflections);
            let reflect = |i: usize| {
                let mut moves = self.reflected(self.scaled_moves(i));
                reflections.iter().for_each(|r| r.apply(&mut moves));
                moves.split_off(p.min(n))
            };
            let moves = (0..self.d).map(reflect).collect();
            Form { matrix, reflections, moves }
        })
    }

    /// Columns of P: a constant and the directions.
    fn polynomials(&self) -> usize {
        if self.nodes.len() == 0 { 0 } else { 1 + self.rank() }
    }

    fn polynomial(&self, k: usize) -> Vec<f64> {
        let along = |point: &[f64]| match k.checked_sub(1).and_then(|k| self.nodes.directions.get(k)) {
            Some(direction) => point.iter().zip(direction).map(|(x, v)| x * v).sum(),
            None => 1.0,
        };
        self.nodes.points.chunks_exact(self.d).zip(&self.roots).map(|(p, root)| root * along(p)).collect()
    }

    /// Output `i` of the moves, times the roots.
    fn scaled_moves(&self, i: usize) -> Vec<f64> {
        self.nodes.moves.iter().skip(i).step_by(self.d).zip(&self.roots).map(|(v, root)| v * root).collect()
    }

    fn reflected(&self, mut x: Vec<f64>) -> Vec<f64> {
        self.reflections.iter().for_each(|r| r.apply(&mut x));
        x
    }

    /// Takes reflections back.
    fn unreflected(&self, mut x: Vec<f64>) -> Vec<f64> {
        self.reflections.iter().rev().for_each(|r| r.apply(&mut x));
        x
    }

    /// lambda in scaled coordinates: kernels shrink with the square of the scale.
    fn scaled_lambda(&self, lambda: f64) -> f64 {
        lambda / (self.nodes.scale * self.nodes.scale)
    }

    /// Solves for one lambda (plain units): by the form if there is one, otherwise by a factor, which is faster than making a form.
    pub fn solve(&self, lambda: f64) -> Option<Solution> {
        let (n, p) = (self.nodes.len(), self.triangle.len());
        let scaled_lambda = self.scaled_lambda(lambda);
        let form = self.form.get();
        let (rest, trace) = match form {
            Some(form) => {
                let mut rest = form.moves.clone();
                let trace = form.matrix.solve(scaled_lambda, &mut rest)?;
                (rest, trace)
            }
            None => {
                let factor = self.factored(lambda)?;
                let moves = |i: usize| self.reflected(self.scaled_moves(i)).split_off(p.min(n));
                let mut rest: Vec<Vec<f64>> = (0..self.d).map(moves).collect();
                factor.solve(&mut rest);
                (rest, factor.trace_of_inverse())
            }
        };
        let scaled = rest.into_iter().map(|g| {
            let mut all = vec![0.0; p];
            all.extend(g);
            form.iter().flat_map(|form| form.reflections.iter().rev()).for_each(|r| r.apply(&mut all));
            self.unreflected(all)
        });
        Some(Solution {
            scaled: scaled.collect(),
            freedom: n as f64 - scaled_lambda * trace,
            lambda: scaled_lambda,
        })
    }

    /// Weighted sum of squared residuals at the nodes, over all outputs.
    fn left(&self, solution: &Solution) -> f64 {
        let squares: f64 = solution.scaled.iter().flatten().map(|w| w * w).sum();
        solution.lambda * solution.lambda * squares
    }

    /// The lambda of least n RSS / (n - freedom)^2, among those with freedom below 0.9 n.
    fn cross_validated(&self) -> f64 {
        let n = self.nodes.len() as f64;
        let grid = (0..=36).map(|k| 10_f64.powf(-2.0 + f64::from(k) / 4.0));
        // Each of many is then cheap to solve for.
        self.form();
        let scored = grid.filter_map(|lambda| {
            let solution = self.solve(lambda)?;
            let free = n - solution.freedom;
            (solution.freedom < 0.9 * n).then(|| (n * self.left(&solution) / (free * free), lambda))
        });
        scored.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(1e7, |(_, lambda)| lambda)
    }

    /// lambda in plain units.
    pub fn lambda(&self, stiffness: Stiffness) -> Result<f64, FitError> {
        let lambda = match stiffness {
            Stiffness::Lambda(lambda) => lambda,
            Stiffness::ScaleFree(free) => free * self.nodes.mean_distance(self.d).powi(2),
            Stiffness::Auto if self.nodes.len() == self.triangle.len() => 0.0,
            Stiffness::Auto => self.cross_validated(),
        };
        if lambda >= 0.0 && lambda.is_finite() { Ok(lambda) } else { Err(FitError::Lambda { found: lambda }) }
    }

    /// Constant and linear part: R A = Q1^T (v - e - (K + lambda) w), in coordinates of the vectors; `errors` is e at `rows`.
    fn affine(&self, solution: &Solution, rows: &[usize], errors: &[Vec<f64>]) -> Vec<f64> {
        let (d, n, p) = (self.d, self.nodes.len(), self.triangle.len());
        let mut affine = vec![0.0; (d + 1) * d];
        for (i, w) in solution.scaled.iter().enumerate() {
            let mut left = self.scaled_moves(i);
            for (row, e) in rows.iter().zip(errors.get(i).into_iter().flatten()) {
                left[*row] -= e;
            }
            left.iter_mut().zip(w).for_each(|(left, w)| *left -= solution.lambda * w);
            let mut a = self.reflected(left);
            let w = self.reflected(w.clone());
            for (a, row) in a.iter_mut().zip(self.reduced.chunks_exact(n.max(1))).take(p) {
                *a -= dot(row, &w);
            }
            for k in (0..p).rev() {
                let known: f64 = (k + 1..p).map(|j| self.triangle[j][k] * a[j]).sum();
                a[k] = (a[k] - known) / self.triangle[k][k];
            }
            for (k, &a) in a.iter().enumerate().take(p) {
                match k.checked_sub(1).and_then(|k| self.nodes.directions.get(k)) {
                    None => affine[i] += a,
                    Some(v) => v.iter().enumerate().for_each(|(j, v)| affine[(j + 1) * d + i] += a * v),
                }
            }
        }
        affine
    }

    /// The spline that is fitted to all but the nodes `rows`.
    ///
    /// With `(w, e)` such that `w = M (v - e)` is 0 at the rows and `e` elsewhere, w solves the problem without them.
    ///
    /// # Shapes
    /// `matrix: [n, n]` and `moved: [d][n]` as of [`Problem::inverse`]; `errors: [d][rows]`, `M_BB^-1 (M v)_B`.
    pub fn without(
        &self,
        rows: &[usize],
        errors: &[Vec<f64>],
        (matrix, moved): (&[f64], &[Vec<f64>]),
        lambda: f64,
    ) -> Tps {
        let n = self.nodes.len();
        let scaled = moved.iter().zip(errors).map(|(moved, errors)| {
            let mut w = moved.clone();
            for (row, e) in rows.iter().zip(errors) {
                let column = matrix.iter().skip(row * n).take(n);
                w.iter_mut().zip(column).for_each(|(w, m)| *w -= m * e);
            }
            rows.iter().for_each(|row| w[*row] = 0.0);
            w
        });
        let solution =
            Solution { scaled: scaled.collect(), freedom: 0.0, lambda: self.scaled_lambda(lambda) };
        self.spline(&solution, rows, errors)
    }

    fn spline(&self, solution: &Solution, rows: &[usize], errors: &[Vec<f64>]) -> Tps {
        let (d, n) = (self.d, self.nodes.len());
        let mut weights = vec![0.0; n * d];
        for (i, scaled) in solution.scaled.iter().enumerate() {
            for (k, (w, root)) in scaled.iter().zip(&self.roots).enumerate() {
                weights[k * d + i] = w * root;
            }
        }
        let back = |(k, x): (usize, &f64)| self.nodes.centre[k % d] + self.nodes.scale * x;
        Tps {
            dims: d,
            centre: self.nodes.centre.clone(),
            scale: self.nodes.scale,
            nodes: self.nodes.points.iter().enumerate().map(back).collect(),
            weights,
            affine: self.affine(solution, rows, errors),
        }
    }

    fn warnings(&self, lambda: f64) -> Vec<String> {
        let (n, rank) = (self.nodes.len(), self.rank());
        let mut warnings = Vec::new();
        match n {
            0 => warnings.push("there is no pair: the warp changes nothing".to_owned()),
            1 => warnings.push("there is one node: the warp is a translation".to_owned()),
            _ if rank < self.d => {
                let on = match rank {
                    1 => "a line",
                    2 => "a plane",
                    _ => "a flat",
                };
                warnings.push(format!(
                    "the {n} nodes lie on {on}, or nearly so: they spread in {rank} of {} directions, and the affine part of the warp, \
                     of rank {rank}, does not change the others",
                    self.d
                ));
            }
            _ => {}
        }
        if lambda == 0.0 && self.nodes.conflict > 0.0 {
            warnings.push(format!(
                "pairs with the same start end up to {:.3} away from the mean of their ends, which the warp uses",
                self.nodes.conflict
            ));
        }
        warnings
    }

    /// Fits the spline.
    pub fn fit(&self, stiffness: Stiffness) -> Result<(Tps, FitReport), FitError> {
        let lambda = self.lambda(stiffness)?;
        let n = self.nodes.len();
        if n == 0 {
            let report = FitReport { warnings: self.warnings(lambda), ..FitReport::default() };
            return Ok((Tps::identity(self.d), report));
        }
        let solution = self.solve(lambda).ok_or(FitError::Singular { lambda })?;
        let total: f64 = self.nodes.weights.iter().sum();
        let report = FitReport {
            pairs: self.nodes.of_pair.len(),
            nodes: n,
            rank: self.rank(),
            lambda,
            freedom: solution.freedom,
            residual: (self.left(&solution) / total).sqrt(),
            conflict: self.nodes.conflict,
            warnings: self.warnings(lambda),
        };
        Ok((self.spline(&solution, &[], &[]), report))
    }
}
