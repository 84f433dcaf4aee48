//! Non-negative least squares.

use super::linear::least_squares;

/// Minimises `|A x - b|` over `x >= 0` for a row-major `[rows, columns]` matrix of few columns.
///
/// Columns are scaled to unit length, and each subproblem is solved by reflections. Dependent columns stay at 0.
///
/// # Source
/// Lawson and Hanson, "Solving Least Squares Problems" (1974), chapter 23.
///
/// # Complexity
/// O(rows columns^2) a step, about as many steps as columns.
#[must_use]
pub fn nnls(a: &[f64], b: &[f64], columns: usize) -> Vec<f64> {
    let rows = b.len();
    let norm = |j: usize| (0..rows).map(|i| a[i * columns + j].powi(2)).sum::<f64>().sqrt();
    let scale: Vec<f64> = (0..columns).map(norm).map(|n| if n > 0.0 { 1.0 / n } else { 0.0 }).collect();
    let scaled: Vec<f64> = (0..rows * columns).map(|k| a[k] * scale[k % columns]).collect();
    let mut x = vec![0.0; columns];
    let mut passive: Vec<usize> = Vec::new();
    let mut refused = vec![false; columns];
    let size = b.iter().map(|b| b * b).sum::<f64>().sqrt();
    for _ in 0..10 * columns.max(3) {
        let residual: Vec<f64> = (0..rows)
            .map(|i| b[i] - (0..columns).map(|j| scaled[i * columns + j] * x[j]).sum::<f64>())
            .collect();
        let slope = |j: usize| (0..rows).map(|i| scaled[i * columns + j] * residual[i]).sum::<f64>();
        let next = (0..columns)
            .filter(|j| !passive.contains(j) && !refused[*j])
            .map(|j| (j, slope(j)))
            .filter(|(_, s)| *s > 1e-13 * size)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((next, _)) = next else { break };
        passive.push(next);
        passive.sort_unstable();
        loop {
            let Some(solution) = least_squares(&scaled, b, columns, &passive) else {
                passive.retain(|j| *j != next);
                refused[next] = true;
                break;
            };
            if solution.iter().all(|s| *s > 0.0) {
                x.fill(0.0);
                passive.iter().zip(&solution).for_each(|(j, s)| x[*j] = *s);
                break;
            }
            let blocked = passive.iter().zip(&solution).filter(|(_, s)| **s <= 0.0);
            let step = blocked.map(|(j, s)| x[*j] / (x[*j] - s)).fold(1.0, f64::min);
            for (j, s) in passive.iter().zip(&solution) {
                x[*j] += step * (s - x[*j]);
            }
            let leaving: Vec<usize> = passive
                .iter()
                .zip(&solution)
                .filter(|(j, s)| **s <= 0.0 && x[**j] <= 1e-15)
                .map(|(j, _)| *j)
                .collect();
            passive.retain(|j| !leaving.contains(j));
            leaving.iter().for_each(|j| x[*j] = 0.0);
            if leaving.contains(&next) {
                refused[next] = true;
            }
            if leaving.is_empty() || passive.is_empty() {
                break;
            }
        }
    }
    x.iter().zip(&scale).map(|(x, s)| x * s).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    /// `A^T (b - A x)`.
    fn slopes(a: &[f64], b: &[f64], x: &[f64]) -> Vec<f64> {
        let n = x.len();
        let residual: Vec<f64> =
            b.iter().enumerate().map(|(i, b)| b - (0..n).map(|j| a[i * n + j] * x[j]).sum::<f64>()).collect();
        (0..n).map(|j| residual.iter().enumerate().map(|(i, r)| a[i * n + j] * r).sum()).collect()
    }

    #[test]
    fn solutions_satisfy_the_conditions_of_kuhn_and_tucker() {
        let mut rng = Rng::new(3);
        for _ in 0..200 {
            let (rows, n) = (6 + rng.below(10), 1 + rng.below(5));
            let a: Vec<f64> = (0..rows * n).map(|_| rng.between(-1.0, 1.0)).collect();
            let b: Vec<f64> = (0..rows).map(|_| rng.between(-1.0, 1.0)).collect();
            let x = nnls(&a, &b, n);
            for (x, slope) in x.iter().zip(slopes(&a, &b, &x)) {
                assert!(*x >= 0.0 && slope < 1e-9 && (*x == 0.0 || slope.abs() < 1e-9), "{x} {slope}");
            }
        }
    }

    #[test]
    fn dependent_and_empty_columns_stay_at_zero() {
        let a = [1.0, 1.0, 0.0, 2.0, 2.0, 0.0, 3.0, 3.0, 0.0];
        let x = nnls(&a, &[2.0, 4.0, 6.0], 3);
        assert!((x[0] + x[1] - 2.0).abs() < 1e-12 && x[2] == 0.0, "{x:?}");
        assert_eq!(nnls(&[1.0, 1.0], &[-1.0, -1.0], 1), [0.0]);
    }
}
