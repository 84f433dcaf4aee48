//! Small symmetric positive definite systems.

/// Solves `A x = b` for a symmetric positive definite `A` of `n` rows, `[n * n]`, in place; returns false if it is not.
///
/// The lower triangle of `a` is replaced by its Cholesky factor.
pub(crate) fn cholesky_solve(a: &mut [f64], b: &mut [f64], n: usize) -> bool {
    if !cholesky(a, n) {
        return false;
    }
    for i in 0..n {
        let mut sum = b[i];
        for k in 0..i {
            sum -= a[i * n + k] * b[k];
        }
        b[i] = sum / a[i * n + i];
    }
    for i in (0..n).rev() {
        let mut sum = b[i];
        for k in i + 1..n {
            sum -= a[k * n + i] * b[k];
        }
        b[i] = sum / a[i * n + i];
    }
    true
}

fn cholesky(a: &mut [f64], n: usize) -> bool {
    for j in 0..n {
        let scale = a[j * n + j];
        for i in j..n {
            let mut sum = a[i * n + j];
            for k in 0..j {
                sum -= a[i * n + k] * a[j * n + k];
            }
            if i == j {
                if !(sum > 1e-14 * scale && sum > 0.0) {
                    return false;
                }
                a[j * n + j] = sum.sqrt();
            } else {
                a[i * n + j] = sum / a[j * n + j];
            }
        }
    }
    true
}

/// The inverse of a symmetric positive definite matrix, `[n * n]`, scaled to a unit diagonal first; `None` if it is not.
pub(crate) fn inverse(a: &[f64], n: usize) -> Option<Vec<f64>> {
    let scale: Vec<f64> = (0..n).map(|i| 1.0 / a[i * n + i].sqrt()).collect();
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let scaled: Vec<f64> = (0..n * n).map(|k| a[k] * scale[k / n] * scale[k % n]).collect();
    let mut out = vec![0.0; n * n];
    for j in 0..n {
        let mut column = vec![0.0; n];
        column[j] = 1.0;
        if !cholesky_solve(&mut scaled.clone(), &mut column, n) {
            return None;
        }
        for i in 0..n {
            out[i * n + j] = column[i] * scale[i] * scale[j];
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_system_is_solved_and_inverted() {
        let a = [4.0, 2.0, 0.4, 2.0, 3.0, 0.5, 0.4, 0.5, 1.0];
        let mut x = [9.2, 9.5, 4.4];
        assert!(cholesky_solve(&mut a.clone(), &mut x, 3));
        for (x, exact) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((x - exact).abs() < 1e-12);
        }
        let inverse = inverse(&a, 3).unwrap();
        let product: f64 = (0..3).map(|k| a[k] * inverse[k * 3]).sum();
        assert!((product - 1.0).abs() < 1e-12);
        assert!(!cholesky_solve(&mut [1.0, 2.0, 2.0, 1.0], &mut [1.0, 1.0], 2));
    }
}
