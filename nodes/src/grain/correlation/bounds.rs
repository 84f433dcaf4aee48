//! Bounds of correlations, by the energies of bands of frequencies.

use super::normaliser::Normaliser;
use crate::dsp::fold_lanes;
use crate::grain::dictionary::TaperShape;
use fearless_simd::{Level, dispatch};
use foley_fft::RealFftPlanner;
use realfft::RealToComplex;
use realfft::num_complex::Complex;
use std::sync::Arc;

/// Bands; the highest has a twelfth of the spectrum, the lowest a few bins.
const BANDS: usize = 64;
/// Outputs that have one bound.
pub const SEGMENT: usize = 256;
/// Samples over which a segment fades in and out.
const FADE: usize = 64;
/// First bin that is not in the lowest band.
const LOWEST: f64 = 4.0;

/// Rounding of the bounds, relative to them.
const ROUNDING: f64 = 1e-4;

/// Norms of the bands of a signal.
type Bands = [f32; BANDS];

/// Norms of the bands of segments of a signal, for grains of up to a length.
///
/// A window `x_t` of a segment and a grain `g` have `|<x_t, g>| <= sum_b |x|_b |g|_b`, since the bands are disjoint sets of bins of a transform that
/// holds both: the segment is as it is at all samples under the grain, and fades out beyond.
pub struct SegmentBands {
    size: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    edges: Vec<usize>,
    segments: Vec<Bands>,
    level: Level,
}

/// Buffers of [`SegmentBands`].
pub struct BandBuffers {
    input: Vec<f32>,
    spectrum: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

impl SegmentBands {
    /// Transforms a signal at the outputs `0 .. outputs`.
    ///
    /// # Shapes
    /// `x: [outputs + max_len - 1]`; samples that are missing are 0.
    ///
    /// # Complexity
    /// A transform for each [`SEGMENT`] outputs.
    #[must_use]
    pub fn new(x: &[f32], outputs: usize, max_len: usize) -> Self {
        let whole = SEGMENT + max_len;
        let size = (whole + 2 * FADE).next_power_of_two();
        let bins = size / 2 + 1;
        let ratio = bins as f64 / LOWEST;
        let edge = |b: usize| (LOWEST * ratio.powf((b - 1) as f64 / (BANDS - 1) as f64)).round() as usize;
        let edges = std::iter::once(0).chain((1..=BANDS).map(edge)).collect();
        let forward = RealFftPlanner::<f32>::new().plan_fft_forward(size);
        let mut own = Self { size, forward, edges, segments: Vec::new(), level: Level::new() };
        let mut buffers = own.buffers();
        let window: Vec<f32> =
            TaperShape::HalfSample.window(whole + 2 * FADE, [FADE; 2]).map(|w| w as f32).collect();
        for from in (0..outputs).step_by(SEGMENT) {
            let sample =
                |k: usize| (from + k).checked_sub(FADE).and_then(|k| x.get(k)).copied().unwrap_or(0.0);
            let input = &mut buffers.input;
            input.fill(0.0);
            input.iter_mut().zip(&window).enumerate().for_each(|(k, (y, w))| *y = w * sample(k));
            let bands = own.transformed(&mut buffers);
            own.segments.push(bands);
        }
        own
    }

    /// Buffers of a thread.
    #[must_use]
    pub fn buffers(&self) -> BandBuffers {
        BandBuffers {
            input: self.forward.make_input_vec(),
            spectrum: self.forward.make_output_vec(),
            scratch: self.forward.make_scratch_vec(),
        }
    }

    /// Norms of the bands of the input.
    fn transformed(&self, buffers: &mut BandBuffers) -> Bands {
        let BandBuffers { input, spectrum, scratch } = buffers;
        let mut bands = [f32::INFINITY; BANDS];
        // Lengths agree by construction; without a transform nothing is known.
        if self.forward.process_with_scratch(input, spectrum, scratch).is_err() {
            return bands;
        }
        for (band, edges) in bands.iter_mut().zip(self.edges.windows(2)) {
            let energy: f64 = (edges[0]..edges[1])
                .map(|k| {
                    // All but the first and the last bin stand for two.
                    let weight = if k == 0 || k == self.size / 2 { 1.0 } else { 2.0 };
                    weight * f64::from(spectrum[k].norm_sqr())
                })
                .sum();
            *band = (energy / self.size as f64).sqrt() as f32;
        }
        bands
    }

    /// Norms of the bands of a grain of up to the length.
    fn of_grain(&self, grain: &[f32], buffers: &mut BandBuffers) -> Bands {
        buffers.input.fill(0.0);
        let len = grain.len().min(self.size);
        buffers.input[..len].copy_from_slice(&grain[..len]);
        self.transformed(buffers)
    }

    /// Bounds of the normalised correlation of a grain, of this norm, with each segment, raised by `errors` of each segment, which are relative to the
    /// norm of the grain; output 0 is at sample `first` of the recording.
    ///
    /// # Complexity
    /// A transform, and a product of each band of each segment.
    #[must_use]
    pub fn bounds(
        &self,
        grain: &[f32],
        norm: f64,
        normaliser: &Normaliser,
        first: usize,
        errors: &[f64],
        buffers: &mut BandBuffers,
    ) -> Vec<f32> {
        let own = self.of_grain(grain, buffers);
        let mut bounds = vec![0.0; self.segments.len()];
        dispatch!(self.level, _simd => products(&self.segments, &own, &mut bounds));
        for ((segment, bound), error) in bounds.iter_mut().enumerate().zip(errors) {
            let least = normaliser.least_of(first + segment * SEGMENT, SEGMENT, grain.len());
            *bound = ((f64::from(*bound) * (1.0 + ROUNDING) / norm + error) / least) as f32;
        }
        bounds
    }
}

/// The greatest magnitude of the correlation of a grain with each segment, but for the rounding of single precision; all instruction sets compute the
/// same bits.
#[inline(always)]
fn products(segments: &[Bands], grain: &Bands, bounds: &mut [f32]) {
    for (segment, bound) in segments.iter().zip(bounds) {
        let mut lanes = [0.0_f32; 16];
        for (x, g) in segment.as_chunks::<16>().0.iter().zip(grain.as_chunks::<16>().0) {
            for k in 0..16 {
                lanes[k] += x[k] * g[k];
            }
        }
        *bound = fold_lanes(lanes, |a, b| a + b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    /// The bound of a segment.
    fn bound(bands: &SegmentBands, segment: usize, grain: &Bands) -> f64 {
        let mut bounds = vec![0.0; bands.segments.len()];
        products(&bands.segments, grain, &mut bounds);
        f64::from(bounds[segment])
    }

    #[test]
    fn no_correlation_exceeds_its_bound_and_a_match_comes_near() {
        let mut rng = Rng::new(3);
        for trial in 0..12 {
            let len = 40 + rng.below(900);
            let mut last = 0.0;
            let feedback = [0.0, 0.9, -0.9][trial % 3];
            let x: Vec<f32> = (0..3000)
                .map(|_| {
                    last = feedback * last + rng.between(-1.0, 1.0);
                    last as f32
                })
                .collect();
            let outputs = x.len() - len + 1;
            let bands = SegmentBands::new(&x, outputs, len);
            let mut buffers = bands.buffers();
            let norm = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
            for g in [
                x[700..700 + len].to_vec(),
                (0..len).map(|k| (1.3 * k as f32).sin()).collect(),
                (0..len / 2).map(|_| rng.between(-1.0, 1.0) as f32).collect(),
            ] {
                let own = bands.of_grain(&g, &mut buffers);
                let bounds: Vec<f64> =
                    (0..outputs.div_ceil(SEGMENT)).map(|k| bound(&bands, k, &own)).collect();
                for t in 0..outputs {
                    let dot: f64 = x[t..].iter().zip(&g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                    let bound = bounds[t / SEGMENT];
                    assert!(dot.abs() <= bound * (1.0 + 1e-5), "{trial} {t}: {dot} {bound}");
                }
            }
            // The bands of all of a grain have its norm.
            let own = bands.of_grain(&x[700..700 + len], &mut buffers);
            assert!((norm(&own) / norm(&x[700..700 + len]) - 1.0).abs() < 1e-5);
        }
        // A low tone and noise without low frequencies hardly correlate.
        let low: Vec<f32> = (0..3000).map(|k| (0.02 * k as f32).sin()).collect();
        let high: Vec<f32> = (0..500).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
        let bands = SegmentBands::new(&low, 2501, 500);
        let own = bands.of_grain(&high, &mut bands.buffers());
        assert!(bound(&bands, 2, &own) < 0.05 * 500_f64.sqrt() * 0.1 * 500_f64.sqrt());
    }
}
