//! The exponentially modified Gaussian distribution, stable in all of its range.
//!
//! An observation is `y = c + sigma g + e` with `g` standard normal and `e` exponential of mean `1/eta`. With `u = (y - c)/sigma`,
//! `k = eta sigma` and `v = k - u` its density is `eta exp(h(u, k))`, where `h = -k u + k^2/2 + ln Phi(-v)`.
//!
//! # Source
//! Grushka, "Characterization of exponentially modified Gaussian peaks in chromatography" (Anal. Chem. 44, 1972); Sterling et al.,
//! "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5), 2019), eqs. 9 to
//! 20. Eqs. 12 and 15 overflow as printed, and eqs. 16 and 18 have errors in print; the forms here are those of the density itself.

use super::erfcx::erfcx;
use std::f64::consts::FRAC_1_SQRT_2;

/// `sqrt(2 / pi)`.
const SQRT_2_PI: f64 = 0.797_884_560_802_865_4;
/// `1 / sqrt(2 pi)`.
const INV_SQRT_TAU: f64 = 0.398_942_280_401_432_7;
/// Below this the normal hazard is 0 in double precision.
const NO_HAZARD: f64 = -38.0;

/// A function of `u` and `k`, with its first and second derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// Value.
    pub value: f64,
    /// `d/du`.
    pub u: f64,
    /// `d/dk`.
    pub k: f64,
    /// `d^2/du^2`.
    pub uu: f64,
    /// `d^2/du dk`.
    pub uk: f64,
    /// `d^2/dk^2`.
    pub kk: f64,
}

/// The normal hazard `m = phi(v) / Phi(-v)`, `q = v - m` and `q' = 1 + m q`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hazard {
    /// `phi(v) / Phi(-v)`.
    pub m: f64,
    /// `v - m`, below 0.
    pub q: f64,
    /// Derivative of `q`, from 0 to 1.
    pub dq: f64,
}

/// Number of terms of the continued fraction that leave a relative error of 1e-16.
fn depth(v: f64) -> u32 {
    match v {
        v if v >= 40.0 => 9,
        v if v >= 20.0 => 11,
        v if v >= 12.0 => 15,
        v if v >= 8.0 => 20,
        v if v >= 6.0 => 28,
        _ => 42,
    }
}

/// The hazard at `v >= 4`, where `v - m` as a difference loses its digits.
///
/// `t = v + 3/(v + 4/(v + ...))` is evaluated as one quotient by the recurrence of its convergents.
fn tail_hazard(v: f64) -> Hazard {
    if v > 1e8 {
        return Hazard { m: v + 1.0 / v, q: -1.0 / v, dq: 1.0 / (v * v) };
    }
    let (mut top, mut bottom) = ([1.0, v], [0.0, 1.0]);
    for j in 3..depth(v) + 3 {
        let j = f64::from(j);
        top = [top[1], v * top[1] + j * top[0]];
        bottom = [bottom[1], v * bottom[1] + j * bottom[0]];
    }
    let two_t = 2.0 * bottom[1] / top[1];
    let d = 1.0 / (v + two_t);
    Hazard { m: v + d, q: -d, dq: d * (two_t - d) }
}

/// The normal hazard and its derivatives.
#[must_use]
pub fn hazard(v: f64) -> Hazard {
    if v >= 4.0 {
        return tail_hazard(v);
    }
    let m = if v >= 0.0 {
        SQRT_2_PI / erfcx(v * FRAC_1_SQRT_2)
    } else if v > NO_HAZARD {
        let density = libm::exp(-0.5 * v * v);
        INV_SQRT_TAU * density / (1.0 - 0.5 * density * erfcx(-v * FRAC_1_SQRT_2))
    } else {
        0.0
    };
    let q = v - m;
    Hazard { m, q, dq: 1.0 + m * q }
}

/// `h(u, k)` with its derivatives.
#[must_use]
pub fn terms(u: f64, k: f64) -> Terms {
    let v = k - u;
    if v >= 0.0 {
        let scaled = erfcx(v * FRAC_1_SQRT_2);
        let Hazard { q, dq, .. } = if v >= 4.0 {
            tail_hazard(v)
        } else {
            let m = SQRT_2_PI / scaled;
            Hazard { m, q: v - m, dq: 1.0 + m * (v - m) }
        };
        let value = libm::log(0.5 * scaled) - 0.5 * u * u;
        return Terms { value, u: -(u + q), k: q, uu: dq - 1.0, uk: -dq, kk: dq };
    }
    let (m, log_phi) = if v > NO_HAZARD {
        let density = libm::exp(-0.5 * v * v);
        let half_tail = 0.5 * density * erfcx(-v * FRAC_1_SQRT_2);
        (INV_SQRT_TAU * density / (1.0 - half_tail), libm::log1p(-half_tail))
    } else {
        (0.0, 0.0)
    };
    let q = v - m;
    // q' = 1 + m q, which is 1 to the last digit far below 0.
    Terms {
        value: k * (0.5 * k - u) + log_phi,
        u: m - k,
        k: q,
        uu: m * q,
        uk: -(1.0 + m * q),
        kk: 1.0 + m * q,
    }
}

/// `h(u, k)` alone.
#[must_use]
pub fn log_shape(u: f64, k: f64) -> f64 {
    let v = k - u;
    if v >= 0.0 {
        return libm::log(0.5 * erfcx(v * FRAC_1_SQRT_2)) - 0.5 * u * u;
    }
    let log_phi = if v > NO_HAZARD {
        libm::log1p(-0.5 * libm::exp(-0.5 * v * v) * erfcx(-v * FRAC_1_SQRT_2))
    } else {
        0.0
    };
    k * (0.5 * k - u) + log_phi
}

/// `-ln S` with its derivatives, where `S = Phi(-u) + exp(h(u, k))` is the probability of an observation above `u`.
#[must_use]
pub fn negative_log_survivor(u: f64, k: f64) -> Terms {
    let h = terms(u, k);
    let e = libm::exp(h.value);
    let s = 0.5 * libm::erfc(u * FRAC_1_SQRT_2) + e;
    if s <= 0.0 {
        // Far above the curve, where the exponential tail is all that is left: S = exp(h).
        return Terms { value: -h.value, u: -h.u, k: -h.k, uu: -h.uu, uk: -h.uk, kk: -h.kk };
    }
    let (su, sk) = (-k * e / s, e * h.k / s);
    let (suu, suk) = (-k * e * h.u / s, -(e + k * e * h.k) / s);
    let skk = e * (h.kk + h.k * h.k) / s;
    Terms { value: -libm::log(s), u: -su, k: -sk, uu: su * su - suu, uk: su * sk - suk, kk: sk * sk - skk }
}

/// One distribution: the curve's value, the noise and the rate of the excess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emg {
    /// Location: the material's part `c`, 1/s.
    pub c: f64,
    /// Standard deviation of the normal part, 1/s; 0 for none.
    pub sigma: f64,
    /// Rate of the exponential part, s; infinite for none.
    pub eta: f64,
}

impl Emg {
    fn coordinates(&self, y: f64) -> (f64, f64) {
        ((y - self.c) / self.sigma, self.eta * self.sigma)
    }

    /// Logarithm of the density at `y`.
    #[must_use]
    pub fn log_density(&self, y: f64) -> f64 {
        if self.sigma == 0.0 {
            let excess = y - self.c;
            return if excess >= 0.0 { libm::log(self.eta) - self.eta * excess } else { f64::NEG_INFINITY };
        }
        let (u, k) = self.coordinates(y);
        if self.eta.is_infinite() {
            return libm::log(INV_SQRT_TAU / self.sigma) - 0.5 * u * u;
        }
        libm::log(self.eta) + log_shape(u, k)
    }

    /// Derivatives of [`log_density`](Self::log_density) in `c`, `ln sigma` and `ln eta`.
    #[must_use]
    pub fn gradient(&self, y: f64) -> [f64; 3] {
        if self.sigma == 0.0 {
            return [self.eta, 0.0, 1.0 - self.eta * (y - self.c)];
        }
        let (u, k) = self.coordinates(y);
        if self.eta.is_infinite() {
            return [u / self.sigma, u * u - 1.0, 0.0];
        }
        let h = terms(u, k);
        if k - u >= 0.0 {
            [-h.u / self.sigma, u * u + h.k * (u + k), 1.0 + k * h.k]
        } else {
            let m = h.u + k;
            [-h.u / self.sigma, k * k - m * (u + k), 1.0 + k * h.k]
        }
    }

    /// Probability of an observation of at most `y`.
    #[must_use]
    pub fn cdf(&self, y: f64) -> f64 {
        if self.sigma == 0.0 {
            return -libm::expm1(-self.eta * (y - self.c).max(0.0));
        }
        let (u, k) = self.coordinates(y);
        let normal = 0.5 * libm::erfc(-u * FRAC_1_SQRT_2);
        if self.eta.is_infinite() { normal } else { (normal - libm::exp(log_shape(u, k))).max(0.0) }
    }

    /// Probability of an observation above `y`.
    #[must_use]
    pub fn survivor(&self, y: f64) -> f64 {
        if self.sigma == 0.0 {
            return libm::exp(-self.eta * (y - self.c).max(0.0));
        }
        let (u, k) = self.coordinates(y);
        let normal = 0.5 * libm::erfc(u * FRAC_1_SQRT_2);
        if self.eta.is_infinite() { normal } else { normal + libm::exp(log_shape(u, k)) }
    }

    /// Mean and variance of the excess `e` of an observation `y`.
    #[must_use]
    pub fn excess(&self, y: f64) -> (f64, f64) {
        if self.sigma == 0.0 {
            return (y - self.c, 0.0);
        }
        if self.eta.is_infinite() {
            return (0.0, 0.0);
        }
        let (u, k) = self.coordinates(y);
        let Hazard { q, dq, .. } = hazard(k - u);
        (-self.sigma * q, self.sigma * self.sigma * dq)
    }
}

#[cfg(test)]
mod tests;
