//! The modulation spectrum: the spectrum of the envelope of a sound.

use foley_fft::RealFftPlanner;
use std::f64::consts::TAU;

/// Edges of the bands of modulation, Hz.
pub const MODULATION_EDGES: [f64; 10] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 200.0];

/// Number of bands of modulation.
pub(super) const MODULATION_BANDS: usize = MODULATION_EDGES.len() - 1;

/// Power of the envelope in each band of modulation, relative to the square of its mean.
///
/// The envelope is the root of the energies, one for each interval of `1 / rate` seconds. A sound whose amplitude follows `1 + m cos(t)` has a
/// power of `m^2 / 2` in the band of that frequency. A band is `None` if the sound lasts less than two periods of its lower edge, if its
/// upper edge is above 0.45 of the rate, or for silence.
///
/// # Complexity
/// O(n log n).
#[must_use]
pub fn modulation_spectrum(energies: &[f64], rate: f64) -> [Option<f64>; MODULATION_BANDS] {
    let n = energies.len();
    let envelope: Vec<f64> = energies.iter().map(|e| e.max(0.0).sqrt()).collect();
    let mean = envelope.iter().sum::<f64>() / n.max(1) as f64;
    let mut out = [None; MODULATION_BANDS];
    let resolution = rate / n.max(1) as f64;
    if n < 8 || mean <= 0.0 {
        return out;
    }
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let hann = |k: usize| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / n as f64).cos();
    let mut relative: Vec<f64> =
        envelope.iter().enumerate().map(|(k, e)| (e / mean - 1.0) * hann(k)).collect();
    let mut spectrum = plan.make_output_vec();
    if plan.process(&mut relative, &mut spectrum).is_err() {
        return out;
    }
    // Both sides of the spectrum; the mean square of the window is 3/8.
    let scale = 2.0 / (0.375 * (n * n) as f64);
    for (out, edges) in out.iter_mut().zip(MODULATION_EDGES.windows(2)) {
        if 2.0 * resolution > edges[0] || edges[1] > 0.45 * rate {
            continue;
        }
        let [from, to] = [edges[0], edges[1]].map(|f| (f / resolution).ceil() as usize);
        let bins = &spectrum[from.min(spectrum.len())..to.min(spectrum.len())];
        *out = Some(scale * bins.iter().map(|z| z.norm_sqr()).sum::<f64>());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sinusoidal_modulation_has_half_its_squared_depth_in_its_band() {
        let energy = |k: usize| (1.0 + 0.4 * (TAU * 6.0 * k as f64 / 1000.0).cos()).powi(2);
        let found = modulation_spectrum(&(0..4000).map(energy).collect::<Vec<f64>>(), 1000.0);
        for (k, power) in found.iter().enumerate() {
            let expected = if k == 3 { 0.08 } else { 0.0 };
            assert!((power.unwrap() - expected).abs() < 1e-3, "{k}: {power:?}");
        }
    }

    #[test]
    fn short_and_silent_sounds_have_no_slow_modulation() {
        let found = modulation_spectrum(&[1.0; 400], 1000.0);
        assert_eq!(found.map(|p| p.is_some()), [false, false, false, false, true, true, true, true, true]);
        assert_eq!(modulation_spectrum(&[0.0; 4000], 1000.0), [None; MODULATION_BANDS]);
        assert_eq!(modulation_spectrum(&[], 1000.0), [None; MODULATION_BANDS]);
    }
}
