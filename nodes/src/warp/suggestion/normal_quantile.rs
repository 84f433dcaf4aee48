//! Quantiles of the normal distribution.

/// The normal distribution's quantile, off by at most 5e-4: Abramowitz and Stegun, 26.2.23.
pub(super) fn probit(p: f64) -> f64 {
    let tail = p.min(1.0 - p).max(1e-300);
    let t = (-2.0 * libm::log(tail)).sqrt();
    let x = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    if p < 0.5 { -x } else { x }
}
