//! Noise with the spectrogram of a recording.

use crate::core::random::Rng;
use foley_fft::RealFftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Samples of a frame, and between two frames.
const FRAME: usize = 512;
const HOP: usize = 128;

/// Noise whose spectrogram has the magnitudes of a recording in frames of 512 samples, and random phases.
///
/// The share that modes explain of it is a baseline for any sound with these envelopes: an object rings if a larger share of its recording
/// is explained.
///
/// # Complexity
/// O(samples log 512).
///
/// # Source
/// Theiler et al., "Testing for nonlinearity in time series: the method of surrogate data" (Physica D 58, 1992), for the idea.
#[must_use]
pub fn surrogate(samples: &[f32], seed: u64) -> Vec<f32> {
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(FRAME), planner.plan_fft_inverse(FRAME));
    let window: Vec<f64> = (0..FRAME).map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / FRAME as f64)).collect();
    let mut rng = Rng::new(seed);
    let mut noise: Vec<f64> = (0..samples.len() + 2 * FRAME).map(|_| rng.between(-1.0, 1.0)).collect();
    // Squares of uniform noise have the mean 1/3: scaled to a density of 1 per frame.
    let scale = (3.0 / window.iter().map(|w| w * w).sum::<f64>()).sqrt();
    noise.iter_mut().for_each(|x| *x *= scale);
    let mut out = vec![0.0; samples.len() + 2 * FRAME];
    let mut weight = vec![0.0; out.len()];
    let (mut time, mut of_sound) = (forward.make_input_vec(), forward.make_output_vec());
    let mut of_noise = forward.make_output_vec();
    for first in (0..samples.len() + FRAME).step_by(HOP) {
        let mut spectrum = |signal: &dyn Fn(usize) -> f64, bins: &mut Vec<Complex<f64>>| {
            for (k, (t, w)) in time.iter_mut().zip(&window).enumerate() {
                *t = signal(first + k) * w;
            }
            forward.process(&mut time, bins).is_ok()
        };
        // The sound begins after one frame of silence.
        let sound =
            |n: usize| n.checked_sub(FRAME).and_then(|n| samples.get(n)).copied().map_or(0.0, f64::from);
        let done = spectrum(&sound, &mut of_sound)
            && spectrum(&|n| noise.get(n).copied().unwrap_or(0.0), &mut of_noise);
        of_noise.iter_mut().zip(&of_sound).for_each(|(noise, sound)| *noise *= sound.norm());
        of_noise[0].im = 0.0;
        of_noise[FRAME / 2].im = 0.0;
        if !done || inverse.process(&mut of_noise, &mut time).is_err() {
            continue;
        }
        for (k, (x, w)) in time.iter().zip(&window).enumerate() {
            if let Some(out) = out.get_mut(first + k) {
                *out += x * w / FRAME as f64;
                weight[first + k] += w * w;
            }
        }
    }
    (0..samples.len()).map(|n| (out[FRAME + n] / weight[FRAME + n].max(1e-9)) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surrogate_has_the_envelope_and_not_the_phases() {
        let samples: Vec<f32> = (0..20_000)
            .map(|n| {
                let t = f64::from(n) / 44_100.0;
                (libm::exp(-8.0 * t) * libm::sin(TAU * 2000.0 * t)) as f32
            })
            .collect();
        let found = surrogate(&samples, 1);
        let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        for part in [0..5000, 5000..10_000, 10_000..20_000] {
            let ratio = energy(&found[part.clone()]) / energy(&samples[part]);
            assert!((0.4..2.5).contains(&ratio), "{ratio}");
        }
        let product: f64 = samples.iter().zip(&found).map(|(a, b)| f64::from(a * b)).sum();
        assert!(product.abs() < 0.5 * energy(&samples));
        assert!(surrogate(&[], 1).is_empty());
    }
}
