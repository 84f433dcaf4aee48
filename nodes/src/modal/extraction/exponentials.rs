//! Sums and products of decaying exponentials over a range of samples.
//!
//! An exponential is `exp(s n)`, `n = 0, 1, ...`, with `s = (-d + i omega) / rate`; its pole is `z = exp(s)`.

use rayon::prelude::*;
use rustfft::num_complex::Complex;

/// A complex number.
pub(super) type C = Complex<f64>;

/// Number of exponentials that run at once, one in each lane.
const LANES: usize = 8;

/// The exponential of a complex number.
pub(super) fn exp(s: C) -> C {
    C::from_polar(libm::exp(s.re), s.im)
}

/// Moments `sum over n < count of n^p exp(s n)` for p = 0, 1 and 2.
///
/// By doubling: the sums over `2 m` samples follow from those over `m`, without the cancellation of the closed forms near `s = 0`.
///
/// # Complexity
/// O(log count).
pub(super) fn moments(s: C, count: usize) -> [C; 3] {
    let zero = C::new(0.0, 0.0);
    let mut sums = [zero; 3];
    // `sums` hold the first `m` samples, the leading bits of `count`; `power` is exp(s m).
    let (mut m, mut power) = (0_usize, C::new(1.0, 0.0));
    let z = exp(s);
    for bit in (0..usize::BITS - count.leading_zeros()).rev() {
        let [a, b, c] = sums;
        let length = m as f64;
        sums = [
            a + power * a,
            b + power * (b + a * length),
            c + power * (c + b * (2.0 * length) + a * (length * length)),
        ];
        (m, power) = (2 * m, power * power);
        if count >> bit & 1 == 1 {
            let length = m as f64;
            sums = [sums[0] + power, sums[1] + power * length, sums[2] + power * (length * length)];
            (m, power) = (m + 1, power * z);
        }
    }
    sums
}

/// Products of a signal with exponentials: `sum over n of x[n] conj(exp(s n))`.
///
/// # Complexity
/// O(samples exponentials).
pub(super) fn products(x: &[f64], exponents: &[C]) -> Vec<C> {
    let of = |group: &[C]| horner::<false>(x, group).into_iter().map(|p| p[0]).collect::<Vec<C>>();
    exponents.par_chunks(LANES).flat_map_iter(of).collect()
}

/// The [`products`], and those with `n x[n]`.
///
/// # Complexity
/// O(samples exponentials).
pub(super) fn moment_products(x: &[f64], exponents: &[C]) -> Vec<[C; 2]> {
    exponents.par_chunks(LANES).flat_map_iter(|group| horner::<true>(x, group)).collect()
}

/// Products with one group of exponentials, by Horner's scheme from the last sample on, for the polynomial and for its derivative.
fn horner<const MOMENTS: bool>(x: &[f64], group: &[C]) -> Vec<[C; 2]> {
    let (mut c, mut s) = ([0.0; LANES], [0.0; LANES]);
    for (k, exponent) in group.iter().enumerate() {
        let z = exp(exponent.conj());
        (c[k], s[k]) = (z.re, z.im);
    }
    let (mut re, mut im, mut dre, mut dim) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for &x in x.iter().rev() {
        for k in 0..LANES {
            let (a, b) = (re[k], im[k]);
            if MOMENTS {
                let (p, q) = (dre[k], dim[k]);
                dre[k] = p * c[k] - q * s[k] + a;
                dim[k] = p * s[k] + q * c[k] + b;
            }
            re[k] = a * c[k] - b * s[k] + x;
            im[k] = a * s[k] + b * c[k];
        }
    }
    let each = |k: usize| [C::new(re[k], im[k]), C::new(dre[k], dim[k]) * C::new(c[k], s[k])];
    (0..group.len()).map(each).collect()
}

/// Adds `sum of Re(amplitude exp(s n))` to a signal.
pub(super) fn add(x: &mut [f64], exponents: &[C], amplitudes: &[C]) {
    for (exponents, amplitudes) in exponents.chunks(LANES).zip(amplitudes.chunks(LANES)) {
        let (mut c, mut s, mut re, mut im) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (k, (exponent, a)) in exponents.iter().zip(amplitudes).enumerate() {
            let z = exp(*exponent);
            (c[k], s[k], re[k], im[k]) = (z.re, z.im, a.re, a.im);
        }
        for x in &mut *x {
            let mut sum = 0.0;
            for k in 0..LANES {
                let (a, b) = (re[k], im[k]);
                sum += a;
                re[k] = a * c[k] - b * s[k];
                im[k] = a * s[k] + b * c[k];
            }
            *x += sum;
        }
    }
}

/// The energy of a signal.
pub(super) fn energy(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_equal_the_sums() {
        for (s, count) in [
            (C::new(-1e-3, 0.2), 1000),
            (C::new(-1e-9, 1e-8), 77),
            (C::new(-0.5, 3.0), 1),
            (C::new(0.0, 0.0), 9),
            (C::new(-0.01, 0.1), 0),
        ] {
            let found = moments(s, count);
            for (p, found) in found.iter().enumerate() {
                let terms = (0..count).map(|n| exp(s * n as f64) * (n as f64).powi(p as i32));
                let size: f64 = terms.clone().map(|x| x.norm()).sum();
                let sum: C = terms.sum();
                assert!((found - sum).norm() <= 1e-12 * size, "{s} {count} {p}: {found} {sum}");
            }
        }
    }

    #[test]
    fn products_and_sums_equal_their_definitions() {
        let exponents: Vec<C> =
            (0..11).map(|k| C::new(-0.001 * f64::from(k + 1), 0.1 * f64::from(k))).collect();
        let amplitudes: Vec<C> = (0..11).map(|k| C::new(1.0, -0.3 * f64::from(k))).collect();
        let mut x = vec![0.25; 300];
        add(&mut x, &exponents, &amplitudes);
        for (n, x) in x.iter().enumerate() {
            let sum: f64 = exponents.iter().zip(&amplitudes).map(|(s, a)| (a * exp(s * n as f64)).re).sum();
            assert!((x - 0.25 - sum).abs() < 1e-11);
        }
        let first: Vec<C> = moment_products(&x, &exponents).iter().map(|p| p[0]).collect();
        assert_eq!(products(&x, &exponents), first);
        for (s, found) in exponents.iter().zip(moment_products(&x, &exponents)) {
            for (p, found) in found.iter().enumerate() {
                let at = |n: usize| exp(s.conj() * n as f64) * x[n] * (n as f64).powi(p as i32);
                let sum: C = (0..x.len()).map(at).sum();
                assert!((found - sum).norm() < 1e-9 * (1.0 + sum.norm()));
            }
        }
    }
}
