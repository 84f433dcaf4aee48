//! Least-squares fits of a damping model, which attribute all damping to the material.

use super::linear::least_squares as solve;
use super::nnls::nnls;
use super::point::Sample;
use super::scan::maximum_within;
use crate::material::damping::Family;

/// The quantity whose squared differences are summed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Space {
    /// `y - c`.
    #[default]
    Linear,
    /// `ln y - ln c`, for power laws.
    Log,
}

/// Options of a least-squares fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeastSquares {
    /// The quantity.
    pub space: Space,
    /// True for ordinary least squares, whose parameters may be below 0.
    pub unconstrained: bool,
}

impl LeastSquares {
    /// Parameters `theta` in normalised units, of at least 0 unless unconstrained.
    ///
    /// An exponent is found by variable projection: the best of 25 in its range, refined by golden sections.
    ///
    /// # Complexity
    /// O(n p^2), or 70 times this with an exponent.
    #[must_use]
    pub fn fit(&self, sample: &Sample) -> Vec<f64> {
        if self.space == Space::Log && sample.family == Family::Power {
            return log_power(sample);
        }
        let family = sample.family;
        if !family.has_exponent() {
            return self.linear(sample, 1.0).0;
        }
        let [low, high] = family.bounds()[family.linear_parameters()];
        let mut best = (f64::INFINITY, low);
        for k in 0..25 {
            let g3 = low + (high - low) * f64::from(k) / 24.0;
            let (_, sum) = self.linear(sample, g3);
            if sum < best.0 {
                best = (sum, g3);
            }
        }
        let step = (high - low) / 24.0;
        let g3 = maximum_within((best.1 - step).max(low), (best.1 + step).min(high), |g3| {
            -self.linear(sample, g3).1
        });
        let (mut theta, _) = self.linear(sample, g3);
        theta.push(g3);
        theta
    }

    /// Linear parameters and the weighted sum of squares at an exponent.
    pub(super) fn linear(&self, sample: &Sample, exponent: f64) -> (Vec<f64>, f64) {
        let p = sample.family.linear_parameters();
        let mut basis = sample.basis_of(exponent);
        let root: Vec<f64> = sample.weight.iter().map(|w| w.sqrt()).collect();
        basis.chunks_exact_mut(p).zip(&root).for_each(|(row, w)| row.iter_mut().for_each(|b| *b *= w));
        let y: Vec<f64> = sample.y.iter().zip(&root).map(|(y, w)| y * w).collect();
        let theta = if self.unconstrained {
            solve(&basis, &y, p, &(0..p).collect::<Vec<_>>()).unwrap_or_else(|| nnls(&basis, &y, p))
        } else {
            nnls(&basis, &y, p)
        };
        let square =
            |(row, y): (&[f64], &f64)| (y - row.iter().zip(&theta).map(|(b, t)| b * t).sum::<f64>()).powi(2);
        let sum = basis.chunks_exact(p).zip(&y).map(square).sum();
        (theta, sum)
    }
}

/// The straight line through `ln y` over `ln x`, its slope within the range of exponents.
fn log_power(sample: &Sample) -> Vec<f64> {
    let total = sample.total_weight();
    let mean =
        |f: &dyn Fn(usize) -> f64| (0..sample.len()).map(|i| sample.weight[i] * f(i)).sum::<f64>() / total;
    let log_y: Vec<f64> = sample.y.iter().map(|y| libm::log(*y)).collect();
    let (mx, my) = (mean(&|i| sample.log_x[i]), mean(&|i| log_y[i]));
    let cross = mean(&|i| (sample.log_x[i] - mx) * (log_y[i] - my));
    let square = mean(&|i| (sample.log_x[i] - mx).powi(2));
    let [low, high] = sample.family.bounds()[1];
    let slope = (cross / square).clamp(low, high);
    vec![libm::exp(my - slope * mx), slope]
}
