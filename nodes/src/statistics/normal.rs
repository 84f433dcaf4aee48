//! Quantiles of the normal distribution, to full precision.

use crate::core::random::Rng;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// The standard normal variable below which a share `p` lies, for `0 < p < 1`.
///
/// A rational approximation, improved by two steps of Halley's method.
///
/// # Source
/// Hastings, in Abramowitz and Stegun, "Handbook of Mathematical Functions" (1964), 26.2.23, for the approximation.
#[must_use]
pub fn normal_quantile(p: f64) -> f64 {
    let tail = p.min(1.0 - p);
    if tail <= 0.0 {
        return if p > 0.5 { f64::INFINITY } else { f64::NEG_INFINITY };
    }
    let t = (-2.0 * libm::log(tail)).sqrt();
    let top = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let mut x = t - top / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    for _ in 0..2 {
        // x is in the upper tail, where the share is known without cancellation.
        let error = 0.5 * libm::erfc(x * FRAC_1_SQRT_2) - tail;
        let step = error * TAU.sqrt() * libm::exp(0.5 * x * x);
        x += step / (1.0 - 0.5 * x * step);
    }
    if p < 0.5 { -x } else { x }
}

/// The share of the standard normal distribution that lies below `z`.
#[must_use]
pub fn normal_share(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// A standard normal variable.
pub fn standard_normal(rng: &mut Rng) -> f64 {
    normal_quantile(rng.between(1e-12, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_have_all_digits() {
        // scipy.stats.norm.ppf.
        for (p, exact) in [
            (0.5, 0.0),
            (0.975, 1.959_963_984_540_054),
            (0.025, -1.959_963_984_540_054_5),
            (1e-10, -6.361_340_902_404_056),
            (0.3, -0.524_400_512_708_041),
            (1e-300, -37.047_096_299_361_2),
        ] {
            let found = normal_quantile(p);
            assert!((found - exact).abs() <= 1e-14 * exact.abs().max(1.0), "{p}: {found}");
        }
        assert_eq!((normal_quantile(0.0), normal_quantile(1.0)), (f64::NEG_INFINITY, f64::INFINITY));
    }
}
