//! Departure of a mode from a constant frequency.

use super::exponentials::{C, exp, moments, products};
use super::feature::Feature;
use std::f64::consts::{LN_10, PI, TAU};

/// Most parts of the decay in which the phase is measured.
const PARTS: usize = 8;
/// Fewest parts.
const FEWEST: usize = 4;
/// Fewest periods in a part.
const PERIODS: f64 = 4.0;

/// Largest departure of the phase of a mode from that of a constant frequency while it decays by 20 dB, in rad; `None` if this takes fewer
/// than 16 periods.
///
/// `residual` is the sound without any mode, from the onset on, so that its sum with the mode is the recorded mode. The phase of the sum
/// relative to the fitted sine is measured in eight parts of the decay, or in fewer of four periods each, and a line is subtracted, with
/// weights of the amplitudes of the parts. Causes of a drift are a complex mode shape, a frequency that depends on the amplitude, and two
/// modes that are fitted as one. Noise of the amplitude `r` relative to the mode within the band of a part adds about `r`.
///
/// # Complexity
/// O(samples of the decay).
pub(super) fn phase_drift(mode: &Feature, residual: &[f64], rate: f64) -> Option<f64> {
    let samples = (LN_10 / mode.decay * rate).min(residual.len() as f64);
    let parts = ((mode.freq_hz * samples / rate / PERIODS) as usize).min(PARTS);
    let length = samples as usize / parts.max(1);
    if parts < FEWEST || length == 0 {
        return None;
    }
    let s = C::new(-mode.decay, TAU * mode.freq_hz) / rate;
    let a = C::from_polar(mode.amp, mode.phase);
    let [decays, images] = [C::new(2.0 * s.re, 0.0), 2.0 * s.conj()].map(|s| moments(s, length)[0]);
    // Time in parts, phase, weight.
    let mut last = 0.0;
    let points = (0..parts).map(|k| {
        let b = a * exp(s * (k * length) as f64);
        let expected = 0.5 * (b * decays + b.conj() * images);
        let found = expected + products(&residual[k * length..(k + 1) * length], &[s])[0];
        let phase = (found / expected).arg();
        last = phase + TAU * ((last - phase) / TAU).round();
        (k as f64, last, expected.norm())
    });
    let points: Vec<(f64, f64, f64)> = points.collect();
    let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
        points.iter().map(|p| p.2 * of(p)).sum::<f64>() / points.iter().map(|p| p.2).sum::<f64>()
    };
    let (time, phase) = (mean(&|p| p.0), mean(&|p| p.1));
    let slope = mean(&|p| (p.0 - time) * (p.1 - phase)) / mean(&|p| (p.0 - time).powi(2));
    let away = points.iter().map(|p| (p.1 - phase - slope * (p.0 - time)).abs());
    Some(away.fold(0.0, f64::max)).filter(|drift| drift.is_finite()).map(|drift| drift.min(PI * PARTS as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 44_100.0;
    const MODE: Feature = Feature {
        freq_hz: 800.0,
        amp: 0.4,
        decay: 6.0,
        phase: 0.7,
        sd_freq: 0.0,
        sd_decay: 0.0,
        level: 0,
        quality: 0.0,
    };

    /// Residual that the mode leaves of a sine whose phase differs from its own by `phase(t)`.
    fn residual(phase: impl Fn(f64) -> f64) -> Vec<f64> {
        let sample = |n: usize| {
            let t = n as f64 / RATE;
            let angle = TAU * MODE.freq_hz * t + MODE.phase;
            MODE.amp * libm::exp(-MODE.decay * t) * (libm::cos(angle + phase(t)) - libm::cos(angle))
        };
        (0..30_000).map(sample).collect()
    }

    #[test]
    fn a_mode_of_another_constant_frequency_does_not_drift() {
        assert!(phase_drift(&MODE, &residual(|_| 0.0), RATE).unwrap() < 1e-12);
        let drift = phase_drift(&MODE, &residual(|t| 0.2 + 3.0 * t), RATE).unwrap();
        assert!(drift < 0.02, "{drift}");
        assert_eq!(phase_drift(&Feature { decay: 150.0, ..MODE }, &residual(|_| 0.0), RATE), None);
    }

    #[test]
    fn a_frequency_that_glides_drifts() {
        // A parabola of 0.6 rad over the decay: a line through the louder beginning leaves 0.19 of it at the end.
        let duration = LN_10 / MODE.decay;
        for size in [0.6, 1.2] {
            let drift = phase_drift(&MODE, &residual(|t| size * (t / duration).powi(2)), RATE).unwrap();
            assert!((0.16..0.22).contains(&(drift / size)), "{drift}");
        }
    }
}
