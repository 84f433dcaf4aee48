//! A loop of noise that can be read at any speed, forwards and backwards, without images and without anything folding down.

use super::interpolation::{NoiseInterp, PHASES, Row, TAPS, weights};
use crate::scrape::force::approximation::log2;
use crate::scrape::force::segment::{CELL, Cell};
use crate::texture::NoiseLine;
use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use foley_fft::RealFftPlanner;
use rayon::prelude::*;
use realfft::ComplexToReal;
use realfft::num_complex::Complex;
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// Bands per octave.
const OCTAVE: f64 = 8.0;
/// Step in samples up to which the loop is read as it is.
const WHOLE: f64 = 0.9;
/// End of the pass band and start of the stop band, in parts of the rate of the sound.
const KEPT: [f64; 2] = [0.4, 0.5];
/// Maximum number of bands: steps of 2^12 samples.
const MAX_COUNT: usize = 96;
/// Samples of the shortest band.
const SHORTEST: usize = 64;
/// Maximum frequency of a stored band, in parts of its density.
const CONTENT: f64 = 0.3;

/// One band-limited form of a loop: its samples with those around the seam, and samples of it per sample of the whole.
#[derive(Clone, Debug, PartialEq)]
struct Band {
    samples: Vec<f32>,
    density: f64,
}

/// A loop of noise with its low-passed versions, one per eighth of an octave.
///
/// Between two samples a sinc of 32 taps under a squared cosine is read, of which 1024 positions are stored and what is between
/// them is interpolated. Steps of more than a sample read a form of the loop that holds nothing above half of the rate of the sound: for
/// steps between two forms, a mixture of both. All of it up to 0.4 of the rate stays.
///
/// # Complexity
/// `O(n log n)` and 17 times the memory of the loop to make; 32 products a reading. For steps of more than a sample 32 more to mix
/// two forms, and once an octave, where these are of unequal density, 32 more again.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBands {
    bands: Vec<Band>,
    weights: Vec<Row>,
    /// Samples of one round.
    len: f64,
    /// Metres from one sample to the next.
    spacing: f64,
}

/// A band with the samples that a reading needs beyond its seam.
fn closed(samples: &[f32], density: f64) -> Band {
    let n = samples.len() as i64;
    let around = -(TAPS as i64 / 2)..n + TAPS as i64 / 2 + 2;
    let sample = |k: i64| samples.get(k.rem_euclid(n) as usize).copied().unwrap_or_default();
    Band { samples: around.map(sample).collect(), density }
}

impl NoiseBands {
    /// Creates all bands of a loop of at least one sample.
    #[must_use]
    pub fn new(line: &NoiseLine) -> Self {
        Self::made(line, NoiseInterp::Sinc32, f64::INFINITY)
    }

    /// The same bands with another interpolation.
    #[must_use]
    pub fn read_by(line: &NoiseLine, interp: NoiseInterp) -> Self {
        Self::made(line, interp, f64::INFINITY)
    }

    /// The bands that steps of up to `fastest` samples read, with the same results; slow steps need only the loop.
    #[must_use]
    pub fn up_to(line: &NoiseLine, fastest: f64) -> Self {
        Self::made(line, NoiseInterp::Sinc32, fastest)
    }

    fn made(line: &NoiseLine, interp: NoiseInterp, fastest: f64) -> Self {
        let n = line.samples.len().max(1);
        let mut bands = vec![closed(line.samples.get(..n).unwrap_or(&[0.0]), 1.0)];
        let mut planner = RealFftPlanner::<f64>::new();
        let ratio = 2_f64.powf(1.0 / OCTAVE);
        let parts = (1..MAX_COUNT).map_while(|k| {
            let step = WHOLE * ratio.powi(k as i32);
            // It is mixed in from the step before it, and is still read at the next.
            let [pass, stop] = [KEPT[0] * ratio / step, KEPT[1] / (ratio * step)];
            let halvings = (CONTENT / stop).log2().floor().max(0.0);
            let len = (n as f64 / halvings.exp2()).ceil() as usize;
            let read = step <= fastest * ratio && len >= SHORTEST.min(n);
            read.then(|| ([pass, stop], planner.plan_fft_inverse(len)))
        });
        let parts: Vec<_> = parts.collect();
        if !parts.is_empty() {
            let spectrum = spectrum(&line.samples, n, &mut planner);
            let band = |([pass, stop], inverse): ([f64; 2], Arc<dyn ComplexToReal<f64>>)| {
                band(&spectrum, n, [pass, stop], &*inverse)
            };
            bands.par_extend(parts.into_par_iter().map(band));
        }
        Self { bands, weights: weights(interp), len: n as f64, spacing: line.spacing }
    }

    /// Samples of one round.
    #[must_use]
    pub fn round(&self) -> f64 {
        self.len
    }

    /// Metres from one sample to the next.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Reads at `position` (0 to [`round`](Self::round)) for steps of `step` samples.
    #[inline(always)]
    #[must_use]
    pub(super) fn read(&self, simd: impl Simd, position: f64, step: f32) -> f32 {
        if step <= WHOLE as f32 {
            return self.band(simd, 0, position);
        }
        let last = self.bands.len() - 1;
        let depth = (log2(step * (1.0 / WHOLE as f32)) * OCTAVE as f32).clamp(0.0, last as f32);
        let below = depth as usize;
        let (part, above) = (depth - below as f32, (below + 1).min(last));
        let (Some(a), Some(b)) = (self.bands.get(below), self.bands.get(above)) else { return 0.0 };
        if a.density != b.density {
            let near = self.band(simd, below, position);
            return near + part * (self.band(simd, above, position) - near);
        }
        // Mixed before they are weighed.
        let spot = Spot::new(position * a.density);
        let (Some(near), Some(far), Some(row)) =
            (spot.samples(a), spot.samples(b), self.weights.get(spot.row))
        else {
            return 0.0;
        };
        let part = f32x8::splat(simd, part);
        total(weigh(simd, row, spot.between, |group| {
            let (near, far) = (eight(simd, near, group), eight(simd, far, group));
            near + part * (far - near)
        }))
    }

    /// The same for each sample of `range` in a cell.
    #[inline(always)]
    #[must_use]
    pub(super) fn read_cell(
        &self,
        simd: impl Simd,
        positions: &[f64; CELL],
        steps: &Cell,
        range: Range<usize>,
    ) -> Cell {
        let mut made = [0.0; CELL];
        let slow = range.clone().all(|n| steps[n] <= WHOLE as f32);
        let Some(band) = self.bands.first().filter(|_| slow) else {
            for n in range {
                made[n] = self.read(simd, positions[n], steps[n]);
            }
            return made;
        };
        // Three loops; the first and the last process several samples at once.
        let (mut wholes, mut rows, mut betweens) = ([0; CELL], [0; CELL], [0.0; CELL]);
        for n in 0..CELL {
            (wholes[n], rows[n], betweens[n]) = parts(positions[n]);
        }
        let mut sums = [[0.0; 4]; CELL];
        for n in range {
            let spot = Spot { whole: wholes[n] as usize, row: rows[n] as usize, between: betweens[n] };
            if let (Some(samples), Some(row)) = (spot.samples(band), self.weights.get(spot.row)) {
                sums[n] = weigh(simd, row, spot.between, |group| eight(simd, samples, group));
            }
        }
        for n in 0..CELL {
            made[n] = total(sums[n]);
        }
        made
    }

    #[inline(always)]
    fn band(&self, simd: impl Simd, k: usize, position: f64) -> f32 {
        let Some(band) = self.bands.get(k) else { return 0.0 };
        let spot = Spot::new(position * band.density);
        let (Some(samples), Some(row)) = (spot.samples(band), self.weights.get(spot.row)) else { return 0.0 };
        total(weigh(simd, row, spot.between, |group| eight(simd, samples, group)))
    }
}

/// A position between samples.
#[derive(Clone, Copy)]
struct Spot {
    /// The sample before it.
    whole: usize,
    /// The stored position before it, and the fraction from there to the next, 0 to 1.
    row: usize,
    between: f32,
}

impl Spot {
    #[inline(always)]
    fn new(position: f64) -> Self {
        let (whole, row, between) = parts(position);
        Self { whole: whole as usize, row: row as usize, between }
    }

    /// The samples around it: the first is 15 before the position, and the seam is padded by 16.
    #[inline(always)]
    fn samples(self, band: &Band) -> Option<&[f32; TAPS]> {
        let at = self.whole + 1;
        band.samples.get(at..at + TAPS).and_then(|samples| samples.try_into().ok())
    }
}

/// The sample before a position, the stored position before it, and the fraction from there to the next, 0 to 1.
///
/// Places are never negative, and loops so short that a cast to 32 bits, which is quick, is their floor.
#[inline(always)]
fn parts(position: f64) -> (i32, i32, f32) {
    let whole = position as i32;
    let phase = (position - f64::from(whole)) * PHASES as f64;
    let row = phase as i32;
    (whole, row, (phase - f64::from(row)) as f32)
}

/// Eight of the numbers for all taps.
#[inline(always)]
fn eight<S: Simd>(simd: S, all: &[f32; TAPS], group: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &all[8 * group..8 * group + 8])
}

/// Samples times weights between two rows, in four sums side by side.
#[inline(always)]
fn weigh<S: Simd>(
    simd: S,
    [here, change]: &Row,
    between: f32,
    samples: impl Fn(usize) -> f32x8<S>,
) -> [f32; 4] {
    let between = f32x8::splat(simd, between);
    let part =
        |group: usize| samples(group) * (eight(simd, here, group) + between * eight(simd, change, group));
    let sum = (part(0) + part(1)) + (part(2) + part(3));
    let (low, high) = simd.split_f32x8(sum);
    (low + high).into()
}

/// The sum of four.
#[inline(always)]
fn total([a, b, c, d]: [f32; 4]) -> f32 {
    (a + b) + (c + d)
}

/// The half of the spectrum of a loop that determines the other half.
fn spectrum(samples: &[f32], n: usize, planner: &mut RealFftPlanner<f64>) -> Vec<Complex<f64>> {
    let forward = planner.plan_fft_forward(n);
    let (mut whole, mut bins) = (forward.make_input_vec(), forward.make_output_vec());
    whole.iter_mut().zip(samples).for_each(|(whole, x)| *whole = f64::from(*x));
    // The lengths are those of the plan.
    let _ = forward.process(&mut whole, &mut bins);
    bins
}

/// Low-pass of a loop of `n` samples, with a transition from `pass` to `stop`, both in cycles per sample, in as many samples as
/// `inverse` returns.
fn band(
    spectrum: &[Complex<f64>],
    n: usize,
    [pass, stop]: [f64; 2],
    inverse: &dyn ComplexToReal<f64>,
) -> Band {
    let (mut bins, mut part) = (inverse.make_input_vec(), inverse.make_output_vec());
    for (cycles, (bin, whole)) in bins.iter_mut().zip(spectrum).enumerate() {
        let f = cycles as f64 / n as f64;
        if f >= stop {
            break;
        }
        let fraction = ((f - pass) / (stop - pass)).max(0.0);
        *bin = whole * (0.5 + 0.5 * libm::cos(PI * fraction));
    }
    // The lengths are those of the plan, and nothing stands at half of the density.
    let _ = inverse.process(&mut bins, &mut part);
    let samples: Vec<f32> = part.iter().map(|x| (x / n as f64) as f32).collect();
    closed(&samples, part.len() as f64 / n as f64)
}

#[cfg(test)]
mod tests;
