//! Selection of exponentials from a dictionary by their inner products.
//!
//! A mode is `Re(a exp(s n))`: two real columns, `Re exp(s n)` and `Re i exp(s n)`, with the coefficients Re a and Im a. All inner products
//! of columns have closed forms, so that a selection costs one pass over the recording, whatever the number of modes.

use super::exponentials::{C, moments};
use faer::Mat;
use faer::linalg::solvers::Solve;

/// A 2 x 2 block: the inner products of the columns of two modes.
type Block = [[f64; 2]; 2];

/// Weight of the samples after the recording.
const AFTER: f64 = 0.02;
/// Share of a mode that must be linearly independent of the modes already selected.
const INDEPENDENT: f64 = 1e-4;

/// Inner products of `n^p Re(u exp(a n))` and `n^q Re(v exp(b n))`, given their moments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Products {
    /// Moments of `exp((conj a + b) n)`.
    difference: [C; 3],
    /// Moments of `exp((a + b) n)`.
    sum: [C; 3],
}

impl Products {
    pub(super) fn new(a: C, b: C, problem: &Problem) -> Self {
        let sums = |s: C| {
            let inside = moments(s, problem.count);
            if problem.after == 0 {
                return inside;
            }
            let all = moments(s, problem.count + problem.after);
            [0, 1, 2].map(|p| inside[p] * (1.0 - AFTER) + all[p] * AFTER)
        };
        Self { difference: sums(a.conj() + b), sum: sums(a + b) }
    }

    /// The inner product for `p + q = power`.
    pub(super) fn of(&self, power: usize, u: C, v: C) -> f64 {
        0.5 * (u.conj() * v * self.difference[power] + u * v * self.sum[power]).re
    }

    fn block(&self) -> Block {
        let units = [C::new(1.0, 0.0), C::new(0.0, 1.0)];
        units.map(|u| units.map(|v| self.of(0, u, v)))
    }
}

fn block(a: C, b: C, problem: &Problem) -> Block {
    Products::new(a, b, problem).block()
}

fn determinant([[a, b], [c, d]]: Block) -> f64 {
    a * d - b * c
}

fn inverse(m: Block) -> Option<Block> {
    let (det, [[a, b], [c, d]]) = (determinant(m), m);
    (det > 0.0 && det.is_finite()).then(|| [[d / det, -b / det], [-c / det, a / det]])
}

fn form(m: &Block, v: [f64; 2]) -> f64 {
    v[0] * (m[0][0] * v[0] + m[0][1] * v[1]) + v[1] * (m[1][0] * v[0] + m[1][1] * v[1])
}

/// Inner products of a recording with the columns of one mode.
pub(super) fn column_products(product: C) -> [f64; 2] {
    [product.re, product.im]
}

/// The inner products of a recording with exponentials.
#[derive(Clone, Copy, Debug)]
pub(super) struct Problem {
    /// Number of samples.
    pub(super) count: usize,
    /// Number of samples after those, in which the modes should be silent, with a small weight: the recording does not constrain them there,
    /// but modes that cancel each other within the recording only to ring after it do not exist.
    pub(super) after: usize,
    /// Penalty of the sum of squared amplitudes, which prevents modes from cancelling each other.
    pub(super) ridge: f64,
}

impl Problem {
    fn diagonal(&self, s: C) -> Block {
        let mut found = block(s, s, self);
        found[0][0] += self.ridge;
        found[1][1] += self.ridge;
        found
    }

    /// Indices of up to `max` exponentials, each of which explains the most beside those before it, while one explains more than its
    /// `threshold`.
    ///
    /// # Complexity
    /// O(candidates max^2).
    ///
    /// # Source
    /// Orthogonal least squares: Chen, Billings and Luo (Int. J. Control 50, 1989), here for pairs of columns by a Cholesky
    /// decomposition with 2 x 2 pivots.
    pub(super) fn forward(
        &self,
        exponents: &[C],
        products: &[C],
        thresholds: &[f64],
        max: usize,
    ) -> Vec<usize> {
        let mut schur: Vec<Block> = exponents.iter().map(|s| self.diagonal(*s)).collect();
        let first_det: Vec<f64> = schur.iter().map(|m| determinant(*m)).collect();
        let mut right: Vec<[f64; 2]> = products.iter().map(|p| column_products(*p)).collect();
        // factors[k][j]: block of the Cholesky factor for step k and candidate j.
        let mut factors: Vec<Vec<Block>> = Vec::new();
        let mut chosen = Vec::new();
        let mut left: Vec<bool> = vec![true; exponents.len()];
        while chosen.len() < max {
            let gain = |j: usize| {
                let det = determinant(schur[j]);
                let independent = left[j] && det > INDEPENDENT * INDEPENDENT * first_det[j];
                let gain =
                    independent.then(|| inverse(schur[j])).flatten().map_or(0.0, |m| form(&m, right[j]));
                if gain > thresholds[j] { gain } else { 0.0 }
            };
            let best = (0..exponents.len()).map(|j| (gain(j), j)).max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((best, pivot)) = best else { break };
            if best <= 0.0 {
                break;
            }
            left[pivot] = false;
            chosen.push(pivot);
            // The pivot is R^T R with R = [[a, b], [0, c]].
            let m = schur[pivot];
            let a = m[0][0].sqrt();
            let b = m[0][1] / a;
            let c = (m[1][1] - b * b).max(f64::MIN_POSITIVE).sqrt();
            let solve = |v: [f64; 2]| {
                let x = v[0] / a;
                [x, (v[1] - b * x) / c]
            };
            let w = solve(right[pivot]);
            let mut step = vec![[[0.0; 2]; 2]; exponents.len()];
            for j in (0..exponents.len()).filter(|j| left[*j]) {
                let mut cross = block(exponents[pivot], exponents[j], self);
                for earlier in &factors {
                    let (p, q) = (&earlier[pivot], &earlier[j]);
                    for r in 0..2 {
                        for s in 0..2 {
                            cross[r][s] -= p[0][r] * q[0][s] + p[1][r] * q[1][s];
                        }
                    }
                }
                let columns = [solve([cross[0][0], cross[1][0]]), solve([cross[0][1], cross[1][1]])];
                let l = [[columns[0][0], columns[1][0]], [columns[0][1], columns[1][1]]];
                for r in 0..2 {
                    for s in 0..2 {
                        schur[j][r][s] -= l[0][r] * l[0][s] + l[1][r] * l[1][s];
                    }
                    right[j][r] -= l[0][r] * w[0] + l[1][r] * w[1];
                }
                step[j] = l;
            }
            factors.push(step);
        }
        chosen
    }

    /// The Gram matrix of the columns, with the penalty.
    pub(super) fn gram(&self, exponents: &[C]) -> Mat<f64> {
        let mut gram = Mat::<f64>::zeros(2 * exponents.len(), 2 * exponents.len());
        for (i, a) in exponents.iter().enumerate() {
            for (j, b) in exponents.iter().enumerate().take(i + 1) {
                let m = if i == j { self.diagonal(*a) } else { block(*a, *b, self) };
                for (r, row) in m.iter().enumerate() {
                    for (s, x) in row.iter().enumerate() {
                        gram[(2 * i + r, 2 * j + s)] = *x;
                        gram[(2 * j + s, 2 * i + r)] = *x;
                    }
                }
            }
        }
        gram
    }

    /// The amplitudes that minimise the energy of the residual plus the penalty, and the difference of the minimum from the energy of the
    /// recording; `None` if the columns are linearly dependent.
    pub(super) fn amplitudes(&self, exponents: &[C], products: &[C]) -> Option<(Vec<C>, f64)> {
        let right = right_side(products);
        // Unit diagonals before the decomposition.
        let gram = self.gram(exponents);
        let scale: Vec<f64> = (0..gram.nrows()).map(|i| 1.0 / gram[(i, i)].sqrt()).collect();
        let scaled = Mat::from_fn(gram.nrows(), gram.ncols(), |i, j| gram[(i, j)] * scale[i] * scale[j]);
        let decomposition = scaled.llt(faer::Side::Lower).ok()?;
        let solution = decomposition.solve(&Mat::from_fn(right.len(), 1, |i, _| right[i] * scale[i]));
        let x: Vec<f64> = (0..right.len()).map(|i| solution[(i, 0)] * scale[i]).collect();
        let explained = x.iter().zip(&right).map(|(x, b)| x * b).sum();
        Some((x.chunks_exact(2).map(|x| C::new(x[0], x[1])).collect(), explained))
    }

    /// Indices of the exponentials that remain when, one after the other, the one that explains the least beside the others is removed:
    /// while there are more than `max`, or it explains less than its threshold.
    ///
    /// # Complexity
    /// O(exponentials^3).
    pub(super) fn backward(
        &self,
        exponents: &[C],
        products: &[C],
        thresholds: &[f64],
        max: usize,
    ) -> Vec<usize> {
        let gram = self.gram(exponents);
        let all: Vec<usize> = (0..exponents.len()).collect();
        let Ok(decomposition) = gram.llt(faer::Side::Lower) else { return all };
        let n = gram.nrows();
        let mut inverted = decomposition.solve(&Mat::<f64>::identity(n, n));
        let right = right_side(products);
        let mut x: Vec<f64> = (0..n).map(|i| (0..n).map(|j| inverted[(i, j)] * right[j]).sum()).collect();
        let mut left = all;
        loop {
            let own = |i: usize| {
                let at = |r: usize, s: usize| inverted[(2 * i + r, 2 * i + s)];
                inverse([[at(0, 0), at(0, 1)], [at(1, 0), at(1, 1)]])
            };
            let cost = |i: usize| own(i).map_or(0.0, |m| form(&m, [x[2 * i], x[2 * i + 1]]));
            let Some((cost, least)) = left.iter().map(|i| (cost(*i), *i)).min_by(|a, b| a.0.total_cmp(&b.0))
            else {
                return left;
            };
            if left.len() <= max && cost >= thresholds[least] {
                return left;
            }
            let Some(m) = own(least) else { return left };
            left.retain(|i| *i != least);
            let columns: Vec<[f64; 2]> =
                (0..n).map(|i| [inverted[(i, 2 * least)], inverted[(i, 2 * least + 1)]]).collect();
            let own_x = [x[2 * least], x[2 * least + 1]];
            let times = |v: [f64; 2]| [m[0][0] * v[0] + m[0][1] * v[1], m[1][0] * v[0] + m[1][1] * v[1]];
            let weights: Vec<[f64; 2]> = columns.iter().map(|v| times(*v)).collect();
            for &i in &left {
                for r in 0..2 {
                    let row = 2 * i + r;
                    x[row] -= weights[row][0] * own_x[0] + weights[row][1] * own_x[1];
                }
            }
            for &j in &left {
                for s in 0..2 {
                    let column = 2 * j + s;
                    for &i in &left {
                        for r in 0..2 {
                            let row = 2 * i + r;
                            inverted[(row, column)] -=
                                weights[row][0] * columns[column][0] + weights[row][1] * columns[column][1];
                        }
                    }
                }
            }
        }
    }
}

fn right_side(products: &[C]) -> Vec<f64> {
    products.iter().flat_map(|p| column_products(*p)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::exponentials::{add, energy, products};
    use super::*;

    fn exponents() -> Vec<C> {
        vec![
            C::new(-0.002, 0.3),
            C::new(-0.004, 0.31),
            C::new(-0.01, 1.1),
            C::new(-0.02, 2.0),
            C::new(-0.001, 0.9),
        ]
    }

    #[test]
    fn amplitudes_are_those_of_the_signal() {
        let s = exponents();
        let a: Vec<C> = (0..5).map(|k| C::new(1.0 - 0.3 * f64::from(k), 0.2)).collect();
        let mut x = vec![0.0; 2000];
        add(&mut x, &s, &a);
        let problem = Problem { count: x.len(), after: 0, ridge: 0.0 };
        let (found, explained) = problem.amplitudes(&s, &products(&x, &s)).unwrap();
        assert!(found.iter().zip(&a).all(|(x, y)| (x - y).norm() < 1e-9), "{found:?}");
        assert!((explained / energy(&x) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn selections_find_the_modes_of_a_signal_among_others() {
        let s = exponents();
        let mut x = vec![0.0; 2000];
        add(&mut x, &[s[1], s[3]], &[C::new(1.0, 0.0), C::new(0.0, 0.5)]);
        let problem = Problem { count: x.len(), after: 0, ridge: 0.0 };
        let (found, thresholds) = (products(&x, &s), vec![1e-9 * energy(&x); 5]);
        let mut forward = problem.forward(&s, &found, &thresholds, 5);
        let mut backward = problem.backward(&s, &found, &thresholds, 5);
        forward.sort_unstable();
        backward.sort_unstable();
        assert!(forward.len() <= 3 && forward.contains(&1) && forward.contains(&3), "{forward:?}");
        assert_eq!(backward, [1, 3]);
        assert_eq!(problem.backward(&s, &found, &[0.0; 5], 1), [1]);
    }

    #[test]
    fn what_a_mode_explains_is_what_its_removal_costs() {
        let s = exponents();
        let x: Vec<f64> = (0..1500)
            .map(|n| libm::sin(f64::from(n * n) * 1e-3) * libm::exp(-f64::from(n) / 300.0))
            .collect();
        let problem = Problem { count: x.len(), after: 0, ridge: 0.0 };
        let (all, explained) = problem.amplitudes(&s, &products(&x, &s)).unwrap();
        assert_eq!(all.len(), 5);
        let four = |i: usize| {
            let rest: Vec<C> = s.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, s)| *s).collect();
            explained - problem.amplitudes(&rest, &products(&x, &rest)).unwrap().1
        };
        let least = (0..5).min_by(|a, b| four(*a).total_cmp(&four(*b))).unwrap();
        let left = problem.backward(&s, &products(&x, &s), &[0.0; 5], 4);
        assert!(!left.contains(&least) && left.len() == 4);
    }
}
