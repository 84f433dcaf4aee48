//! Mel band energies and mel cepstrum of one unit of sound.

use super::conventions::{BandShape, FeatureConventions, FeatureWindow, LogScale, MelScale};
use super::frame_power::FramePower;
use crate::dsp::fold_lanes;
use fearless_simd::{Level, dispatch};
use std::f64::consts::PI;

impl MelScale {
    /// Converts a frequency in hertz to the scale.
    #[must_use]
    pub fn mel(self, f: f64) -> f64 {
        match self {
            Self::Htk => 2595.0 * (1.0 + f / 700.0).log10(),
            Self::Slaney if f < 1000.0 => f * 3.0 / 200.0,
            Self::Slaney => 15.0 + (f / 1000.0).ln() * 27.0 / 6.4_f64.ln(),
        }
    }

    /// Converts a value on the scale to a frequency in hertz.
    #[must_use]
    pub fn hz(self, mel: f64) -> f64 {
        match self {
            Self::Htk => 700.0 * (10f64.powf(mel / 2595.0) - 1.0),
            Self::Slaney if mel < 15.0 => mel * 200.0 / 3.0,
            Self::Slaney => 1000.0 * ((mel - 15.0) * 6.4_f64.ln() / 27.0).exp(),
        }
    }

    /// Returns `count + 1` frequencies from `low` to `high`, equally spaced on the scale.
    #[must_use]
    pub fn edges(self, low: f64, high: f64, count: usize) -> Vec<f64> {
        let (from, to) = (self.mel(low), self.mel(high));
        let mut edges: Vec<f64> =
            (0..=count).map(|k| self.hz(from + (to - from) * k as f64 / count.max(1) as f64)).collect();
        // The ends are exact.
        edges[0] = low;
        edges[count] = high;
        edges
    }
}

impl FeatureWindow {
    /// Returns the samples of the window.
    #[must_use]
    pub fn samples(self, frame: usize) -> Vec<f64> {
        let position = |i: usize| (i as f64 + 0.5) / frame as f64;
        match self {
            Self::Sine2 => (0..frame).map(|i| (PI * position(i)).sin()).collect(),
            Self::Rect => vec![1.0; frame],
            // Periodic, for spectral analysis.
            Self::Hann => {
                (0..frame).map(|i| 0.5 - 0.5 * (2.0 * PI * i as f64 / frame as f64).cos()).collect()
            }
        }
    }
}

/// Bins that are added together: many bands are as narrow.
const LANES: usize = 4;

/// One band: weights of adjacent bins, with weights of 0 up to a multiple of [`LANES`].
#[derive(Clone, Debug, PartialEq)]
struct Band {
    first: usize,
    weights: Vec<[f64; LANES]>,
}

/// Returns the weights of the bins of a spectrum in each band.
fn bands(c: &FeatureConventions, length: usize) -> Vec<Band> {
    let (count, rate) = (c.bands as usize, c.rate.as_f64());
    let (bins, df) = (length / 2 + 1, rate / length as f64);
    match c.shape {
        BandShape::Rectangular => {
            let edges = c.mel.edges(c.f_lo, c.f_hi, count);
            edges.windows(2).map(|e| sparse((0..bins).map(|k| share(k, df, rate, e[0], e[1])))).collect()
        }
        BandShape::Triangular | BandShape::TriangularArea => {
            let edges = c.mel.edges(c.f_lo, c.f_hi, count + 1);
            let scale = |e: &[f64]| match c.shape {
                BandShape::TriangularArea => 2.0 / (e[2] - e[0]),
                _ => 1.0,
            };
            let at =
                |f: f64, e: &[f64]| ((f - e[0]) / (e[1] - e[0])).min((e[2] - f) / (e[2] - e[1])).max(0.0);
            edges.windows(3).map(|e| sparse((0..bins).map(|k| scale(e) * at(k as f64 * df, e)))).collect()
        }
    }
}

/// Returns the share of bin `k`, from half a bin below to half a bin above its centre, that lies in a band.
fn share(k: usize, df: f64, rate: f64, low: f64, high: f64) -> f64 {
    let from = ((k as f64 - 0.5) * df).max(0.0);
    let to = ((k as f64 + 0.5) * df).min(rate / 2.0);
    ((to.min(high) - from.max(low)) / (to - from)).max(0.0)
}

/// Returns the range of non-zero weights.
fn sparse(weights: impl Iterator<Item = f64>) -> Band {
    let all: Vec<f64> = weights.collect();
    let first = all.iter().position(|w| *w > 0.0).unwrap_or(0);
    let end = all.iter().rposition(|w| *w > 0.0).map_or(first, |last| last + 1);
    let count = (end - first).div_ceil(LANES);
    // What fills the last lanes is within the spectrum, unless that is shorter.
    let first = first.min(all.len().saturating_sub(count * LANES));
    let weight = |k: usize| all.get(k).copied().unwrap_or(0.0);
    let lanes = |i: usize| std::array::from_fn(|j| weight(first + i * LANES + j));
    Band { first, weights: (0..count).map(lanes).collect() }
}

/// Sums of the weighted powers of bands; all instruction sets compute the same bits.
#[inline(always)]
fn sums(power: &[f64], bands: &[Band], energies: &mut [f64]) {
    for (energy, band) in energies.iter_mut().zip(bands) {
        let Some(bins) = power.get(band.first..band.first + LANES * band.weights.len()) else {
            // The spectrum is shorter than its lanes.
            let weighted = power.iter().skip(band.first).zip(band.weights.as_flattened());
            *energy = weighted.map(|(bin, weight)| bin * weight).sum();
            continue;
        };
        let mut lanes = [0.0; LANES];
        for (bins, weights) in bins.as_chunks::<LANES>().0.iter().zip(&band.weights) {
            for k in 0..LANES {
                lanes[k] += bins[k] * weights[k];
            }
        }
        *energy = fold_lanes(lanes, |a, b| a + b);
    }
}

/// Computes the mel cepstrum of the samples of one unit.
///
/// # Complexity
/// One real FFT in f64, of the length of the window rounded up to a power of two. In f32, loud bands would mask quiet ones.
///
/// # Source
/// An, James and Marschner (SIGGRAPH 2012), section 4.2; Davis and Mermelstein (1980) for the cepstrum. Rectangular bands
/// count every frequency once; their energies are the mean squares of the unit within the band.
///
/// # Example
/// ```
/// use foley_nodes::core::time::Rate;
/// use foley_nodes::feature::{FeatureConventions, MelCepstrum};
/// let mut cepstrum = MelCepstrum::new(&FeatureConventions::cloth(Rate::hz(96_000), 400), 1e-10);
/// let mut features = [0.0; 3];
/// cepstrum.process(&[0.0; 800], &mut features);
/// // Silence is at the floor in every band.
/// assert!((features[0] - 3f32.sqrt() * 1e-10f32.ln()).abs() < 1e-4 && features[1].abs() < 1e-4);
/// ```
#[derive(Clone)]
pub struct MelCepstrum {
    power: FramePower,
    bands: Vec<Band>,
    /// `[n, bands]`.
    cosines: Vec<f64>,
    log: LogScale,
    floor: f64,
    energies: Vec<f64>,
    mean: Vec<f64>,
    level: Level,
}

impl std::fmt::Debug for MelCepstrum {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MelCepstrum({} bands of {} samples)", self.bands.len(), self.frame())
    }
}

impl MelCepstrum {
    /// Plans the transform. `floor` is the lowest energy of a band, as mean square relative to full scale.
    #[must_use]
    pub fn new(c: &FeatureConventions, floor: f64) -> Self {
        let frame = c.frame.max(1) as usize;
        // The transform needs at least two samples.
        let length = frame.next_power_of_two().max(2);
        let window = c.window.samples(frame);
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let scale = 2.0 / (length as f64 * energy.max(f64::MIN_POSITIVE));
        Self {
            bands: bands(c, length),
            cosines: cosines(c.first as usize, c.n as usize, c.bands as usize),
            log: c.log,
            floor: floor.max(f64::MIN_POSITIVE),
            energies: vec![0.0; c.bands as usize],
            mean: vec![0.0; c.bands as usize],
            power: FramePower::new(window, length, scale),
            level: Level::new(),
        }
    }

    /// Sets the lowest energy of a band.
    pub fn set_floor(&mut self, floor: f64) {
        self.floor = floor.max(f64::MIN_POSITIVE);
    }

    /// Returns the length of the window in samples, which is centred on the unit.
    #[must_use]
    pub fn frame(&self) -> usize {
        self.power.frame()
    }

    /// Returns the mean square of the windowed samples in each band.
    pub fn energies(&mut self, frame: &[f32]) -> &[f64] {
        let power = self.power.process(frame);
        dispatch!(self.level, _simd => sums(power, &self.bands, &mut self.energies));
        &self.energies
    }

    /// Writes the cepstral coefficients of one unit.
    pub fn process(&mut self, frame: &[f32], out: &mut [f32]) {
        self.energies(frame);
        self.coefficients(out);
    }

    /// Writes the cepstral coefficients of the mean power of several channels, which delays between them do not change.
    pub fn process_mean<'a>(&mut self, frames: impl ExactSizeIterator<Item = &'a [f32]>, out: &mut [f32]) {
        let weight = 1.0 / frames.len().max(1) as f64;
        self.mean.fill(0.0);
        for frame in frames {
            self.energies(frame);
            self.mean.iter_mut().zip(&self.energies).for_each(|(mean, energy)| *mean += weight * energy);
        }
        self.energies.copy_from_slice(&self.mean);
        self.coefficients(out);
    }

    /// Writes the cepstral coefficients of the band energies, which become their logarithms.
    fn coefficients(&mut self, out: &mut [f32]) {
        let (floor, log) = (self.floor, self.log);
        for energy in &mut self.energies {
            let floored = energy.max(floor);
            *energy = match log {
                LogScale::Natural => floored.ln(),
                LogScale::Decibel => 10.0 * floored.log10(),
            };
        }
        for (out, row) in out.iter_mut().zip(self.cosines.chunks_exact(self.energies.len())) {
            *out = row.iter().zip(&self.energies).map(|(c, e)| c * e).sum::<f64>() as f32;
        }
    }
}

/// Returns rows `first..first + count` of the orthonormal DCT-II of `size` points.
fn cosines(first: usize, count: usize, size: usize) -> Vec<f64> {
    let row = |k: usize| {
        let scale = if k == 0 { 1.0 } else { 2.0_f64 } / size as f64;
        (0..size).map(move |b| scale.sqrt() * (PI * k as f64 * (b as f64 + 0.5) / size as f64).cos())
    };
    (first..first + count).flat_map(row).collect()
}

#[cfg(test)]
mod tests;
