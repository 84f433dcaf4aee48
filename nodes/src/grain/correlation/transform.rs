//! Correlation of a signal with short grains by overlap-save.

use super::normaliser::BLOCK;
use crate::dsp::fold_lanes;
use fearless_simd::{Level, dispatch};
use foley_fft::FftPlanner;
use rustfft::Fft;
use rustfft::num_complex::Complex;
use std::sync::Arc;

/// Sizes of transforms.
const SIZES: std::ops::RangeInclusive<u32> = 9..=16;

/// Relative penalty on a transform of twice the size: smaller blocks can be left out more often.
const COARSENESS: f64 = 0.15;

/// Rounding error of a correlation by transforms, relative to the norms of its block and of the grain.
const ROUNDING: f64 = 1e-6;

/// Size of the transform that takes the least work a sample for grains of up to `len` samples: `N log N / (N - len + 1)`.
#[must_use]
pub fn best_size(len: usize) -> usize {
    let cost = |log: u32| {
        let n = (1_usize << log) as f64;
        // Beyond 2^14 the spectra leave the cache of a core.
        let cache = if log > 14 { 1.3 } else { 1.0 };
        cache * (1.0 + COARSENESS).powi(log as i32) * n * f64::from(log) / (n - len as f64 + 1.0).max(1e-3)
    };
    let fits = SIZES.filter(|log| 1_usize << log >= 2 * len.max(1));
    let best = fits.min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
    best.map_or_else(|| (2 * len).next_power_of_two(), |log| 1 << log)
}

/// Spectra of the blocks of a signal, for grains of up to a length.
///
/// Block `j` has the outputs `j * step .. (j + 1) * step`, a multiple of [`BLOCK`]. Its two halves are the real and the imaginary part of one
/// complex signal: a correlation with a real grain leaves them apart.
pub struct Blocks {
    size: usize,
    /// Outputs of half a block.
    half: usize,
    outputs: usize,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
    spectra: Vec<Vec<Complex<f32>>>,
    /// Rounding error of the outputs of each block, relative to the norm of the grain.
    errors: Vec<f32>,
    level: Level,
}

/// Buffers of a thread.
pub struct Buffers {
    grain: Vec<Complex<f32>>,
    product: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

impl Blocks {
    /// Transforms a signal; `outputs` is the number of positions at which grains of up to `max_len` samples begin, and `size` is at least that of
    /// [`best_size`].
    ///
    /// # Shapes
    /// `x: [outputs + max_len - 1]`; samples that are missing are 0.
    #[must_use]
    pub fn new(x: &[f32], outputs: usize, max_len: usize, size: usize) -> Self {
        let mut planner = FftPlanner::<f32>::new();
        let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
        let half = Self::half(max_len, size);
        let count = outputs.div_ceil(2 * half);
        let mut scratch = vec![Complex::default(); forward.get_inplace_scratch_len()];
        let (mut spectra, mut errors) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for j in 0..count {
            let part = |k: usize| {
                let from = (k * half).min(x.len());
                &x[from..x.len().min(k * half + size)]
            };
            let (re, im) = (part(2 * j), part(2 * j + 1));
            let mut block = vec![Complex::default(); size];
            block.iter_mut().zip(re).for_each(|(z, x)| z.re = *x);
            block.iter_mut().zip(im).for_each(|(z, x)| z.im = *x);
            let energy: f64 = re.iter().chain(im).map(|x| f64::from(*x).powi(2)).sum();
            errors.push((ROUNDING * energy.sqrt()) as f32);
            forward.process_with_scratch(&mut block, &mut scratch);
            let scale = 1.0 / size as f32;
            block.iter_mut().for_each(|z| *z *= scale);
            spectra.push(block);
        }
        Self { size, half, outputs, forward, inverse, spectra, errors, level: Level::new() }
    }

    /// Outputs of half a block.
    fn half(max_len: usize, size: usize) -> usize {
        ((size - max_len.min(size) + 1) / BLOCK * BLOCK).max(BLOCK)
    }

    /// Buffers of a thread.
    #[must_use]
    pub fn buffers(&self) -> Buffers {
        let scratch = self.inverse.get_inplace_scratch_len().max(self.forward.get_inplace_scratch_len());
        let [grain, product, scratch] =
            [self.size, self.size, scratch].map(|len| vec![Complex::default(); len]);
        Buffers { grain, product, scratch }
    }

    /// Transforms a grain, for [`Self::fill`].
    pub fn transform(&self, grain: &[f32], buffers: &mut Buffers) {
        let Buffers { grain: spectrum, scratch, .. } = buffers;
        let (samples, rest) = spectrum.split_at_mut(grain.len().min(self.size));
        samples.iter_mut().zip(grain).for_each(|(z, x)| *z = Complex::new(*x, 0.0));
        rest.fill(Complex::default());
        self.forward.process_with_scratch(spectrum, scratch);
    }

    /// The number of blocks.
    #[must_use]
    pub fn count(&self) -> usize {
        self.spectra.len()
    }

    /// The block of an output.
    #[must_use]
    pub fn block_of(&self, t: usize) -> usize {
        t / (2 * self.half)
    }

    /// Computes `y[t] = sum_n x[t + n] g[n]` for the outputs `t` of block `j` that `y`, which begins with output 0, has, and the [`greatest`] value of
    /// each [`BLOCK`] of them.
    ///
    /// # Complexity
    /// One inverse transform.
    pub fn fill(&self, j: usize, buffers: &mut Buffers, absolute: bool, y: &mut [f32], tops: &mut [f32]) {
        let Buffers { grain, product, scratch } = buffers;
        dispatch!(self.level, _simd => multiply(&self.spectra[j], grain, product));
        self.inverse.process_with_scratch(product, scratch);
        let end = self.outputs.min(y.len());
        for (half, part) in [(2 * j, Part::Real), (2 * j + 1, Part::Imaginary)] {
            let from = (half * self.half).min(end);
            let to = (from + self.half).min(end);
            let (y, tops) = (&mut y[from..to], &mut tops[from / BLOCK..to.div_ceil(BLOCK)]);
            dispatch!(self.level, _simd => separate(product, part, absolute, y, tops));
        }
    }

    /// Rounding error of the outputs of block `j`, relative to the norm of the grain.
    #[must_use]
    pub fn error(&self, j: usize) -> f64 {
        f64::from(self.errors[j])
    }

    /// Bytes of the spectra of a signal.
    #[must_use]
    pub fn bytes(outputs: usize, max_len: usize, size: usize) -> usize {
        outputs.div_ceil(2 * Self::half(max_len, size)) * size * size_of::<Complex<f32>>()
    }
}

/// A part of complex outputs.
#[derive(Clone, Copy)]
enum Part {
    Real,
    Imaginary,
}

/// A part of outputs, and the greatest value of each block of it.
#[inline(always)]
fn separate(product: &[Complex<f32>], part: Part, absolute: bool, y: &mut [f32], tops: &mut [f32]) {
    for ((y, z), top) in y.chunks_mut(BLOCK).zip(product.chunks(BLOCK)).zip(tops) {
        match part {
            Part::Real => y.iter_mut().zip(z).for_each(|(y, z)| *y = z.re),
            Part::Imaginary => y.iter_mut().zip(z).for_each(|(y, z)| *y = z.im),
        }
        *top = greatest(y, absolute);
    }
}

/// Greatest value or, if `absolute`, magnitude; at least 0.
#[inline(always)]
pub fn greatest(y: &[f32], absolute: bool) -> f32 {
    let mut lanes = [0.0_f32; 16];
    let (chunks, rest) = y.as_chunks::<16>();
    // The bits without the sign are those of the magnitude.
    let mask = if absolute { 0x7fff_ffff } else { u32::MAX };
    for chunk in chunks {
        for (lane, y) in lanes.iter_mut().zip(chunk) {
            let y = f32::from_bits(y.to_bits() & mask);
            *lane = if y > *lane { y } else { *lane };
        }
    }
    for y in rest {
        let y = f32::from_bits(y.to_bits() & mask);
        lanes[0] = if y > lanes[0] { y } else { lanes[0] };
    }
    fold_lanes(lanes, |a, b| if b > a { b } else { a })
}

/// Products of a spectrum with the conjugate of another; all instruction sets compute the same bits.
#[inline(always)]
fn multiply(x: &[Complex<f32>], g: &[Complex<f32>], product: &mut [Complex<f32>]) {
    for ((p, x), g) in product.iter_mut().zip(x).zip(g) {
        *p = Complex::new(x.re * g.re + x.im * g.im, x.im * g.re - x.re * g.im);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn all_outputs_equal_the_direct_form() {
        let mut rng = Rng::new(4);
        let x: Vec<f32> = (0..5000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        for (len, size) in [(300, 1024), (300, 4096), (17, 512), (1000, 2048)] {
            let g: Vec<f32> = (0..len).map(|_| rng.between(-1.0, 1.0) as f32).collect();
            let outputs = x.len() - len + 1;
            let blocks = Blocks::new(&x, outputs, len, size);
            let (mut y, mut buffers) = (vec![f32::NAN; outputs], blocks.buffers());
            blocks.transform(&g, &mut buffers);
            let mut tops = vec![f32::NAN; outputs.div_ceil(BLOCK)];
            (0..blocks.count()).for_each(|j| blocks.fill(j, &mut buffers, false, &mut y, &mut tops));
            let of_block = |y: &[f32]| y.iter().fold(0.0_f32, |top, y| top.max(*y));
            assert!(y.chunks(BLOCK).map(of_block).eq(tops.iter().copied()));
            let norm = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
            for (t, y) in y.iter().enumerate() {
                let direct: f64 = x[t..].iter().zip(&g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                let error = (f64::from(*y) - direct).abs() / (norm(&g) * norm(&x[t..t + len]));
                assert!(error < 2e-6, "{len} {size} {t}: {error}");
            }
        }
    }

    #[test]
    fn sizes_grow_with_the_grains() {
        assert_eq!([300, 1126, 3000, 100_000].map(best_size), [1024, 4096, 16_384, 262_144]);
    }
}
