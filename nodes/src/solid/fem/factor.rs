//! Sparse factorisations: solutions with `K - s M`, and counts of eigenvalues.

use super::block_matrix::BlockMatrix;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, LltRef, SymbolicCholesky, SymbolicCholeskyRaw,
    SymmetricOrdering, factorize_symbolic_cholesky, supernodal::SupernodalIntranodeLbltRef,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use rayon::prelude::*;

/// Columns per task of a solution.
const COLUMNS: usize = 4;
/// Pivot relative to the largest diagonal entry below which its sign is not trusted.
const TINY: f64 = 1e-15;

/// The pattern of `K - s M` and of its factors.
pub(super) struct Symbolic {
    starts: Vec<usize>,
    rows: Vec<usize>,
    factor: SymbolicCholesky<usize>,
}

impl Symbolic {
    /// Orders the unknowns by approximate minimum degree; `None` if memory runs out.
    pub(super) fn new(matrix: &BlockMatrix) -> Option<Self> {
        let (starts, rows, _) = matrix.shifted(0.0);
        let n = matrix.size();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let factor =
            factorize_symbolic_cholesky(pattern, Side::Lower, SymmetricOrdering::Amd, params).ok()?;
        Some(Self { starts, rows, factor })
    }

    /// Bytes of a factor and of the memory that computes it.
    pub(super) fn bytes(&self) -> u64 {
        let scratch =
            self.factor.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Default::default());
        let llt = self.factor.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let scratch = scratch.size_bytes().max(llt.size_bytes());
        (8 * self.factor.len_val() + scratch + 24 * self.rows.len()) as u64
    }

    fn values<'a>(&'a self, values: &'a [f64]) -> SparseColMatRef<'a, usize, f64> {
        let n = self.starts.len() - 1;
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.starts, None, &self.rows);
        SparseColMatRef::new(pattern, values)
    }

    /// The factor `L` of `K - shift M = L L^T`; `None` if the matrix is not positive definite.
    pub(super) fn cholesky(&self, matrix: &BlockMatrix, shift: f64) -> Option<Cholesky<'_>> {
        let (_, _, entries) = matrix.shifted(shift);
        let mut values = vec![0.0; self.factor.len_val()];
        let scratch = self.factor.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let done = self.factor.factorize_numeric_llt(
            &mut values,
            self.values(&entries),
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        done.ok()?;
        Some(Cholesky { symbolic: &self.factor, values })
    }

    /// Number of eigenvalues of `K phi = lambda M phi` below a shift, by the signs of the pivots of `K - shift M = L B L^T`
    /// (Sylvester's law of inertia); `None` if a pivot is too small for its sign to be trusted.
    pub(super) fn count_below(&self, matrix: &BlockMatrix, shift: f64) -> Option<usize> {
        let (_, _, entries) = matrix.shifted(shift);
        let n = matrix.size();
        let largest = self.starts[..n].iter().map(|k| entries[*k].abs()).fold(0.0, f64::max);
        let mut values = vec![0.0; self.factor.len_val()];
        let (mut below, mut forward, mut inverse) = (vec![0.0; n], vec![0; n], vec![0; n]);
        let scratch =
            self.factor.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let _: IntranodeLbltRef<'_, usize, f64> = self.factor.factorize_numeric_intranode_lblt(
            &mut values,
            &mut below,
            &mut forward,
            &mut inverse,
            self.values(&entries),
            Side::Lower,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        let SymbolicCholeskyRaw::Supernodal(raw) = self.factor.raw() else { return None };
        let perm = PermRef::new_checked(&forward, &inverse, n);
        let factor = SupernodalIntranodeLbltRef::new(raw, &values, &below, perm);
        let mut negative = 0;
        let mut count = |pivot: f64| {
            negative += usize::from(pivot < 0.0);
            (pivot.abs() > TINY * largest).then_some(())
        };
        for s in 0..raw.n_supernodes() {
            let node = factor.supernode(s);
            let (diagonal, start) = (node.val(), node.start());
            let mut k = 0;
            while k < diagonal.ncols() {
                let d = diagonal[(k, k)];
                let off = below[start + k];
                if off == 0.0 {
                    count(d)?;
                    k += 1;
                } else {
                    let e = diagonal[(k + 1, k + 1)];
                    let (mean, half) = (0.5 * (d + e), 0.5 * (d - e));
                    let root = libm::hypot(half, off);
                    count(mean - root)?;
                    count(mean + root)?;
                    k += 2;
                }
            }
        }
        Some(negative)
    }
}

/// A factor that solves equations.
pub(super) struct Cholesky<'a> {
    symbolic: &'a SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl Cholesky<'_> {
    /// Solves `(K - shift M) X = B` in the memory of `B`.
    pub(super) fn solve(&self, mut x: MatMut<'_, f64>) {
        x.as_mut().par_col_chunks_mut(COLUMNS).for_each(|x| {
            let scratch = self.symbolic.solve_in_place_scratch::<f64>(x.ncols(), Par::Seq);
            let mut memory = MemBuffer::new(scratch);
            let factor = LltRef::new(self.symbolic, &self.values);
            factor.solve_in_place_with_conj(Conj::No, x, Par::Seq, MemStack::new(&mut memory));
        });
    }
}
