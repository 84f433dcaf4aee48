//! The noise of a recording, from its part without the impact.

use crate::friction::builder::psd::{AnalysisWindow, welch};
use std::f64::consts::LN_2;

/// Samples of a frame, at 44.1 kHz.
const FRAME: f64 = 1024.0;
/// Least duration of a part without the impact, s.
const SHORTEST: f64 = 0.1;
/// Part of the recording, at its end, that holds the noise if nothing precedes the impact.
const END: f64 = 0.1;
/// Width of the band over which the median is taken, octaves.
const WIDTH: f64 = 1.0;
/// Least number of bins on each side of the median.
const BINS: usize = 12;

/// Variance per sample of white noise with the same density, over frequency.
#[derive(Clone, Debug)]
pub(super) struct NoiseFloor {
    /// `[bins]`, from 0 Hz to half the sample rate; empty if it is unknown.
    variances: Vec<f64>,
    rate: f64,
}

impl NoiseFloor {
    /// The noise before the onset or at the end of the recording: the lower one where both are long enough.
    ///
    /// At each frequency it is the median over an octave, which single modes that still ring do not change.
    pub(super) fn new(samples: &[f32], onset: usize, rate: f64) -> Self {
        let shortest = (SHORTEST * rate) as usize;
        // The last millisecond before the onset may hold its beginning.
        let before = &samples[..onset.saturating_sub((0.001 * rate) as usize)];
        let length = ((samples.len() - onset) as f64 * END) as usize;
        let end = &samples[samples.len() - length..];
        let parts = [before, end].into_iter().filter(|part| part.len() >= shortest);
        let variances = parts
            .filter_map(|part| variances(part, rate))
            .reduce(|a, b| a.iter().zip(&b).map(|(a, b)| a.min(*b)).collect())
            .unwrap_or_default();
        Self { variances, rate }
    }

    /// Variance per sample of the noise; 0 if it is unknown.
    pub(super) fn power(&self) -> f64 {
        self.variances.iter().sum::<f64>() / self.variances.len().max(1) as f64
    }

    /// Variance at a frequency in Hz; 0 if it is unknown.
    pub(super) fn variance(&self, frequency: f64) -> f64 {
        let last = self.variances.len().saturating_sub(1);
        let bin = (2.0 * frequency / self.rate * last as f64).round() as usize;
        self.variances.get(bin.min(last)).copied().unwrap_or(0.0)
    }
}

/// The running median of the power density, as the variance of white noise.
fn variances(part: &[f32], rate: f64) -> Option<Vec<f64>> {
    let frame = ((FRAME * rate / 44_100.0) as usize).next_power_of_two().min(part.len() & !1);
    let density = welch(part, rate, frame, frame / 2, AnalysisWindow::Hann)?;
    // The median of few spectra is that of an exponential distribution, ln 2 of its mean.
    let few = if part.len() < 2 * frame + frame / 2 { LN_2 } else { 1.0 };
    let half_width = 2.0_f64.powf(0.5 * WIDTH);
    let median = |bin: usize| {
        let (low, high) = ((bin as f64 / half_width) as usize, (bin as f64 * half_width) as usize + 1);
        let mut band = density
            [low.min(bin.saturating_sub(BINS))..(high.max(bin + BINS) + 1).min(density.len())]
            .to_vec();
        let middle = band.len() / 2;
        *band.select_nth_unstable_by(middle, f64::total_cmp).1 * 0.5 * rate / few
    };
    Some((0..density.len()).map(median).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn the_variance_is_that_of_the_noise_beside_modes() {
        let mut rng = Rng::new(5);
        let variance = 1e-4_f64;
        let noise = |rng: &mut Rng| (12.0 * variance).sqrt() * (rng.uniform() - 0.5);
        let mut samples: Vec<f32> = (0..60_000).map(|_| noise(&mut rng) as f32).collect();
        for (n, x) in samples[10_000..].iter_mut().enumerate() {
            *x += (libm::exp(-5e-5 * n as f64) * libm::sin(0.1 * n as f64)) as f32;
        }
        for (what, found) in [
            ("before", NoiseFloor::new(&samples, 10_000, 44_100.0)),
            ("at the end", NoiseFloor::new(&samples, 3, 44_100.0)),
        ] {
            for f in [50.0, 700.0, 8000.0, 20_000.0] {
                let ratio = found.variance(f) / variance;
                assert!((0.7..1.4).contains(&ratio), "{what}, {f} Hz: {ratio}");
            }
        }
        assert_eq!(NoiseFloor::new(&samples[..1000], 0, 44_100.0).variance(440.0), 0.0);
    }
}
