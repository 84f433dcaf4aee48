//! Statistics: quantiles, clusters, distributions, tests, and the small linear systems that estimates need.

mod k_means;
#[cfg(feature = "impact")]
pub(crate) mod linear;
pub mod normal;
pub mod ranks;
pub mod special;
pub mod tests_of_means;

pub use k_means::{Points, k_means, nearest, squared};

/// Mean and unbiased standard deviation.
#[must_use]
pub fn mean_and_deviation(x: &[f64]) -> [Option<f64>; 2] {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let square: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    [(n > 0.0).then_some(mean), (n > 1.0).then(|| (square / (n - 1.0)).sqrt())]
}

/// The quantile of sorted values at a share from 0 to 1, interpolated.
#[must_use]
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = share.clamp(0.0, 1.0) * last as f64;
    let k = (at as usize).min(last);
    let next = sorted[(k + 1).min(last)];
    sorted[k] + (at - k as f64) * (next - sorted[k])
}
