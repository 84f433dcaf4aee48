//! The Cholesky factor of a dense matrix, as products of tiles that fit into vector registers.

use super::linear::PIVOT;
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

/// Rows of a tile.
const ROWS: usize = 4;
/// Columns of a tile.
const COLUMNS: usize = 8;

/// Part of a matrix, row by row.
type Tile = [[f64; COLUMNS]; ROWS];
/// Some columns of a matrix, row by row.
type Panel = [[f64; COLUMNS]];
/// Some rows of a matrix, column by column.
type Strip = [[f64; ROWS]];

/// A symmetric positive definite matrix as the product of a lower triangle and its transpose.
///
/// Each sum runs in a fixed order, so that the bits are the same on every machine and with any number of threads.
///
/// # Source
/// Golub and Van Loan, "Matrix Computations", section 4.2, row by row; Goto and van de Geijn, "Anatomy of high-performance matrix
/// multiplication" (2008), for the tiles.
#[derive(Debug)]
pub(crate) struct Cholesky {
    n: usize,
    /// Strips of the triangle one after the other, each up to the diagonal. The diagonal holds reciprocals. Beyond row `n` it
    /// is that of the identity, up to whole panels.
    strips: Vec<[f64; ROWS]>,
}

/// Number of columns in the strips before one.
fn columns_before(strip: usize) -> usize {
    ROWS * strip * (strip + 1) / 2
}

impl Cholesky {
    /// Factors `A + shift`; each row of A is read up to the diagonal. `None` if the sum is not positive definite.
    ///
    /// # Complexity
    /// n^3 / 6 multiplications and as many additions.
    pub fn of(rows: &[&[f64]], shift: f64) -> Option<Self> {
        let n = rows.len();
        let largest =
            rows.iter().enumerate().fold(0.0_f64, |most, (k, row)| most.max((row[k] + shift).abs()));
        let mut this =
            Self { n, strips: vec![[0.0; ROWS]; columns_before(n.next_multiple_of(COLUMNS) / ROWS)] };
        // All instruction sets compute the same bits.
        dispatch!(Level::new(), _simd => this.factor(rows, shift, PIVOT * largest)).then_some(this)
    }

    /// Solves for each right side in place.
    pub fn solve(&self, right: &mut [Vec<f64>]) {
        for right in right.chunks_mut(COLUMNS) {
            let mut panel = vec![[0.0; COLUMNS]; self.n.next_multiple_of(COLUMNS)];
            for (c, x) in right.iter().enumerate() {
                panel.iter_mut().zip(x).for_each(|(row, x)| row[c] = *x);
            }
            dispatch!(Level::new(), _simd => {
                self.forward(0, &mut panel);
                self.backward(&mut panel);
            });
            for (c, x) in right.iter_mut().enumerate() {
                x.iter_mut().zip(&panel).for_each(|(x, row)| *x = row[c]);
            }
        }
    }

    /// Trace of the inverse: the sum of the squares of the inverse of the triangle, on all cores.
    ///
    /// # Complexity
    /// n^3 / 6 multiplications and as many additions.
    pub fn trace_of_inverse(&self) -> f64 {
        let squares = |panel: usize| {
            let mut squares = [0.0; COLUMNS];
            let inverse = self.inverse_panel(panel);
            for row in inverse.iter().take(self.n - panel * COLUMNS) {
                squares.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x);
            }
            squares.iter().take(self.n - panel * COLUMNS).sum::<f64>()
        };
        let panels: Vec<f64> = (0..self.n.div_ceil(COLUMNS)).into_par_iter().map(squares).collect();
        panels.iter().sum()
    }

    /// The inverse, `[n, n]`, symmetric to the bit, on all cores.
    pub fn inverse(&self) -> Vec<f64> {
        let n = self.n;
        let panels: Vec<_> =
            (0..n.div_ceil(COLUMNS)).into_par_iter().map(|panel| self.inverse_panel(panel)).collect();
        let mut out = vec![0.0; n * n];
        out.par_chunks_mut((n * ROWS).max(1)).enumerate().for_each(|(strip, out)| {
            dispatch!(Level::new(), _simd => multiply_strip(&panels, strip, n, out));
        });
        for i in 0..n {
            for j in i + 1..n {
                out[i * n + j] = out[j * n + i];
            }
        }
        out
    }

    /// A strip from column `from` to its diagonal.
    #[inline(always)]
    fn strip(&self, strip: usize, from: usize) -> &Strip {
        &self.strips[columns_before(strip) + from..columns_before(strip + 1)]
    }

    /// Computes the triangle of a matrix; false at a pivot that is not above the least.
    #[inline(always)]
    fn factor(&mut self, rows: &[&[f64]], shift: f64, least: f64) -> bool {
        let mut panel = Vec::with_capacity(rows.len() + COLUMNS);
        for (number, rows) in rows.chunks(COLUMNS).enumerate() {
            // What is left of the diagonal is, as columns, a solution by the triangle above.
            let from = number * COLUMNS;
            panel.clear();
            panel.resize(from, [0.0; COLUMNS]);
            for (c, row) in rows.iter().enumerate() {
                panel.iter_mut().zip(*row).for_each(|(panel, x)| panel[c] = *x);
            }
            self.forward(0, &mut panel);
            let mut diagonal = [[0.0; COLUMNS]; COLUMNS];
            for (r, entries) in diagonal.iter_mut().enumerate() {
                entries[r] = 1.0;
                if let Some(row) = rows.get(r) {
                    entries[..=r].copy_from_slice(&row[from..=from + r]);
                    entries[r] += shift;
                }
            }
            for (half, tile) in diagonal.as_chunks_mut::<ROWS>().0.iter_mut().enumerate() {
                let first = columns_before(COLUMNS / ROWS * number + half);
                let strip = &mut self.strips[first..][..from];
                for (strip, row) in strip.iter_mut().zip(&panel) {
                    strip.copy_from_slice(&row[half * ROWS..][..ROWS]);
                }
                subtract_product(tile, strip, &panel);
            }
            if !factor_diagonal(&mut diagonal, least, rows.len()) {
                return false;
            }
            for (r, entries) in diagonal.iter().enumerate() {
                let first = columns_before(COLUMNS / ROWS * number + r / ROWS) + from;
                for (strip, x) in self.strips[first..].iter_mut().zip(&entries[..=r]) {
                    strip[r % ROWS] = *x;
                }
            }
        }
        true
    }

    /// Solves with the triangle from row `from` on, which a panel begins at.
    #[inline(always)]
    fn forward(&self, from: usize, panel: &mut Panel) {
        for at in (0..panel.len()).step_by(ROWS) {
            let (solved, rest) = panel.split_at_mut(at);
            let Some(tile) = rest.first_chunk_mut::<ROWS>() else { return };
            let (beside, triangle) = self.strip((from + at) / ROWS, from).split_at(at);
            let mut sums = *tile;
            subtract_product(&mut sums, beside, solved);
            for r in 0..ROWS {
                let (above, rest) = sums.split_at_mut(r);
                for (column, above) in triangle.iter().zip(above) {
                    rest[0].iter_mut().zip(above).for_each(|(x, above)| *x -= column[r] * *above);
                }
                rest[0].iter_mut().for_each(|x| *x *= triangle[r][r]);
            }
            *tile = sums;
        }
    }

    /// Solves with the transposed triangle.
    #[inline(always)]
    fn backward(&self, panel: &mut Panel) {
        for at in (0..panel.len()).step_by(ROWS).rev() {
            let strip = self.strip(at / ROWS, 0);
            for k in (at..at + ROWS).rev() {
                let (above, rest) = panel.split_at_mut(k);
                let solved = &mut rest[0];
                solved.iter_mut().for_each(|x| *x *= strip[k][k - at]);
                for (above, column) in above.iter_mut().zip(strip) {
                    above.iter_mut().zip(&*solved).for_each(|(x, solved)| *x -= column[k - at] * solved);
                }
            }
        }
    }

    /// A panel of the inverse of the triangle, from its diagonal on.
    fn inverse_panel(&self, number: usize) -> Vec<[f64; COLUMNS]> {
        let from = number * COLUMNS;
        let mut panel = vec![[0.0; COLUMNS]; self.n.next_multiple_of(COLUMNS) - from];
        panel.iter_mut().enumerate().take(COLUMNS).for_each(|(k, row)| row[k] = 1.0);
        dispatch!(Level::new(), _simd => self.forward(from, &mut panel));
        panel
    }
}

/// Subtracts the product of a strip and a panel from a tile.
#[inline(always)]
fn subtract_product(tile: &mut Tile, strip: &Strip, panel: &Panel) {
    let mut sums = *tile;
    for (column, row) in strip.iter().zip(panel) {
        for (sums, x) in sums.iter_mut().zip(column) {
            sums.iter_mut().zip(row).for_each(|(sum, y)| *sum -= x * y);
        }
    }
    *tile = sums;
}

/// Replaces the lower triangle of a block by its factor, with reciprocals on the diagonal; false if one of the first `checked`
/// pivots is not above the least.
#[inline(always)]
fn factor_diagonal(block: &mut [[f64; COLUMNS]; COLUMNS], least: f64, checked: usize) -> bool {
    for k in 0..COLUMNS {
        let pivot = block[k][k];
        if k < checked && (pivot.is_nan() || pivot <= least) {
            return false;
        }
        let reciprocal = 1.0 / pivot.sqrt();
        block[k][k] = reciprocal;
        for i in k + 1..COLUMNS {
            block[i][k] *= reciprocal;
            for j in k + 1..=i {
                block[i][j] -= block[i][k] * block[j][k];
            }
        }
    }
    true
}

/// Rows of `X^T X` up to the diagonal, for the panels of a lower triangle X.
#[inline(always)]
fn multiply_strip(panels: &[Vec<[f64; COLUMNS]>], strip: usize, n: usize, out: &mut [f64]) {
    let (own, half) = (strip * ROWS / COLUMNS, strip * ROWS % COLUMNS);
    let columns: Vec<[f64; ROWS]> =
        panels[own].iter().map(|row| std::array::from_fn(|r| row[half + r])).collect();
    for (number, panel) in panels.iter().enumerate().take(own + 1) {
        let mut tile = [[0.0; COLUMNS]; ROWS];
        subtract_product(&mut tile, &columns, &panel[(own - number) * COLUMNS..]);
        for (row, out) in tile.iter().zip(out.chunks_exact_mut(n)) {
            out.iter_mut().skip(number * COLUMNS).zip(row).for_each(|(out, x)| *out = -x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::spline::linear::tests::{numbers, positive};
    use crate::warp::spline::linear::{dot, solve_dense};

    fn factor(matrix: &[f64], n: usize) -> Option<Cholesky> {
        let rows: Vec<&[f64]> = matrix.chunks_exact(n.max(1)).collect();
        Cholesky::of(&rows, 0.0)
    }

    /// Rows of the triangle, entry by entry.
    fn plain_factor(matrix: &[f64], n: usize) -> Vec<f64> {
        let mut lower = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let left = matrix[i * n + j] - dot(&lower[i * n..][..j], &lower[j * n..][..j]);
                lower[i * n + j] = if i == j { left.sqrt() } else { left / lower[j * n + j] };
            }
        }
        lower
    }

    /// Rows of the inverse of a triangle, entry by entry.
    fn plain_inverse(lower: &[f64], n: usize) -> Vec<f64> {
        let mut inverse = vec![0.0; n * n];
        for j in 0..n {
            for i in j..n {
                let known: f64 = (j..i).map(|k| lower[i * n + k] * inverse[k * n + j]).sum();
                inverse[i * n + j] = (f64::from(u8::from(i == j)) - known) / lower[i * n + i];
            }
        }
        inverse
    }

    #[test]
    fn a_positive_matrix_is_inverted_as_by_elimination() {
        for n in [1, 2, 9, 40] {
            let a = positive(n);
            let factor = factor(&a, n).unwrap();
            let found = factor.inverse();
            for k in 0..n {
                let mut axis = [(0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<_>>()];
                solve_dense(&mut a.clone(), n, &mut axis);
                let row = &found[k * n..(k + 1) * n];
                assert!(row.iter().zip(&axis[0]).all(|(x, y)| (x - y).abs() < 1e-9), "{n} {k}");
                assert!((0..n).all(|i| row[i] == found[i * n + k]), "symmetric to the bit");
            }
            let trace: f64 = (0..n).map(|k| found[k * n + k]).sum();
            assert!((factor.trace_of_inverse() - trace).abs() < 1e-9 * trace);
            let (b, mut right) = (numbers(n), [numbers(n), numbers(n)]);
            factor.solve(&mut right);
            let product = |x: &[f64], i: usize| dot(&a[i * n..(i + 1) * n], x);
            assert!(right.iter().all(|x| (0..n).all(|i| (product(x, i) - b[i]).abs() < 1e-9)));
        }
        assert!(factor(&[], 0).unwrap().inverse().is_empty());
        assert!(factor(&[1.0, 2.0, 2.0, 1.0], 2).is_none(), "not positive");
        assert!(factor(&[1.0, 1.0, 1.0, 1.0], 2).is_none(), "singular");
    }

    #[test]
    fn tiles_compute_what_single_entries_do() {
        for n in [1, 2, 9, 40, 67, 130] {
            let (a, shift) = (positive(n), 0.5);
            let rows: Vec<&[f64]> = a.chunks_exact(n).collect();
            let shifted: Vec<f64> =
                (0..n * n).map(|k| a[k] + if k / n == k % n { shift } else { 0.0 }).collect();
            let lower = plain_factor(&shifted, n);
            let inverse = plain_inverse(&lower, n);
            let factor = Cholesky::of(&rows, shift).unwrap();
            for i in 0..n {
                for j in 0..=i {
                    let found = factor.strips[columns_before(i / ROWS) + j][i % ROWS];
                    let found = if i == j { 1.0 / found } else { found };
                    assert!((found - lower[i * n + j]).abs() < 1e-12 * lower[i * n + i], "{n}: {i} {j}");
                }
            }
            let trace: f64 = inverse.iter().map(|x| x * x).sum();
            assert!((factor.trace_of_inverse() / trace - 1.0).abs() < 1e-12, "{n}");
            // More right sides than a panel has columns.
            let mut right: Vec<Vec<f64>> = numbers(11 * n).chunks_exact(n).map(<[f64]>::to_vec).collect();
            let wanted = right.clone();
            factor.solve(&mut right);
            for (x, wanted) in right.iter().zip(&wanted) {
                let residual = (0..n).map(|i| (dot(&shifted[i * n..][..n], x) - wanted[i]).abs());
                assert!(residual.fold(0.0, f64::max) < 1e-12 * n as f64, "{n}");
            }
            let entry =
                |i: usize, j: usize| (0..n).map(|k| inverse[k * n + i] * inverse[k * n + j]).sum::<f64>();
            let whole = factor.inverse();
            assert!((0..n * n).all(|k| (whole[k] - entry(k / n, k % n)).abs() < 1e-12 * trace), "{n}");
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let (n, a) = (67, positive(67));
        let factor = factor(&a, n).unwrap();
        let wanted = (factor.trace_of_inverse(), factor.inverse());
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| (factor.trace_of_inverse(), factor.inverse())) == wanted);
        }
    }

    #[test]
    fn the_smallest_pivot_decides_wherever_it_lies() {
        for n in [3, 8, 9, 21] {
            for at in 0..n {
                let entry = |pivot: f64, k: usize| match (k / n == k % n, k / n == at) {
                    (true, true) => pivot,
                    (true, false) => 2e15,
                    _ => 0.0,
                };
                let matrix = |pivot: f64| (0..n * n).map(|k| entry(pivot, k)).collect::<Vec<_>>();
                assert!(factor(&matrix(30.0), n).is_some(), "{n} {at}");
                assert!(factor(&matrix(10.0), n).is_none() && factor(&matrix(f64::NAN), n).is_none());
            }
        }
    }
}
