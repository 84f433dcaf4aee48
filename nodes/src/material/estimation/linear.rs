//! Small systems of full rank.

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
    fn a_small_system_is_solved_unless_its_columns_are_dependent() {
        let a = [4.0, 2.0, 0.4, 2.0, 3.0, 0.5, 0.4, 0.5, 1.0];
        let x = least_squares(&a, &[9.2, 9.5, 4.4], 3, &[0, 1, 2]).unwrap();
        for (x, exact) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((x - exact).abs() < 1e-12);
        }
        assert!(least_squares(&[1.0, 2.0, 1.0, 2.0, 1.0, 2.0], &[1.0; 3], 2, &[0, 1]).is_none());
    }
}
