//! Small dense linear algebra.

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

/// Least squares `min |A x - b|` of the columns `which` of a row-major `[rows, columns]` matrix, by Householder reflections.
///
/// Returns `None` if the columns are dependent.
pub(crate) fn least_squares(a: &[f64], b: &[f64], columns: usize, which: &[usize]) -> Option<Vec<f64>> {
    let (rows, n) = (b.len(), which.len());
    if rows < n {
        return None;
    }
    // Column-major copy.
    let mut q: Vec<Vec<f64>> =
        which.iter().map(|&j| (0..rows).map(|i| a[i * columns + j]).collect()).collect();
    let mut rhs = b.to_vec();
    let mut diagonal = vec![0.0; n];
    for j in 0..n {
        let whole = q[j].iter().map(|x| x * x).sum::<f64>().sqrt();
        let norm = q[j][j..].iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm.is_nan() || norm <= 1e-13 * whole {
            return None;
        }
        let alpha = if q[j][j] > 0.0 { -norm } else { norm };
        diagonal[j] = alpha;
        q[j][j] -= alpha;
        let v: Vec<f64> = q[j][j..].to_vec();
        let beta = 2.0 / v.iter().map(|x| x * x).sum::<f64>();
        let reflect = |x: &mut [f64]| {
            let dot: f64 = x.iter().zip(&v).map(|(a, b)| a * b).sum();
            x.iter_mut().zip(&v).for_each(|(x, v)| *x -= beta * dot * v);
        };
        q[j + 1..].iter_mut().for_each(|column| reflect(&mut column[j..]));
        reflect(&mut rhs[j..]);
    }
    let mut x = vec![0.0; n];
    for j in (0..n).rev() {
        let sum: f64 = (j + 1..n).map(|k| q[k][j] * x[k]).sum();
        x[j] = (rhs[j] - sum) / diagonal[j];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_system_is_solved_by_each_method() {
        let a = [4.0, 2.0, 0.4, 2.0, 3.0, 0.5, 0.4, 0.5, 1.0];
        let mut x = [9.2, 9.5, 4.4];
        assert!(cholesky_solve(&mut a.clone(), &mut x, 3));
        for (x, exact) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((x - exact).abs() < 1e-12);
        }
        let inverse = inverse(&a, 3).unwrap();
        let product: f64 = (0..3).map(|k| a[k] * inverse[k * 3]).sum();
        assert!((product - 1.0).abs() < 1e-12);
        let qr = least_squares(&a, &[9.2, 9.5, 4.4], 3, &[0, 1, 2]).unwrap();
        assert!((qr[2] - 3.0).abs() < 1e-12);
        assert!(least_squares(&[1.0, 2.0, 1.0, 2.0, 1.0, 2.0], &[1.0; 3], 2, &[0, 1]).is_none());
        assert!(!cholesky_solve(&mut [1.0, 2.0, 2.0, 1.0], &mut [1.0, 1.0], 2));
    }
}
