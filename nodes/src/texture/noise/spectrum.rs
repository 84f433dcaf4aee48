//! Statistical models of noise: spectrum as poles or bands, variance, and the distribution of noise with a high kurtosis.
//!
//! # Source
//! Burg, "Maximum entropy spectral analysis" (1975); an implementation of the statistical code of Picard, Tsingos and Faure (VRIPHYS
//! 2008), section 4.2.

use super::profile::{set_variance, variance};
use super::psd;
use crate::core::random::Random;
use crate::texture::holes::{row_segments, valid_samples};
use crate::texture::maps::NoiseMap;
use std::f64::consts::TAU;

/// Order of the all-pole model.
pub const ORDER: usize = 16;
/// Kurtosis above which the model has the distribution.
const MAX_KURTOSIS: f64 = 4.0;
/// Number of quantiles of a distribution.
const QUANTILES: usize = 256;
/// Maximum number of rows for a fit of poles.
const POLE_ROWS: usize = 128;
/// Maximum number of rows for a measurement of bands.
const BAND_ROWS: usize = 512;

/// A spectrum of noise.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// `x[n] = w[n] - sum a[k] x[n - 1 - k]`.
    Poles(Vec<f64>),
    /// Power spectral density in each of 32 bands: see [`psd`].
    Bands(Vec<f64>),
}

/// A statistical model of noise.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    /// Its spectrum.
    pub spectrum: Spectrum,
    /// Mean square.
    pub variance: f64,
    /// Evenly spaced quantiles of the values; empty for noise with a kurtosis of at most 4.
    pub quantiles: Vec<f32>,
}

impl NoiseModel {
    /// Fits poles to rows of a map; `kurtosis` is that of the map.
    ///
    /// # Complexity
    /// `O(pixels * order)`, of 128 rows at most.
    #[must_use]
    pub fn poles(noise: &NoiseMap, kurtosis: f64) -> Self {
        Self::new(noise, kurtosis, Spectrum::Poles(burg(&rows(noise, POLE_ROWS), ORDER)))
    }

    /// Measures the bands of rows of a map; `kurtosis` is that of the map.
    ///
    /// # Complexity
    /// As [`psd::densities`], of 512 rows at most.
    #[must_use]
    pub fn bands(noise: &NoiseMap, kurtosis: f64) -> Self {
        Self::new(noise, kurtosis, Spectrum::Bands(psd::densities(&rows(noise, BAND_ROWS))))
    }

    fn new(noise: &NoiseMap, kurtosis: f64, spectrum: Spectrum) -> Self {
        let map = &noise.grid;
        let mut quantiles = Vec::new();
        if kurtosis > MAX_KURTOSIS {
            let mut sorted: Vec<f32> = valid_samples(map, &noise.holes).collect();
            sorted.sort_unstable_by(f32::total_cmp);
            let at = |k: usize| (k * 2 + 1) * sorted.len() / (2 * QUANTILES);
            quantiles = (0..QUANTILES).filter_map(|k| sorted.get(at(k)).copied()).collect();
        }
        Self { spectrum, variance: variance(valid_samples(map, &noise.holes)), quantiles }
    }

    /// Size in bytes, at 32 bits per number.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let (Spectrum::Poles(numbers) | Spectrum::Bands(numbers)) = &self.spectrum;
        4 * (numbers.len() + 1 + self.quantiles.len())
    }

    /// Synthesises a closed loop of `count` samples.
    ///
    /// # Complexity
    /// `O(count * order)` for poles; `O(count log count)` for bands and for noise with a distribution.
    #[must_use]
    pub fn synthesize(&self, count: usize, random: &Random) -> Vec<f32> {
        let mut line = match &self.spectrum {
            Spectrum::Poles(poles) => filtered(poles, count, random),
            Spectrum::Bands(densities) => psd::synthesize(densities, count, random),
        };
        if !self.quantiles.is_empty() {
            self.match_ranks(&mut line);
        }
        set_variance(&mut line, self.variance);
        line
    }

    /// Replaces each sample by the quantile of its rank.
    fn match_ranks(&self, line: &mut [f32]) {
        let mut order: Vec<usize> = (0..line.len()).collect();
        order.sort_by(|a, b| line[*a].total_cmp(&line[*b]));
        let last = self.quantiles.len() - 1;
        for (rank, at) in order.into_iter().enumerate() {
            let position = (rank as f32 + 0.5) / line.len() as f32 * self.quantiles.len() as f32 - 0.5;
            let position = position.clamp(0.0, last as f32);
            let low = (position as usize).min(last);
            let (a, b) = (self.quantiles[low], self.quantiles[(low + 1).min(last)]);
            line[at] = a + (b - a) * (position - low as f32);
        }
    }
}

/// Segments between holes of at most `max` evenly spaced rows of a map, without short segments.
fn rows(noise: &NoiseMap, max: usize) -> Vec<&[f32]> {
    let long = |line: &&[f32]| line.len() > 2 * ORDER || line.len() == noise.grid.width;
    let row = |y| row_segments(&noise.grid, &noise.holes, y).into_iter().filter(long).collect();
    let mut lines: Vec<Vec<&[f32]>> = (0..noise.grid.height).map(row).collect();
    lines.retain(|line| !line.is_empty());
    let step = lines.len().div_ceil(max).max(1);
    lines.into_iter().step_by(step).flatten().collect()
}

/// Filters white noise by an all-pole filter to a closed loop.
fn filtered(poles: &[f64], count: usize, random: &Random) -> Vec<f32> {
    let white: Vec<f64> = (0..count).map(|k| normal(random, k as u64)).collect();
    let mut history = [0.0; ORDER];
    let mut line = vec![0.0_f32; count];
    // In the second pass the transient of the start has decayed, so that the loop is closed.
    for _ in 0..2 {
        for (out, w) in line.iter_mut().zip(&white) {
            let x = w - poles.iter().zip(&history).map(|(a, x)| a * x).sum::<f64>();
            history.rotate_right(1);
            history[0] = x;
            *out = x as f32;
        }
    }
    line
}

/// A normally distributed number of variance 1, by the Box-Muller transform.
pub(super) fn normal(random: &Random, index: u64) -> f64 {
    let (u, v) = (random.uniform(0, index, 0), random.uniform(0, index, 1));
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
}

/// Returns the coefficients of the all-pole model of several lines, by Burg's method. The model is always stable.
#[must_use]
pub fn burg(lines: &[&[f32]], order: usize) -> Vec<f64> {
    let mut forward: Vec<Vec<f64>> =
        lines.iter().map(|line| line.iter().map(|x| f64::from(*x)).collect()).collect();
    let mut backward = forward.clone();
    let mut poles: Vec<f64> = Vec::new();
    for m in 0..order {
        let (mut product, mut power) = (0.0, 0.0);
        for (f, b) in forward.iter().zip(&backward) {
            for (f, b) in f.iter().skip(m + 1).zip(b.iter().skip(m)) {
                product += f * b;
                power += f * f + b * b;
            }
        }
        // Below 1, so that the filter of an exactly periodic line decays.
        let k = if power > 0.0 { (-2.0 * product / power).clamp(-0.9999, 0.9999) } else { 0.0 };
        let reversed: Vec<f64> = poles.iter().rev().copied().collect();
        poles.iter_mut().zip(reversed).for_each(|(a, r)| *a += k * r);
        poles.push(k);
        for (f, b) in forward.iter_mut().zip(&mut backward) {
            // From the end, because each step reads the old previous sample.
            for n in (m + 1..f.len()).rev() {
                let (x, y) = (f[n], b[n - 1]);
                (f[n], b[n]) = (x + k * y, y + k * x);
            }
        }
    }
    poles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::noise::split::statistics;
    use crate::texture::{Grid, Surface};
    use foley_fft::FftPlanner;
    use rustfft::num_complex::Complex;

    /// A resonance at a tenth of the rate, and a decrease towards high frequencies.
    const TRUE: [f64; 3] = [-1.9, 1.42, -0.36];

    fn map(spiky: bool) -> NoiseMap {
        made(512, 256, spiky)
    }

    fn made(width: usize, height: usize, spiky: bool) -> NoiseMap {
        let random = Random::new(5, "map");
        let mut history = [0.0; 3];
        let mut k = 0;
        let grid = Grid::from_fn(width, height, |_, _| {
            k += 1;
            let x = normal(&random, k) - TRUE.iter().zip(history).map(|(a, x)| a * x).sum::<f64>();
            history = [x, history[0], history[1]];
            (if spiky { x * x * x * 0.1 } else { x }) as f32
        });
        NoiseMap { grid, holes: Vec::new(), surface: Surface::default() }
    }

    fn density(poles: &[f64], w: f64) -> f64 {
        let terms = poles.iter().enumerate().map(|(k, a)| Complex::from_polar(*a, -w * (k + 1) as f64));
        1.0 / (Complex::new(1.0, 0.0) + terms.sum::<Complex<f64>>()).norm_sqr()
    }

    #[test]
    fn burg_finds_the_poles_that_made_the_noise() {
        let map = map(false);
        let rows: Vec<&[f32]> = map.grid.samples.chunks(512).collect();
        for (a, b) in burg(&rows, 3).iter().zip(TRUE) {
            assert!((a - b).abs() < 0.01, "{a} {b}");
        }
        assert_eq!(burg(&[&[0.0; 100]], 4), [0.0; 4]);
        assert_eq!(burg(&[&[1.0]], 4), [0.0; 4]);
    }

    /// Mean power in each of 32 bands of loops of `n` samples, over seeds.
    fn powers(model: &NoiseModel, n: usize, seeds: u64) -> Vec<f64> {
        let transform = FftPlanner::new().plan_fft_forward(n);
        let mut bands = vec![0.0; psd::BANDS];
        for seed in 0..seeds {
            let line = model.synthesize(n, &Random::new(seed, "n"));
            let mut bins: Vec<Complex<f64>> = line.iter().map(|x| Complex::new(f64::from(*x), 0.0)).collect();
            transform.process(&mut bins);
            for (k, band) in bands.iter_mut().enumerate() {
                *band += mean(n, k, |k| bins[k].norm_sqr() / n as f64) / seeds as f64;
            }
        }
        bands
    }

    /// Mean over the bins of a band.
    fn mean(n: usize, band: usize, f: impl Fn(usize) -> f64) -> f64 {
        let [low, high] = [band, band + 1].map(|k| (psd::edge(k) * n as f64).ceil() as usize);
        (low..high).map(f).sum::<f64>() / (high - low) as f64
    }

    /// The exact power in each band of the noise of [`map`], for a variance.
    fn right(variance: f64) -> Vec<f64> {
        let n = 1 << 16;
        let at = |k: usize| density(&TRUE, TAU * k as f64 / n as f64);
        let whole: f64 = (1..n).map(at).sum::<f64>() / n as f64;
        (0..psd::BANDS).map(|band| variance * mean(n, band, at) / whole).collect()
    }

    #[test]
    fn synthesised_noise_has_the_spectrum_within_1_db_per_band_and_the_variance() {
        let n = 1 << 16;
        // Rows of 4096 pixels resolve all bands.
        let wide = made(4096, 256, false);
        let kurtosis = statistics(&wide.grid, &[]).kurtosis;
        for (model, bytes) in
            [(NoiseModel::poles(&wide, kurtosis), 68), (NoiseModel::bands(&wide, kurtosis), 132)]
        {
            assert!(model.quantiles.is_empty() && model.bytes() == bytes);
            let power = wide.grid.samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>()
                / wide.grid.samples.len() as f64;
            let line = model.synthesize(n, &Random::new(1, "n"));
            let ours = line.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / n as f64;
            assert!((ours / power - 1.0).abs() < 0.01, "{ours} {power}");
            // A single loop deviates randomly by up to 1 dB in the lowest bands, so sixteen are averaged.
            for (band, (ours, right)) in powers(&model, n, 16).iter().zip(right(power)).enumerate() {
                let db = 10.0 * (ours / right).log10();
                assert!(db.abs() < 1.0, "{bytes} bytes, band {band}: {db} dB");
            }
        }
    }

    #[test]
    fn synthesised_bands_of_a_small_map_are_within_1_db_of_its_density() {
        let map = map(false);
        let model = NoiseModel::bands(&map, statistics(&map.grid, &[]).kurtosis);
        let Spectrum::Bands(measured) = &model.spectrum else { panic!("bands are expected") };
        let right = right(model.variance);
        for (k, ours) in powers(&model, 1 << 16, 1).iter().enumerate() {
            let db = 10.0 * (ours / measured[k]).log10();
            assert!(db.abs() < 1.0, "band {k} against the map: {db} dB");
            // Rows of 512 pixels have only a few periods of the lowest bands.
            let db = 10.0 * (ours / right[k]).log10();
            assert!(k < 12 || db.abs() < 1.0, "band {k} against what made the map: {db} dB");
        }
    }

    #[test]
    fn noise_of_a_high_kurtosis_keeps_its_distribution() {
        let map = map(true);
        let kurtosis = statistics(&map.grid, &[]).kurtosis;
        assert!(kurtosis > 10.0, "{kurtosis}");
        for model in [NoiseModel::poles(&map, kurtosis), NoiseModel::bands(&map, kurtosis)] {
            let line = model.synthesize(1 << 15, &Random::new(1, "n"));
            assert!((variance(line.iter().copied()) / model.variance - 1.0).abs() < 0.01);
            let tall = Grid { width: line.len(), height: 1, samples: line };
            assert!(statistics(&tall, &[]).kurtosis > 6.0, "{}", statistics(&tall, &[]).kurtosis);
        }
    }

    #[test]
    fn the_loop_is_closed_and_depends_on_the_seed() {
        let model = NoiseModel::poles(&map(false), 3.0);
        let Spectrum::Poles(poles) = &model.spectrum else { panic!("poles are expected") };
        let line = model.synthesize(4096, &Random::new(1, "n"));
        assert_eq!(line, model.synthesize(4096, &Random::new(1, "n")));
        assert_ne!(line, model.synthesize(4096, &Random::new(2, "n")));
        let n = line.len();
        // The prediction error of the first samples from the last is as small as elsewhere.
        let predicted = |k: usize| -> f64 {
            poles.iter().enumerate().map(|(j, a)| -a * f64::from(line[(k + n - 1 - j) % n])).sum()
        };
        let error = |k: usize| (f64::from(line[k]) - predicted(k)).powi(2);
        let mean = (0..n).map(error).sum::<f64>() / n as f64;
        assert!((0..16).map(error).sum::<f64>() / 16.0 < 3.0 * mean);
    }

    #[test]
    fn half_a_hole_has_the_model_of_the_other_half() {
        for spiky in [false, true] {
            let half = map(spiky);
            let grid =
                Grid::from_fn(1024, 256, |x, y| if x < 512 { half.grid.samples[512 * y + x] } else { 0.0 });
            let holes: Vec<bool> = (0..1024 * 256).map(|k| k % 1024 >= 512).collect();
            let wide = NoiseMap { grid, holes, surface: half.surface };
            let kurtosis = statistics(&wide.grid, &wide.holes).kurtosis;
            assert_eq!(NoiseModel::poles(&wide, kurtosis), NoiseModel::poles(&half, kurtosis));
            assert_eq!(NoiseModel::bands(&wide, kurtosis), NoiseModel::bands(&half, kurtosis));
        }
    }
}
