//! Power spectral density of a recording: periodogram and Welch average.
//!
//! One-sided density in full scale squared per hertz: `S_k = c_k |X_k|^2 / (fs sum w^2)`, where `c_k` is 2 except at
//! DC and Nyquist (1). Then `sum_k S_k df` is the mean square of the windowed samples over that of the window.

use std::f64::consts::TAU;
use std::sync::Arc;

use foley_fft::RealFftPlanner;
use realfft::RealToComplex;
use realfft::num_complex::Complex;

/// Window of an analysis frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalysisWindow {
    /// `1 - |(n + 1/2)/(N/2) - 1|`; the sum of its squares tends to `N/3`.
    Triangle,
    /// Periodic Hann, for measurements of output.
    Hann,
    /// Constant.
    Rectangle,
}

impl AnalysisWindow {
    /// Returns the value at sample `n` of `len`.
    #[must_use]
    pub fn at(self, n: usize, len: usize) -> f64 {
        let (n, len) = (n as f64, len as f64);
        match self {
            Self::Triangle => 1.0 - ((n + 0.5) / (0.5 * len) - 1.0).abs(),
            Self::Hann => 0.5 - 0.5 * (TAU * n / len).cos(),
            Self::Rectangle => 1.0,
        }
    }
}

/// Periodogram of frames of one length; plan, window and buffers are made once.
pub struct Periodogram {
    plan: Arc<dyn RealToComplex<f64>>,
    window: Vec<f64>,
    input: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    scale: f64,
}

impl Periodogram {
    /// Creates a periodogram of `len` samples (rounded up to an even number, at least 2) at `fs` hertz.
    #[must_use]
    pub fn new(len: usize, fs: f64, window: AnalysisWindow) -> Self {
        let len = len.max(2).next_multiple_of(2);
        let plan = RealFftPlanner::new().plan_fft_forward(len);
        let window: Vec<f64> = (0..len).map(|n| window.at(n, len)).collect();
        let energy: f64 = window.iter().map(|w| w * w).sum();
        Self {
            input: plan.make_input_vec(),
            spectrum: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            scale: 1.0 / (fs * energy),
            plan,
            window,
        }
    }

    /// Returns the number of samples per frame.
    #[must_use]
    pub fn frame_len(&self) -> usize {
        self.window.len()
    }

    /// Returns the number of one-sided bins, `N/2 + 1`.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.spectrum.len()
    }

    /// Adds the density of one frame to `sum`. Missing samples count as zeros, extra ones are ignored.
    ///
    /// # Shapes
    /// `frame: [N]`, `sum: [N/2 + 1]`.
    ///
    /// # Complexity
    /// O(N log N); no allocation.
    pub fn accumulate(&mut self, frame: &[f32], sum: &mut [f64]) {
        self.input.fill(0.0);
        for ((x, w), &s) in self.input.iter_mut().zip(&self.window).zip(frame) {
            *x = w * f64::from(s);
        }
        // The plan refuses only wrong lengths, and it made these buffers itself.
        if self.plan.process_with_scratch(&mut self.input, &mut self.spectrum, &mut self.scratch).is_err() {
            return;
        }
        let last = self.spectrum.len() - 1;
        for (k, (s, x)) in sum.iter_mut().zip(&self.spectrum).enumerate() {
            let sides = if k == 0 || k == last { 1.0 } else { 2.0 };
            *s += sides * self.scale * x.norm_sqr();
        }
    }
}

/// Returns the mean density of all whole frames of `len` samples, `hop` apart; `None` without a whole frame.
///
/// # Shapes
/// `[T]` samples to `[N/2 + 1]` in full scale squared per hertz.
///
/// # Source
/// Welch, "The use of fast Fourier transform for the estimation of power spectra" (1967); equals SciPy's `welch` with
/// `detrend=False, scaling="density"`.
#[must_use]
pub fn welch(samples: &[f32], fs: f64, len: usize, hop: usize, window: AnalysisWindow) -> Option<Vec<f64>> {
    let mut periodogram = Periodogram::new(len, fs, window);
    let mut sum = vec![0.0; periodogram.bins()];
    let mut frames = 0_u64;
    for frame in samples.windows(periodogram.frame_len()).step_by(hop.max(1)) {
        periodogram.accumulate(frame, &mut sum);
        frames += 1;
    }
    if frames == 0 {
        return None;
    }
    sum.iter_mut().for_each(|s| *s /= frames as f64);
    Some(sum)
}

/// Returns the mean frequency of a power density in hertz, 0 for silence.
#[must_use]
pub fn centroid(psd: &[f64], df: f64) -> f64 {
    let (mut weighted, mut total) = (0.0, 0.0);
    for (k, s) in psd.iter().enumerate() {
        weighted += k as f64 * df * s;
        total += s;
    }
    if total > 0.0 { weighted / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_mean_square_as_total_power() {
        let (fs, n) = (8000.0, 400);
        let x: Vec<f32> =
            (0..4000).map(|i| (0.5 * (TAU * 1000.0 * f64::from(i) / fs).sin()) as f32).collect();
        let psd = welch(&x, fs, n, n / 2, AnalysisWindow::Rectangle).unwrap();
        let df = fs / n as f64;
        assert!((psd.iter().sum::<f64>() * df - 0.125).abs() < 1e-7);
        assert!((psd[50] * df - 0.125).abs() < 1e-7, "the power lies in the bin of the sine");
    }

    #[test]
    fn white_noise_has_a_flat_density_of_its_variance_over_the_nyquist_band() {
        let random = crate::core::random::Random::new(1, "white");
        let x: Vec<f32> = (0..200_000).map(|i| random.uniform(0, i, 0) as f32 - 0.5).collect();
        let psd = welch(&x, 48000.0, 256, 128, AnalysisWindow::Triangle).unwrap();
        let expected = (1.0 / 12.0) / 24000.0;
        let mean = psd[1..128].iter().sum::<f64>() / 127.0;
        assert!((mean / expected - 1.0).abs() < 0.02, "{mean} {expected}");
    }

    #[test]
    fn the_triangle_squared_sums_to_a_third_of_its_length() {
        let n = 4800;
        let sum: f64 = (0..n).map(|i| AnalysisWindow::Triangle.at(i, n).powi(2)).sum();
        assert!((sum / n as f64 - 1.0 / 3.0).abs() < 1e-6);
    }

    #[test]
    fn welch_equals_scipy_welch_with_a_triangular_window() {
        // tests/oracles/friction.py, "welch": scipy.signal.welch(x, 1000, windows.triang(16), 16, 8, detrend=False)
        let x: Vec<f32> = (0..64).map(|i| ((i * i * 7 + 3 * i) % 31) as f32 / 31.0 - 0.5).collect();
        let psd = welch(&x, 1000.0, 16, 8, AnalysisWindow::Triangle).unwrap();
        let scipy = [
            1.2306246654845328e-4,
            1.1304496472687807e-4,
            9.093_720_481_929_57e-5,
            2.7535365906729346e-4,
            2.088_541_333_951_119e-4,
            1.1422950621873607e-4,
            4.795_085_424_270_76e-5,
            6.229_461_448_491_615e-5,
            2.3949583200346652e-5,
        ];
        for (k, (a, b)) in psd.iter().zip(scipy).enumerate() {
            assert!((a - b).abs() < 1e-9 * b.max(1e-5), "bin {k}: {a} {b}");
        }
    }

    #[test]
    fn fewer_samples_than_a_frame_have_no_density() {
        assert_eq!(welch(&[0.0; 10], 1000.0, 16, 8, AnalysisWindow::Triangle), None);
    }
}
