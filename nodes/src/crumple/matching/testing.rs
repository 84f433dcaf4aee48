//! Energies for the tests of this folder.

use crate::core::random::Rng;

/// Log-normal numbers, sorted.
pub(super) fn log_normal(n: usize, sigma: f64, mean: f64, seed: u64) -> Vec<f64> {
    let mut rng = Rng::new(seed);
    // Box and Muller: the far tail counts here.
    let mut normal =
        || (-2.0 * (1.0 - rng.uniform()).ln()).sqrt() * (std::f64::consts::TAU * rng.uniform()).cos();
    let mut all: Vec<f64> = (0..n).map(|_| (mean + sigma * normal()).exp()).collect();
    all.sort_unstable_by(f64::total_cmp);
    all
}
