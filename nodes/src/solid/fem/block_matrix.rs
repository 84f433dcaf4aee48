//! Stiffness and mass over the same pairs of nodes, as sparse matrices of blocks.

use faer::{Mat, MatMut, MatRef};
use rayon::prelude::*;

/// Nodes per task of a product; fixed, so that tasks do not depend on the number of threads.
const CHUNK: usize = 512;
/// Vectors that are multiplied at once.
const LANES: usize = 8;

/// A product of one entry of the matrices with the components of `L` vectors at its column.
trait Term: Sync {
    /// Adds the product for entry `k`.
    fn add<const L: usize>(&self, matrix: &BlockMatrix, k: usize, v: &[[f64; L]; 3], sum: &mut [[f64; L]; 3]);
}

struct Mass;

/// The stiffness, with a function of each product.
struct Stiffness<F>(F);

impl Term for Mass {
    fn add<const L: usize>(
        &self,
        matrix: &BlockMatrix,
        k: usize,
        v: &[[f64; L]; 3],
        sum: &mut [[f64; L]; 3],
    ) {
        let m = matrix.mass[k];
        for (sum, v) in sum.iter_mut().zip(v) {
            sum.iter_mut().zip(v).for_each(|(sum, v)| *sum += m * v);
        }
    }
}

impl<F: Fn(f64) -> f64 + Sync> Term for Stiffness<F> {
    fn add<const L: usize>(
        &self,
        matrix: &BlockMatrix,
        k: usize,
        v: &[[f64; L]; 3],
        sum: &mut [[f64; L]; 3],
    ) {
        let block = &matrix.stiffness[k];
        for (row, sum) in block.chunks_exact(3).zip(sum) {
            for (j, sum) in sum.iter_mut().enumerate() {
                *sum += (self.0)(row[0] * v[0][j]) + (self.0)(row[1] * v[1][j]) + (self.0)(row[2] * v[2][j]);
            }
        }
    }
}

/// Stiffness `K` as 3 x 3 blocks, and mass `M` as one number per pair of nodes, the same along each axis.
///
/// # Shapes
/// Row `i` has the columns `columns[starts[i]..starts[i + 1]]`, in order. A vector of displacements has three entries per node.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMatrix {
    /// First entry of each row, `[nodes + 1]`.
    pub starts: Vec<usize>,
    /// Column of each entry.
    pub columns: Vec<u32>,
    /// Blocks of the stiffness by rows, N/m.
    pub stiffness: Vec<[f64; 9]>,
    /// Masses, kg.
    pub mass: Vec<f64>,
}

impl BlockMatrix {
    /// Number of nodes.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of degrees of freedom.
    #[must_use]
    pub fn size(&self) -> usize {
        3 * self.nodes()
    }

    fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// `M X`.
    #[must_use]
    pub fn mass_times(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        self.product(x, Mass)
    }

    /// `K X`.
    #[must_use]
    pub fn stiffness_times(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        self.product(x, Stiffness(|product| product))
    }

    /// `|K| |X|`, for bounds of rounding errors.
    #[must_use]
    pub fn absolute_stiffness_times(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        self.product(x, Stiffness(f64::abs))
    }

    fn product(&self, x: MatRef<'_, f64>, term: impl Term) -> Mat<f64> {
        let mut out = Mat::zeros(x.nrows(), x.ncols());
        for first in (0..x.ncols()).step_by(LANES) {
            let lanes = LANES.min(x.ncols() - first);
            let (x, out) = (x.subcols(first, lanes), out.as_mut().subcols_mut(first, lanes));
            if lanes == 1 { self.lanes::<1>(x, out, &term) } else { self.lanes::<LANES>(x, out, &term) }
        }
        out
    }

    /// Products with at most `L` vectors, whose components are side by side in memory.
    fn lanes<const L: usize>(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>, term: &impl Term) {
        let mut packed = vec![[[0.0; L]; 3]; self.nodes()];
        for j in 0..x.ncols() {
            let x = x.col(j);
            packed.iter_mut().enumerate().for_each(|(i, v)| (0..3).for_each(|a| v[a][j] = x[3 * i + a]));
        }
        out.as_mut().par_row_chunks_mut(3 * CHUNK).enumerate().for_each(
            |(chunk, mut out): (usize, MatMut<'_, f64>)| {
                for local in 0..out.nrows() / 3 {
                    let mut sum = [[0.0; L]; 3];
                    for k in self.row(chunk * CHUNK + local) {
                        term.add(self, k, &packed[self.columns[k] as usize], &mut sum);
                    }
                    for j in 0..out.ncols() {
                        (0..3).for_each(|a| out[(3 * local + a, j)] = sum[a][j]);
                    }
                }
            },
        );
    }

    /// The lower triangle of `K - shift M` by columns: first entries, rows and values.
    #[must_use]
    pub fn shifted(&self, shift: f64) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for i in 0..self.nodes() {
            for a in 0..3 {
                for k in self.row(i).filter(|k| self.columns[*k] as usize >= i) {
                    let j = self.columns[k] as usize;
                    for b in if j == i { a..3 } else { 0..3 } {
                        // Both matrices are symmetric.
                        let mass = if a == b { self.mass[k] } else { 0.0 };
                        rows.push(3 * j + b);
                        values.push(self.stiffness[k][3 * a + b] - shift * mass);
                    }
                }
                starts.push(rows.len());
            }
        }
        (starts, rows, values)
    }

    /// Dense copies of `K` and `M`.
    #[must_use]
    pub fn dense(&self) -> [Mat<f64>; 2] {
        let mut all = [Mat::zeros(self.size(), self.size()), Mat::zeros(self.size(), self.size())];
        for i in 0..self.nodes() {
            for k in self.row(i) {
                let j = self.columns[k] as usize;
                for a in 0..3 {
                    (0..3).for_each(|b| all[0][(3 * i + a, 3 * j + b)] = self.stiffness[k][3 * a + b]);
                    all[1][(3 * i + a, 3 * j + a)] = self.mass[k];
                }
            }
        }
        all
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (8 * self.starts.len() + (4 + 72 + 8) * self.columns.len()) as u64
    }
}
