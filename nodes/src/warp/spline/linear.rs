//! The linear algebra that a thin-plate fit needs: reflections, a tridiagonal form, singular values, determinants.

use fearless_simd::{Level, dispatch};

/// A reflection `1 - tau v v^T` that acts on the coordinates from `start` on.
#[derive(Clone, Debug)]
pub(crate) struct Reflection {
    start: usize,
    v: Vec<f64>,
    tau: f64,
}

/// Sum of products.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Sums that a processor adds at once, twice as many as it holds in a register so that one waits for the other.
    let mut sums = [0.0; 16];
    let (a16, a_rest) = a.as_chunks::<16>();
    let (b16, b_rest) = b.as_chunks::<16>();
    for (a, b) in a16.iter().zip(b16) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    for half in [8, 4, 2, 1] {
        (0..half).for_each(|k| sums[k] += sums[k + half]);
    }
    sums[0] + rest
}

impl Reflection {
    /// The reflection that turns `x` (the coordinates from `start` on) into a multiple of its first axis, and that multiple.
    pub fn onto_axis(start: usize, x: &[f64]) -> (Self, f64) {
        let largest = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        if largest == 0.0 || x.len() < 2 {
            return (Self { start, v: vec![0.0; x.len()], tau: 0.0 }, x.first().copied().unwrap_or(0.0));
        }
        let mut v: Vec<f64> = x.iter().map(|x| x / largest).collect();
        let norm = dot(&v, &v).sqrt();
        // Away from x, so that nothing cancels.
        let onto = if v[0] > 0.0 { -norm } else { norm };
        v[0] -= onto;
        let tau = 2.0 / dot(&v, &v);
        (Self { start, v, tau }, onto * largest)
    }

    /// Reflects a vector that starts at coordinate 0.
    pub fn apply(&self, x: &mut [f64]) {
        let x = &mut x[self.start..];
        let along = self.tau * dot(&self.v, x);
        x.iter_mut().zip(&self.v).for_each(|(x, v)| *x -= along * v);
    }

    /// Reflects the rows and columns from `start` on of a symmetric matrix of `n` rows.
    pub fn apply_both(&self, matrix: &mut [f64], n: usize) {
        if self.tau == 0.0 {
            return;
        }
        // All instruction sets compute the same bits.
        dispatch!(Level::new(), _simd => self.reflect_both(matrix, n));
    }

    #[inline(always)]
    fn reflect_both(&self, matrix: &mut [f64], n: usize) {
        let (start, v) = (self.start, &self.v);
        let row = |i: usize| (start + i) * n + start..(start + i + 1) * n;
        let mut q: Vec<f64> = (0..v.len()).map(|i| self.tau * dot(&matrix[row(i)], v)).collect();
        let half = 0.5 * self.tau * dot(&q, v);
        q.iter_mut().zip(v).for_each(|(q, v)| *q -= half * v);
        for i in 0..v.len() {
            let (vi, qi) = (v[i], q[i]);
            let entries = matrix[row(i)].iter_mut().zip(v.iter().zip(&q));
            entries.for_each(|(m, (v, q))| *m -= vi * q + qi * v);
        }
    }
}

/// A symmetric tridiagonal matrix.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Tridiagonal {
    pub diagonal: Vec<f64>,
    /// One shorter.
    pub beside: Vec<f64>,
}

impl Tridiagonal {
    /// Turns the rows and columns from `start` on of a symmetric matrix into this form; the reflections that do it are added to
    /// `reflections`.
    ///
    /// # Complexity
    /// 4/3 m^3 operations for m = n - start rows.
    pub fn of(matrix: &mut [f64], n: usize, start: usize, reflections: &mut Vec<Reflection>) -> Self {
        let mut this = Self::default();
        for k in start..n {
            this.diagonal.push(matrix[k * n + k]);
            if k + 1 < n {
                let (reflection, beside) = Reflection::onto_axis(k + 1, &matrix[k * n + k + 1..(k + 1) * n]);
                this.beside.push(beside);
                reflection.apply_both(matrix, n);
                reflections.push(reflection);
            }
        }
        this
    }

    /// Solves `(T + lambda) x = b` in place and returns the trace of `(T + lambda)^-1`; `None` where that is not positive
    /// definite.
    pub fn solve(&self, lambda: f64, right: &mut [Vec<f64>]) -> Option<f64> {
        let m = self.diagonal.len();
        let scale = self.diagonal.iter().fold(0.0_f64, |s, d| s.max(d.abs())) + lambda;
        let usable = |pivot: f64| (pivot > PIVOT * scale).then_some(pivot);
        // Pivots of the elimination from above and from below.
        let (mut down, mut up) = (vec![0.0; m], vec![0.0; m]);
        for k in 0..m {
            let coupling = if k > 0 { self.beside[k - 1].powi(2) / down[k - 1] } else { 0.0 };
            down[k] = usable(self.diagonal[k] + lambda - coupling)?;
        }
        for k in (0..m).rev() {
            let coupling = if k + 1 < m { self.beside[k].powi(2) / up[k + 1] } else { 0.0 };
            up[k] = usable(self.diagonal[k] + lambda - coupling)?;
        }
        for x in right {
            for k in 1..m {
                x[k] -= self.beside[k - 1] / down[k - 1] * x[k - 1];
            }
            for k in (0..m).rev() {
                let after = if k + 1 < m { self.beside[k] * x[k + 1] } else { 0.0 };
                x[k] = (x[k] - after) / down[k];
            }
        }
        Some((0..m).map(|k| 1.0 / (down[k] + up[k] - self.diagonal[k] - lambda)).sum())
    }
}

/// Pivots below this, relative to the largest diagonal entry, are zero but for rounding.
pub(super) const PIVOT: f64 = 1e-14;

/// Directions in which points spread, by one-sided Jacobi rotations: right singular vectors, each with its singular value, largest
/// first.
///
/// # Shapes
/// `points: [n, d]`; the result holds `d` pairs.
pub(crate) fn principal(points: &[f64], d: usize) -> Vec<(f64, Vec<f64>)> {
    let n = points.len() / d.max(1);
    let mut columns: Vec<Vec<f64>> = (0..d).map(|k| (0..n).map(|i| points[i * d + k]).collect()).collect();
    let mut vectors: Vec<Vec<f64>> =
        (0..d).map(|k| (0..d).map(|i| f64::from(u8::from(i == k))).collect()).collect();
    for _ in 0..30 {
        let mut turned = false;
        for p in 0..d {
            for q in p + 1..d {
                let (a, b, c) = (
                    dot(&columns[p], &columns[p]),
                    dot(&columns[q], &columns[q]),
                    dot(&columns[p], &columns[q]),
                );
                if c.abs() <= 1e-15 * (a * b).sqrt() {
                    continue;
                }
                turned = true;
                let zeta = (b - a) / (2.0 * c);
                let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let cos = 1.0 / (1.0 + t * t).sqrt();
                for set in [&mut columns, &mut vectors] {
                    let (head, tail) = set.split_at_mut(q);
                    for (x, y) in head[p].iter_mut().zip(&mut tail[0]) {
                        (*x, *y) = (cos * (*x - t * *y), cos * (t * *x + *y));
                    }
                }
            }
        }
        if !turned {
            break;
        }
    }
    let mut found: Vec<_> = columns.iter().map(|c| dot(c, c).sqrt()).zip(vectors).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found
}

/// Solves a dense system of `m` rows with partial pivoting, in place; returns the determinant, or 0.
///
/// # Shapes
/// `matrix: [m, m]`, each of `right: [m]`.
pub(crate) fn solve_dense(matrix: &mut [f64], m: usize, right: &mut [Vec<f64>]) -> f64 {
    let mut determinant = 1.0;
    for k in 0..m {
        let pivot = (k..m)
            .fold(k, |best, i| if matrix[i * m + k].abs() > matrix[best * m + k].abs() { i } else { best });
        if matrix[pivot * m + k] == 0.0 {
            return 0.0;
        }
        if pivot != k {
            (0..m).for_each(|j| matrix.swap(k * m + j, pivot * m + j));
            right.iter_mut().for_each(|x| x.swap(k, pivot));
            determinant = -determinant;
        }
        determinant *= matrix[k * m + k];
        let (head, tail) = matrix.split_at_mut((k + 1) * m);
        let row = &head[k * m..];
        for (i, below) in (k + 1..m).zip(tail.chunks_exact_mut(m)) {
            let factor = below[k] / row[k];
            if factor != 0.0 {
                below[k..].iter_mut().zip(&row[k..]).for_each(|(b, r)| *b -= factor * r);
                right.iter_mut().for_each(|x| x[i] -= factor * x[k]);
            }
        }
    }
    for x in right {
        for k in (0..m).rev() {
            let known: f64 = (k + 1..m).map(|j| matrix[k * m + j] * x[j]).sum();
            x[k] = (x[k] - known) / matrix[k * m + k];
        }
    }
    determinant
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn numbers(count: usize) -> Vec<f64> {
        (0..count).map(|k| ((k * k + 3 * k) as f64 * 0.7).sin()).collect()
    }

    pub fn positive(n: usize) -> Vec<f64> {
        let a = numbers(n * n);
        let entry = |i: usize, j: usize| (0..n).map(|k| a[i * n + k] * a[j * n + k]).sum::<f64>();
        (0..n * n).map(|k| entry(k / n, k % n) + f64::from(u8::from(k / n == k % n))).collect()
    }

    #[test]
    fn the_tridiagonal_form_solves_what_the_dense_one_does() {
        let (n, lambda) = (9, 0.3);
        let a = positive(n);
        let b = numbers(n);
        let mut reflections = Vec::new();
        let form = Tridiagonal::of(&mut a.clone(), n, 0, &mut reflections);
        let mut x = b.clone();
        reflections.iter().for_each(|r| r.apply(&mut x));
        let mut right = [x];
        let trace = form.solve(lambda, &mut right).unwrap();
        reflections.iter().rev().for_each(|r| r.apply(&mut right[0]));
        let shifted = |mut m: Vec<f64>| {
            (0..n).for_each(|k| m[k * n + k] += lambda);
            m
        };
        let mut dense = [b];
        assert!(solve_dense(&mut shifted(a.clone()), n, &mut dense) > 0.0);
        assert!(right[0].iter().zip(&dense[0]).all(|(x, y)| (x - y).abs() < 1e-12));
        let inverse: f64 = (0..n)
            .map(|k| {
                let mut axis = [(0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<_>>()];
                solve_dense(&mut shifted(a.clone()), n, &mut axis);
                axis[0][k]
            })
            .sum();
        assert!((trace - inverse).abs() < 1e-12);
        assert_eq!(form.solve(-1e3, &mut []), None);
    }

    #[test]
    fn singular_values_distinguish_a_plane_from_space() {
        let plane: Vec<f64> = (0..20)
            .flat_map(|k| {
                let (a, b) = ((k as f64 * 1.3).sin(), (k as f64 * 0.7).cos());
                [a, b, a + b]
            })
            .collect();
        let found = principal(&plane, 3);
        assert!(found[1].0 > 0.5 && found[2].0 < 1e-12 * found[0].0, "{found:?}");
        let normal = &found[2].1;
        assert!((normal[0] - normal[1]).abs() < 1e-9 && (normal[0] + normal[2]).abs() < 1e-9);
    }

    #[test]
    fn determinants_have_their_sign() {
        assert!((solve_dense(&mut [0.0, 2.0, 3.0, 0.0], 2, &mut []) + 6.0).abs() < 1e-12);
        assert_eq!(solve_dense(&mut [1.0, 2.0, 2.0, 4.0], 2, &mut []), 0.0);
    }
}
