//! Sliced Wasserstein distance of two clouds of points.

use std::f64::consts::TAU;

use super::normal_quantile::probit;

/// Sliced Wasserstein distance of two clouds: root mean square over 64 directions of the distance between 199 quantiles of each.
///
/// # Shapes
/// `a` and `b`: `[n, d]`.
///
/// # Source
/// Bonneel, Rabin, Peyre and Pfister, "Sliced and Radon Wasserstein barycenters of measures" (2015).
#[must_use]
pub fn sliced_wasserstein(a: &[f32], b: &[f32], d: usize) -> f64 {
    const DIRECTIONS: usize = 64;
    const QUANTILES: usize = 199;
    let quantiles = |x: &[f32], direction: &[f64]| -> Vec<f64> {
        let along = |row: &[f32]| row.iter().zip(direction).map(|(x, v)| f64::from(*x) * v).sum::<f64>();
        let mut all: Vec<f64> = x.chunks_exact(d).map(along).collect();
        all.sort_unstable_by(f64::total_cmp);
        let quantile = |q: usize| {
            let place = (q + 1) as f64 / (QUANTILES + 1) as f64 * all.len().saturating_sub(1) as f64;
            let (low, t) = (place as usize, place.fract());
            let at = |k: usize| all.get(k).or(all.last()).copied().unwrap_or(0.0);
            at(low) + t * (at(low + 1) - at(low))
        };
        (0..QUANTILES).map(quantile).collect()
    };
    let total: f64 = (0..DIRECTIONS)
        .map(|k| {
            let direction = direction(k, d);
            let pairs = quantiles(a, &direction).into_iter().zip(quantiles(b, &direction));
            pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / QUANTILES as f64
        })
        .sum();
    (total / DIRECTIONS as f64).sqrt()
}

/// Direction `k` of an even spread over the sphere: normal quantiles of a sequence whose steps are powers of one irrational number.
fn direction(k: usize, d: usize) -> Vec<f64> {
    // The root of x^(d + 1) = x + 1 spreads points evenly in d dimensions.
    let mut root = 1.5_f64;
    for _ in 0..40 {
        root = libm::pow(1.0 + root, 1.0 / (d + 1) as f64);
    }
    let v: Vec<f64> = (1..=d)
        .map(|i| probit(((k + 1) as f64 * libm::pow(root, -(i as f64))).fract().clamp(1e-6, 1.0 - 1e-6)))
        .collect();
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { v.iter().map(|x| x / length).collect() } else { vec![libm::cos(TAU * k as f64); d] }
}
