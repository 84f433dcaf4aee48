//! Candidates for modes: subband ESPRIT.

use super::exponentials::{C, energy};
use super::refinement::Limits;
use faer::Mat;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// One analysis into bands.
#[derive(Clone, Copy, Debug)]
struct Analysis {
    /// Samples of the recording per sample of a band, at 44.1 kHz.
    decimation: usize,
    /// Frequency up to which bands are analysed, Hz.
    highest: f64,
}

/// Wide bands up to the highest frequency, and narrow ones in the bass, which separate close modes.
const ANALYSES: [Analysis; 2] =
    [Analysis { decimation: 32, highest: 20_000.0 }, Analysis { decimation: 128, highest: 3000.0 }];
/// Orders of the model in each band; the modes of both are candidates.
const ORDERS: [usize; 2] = [7, 14];
/// Maximum number of samples of a band.
const LONGEST: usize = 600;
/// Minimum number of samples of a band.
const SHORTEST: usize = 24;
/// Part of the energy of a band after which it is cut.
const ENERGY: f64 = 0.99999;

/// Exponents of the damped sines in bands of a recording that begins with the onset.
///
/// Each band is shifted to 0 Hz, filtered *against* time, and decimated. A filter that looks ahead maps a decaying exponential to itself
/// times a constant from its first sample on, without a transient. In each band the poles of the signal are those of ESPRIT with a
/// Hankel matrix of a third of its length.
///
/// # Complexity
/// O(samples bands + bands m^3), with at most 600 samples in a band and m a third of them.
///
/// # Source
/// Sirdey, Derrien, Kronland-Martinet and Aramaki, "Modal analysis of impact sounds with ESPRIT in Gabor transforms" (DAFx 2011), with
/// a low-pass filter in place of the Gabor window.
pub(super) fn candidates(x: &[f64], rate: f64, limits: &Limits) -> Vec<C> {
    let scale = rate / 44_100.0;
    let bands: Vec<(usize, f64)> = ANALYSES
        .iter()
        .flat_map(|a| {
            let decimation = ((a.decimation as f64 * scale).round() as usize).max(1);
            let step = rate / (2.0 * decimation as f64);
            let top = a.highest.min(limits.band[1]);
            let centres = (0..).map(move |k| (0.5 + f64::from(k)) * step);
            centres.take_while(move |f| f - 0.5 * step < top).map(move |f| (decimation, f))
        })
        .filter(|(decimation, f)| f + rate / (4.0 * *decimation as f64) > limits.band[0])
        .collect();
    let found: Vec<Vec<C>> =
        bands.par_iter().map(|(decimation, f)| in_band(x, rate, *decimation, *f, limits.decays)).collect();
    let inside = |s: &C| {
        let f = s.im * rate / TAU;
        (limits.band[0]..=limits.band[1]).contains(&f)
    };
    found.into_iter().flatten().filter(inside).collect()
}

/// Exponents of the damped sines within one band.
fn in_band(x: &[f64], rate: f64, decimation: usize, centre: f64, [slowest, fastest]: [f64; 2]) -> Vec<C> {
    let v = demodulated(x, decimation, TAU * centre / rate);
    let total: f64 = v.iter().map(|z| z.norm_sqr()).sum();
    if total <= 1e-24 * energy(x) {
        return Vec::new();
    }
    let mut sum = 0.0;
    let passed = v.iter().position(|z| {
        sum += z.norm_sqr();
        sum >= ENERGY * total
    });
    let length = passed.map_or(v.len(), |n| (n + 1).max(SHORTEST)).min(LONGEST).min(v.len());
    if length < SHORTEST / 2 {
        return Vec::new();
    }
    let half = 1.3 * 0.25 * rate / decimation as f64;
    let r = decimation as f64;
    let of_pole = |pole: C| {
        let angle = pole.arg() / r;
        // A pole on or beyond the unit circle is a sound that does not decay: it counts with the smallest decay rate.
        let decay = (-pole.norm().max(1e-300).ln() * rate / r).max(slowest);
        let near = (angle * rate / TAU).abs() <= half && decay < fastest;
        near.then(|| C::new(-decay / rate, TAU * centre / rate + angle))
    };
    poles(&v[..length]).into_iter().filter_map(of_pole).collect()
}

/// A band around `omega` radians a sample, shifted to 0 Hz and decimated.
fn demodulated(x: &[f64], decimation: usize, omega: f64) -> Vec<C> {
    let taps = 6 * decimation + 1;
    let middle = 0.5 * (taps - 1) as f64;
    // A low-pass filter with a Hamming window; its cutoff lies at 0.9 of half the rate of the band.
    let cutoff = 0.9 / decimation as f64;
    let filter: Vec<C> = (0..taps)
        .map(|k| {
            let t = k as f64 - middle;
            let sinc = if t == 0.0 { cutoff } else { libm::sin(PI * cutoff * t) / (PI * t) };
            let window = 0.54 - 0.46 * libm::cos(TAU * k as f64 / (taps - 1) as f64);
            C::from_polar(sinc * window, -omega * k as f64)
        })
        .collect();
    (0..x.len().div_ceil(decimation))
        .map(|k| {
            let first = k * decimation;
            let sum: C = x[first..].iter().zip(&filter).map(|(x, h)| h * *x).sum();
            sum * C::from_polar(1.0, -omega * first as f64)
        })
        .collect()
}

/// Poles of a complex signal by ESPRIT with each of [`ORDERS`].
fn poles(v: &[C]) -> Vec<C> {
    let rows = v.len() / 3;
    let columns = v.len() - rows + 1;
    // The covariance `H H^H` of the Hankel matrix: each entry follows from its diagonal predecessor.
    let mut covariance = Mat::<C>::zeros(rows, rows);
    for j in 0..rows {
        covariance[(0, j)] = (0..columns).map(|k| v[k] * v[k + j].conj()).sum();
    }
    for i in 1..rows {
        for j in i..rows {
            covariance[(i, j)] = covariance[(i - 1, j - 1)] - v[i - 1] * v[j - 1].conj()
                + v[i - 1 + columns] * v[j - 1 + columns].conj();
        }
    }
    // The lower triangle is read. The decomposition has absolute tolerances: the largest entry becomes 1.
    let largest = (0..rows).map(|i| covariance[(i, i)].re).fold(f64::MIN_POSITIVE, f64::max);
    let lower = Mat::from_fn(rows, rows, |i, j| {
        if i >= j { covariance[(j, i)].conj() / largest } else { covariance[(i, j)] / largest }
    });
    let Ok(decomposition) = lower.self_adjoint_eigen(faer::Side::Lower) else { return Vec::new() };
    let u = decomposition.U();
    let mut out: Vec<C> = Vec::new();
    let mut before = 0;
    for order in ORDERS {
        let order = order.min(rows.saturating_sub(1));
        if order == before {
            continue;
        }
        before = order;
        // Eigenvalues are in ascending order.
        let signal = Mat::from_fn(rows, order, |i, j| u[(i, rows - 1 - j)]);
        out.extend(rotation_poles(&signal));
    }
    out
}

/// Eigenvalues of the matrix that maps a signal subspace without its last row to that without its first row.
fn rotation_poles(signal: &Mat<C>) -> Vec<C> {
    let (rows, order) = (signal.nrows(), signal.ncols());
    let (upper, lower) = (signal.subrows(0, rows - 1), signal.subrows(1, rows - 1));
    let product = upper.adjoint() * lower;
    // The Gram matrix of `upper` is `I - conj(u) u^T` with the last row u; its inverse is that of Sherman and Morrison.
    let last = signal.row(rows - 1);
    let size: f64 = (0..order).map(|k| last[k].norm_sqr()).sum();
    if size >= 1.0 - 1e-12 {
        return Vec::new();
    }
    let along: Vec<C> =
        (0..order).map(|j| (0..order).map(|k| last[k] * product[(k, j)]).sum::<C>() / (1.0 - size)).collect();
    let rotation = Mat::from_fn(order, order, |i, j| product[(i, j)] + last[i].conj() * along[j]);
    let finite = (0..order).all(|i| (0..order).all(|j| rotation[(i, j)].is_finite()));
    if finite { rotation.eigenvalues().unwrap_or_default() } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::super::exponentials::add;
    use super::*;

    #[test]
    fn clean_modes_are_found_from_their_first_sample_on() {
        for rate in [44_100.0, 96_000.0] {
            let truth = [(440.0, 4.0), (443.0, 5.0), (2500.0, 30.0), (9000.0, 200.0)];
            let exponents: Vec<C> = truth.iter().map(|(f, d)| C::new(-d / rate, TAU * f / rate)).collect();
            let mut x = vec![0.0; rate as usize];
            add(&mut x, &exponents, &[C::new(1.0, 0.5); 4]);
            let found = candidates(&x, rate, &Limits { band: [20.0, 20_000.0], decays: [0.1, 8000.0] });
            for (f, d) in truth {
                let near =
                    |s: &&C| (s.im * rate / TAU - f).abs() < 0.05 && (-s.re * rate / d - 1.0).abs() < 0.01;
                assert!(found.iter().any(|s| near(&s)), "{f} Hz at {rate} Hz");
            }
        }
    }
}
