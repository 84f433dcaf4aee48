//! The eigenvalue problem with dense matrices, for small meshes and as the reference of the sparse solver.

use super::block_matrix::BlockMatrix;
use super::lanczos::symmetric;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, Par};

/// All eigenvalues of `K phi = lambda M phi` in ascending order, and the vectors, orthonormal in the mass.
///
/// # Complexity
/// O(n^3) and five matrices.
pub(super) fn all_modes(matrix: &BlockMatrix) -> Option<(Vec<f64>, Mat<f64>)> {
    let [mut stiffness, mass] = matrix.dense();
    let n = matrix.size();
    // M = L L^T by rows.
    let mut lower = Mat::<f64>::zeros(n, n);
    for j in 0..n {
        for i in j..n {
            let mut sum = mass[(i, j)];
            // M couples equal axes only.
            for k in (j % 3..j).step_by(3) {
                sum -= lower[(i, k)] * lower[(j, k)];
            }
            if i == j {
                if sum <= 0.0 {
                    return None;
                }
                lower[(i, i)] = sum.sqrt();
            } else {
                lower[(i, j)] = sum / lower[(j, j)];
            }
        }
    }
    solve_lower_triangular_in_place(lower.as_ref(), stiffness.as_mut(), Par::Seq);
    let mut turned = stiffness.transpose().to_owned();
    solve_lower_triangular_in_place(lower.as_ref(), turned.as_mut(), Par::Seq);
    let symmetrised = Mat::from_fn(n, n, |i, j| 0.5 * (turned[(i, j)] + turned[(j, i)]));
    let (values, mut vectors) = symmetric(symmetrised.as_ref())?;
    solve_upper_triangular_in_place(lower.transpose(), vectors.as_mut(), Par::Seq);
    Some((values, vectors))
}
