//! Fits a thin-plate spline to pairs of vectors.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::kernel::thin_plate;
use super::linear::{Reflection, Tridiagonal, principal};
use super::tps::Tps;

/// Most nodes of one fit: the time goes with their cube.
pub const MAX_NODES: usize = 3000;
/// Nodes nearer than this, relative to the scale of all, are one.
const SAME: f64 = 1e-9;
/// Directions whose spread is below this, relative to the widest, are not there.
///
/// Loudness spreads over some twenty units of feature space, and features of one sound differ by tenths: what is thinner than a
/// hundredth of the widest is noise, and a slope fitted to it would throw everything beside the nodes anywhere.
const FLAT: f64 = 1e-2;

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

/// Merged nodes in centred and scaled coordinates, `[n, d]` each.
#[derive(Debug)]
struct Nodes {
    centre: Vec<f64>,
    scale: f64,
    points: Vec<f64>,
    moves: Vec<f64>,
    weights: Vec<f64>,
    /// Node of each pair.
    of_pair: Vec<usize>,
    conflict: f64,
    /// Directions in which the nodes spread, `[rank][d]`; they lie in no other.
    directions: Vec<Vec<f64>>,
}

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

/// Directions in which scaled points spread, the widest first.
fn spread_directions(points: &[f64], d: usize) -> Vec<Vec<f64>> {
    let found = principal(points, d);
    let widest = found.first().map_or(0.0, |(s, _)| *s);
    // Points in one place are not scaled, and spread by rounding alone.
    let least = SAME * (points.len() as f64 / d.max(1) as f64).sqrt();
    found.into_iter().filter(|(s, _)| *s > FLAT * widest && *s > least).map(|(_, v)| v).collect()
}

impl Nodes {
    /// Centred and scaled pairs; those that start in one place become one where `merge` says so.
    fn of(pairs: &[Pair], d: usize, merge: bool) -> Self {
        let n = pairs.len().max(1) as f64;
        let centre: Vec<f64> = (0..d).map(|i| pairs.iter().map(|p| p.from[i]).sum::<f64>() / n).collect();
        let square = pairs.iter().flat_map(|p| p.from.iter().zip(&centre)).map(|(x, c)| (x - c).powi(2));
        let spread = (square.sum::<f64>() / n).sqrt();
        let size = pairs.iter().flat_map(|p| &p.from).fold(0.0_f64, |m, x| m.max(x.abs()));
        // Points that differ by rounding alone are one point.
        let scale = if spread > 1e-12 * size { spread } else { 1.0 };
        let mut this = Self {
            centre,
            scale,
            points: Vec::new(),
            moves: Vec::new(),
            weights: Vec::new(),
            of_pair: Vec::new(),
            conflict: 0.0,
            directions: Vec::new(),
        };
        let all: Vec<f64> = pairs.iter().flat_map(|p| this.scaled(p)).collect();
        this.directions = spread_directions(&all, d);
        pairs.iter().for_each(|p| this.add(p, d, merge));
        this.conflict = pairs.iter().zip(&this.of_pair).fold(0.0, |most, (p, node)| {
            let mean = &this.moves[node * d..(node + 1) * d];
            let way = p.from.iter().zip(&p.to).zip(mean).map(|((x, u), m)| (u - x - m).powi(2)).sum::<f64>();
            f64::max(most, way.sqrt())
        });
        this
    }

    fn scaled(&self, pair: &Pair) -> Vec<f64> {
        pair.from.iter().zip(&self.centre).map(|(x, c)| (x - c) / self.scale).collect()
    }

    /// A point without its part along directions that are not there: the kernels need side conditions along all others.
    fn flattened(&self, point: Vec<f64>) -> Vec<f64> {
        if self.directions.len() == point.len() {
            return point;
        }
        let mut flat = vec![0.0; point.len()];
        for direction in &self.directions {
            let along: f64 = point.iter().zip(direction).map(|(x, v)| x * v).sum();
            flat.iter_mut().zip(direction).for_each(|(x, v)| *x += along * v);
        }
        flat
    }

    fn add(&mut self, pair: &Pair, d: usize, merge: bool) {
        let point = self.flattened(self.scaled(pair));
        let near = |p: &[f64]| p.iter().zip(&point).map(|(a, b)| (a - b).powi(2)).sum::<f64>() <= SAME * SAME;
        let moved = pair.to.iter().zip(&pair.from).map(|(u, x)| u - x);
        let known = if merge { self.points.chunks_exact(d).position(near) } else { None };
        match known {
            Some(node) => {
                let total = self.weights[node] + pair.weight;
                for (mean, v) in self.moves[node * d..].iter_mut().zip(moved) {
                    *mean += pair.weight / total * (v - *mean);
                }
                self.weights[node] = total;
                self.of_pair.push(node);
            }
            None => {
                self.of_pair.push(self.weights.len());
                self.points.extend(point);
                self.moves.extend(moved);
                self.weights.push(pair.weight);
            }
        }
    }

    fn len(&self) -> usize {
        self.weights.len()
    }

    fn distance(&self, d: usize, i: usize, j: usize) -> f64 {
        let (a, b) = (&self.points[i * d..(i + 1) * d], &self.points[j * d..(j + 1) * d]);
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
    }

    /// Kernels between all nodes, each times the roots of both weights.
    fn kernels(&self, d: usize, roots: &[f64]) -> Vec<f64> {
        let n = self.len();
        let mut k = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..i {
                let u = roots[i] * roots[j] * thin_plate(self.distance(d, i, j));
                (k[i * n + j], k[j * n + i]) = (u, u);
            }
        }
        k
    }

    /// Mean distance of two nodes, in plain units.
    fn mean_distance(&self, d: usize) -> f64 {
        let n = self.len();
        let all: f64 = (0..n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| self.distance(d, i, j).sqrt())
            .sum();
        self.scale * all / (n * n.saturating_sub(1) / 2).max(1) as f64
    }
}

/// A problem taken apart once, so that every lambda is then solved in O(n).
///
/// With the roots of the weights multiplied into rows and columns, `K + lambda D` becomes `K + lambda`. Reflections make the
/// columns of P upper triangular; what they leave of K is positive definite, and further ones make it tridiagonal.
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
    kernels: Vec<f64>,
    reflections: Vec<Reflection>,
    /// Upper triangle of the reflected P, column by column.
    triangle: Vec<Vec<f64>>,
    form: Tridiagonal,
    /// Reflected moves, `[d][n]`.
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

    /// One node per pair, for those who leave pairs out.
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
        let axis = |k: usize| (0..n).map(|i| f64::from(u8::from(i == k))).collect();
        let mut rest: Vec<Vec<f64>> = (0..n).map(|k| self.reflected(axis(k)).split_off(p)).collect();
        self.form.solve(self.scaled_lambda(lambda), &mut rest)?;
        let row = |g: Vec<f64>| self.unreflected(std::iter::repeat_n(0.0, p).chain(g).collect());
        let matrix = rest.into_iter().flat_map(row).collect();
        Some((matrix, self.solve(lambda)?.scaled))
    }

    fn of(pairs: &[Pair], d: usize, merge: bool) -> Result<Self, FitError> {
        check(pairs, d)?;
        let nodes = Nodes::of(pairs, d, merge);
        let n = nodes.len();
        if n > MAX_NODES {
            return Err(FitError::TooMany { found: n });
        }
        let roots: Vec<f64> = nodes.weights.iter().map(|w| w.sqrt()).collect();
        let kernels = nodes.kernels(d, &roots);
        let mut this = Self {
            d,
            moves: Vec::new(),
            triangle: Vec::new(),
            form: Tridiagonal::default(),
            reflections: Vec::new(),
            kernels,
            roots,
            nodes,
        };
        let mut matrix = this.kernels.clone();
        for k in 0..this.polynomials().min(n) {
            let mut column = this.polynomial(k);
            this.reflections.iter().for_each(|r| r.apply(&mut column));
            let (reflection, onto) = Reflection::onto_axis(k, &column[k..]);
            reflection.apply_both(&mut matrix, n);
            column.truncate(k);
            column.push(onto);
            this.triangle.push(column);
            this.reflections.push(reflection);
        }
        let start = this.triangle.len();
        this.form = Tridiagonal::of(&mut matrix, n, start, &mut this.reflections);
        this.moves = (0..d).map(|i| this.reflected(this.scaled_moves(i))).collect();
        Ok(this)
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

    /// Solves for one lambda (plain units).
    pub fn solve(&self, lambda: f64) -> Option<Solution> {
        let (n, p) = (self.nodes.len(), self.triangle.len());
        let scaled_lambda = self.scaled_lambda(lambda);
        let mut rest: Vec<Vec<f64>> = self.moves.iter().map(|m| m[p..].to_vec()).collect();
        let trace = self.form.solve(scaled_lambda, &mut rest)?;
        let scaled = rest.into_iter().map(|g| {
            let mut all = vec![0.0; p];
            all.extend(g);
            self.unreflected(all)
        });
        Some(Solution {
            scaled: scaled.collect(),
            freedom: n as f64 - scaled_lambda * trace,
            lambda: scaled_lambda,
        })
    }

    /// Weighted sum of squares of what is left at the nodes, over all outputs.
    fn left(&self, solution: &Solution) -> f64 {
        let squares: f64 = solution.scaled.iter().flatten().map(|w| w * w).sum();
        solution.lambda * solution.lambda * squares
    }

    /// The lambda of least n RSS / (n - freedom)^2, among those with freedom below 0.9 n.
    fn cross_validated(&self) -> f64 {
        let n = self.nodes.len() as f64;
        let grid = (0..=36).map(|k| 10_f64.powf(-2.0 + f64::from(k) / 4.0));
        let scored = grid.filter_map(|lambda| {
            let solution = self.solve(lambda)?;
            let free = n - solution.freedom;
            (solution.freedom < 0.9 * n).then(|| (n * self.left(&solution) / (free * free), lambda))
        });
        scored.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(1e7, |(_, lambda)| lambda)
    }

    fn lambda(&self, stiffness: Stiffness) -> Result<f64, FitError> {
        let lambda = match stiffness {
            Stiffness::Lambda(lambda) => lambda,
            Stiffness::ScaleFree(free) => free * self.nodes.mean_distance(self.d).powi(2),
            Stiffness::Auto if self.form.diagonal.is_empty() => 0.0,
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
            for (k, left) in left.iter_mut().enumerate() {
                let row = &self.kernels[k * n..(k + 1) * n];
                *left -= row.iter().zip(w).map(|(k, w)| k * w).sum::<f64>() + solution.lambda * w[k];
            }
            let mut a = self.reflected(left);
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
            1 => warnings.push("there is one node: the warp shifts everything alike".to_owned()),
            _ if rank < self.d => {
                let on = match rank {
                    1 => "a line",
                    2 => "a plane",
                    _ => "a flat",
                };
                warnings.push(format!(
                    "the {n} nodes lie on {on}, or nearly so: they spread in {rank} of {} directions, and the affine part of the warp, \
                     of rank {rank}, leaves the others alone",
                    self.d
                ));
            }
            _ => {}
        }
        if lambda == 0.0 && self.nodes.conflict > 0.0 {
            warnings.push(format!(
                "pairs that start in one place lead up to {:.3} away from their mean, which is where they go",
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

/// In how many directions the starts of pairs spread.
pub(super) fn rank(pairs: &[Pair], d: usize) -> usize {
    Nodes::of(pairs, d, false).directions.len()
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
