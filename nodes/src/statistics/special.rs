//! Incomplete beta function, and the distributions made of it.

/// Regularised incomplete beta function `I_x(a, b)`, relative error about 1e-13.
///
/// # Source
/// Lentz's continued fraction; Press et al., "Numerical Recipes" (2007), section 6.4.
#[must_use]
pub fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, 1.0 - x);
    }
    let front = libm::exp(
        libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * libm::log(x) + b * libm::log1p(-x),
    ) / a;
    let guard = |x: f64| if x.abs() < 1e-300 { 1e-300 } else { x };
    let (mut c, mut d) = (1.0, 1.0 / guard(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for term in [even, odd] {
            d = 1.0 / guard(1.0 + term * d);
            c = guard(1.0 + term / c);
            change = c * d;
            h *= change;
        }
        if (change - 1.0).abs() < 1e-16 {
            break;
        }
    }
    front * h
}

/// Probability that the magnitude of Student's t of `freedom` degrees exceeds `|t|`.
#[must_use]
pub fn t_two_sided(t: f64, freedom: f64) -> f64 {
    incomplete_beta(0.5 * freedom, 0.5, freedom / (freedom + t * t))
}

/// The value that the magnitude of Student's t of `freedom` degrees exceeds with a probability of 5 %.
#[must_use]
pub fn t_95(freedom: f64) -> f64 {
    // 12.7 for one degree of freedom.
    let (mut low, mut high) = (0.0, 13.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if t_two_sided(middle, freedom) > 0.05 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Probability that a variance ratio of `between` and `within` degrees of freedom exceeds `f`.
#[must_use]
pub fn f_above(f: f64, between: f64, within: f64) -> f64 {
    incomplete_beta(0.5 * within, 0.5 * between, within / (within + between * f.max(0.0)))
}

/// Probability that chi-square of one degree of freedom exceeds `x`.
#[must_use]
pub fn chi_square_above(x: f64) -> f64 {
    libm::erfc((0.5 * x.max(0.0)).sqrt())
}

/// Derivative of the logarithm of the gamma function, for `x > 0`.
#[must_use]
pub fn digamma(mut x: f64) -> f64 {
    let mut sum = 0.0;
    while x < 10.0 {
        sum -= 1.0 / x;
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = y * (1.0 / 12.0 - y * (1.0 / 120.0 - y * (1.0 / 252.0 - y * (1.0 / 240.0 - y / 132.0))));
    sum + libm::log(x) - 0.5 / x - series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_scipy() {
        for (found, exact) in [
            (incomplete_beta(2.5, 0.7, 0.3), 0.029814024845250465),
            (t_two_sided(2.1, 7.4), 0.0717349547947788),
            (t_95(24.0), 2.063_898_561_628_020_5),
            (f_above(3.3, 2.0, 27.0), 0.052219242955748243),
            (chi_square_above(3.841_458_820_694_124), 0.05),
            (digamma(0.44), -2.2938699430608036),
        ] {
            assert!((found - exact).abs() < 1e-13 * exact.abs().max(0.1), "{found} {exact}");
        }
        assert!((t_95(1.0) - 12.706_204_736_432_095).abs() < 1e-9, "{}", t_95(1.0));
    }
}
