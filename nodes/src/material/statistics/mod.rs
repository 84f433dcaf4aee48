//! Distributions and tests.

mod k_means;
pub mod listening_test;
pub mod normal;
pub mod ranks;
pub mod rating_statistics;
pub mod ratings;
pub mod special;
pub mod tests_of_means;

pub use k_means::{Points, k_means, nearest, squared};

/// The quantile of sorted values at a share from 0 to 1, interpolated.
#[must_use]
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = share.clamp(0.0, 1.0) * last as f64;
    let k = (at as usize).min(last);
    let next = sorted[(k + 1).min(last)];
    sorted[k] + (at - k as f64) * (next - sorted[k])
}
