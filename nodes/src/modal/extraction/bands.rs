//! Energies of a sound in bands of frequency.

use foley_fft::FftPlanner;
use foley_fft::RealFftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::PI;

/// Zeros after the sound, s, so that filters that look back do not wrap around.
const PADDING: f64 = 0.5;

/// Lower edge, centre and upper edge of thirds of an octave from 25 Hz to 20 kHz, below half the sample rate, Hz.
pub(super) fn third_octaves(rate: f64) -> impl Iterator<Item = [f64; 3]> {
    let edge = 2.0_f64.powf(1.0 / 6.0);
    let centres = (-16..=13).map(|k| 1000.0 * 2.0_f64.powf(f64::from(k) / 3.0));
    centres.map(move |f| [f / edge, f, f * edge]).filter(move |band| band[2] < 0.5 * rate)
}

/// The spectrum of a sound.
pub(super) struct Spectrum {
    bins: Vec<Complex<f64>>,
    /// Length of the transform, and of the sound.
    length: usize,
    samples: usize,
    rate: f64,
}

/// An octave of a sound over time.
pub(super) struct Octave {
    /// Mean squares of the filtered sound, one for each step.
    pub(super) energies: Vec<f64>,
    /// Time between two of them, s.
    pub(super) step: f64,
    /// Bandwidth of white noise with the same energy, Hz.
    pub(super) width: f64,
}

impl Spectrum {
    /// Transforms a sound.
    ///
    /// # Complexity
    /// O(samples log samples).
    pub(super) fn new(x: &[f64], rate: f64) -> Self {
        let length = (x.len() + (PADDING * rate) as usize).next_multiple_of(1 << 10);
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let (mut time, mut bins) = (plan.make_input_vec(), plan.make_output_vec());
        time[..x.len()].copy_from_slice(x);
        // The plan refuses only wrong lengths, and it made these buffers itself.
        if plan.process(&mut time, &mut bins).is_err() {
            bins.fill(Complex::default());
        }
        Self { bins, length, samples: x.len(), rate }
    }

    fn range(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        let bin = |f: f64| ((f * self.length as f64 / self.rate).round() as usize).min(self.bins.len());
        bin(low)..bin(high)
    }

    /// Energy of the sound between two frequencies.
    pub(super) fn energy(&self, low: f64, high: f64) -> f64 {
        let sum: f64 = self.bins[self.range(low, high)].iter().map(|z| z.norm_sqr()).sum();
        2.0 * sum / self.length as f64
    }

    /// The octaves around a frequency; the filter is 1 within `flat` octaves on each side, below 1, and falls by a quarter of a cosine to 0
    /// at a distance of one octave.
    pub(super) fn octave(&self, centre: f64, flat: f64, planner: &mut FftPlanner<f64>) -> Octave {
        let range = self.range(centre / 2.0, centre * 2.0);
        let first = range.start;
        let bins = &self.bins[range];
        let count = bins.len().next_power_of_two().max(64);
        let mut band = vec![Complex::default(); count];
        let bin_width = self.rate / self.length as f64;
        let mut width = 0.0;
        for (k, z) in bins.iter().enumerate() {
            let octaves = ((first + k) as f64 * bin_width / centre).max(1e-9).log2();
            let part = (1.0 - (octaves.abs() - flat).max(0.0) / (1.0 - flat)).clamp(0.0, 1.0);
            let weight = libm::sin(0.5 * PI * part);
            width += weight * weight * bin_width;
            band[k] = z * weight;
        }
        planner.plan_fft_inverse(count).process(&mut band);
        let step = self.length as f64 / count as f64 / self.rate;
        let points = ((self.samples as f64 / self.rate / step) as usize).clamp(1, count);
        let scale = 2.0 / (self.length as f64).powi(2);
        Octave { energies: band[..points].iter().map(|z| scale * z.norm_sqr()).collect(), step, width }
    }
}

/// Energy decay curve: the energy after each point, above a power of noise.
///
/// # Source
/// Schroeder, "New method of measuring reverberation time" (JASA 37, 1965).
pub(super) fn decay_curve(energies: &[f64], noise: f64) -> Vec<f64> {
    let mut curve: Vec<f64> = energies.iter().map(|e| (e - noise).max(0.0)).collect();
    for k in (0..curve.len().saturating_sub(1)).rev() {
        curve[k] += curve[k + 1];
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn energies_are_those_of_the_sound() {
        let mut rng = Rng::new(6);
        let x: Vec<f64> = (0..44_100).map(|_| rng.between(-1.0, 1.0)).collect();
        let spectrum = Spectrum::new(&x, 44_100.0);
        let total: f64 = x.iter().map(|x| x * x).sum();
        assert!((spectrum.energy(0.0, 22_050.0) / total - 1.0).abs() < 1e-3);
        let octave = spectrum.octave(2000.0, 0.5, &mut FftPlanner::new());
        // The density is even: the power is in proportion to the width.
        let mean = octave.energies.iter().sum::<f64>() / octave.energies.len() as f64;
        let expected = octave.width / 22_050.0 / 3.0;
        assert!((mean / expected - 1.0).abs() < 0.1, "{mean} {expected}");
        assert!((octave.energies.len() as f64 * octave.step - 1.0).abs() < 0.01);
    }

    #[test]
    fn thirds_of_an_octave_touch_and_end_below_half_the_rate() {
        let all: Vec<[f64; 3]> = third_octaves(8000.0).collect();
        assert!(all.windows(2).all(|w| (w[0][2] / w[1][0] - 1.0).abs() < 1e-12));
        assert!(all[0][0] > 20.0 && all[all.len() - 1][2] < 4000.0);
        assert_eq!(third_octaves(48_000.0).count(), 30);
    }

    #[test]
    fn a_decay_curve_adds_up_what_remains() {
        assert_eq!(decay_curve(&[3.0, 2.0, 0.5, 1.0], 1.0), [3.0, 1.0, 0.0, 0.0]);
        assert!(decay_curve(&[], 0.0).is_empty());
    }
}
