//! Known answers of the estimators.

mod experiments;
mod golden;
mod properties;
mod uncertainty;

use crate::core::random::Rng;
use crate::material::estimation::point::DampingPoint;
use crate::material::statistics::normal::normal_quantile;
use std::f64::consts::TAU;

/// `n` points of a Rayleigh curve `[a1, a2, sigma, eta]` with frequencies log-uniform from 200 Hz to 15 kHz.
pub(super) fn simulated(rng: &mut Rng, n: usize, [a1, a2, sigma, eta]: [f64; 4]) -> Vec<DampingPoint> {
    (0..n)
        .map(|_| {
            let lambda = (TAU * 200.0 * 75_f64.powf(rng.uniform())).powi(2);
            let excess = -(1.0 - rng.uniform()).ln() / eta;
            let noise = sigma * normal_quantile(rng.between(1e-12, 1.0));
            DampingPoint::new(lambda, (a1 + a2 * lambda + excess + noise).max(1e-3))
        })
        .collect()
}
