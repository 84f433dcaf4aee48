//! The power spectral density of noise in 32 bands of equal logarithmic width.
//!
//! # Source
//! An implementation of the statistical code of Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2; densities by the mean of
//! windowed periodograms (Welch 1967).

use crate::core::random::Random;
use foley_fft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Number of bands; four are an octave.
pub const BANDS: usize = 32;
/// Lower edge of the lowest band, cycles per pixel. Frequencies below it belong to that band too.
const LOWEST: f64 = 1.0 / 512.0;
/// Upper edge of the highest band, cycles per pixel.
const HIGHEST: f64 = 0.5;
/// Minimum length of a Fourier transform, so that each band has several bins.
const MIN_LENGTH: usize = 8192;

/// Lower edge of a band, cycles per pixel; `edge(BANDS)` is the highest frequency.
#[must_use]
pub fn edge(band: usize) -> f64 {
    LOWEST * (HIGHEST / LOWEST).powf(band as f64 / BANDS as f64)
}

/// Index of the band of a frequency.
fn band(f: f64) -> usize {
    let position = (f / LOWEST).ln() / (HIGHEST / LOWEST).ln() * BANDS as f64;
    // Rounding must not move a frequency on an edge to the band below.
    ((position + 1e-9).max(0.0) as usize).min(BANDS - 1)
}

/// Returns the mean power spectral density of lines in each band, in squared units per cycle per pixel; 0 if there are no lines.
///
/// # Complexity
/// `O(n log n)` per line, for `n` of at least 8192 samples.
#[must_use]
pub fn densities(lines: &[&[f32]]) -> Vec<f64> {
    let longest = lines.iter().map(|line| line.len()).max().unwrap_or(0);
    let n = longest.next_power_of_two().max(MIN_LENGTH);
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let (mut buffer, mut bins) = (transform.make_input_vec(), transform.make_output_vec());
    let mut powers = vec![0.0; bins.len()];
    let mut weight = 0.0;
    for line in lines {
        let mean = line.iter().map(|x| f64::from(*x)).sum::<f64>() / line.len().max(1) as f64;
        buffer.fill(0.0);
        for (k, (out, x)) in buffer.iter_mut().zip(*line).enumerate() {
            let window = 0.5 - 0.5 * libm::cos(TAU * (k as f64 + 0.5) / line.len() as f64);
            *out = (f64::from(*x) - mean) * window;
            weight += window * window;
        }
        // The buffers are from the plan, so that lengths match.
        if transform.process(&mut buffer, &mut bins).is_ok() {
            powers.iter_mut().zip(&bins).for_each(|(sum, bin)| *sum += bin.norm_sqr());
        }
    }
    let (mut sums, mut counts) = ([0.0; BANDS], [0.0_f64; BANDS]);
    for (k, power) in powers.iter().enumerate().take(n / 2).skip(1) {
        let f = k as f64 / n as f64;
        // Below the lowest band there is mostly the subtracted mean.
        if f >= LOWEST {
            sums[band(f)] += power;
            counts[band(f)] += 1.0;
        }
    }
    let unit = if weight > 0.0 { 1.0 / weight } else { 0.0 };
    sums.iter().zip(counts).map(|(sum, count)| unit * sum / count.max(1.0)).collect()
}

/// Synthesises a closed loop of `count` samples with the power of `densities` in each band, up to a common factor. Phases are random,
/// magnitudes are not.
///
/// # Complexity
/// `O(count log count)`.
#[must_use]
pub fn synthesize(densities: &[f64], count: usize, random: &Random) -> Vec<f32> {
    let transform = RealFftPlanner::<f64>::new().plan_fft_inverse(count.max(2));
    let (mut bins, mut out) = (transform.make_input_vec(), transform.make_output_vec());
    // Interpolated between bands, then scaled to the exact power of each.
    let curve: Vec<f64> = (0..bins.len()).map(|k| interpolate(densities, k as f64 / count as f64)).collect();
    let top = count.div_ceil(2);
    let (mut sums, mut counts) = ([0.0; BANDS], [0.0; BANDS]);
    for (k, power) in curve.iter().enumerate().take(top).skip(1) {
        let band = band(k as f64 / count as f64);
        sums[band] += power;
        counts[band] += 1.0;
    }
    for (k, (bin, power)) in bins.iter_mut().zip(&curve).enumerate().take(top).skip(1) {
        let band = band(k as f64 / count as f64);
        let wanted = densities.get(band).copied().unwrap_or(0.0) * counts[band];
        let gain = if sums[band] > 0.0 { wanted / sums[band] } else { 0.0 };
        *bin = Complex::from_polar((power * gain).sqrt(), TAU * random.uniform(0, k as u64, 0));
    }
    if transform.process(&mut bins, &mut out).is_err() {
        return vec![0.0; count];
    }
    out.truncate(count);
    out.iter().map(|x| *x as f32).collect()
}

/// Density at a frequency, by log-log interpolation between the centres of the bands.
fn interpolate(densities: &[f64], f: f64) -> f64 {
    let position = (f.max(1e-12) / LOWEST).ln() / (HIGHEST / LOWEST).ln() * BANDS as f64 - 0.5;
    let position = position.clamp(0.0, (BANDS - 1) as f64);
    let low = position as usize;
    let at = |k: usize| densities.get(k.min(BANDS - 1)).copied().unwrap_or(0.0).max(1e-300).ln();
    (at(low) + (position - low as f64) * (at(low + 1) - at(low))).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_a_quarter_of_an_octave_wide() {
        assert_eq!((edge(0), edge(BANDS)), (LOWEST, HIGHEST));
        for k in 0..BANDS {
            assert_eq!(band(edge(k)), k);
            assert!((edge(k + 1) / edge(k) - 2_f64.powf(0.25)).abs() < 1e-12);
        }
        assert_eq!((band(0.0), band(0.7)), (0, BANDS - 1));
    }

    #[test]
    fn a_sine_has_its_power_in_its_band() {
        for k in [6, 15, 23, 31] {
            let f = (edge(k) * edge(k + 1)).sqrt();
            let wave: Vec<f32> = (0..4096).map(|n| (TAU * f * f64::from(n)).sin() as f32).collect();
            let found = densities(&[&wave]);
            let power = |k: usize| 2.0 * found[k] * (edge(k + 1) - edge(k));
            let all: f64 = (0..BANDS).map(power).sum();
            assert!((all / 0.5 - 1.0).abs() < 0.1, "{f}: {all}");
            assert!(power(k) > 0.95 * all, "{f}: {found:?}");
        }
        assert_eq!(densities(&[]), [0.0; BANDS]);
    }

    #[test]
    fn a_synthesised_line_has_exactly_the_power_of_each_band() {
        // A steep fall with a narrow peak.
        let wanted: Vec<f64> =
            (0..BANDS).map(|k| edge(k).powi(-2) * if k == 20 { 30.0 } else { 1.0 }).collect();
        for count in [4096, 1 << 16] {
            let line = synthesize(&wanted, count, &Random::new(1, "n"));
            let transform = RealFftPlanner::<f64>::new().plan_fft_forward(count);
            let mut samples: Vec<f64> = line.iter().map(|x| f64::from(*x)).collect();
            let mut bins = transform.make_output_vec();
            transform.process(&mut samples, &mut bins).unwrap();
            let mean = |k: usize| {
                let all = (1..count / 2).filter(|b| band(*b as f64 / count as f64) == k);
                let all: Vec<f64> = all.map(|b| bins[b].norm_sqr()).collect();
                all.iter().sum::<f64>() / all.len() as f64
            };
            let unit = mean(0) / wanted[0];
            for (k, wanted) in wanted.iter().enumerate() {
                let db = 10.0 * (mean(k) / wanted / unit).log10();
                assert!(db.abs() < 0.05, "{count}, band {k}: {db} dB");
            }
        }
        assert!(synthesize(&[0.0; BANDS], 100, &Random::new(1, "n")).iter().all(|x| x.abs() < 1e-30));
    }
}
