//! Correlation of a signal with short grains by overlap-save.

use fearless_simd::{Level, dispatch};
use foley_fft::FftPlanner;
use rustfft::Fft;
use rustfft::num_complex::Complex;
use std::sync::Arc;

/// Sizes of transforms.
const SIZES: std::ops::RangeInclusive<u32> = 9..=16;

/// Relative penalty on a transform of twice the size: smaller blocks can be left out more often.
const COARSENESS: f64 = 0.15;

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
/// Block `j` has the outputs `j * step .. (j + 1) * step`. Its two halves are the real and the imaginary part of one complex signal: a
/// correlation with a real grain leaves them apart.
pub struct Blocks {
    size: usize,
    /// Outputs of half a block.
    half: usize,
    outputs: usize,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
    spectra: Vec<Vec<Complex<f32>>>,
    /// Norm of the samples of each block.
    norms: Vec<f32>,
    level: Level,
}

/// Buffers of a thread.
pub struct Buffers {
    grain: Vec<Complex<f32>>,
    product: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
}

impl Blocks {
    /// Transforms a signal; `outputs` is the number of positions at which grains of up to `max_len` samples begin.
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
        let (mut spectra, mut norms) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for j in 0..count {
            let part = |k: usize| {
                let from = (k * half).min(x.len());
                &x[from..x.len().min(k * half + size)]
            };
            let (re, im) = (part(2 * j), part(2 * j + 1));
            let mut block = vec![Complex::default(); size];
            block.iter_mut().zip(re).for_each(|(z, x)| z.re = *x);
            block.iter_mut().zip(im).for_each(|(z, x)| z.im = *x);
            norms.push(re.iter().chain(im).map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt() as f32);
            forward.process_with_scratch(&mut block, &mut scratch);
            spectra.push(block);
        }
        Self { size, half, outputs, forward, inverse, spectra, norms, level: Level::new() }
    }

    /// Outputs of a transform.
    fn half(max_len: usize, size: usize) -> usize {
        (size - max_len.min(size) + 1).max(1)
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
        spectrum.fill(Complex::default());
        spectrum.iter_mut().zip(grain).for_each(|(z, x)| z.re = *x);
        self.forward.process_with_scratch(spectrum, scratch);
        let scale = 1.0 / self.size as f32;
        spectrum.iter_mut().for_each(|g| *g = g.conj() * scale);
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

    /// Computes `y[t] = sum_n x[t + n] g[n]` for the outputs `t` of block `j` that `y`, which begins with output 0, has.
    ///
    /// # Complexity
    /// One inverse transform.
    pub fn fill(&self, j: usize, buffers: &mut Buffers, y: &mut [f32]) {
        let Buffers { grain: spectrum, product, scratch } = buffers;
        dispatch!(self.level, _simd => multiply(&self.spectra[j], spectrum, product));
        self.inverse.process_with_scratch(product, scratch);
        let end = self.outputs.min(y.len());
        let from = (2 * j * self.half).min(end);
        let (re, im) = y[from..end].split_at_mut(self.half.min(end - from));
        re.iter_mut().zip(&*product).for_each(|(y, z)| *y = z.re);
        im.iter_mut().zip(&product[..self.half]).for_each(|(y, z)| *y = z.im);
    }

    /// Norm of the samples of the block that has output `t`: its rounding errors are relative to it.
    #[must_use]
    pub fn norm_at(&self, t: usize) -> f32 {
        self.norms.get(self.block_of(t)).copied().unwrap_or(0.0)
    }

    /// Bytes of the spectra of a signal.
    #[must_use]
    pub fn bytes(outputs: usize, max_len: usize, size: usize) -> usize {
        outputs.div_ceil(2 * Self::half(max_len, size)) * size * size_of::<Complex<f32>>()
    }
}

/// Products of two spectra; all instruction sets compute the same bits.
#[inline(always)]
fn multiply(x: &[Complex<f32>], g: &[Complex<f32>], product: &mut [Complex<f32>]) {
    for ((p, x), g) in product.iter_mut().zip(x).zip(g) {
        *p = Complex::new(x.re * g.re - x.im * g.im, x.re * g.im + x.im * g.re);
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
            (0..blocks.count()).for_each(|j| blocks.fill(j, &mut buffers, &mut y));
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
