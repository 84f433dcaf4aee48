//! An excess that is gamma distributed.

use super::emg::Terms;

/// Number of nodes of the quadrature.
const NODES: usize = 96;
/// Range of the quadrature variable, in widths of the integrand.
const FROM: f64 = -5.0;
/// Upper end of the range.
const TO: f64 = 9.0;

/// The density of a normal plus a gamma variable of fixed shape, as `ln p = ln eta + h(u, k)`.
///
/// With `I(v) = 1/Gamma(shape) integral_0^inf t^(shape - 1) exp(-t^2/2 - v t) dt` it is
/// `h = (shape - 1) ln k - ln(2 pi)/2 - u^2/2 + ln I(k - u)`. Shape 1 is the exponential.
#[derive(Clone, Debug, PartialEq)]
pub struct GammaExcess {
    shape: f64,
    log_gamma: f64,
}

impl GammaExcess {
    /// An excess of a shape above 0.
    #[must_use]
    pub fn new(shape: f64) -> Self {
        Self { shape, log_gamma: libm::lgamma(shape) }
    }

    /// Position of the maximum of the integrand in `ln t`, where `t^2 + v t = shape`.
    fn peak(&self, v: f64) -> f64 {
        let root = (v * v + 4.0 * self.shape).sqrt();
        if v > 0.0 { 2.0 * self.shape / (v + root) } else { 0.5 * (root - v) }
    }

    /// `ln I(v) - peak^2/2`, and the mean and variance of `t` under the integrand: minus the first and the second derivative of
    /// `ln I`.
    fn integral(&self, v: f64) -> [f64; 3] {
        let peak = self.peak(v);
        let width = 1.0 / (peak * peak + self.shape).sqrt();
        let (mut sums, step) = ([0.0; 3], (TO - FROM) / (NODES - 1) as f64);
        for k in 0..NODES {
            // Steps grow exponentially towards small t, where the integrand decays as t^shape alone.
            let x = FROM + step * k as f64;
            let back = libm::exp(-x);
            let ds = width * (x + 1.0 - back);
            let dt = peak * libm::expm1(ds);
            // The exponent relative to its maximum, without cancellation: v + peak = shape/peak.
            let value = libm::exp(self.shape * ds - dt * (0.5 * dt + self.shape / peak)) * (1.0 + back);
            sums[0] += value;
            sums[1] += value * dt;
            sums[2] += value * dt * dt;
        }
        let mean = sums[1] / sums[0];
        let variance = (sums[2] / sums[0] - mean * mean).max(0.0);
        let log = libm::log(sums[0] * step * width) + self.shape * (libm::log(peak) - 1.0) - self.log_gamma;
        [log, peak + mean, variance]
    }

    /// `h(u, k)` with its derivatives.
    #[must_use]
    pub fn terms(&self, u: f64, k: f64) -> Terms {
        let [log_integral, mean, variance] = self.integral(k - u);
        let (less, peak) = (self.shape - 1.0, self.peak(k - u));
        let half_log_tau = 0.918_938_533_204_672_7;
        // (peak^2 - u^2)/2, where peak - u = shape/peak - k.
        let squares = 0.5 * (self.shape / peak - k) * (peak + u);
        Terms {
            value: less * libm::log(k) - half_log_tau + squares + log_integral,
            u: mean - u,
            k: less / k - mean,
            uu: variance - 1.0,
            uk: -variance,
            kk: variance - less / (k * k),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::estimation::emg::terms;

    #[test]
    fn shape_1_is_the_exponential() {
        let gamma = GammaExcess::new(1.0);
        for u in [-8.0, -1.0, 0.5, 3.0, 40.0, 1e4] {
            for k in [1e-3, 0.1, 1.0, 20.0] {
                let (a, b) = (gamma.terms(u, k), terms(u, k));
                let close = |x: f64, y: f64, most: f64| (x - y).abs() <= most * y.abs().max(1.0);
                assert!(close(a.value, b.value, 1e-11), "{u} {k}: {a:?} {b:?}");
                assert!(
                    close(a.u, b.u, 1e-9) && close(a.k, b.k, 1e-9) && close(a.kk, b.kk, 1e-8),
                    "{u} {k}: {a:?} {b:?}"
                );
            }
        }
    }

    #[test]
    fn densities_are_those_of_parabolic_cylinder_functions() {
        // mpmath.pcfd: ln I = v^2/4 + ln D_{-shape}(v).
        for (shape, v, exact) in GOLDEN {
            let gamma = GammaExcess::new(shape);
            let found = gamma.integral(v)[0] + 0.5 * gamma.peak(v).powi(2);
            assert!(
                (found - exact).abs() < 1e-10 * exact.abs().max(1.0),
                "{shape} {v}: {found}, not {exact}"
            );
        }
    }

    const GOLDEN: [(f64, f64, f64); 28] = [
        (0.44, -12.0, 70.83074668654357),
        (0.44, -3.0, 4.174160581209176),
        (0.44, -0.5, 0.4354489320082475),
        (0.44, 0.0, 0.1828473891452171),
        (0.44, 1.0, -0.1508455398511117),
        (0.44, 6.0, -0.7967456525357747),
        (0.44, 40.0, -1.62330472033737),
        (0.5, -12.0, 71.10676168432962),
        (0.5, -3.0, 4.355489385238731),
        (0.5, -0.5, 0.47379850019938),
        (0.5, 0.0, 0.1957971963534184),
        (0.5, 1.0, -0.176067854564301),
        (0.5, 6.0, -0.9057746589177857),
        (0.5, 40.0, -1.844673809840625),
        (1.5, -12.0, 74.28129990040985),
        (1.5, -3.0, 6.07277666216247),
        (1.5, -0.5, 0.7288007647789215),
        (1.5, 0.0, 0.1507763939265543),
        (1.5, 1.0, -0.722167052456256),
        (1.5, 6.0, -2.73595239468538),
        (1.5, 40.0, -5.534488866761728),
        (3.0, -12.0, 77.2025250950653),
        (3.0, -3.0, 7.028356101923792),
        (3.0, -0.5, 0.390358871014383),
        (3.0, 0.0, -0.4673558279152179),
        (3.0, 1.0, -1.859955599790806),
        (3.0, 6.0, -5.524784787790554),
        (3.0, 40.0, -11.07037786928954),
    ];
}
