//! Damped sines of given frequencies and decay rates: the energy of another recording that they explain, and their sound.

use super::dictionary::Problem;
use super::exponentials::{C, add, energy, products};
use super::feature::Feature;
use std::f64::consts::TAU;

/// Part of the energy that the penalty of an amplitude at the peak of the recording amounts to.
const PENALTY: f64 = 1e-6;

fn exponent(freq_hz: f64, decay: f64, rate: f64) -> C {
    C::new(-decay, TAU * freq_hz) / rate
}

/// Residual energy of a sound without damped sines with free amplitudes and phases, in dB relative to the sound.
///
/// `sound` begins at the onset; `poles` are frequencies in Hz and decay rates in 1/s. Frequencies above half the rate are left out.
/// 0 dB for a silent sound or without poles.
///
/// # Complexity
/// O(samples poles + poles^3).
#[must_use]
pub fn unexplained_db(sound: &[f64], rate: f64, poles: &[[f64; 2]]) -> f64 {
    let audible = poles.iter().filter(|[f, d]| *f > 0.0 && *f < 0.5 * rate && d.is_finite());
    let exponents: Vec<C> = audible.map(|[f, d]| exponent(*f, d.max(0.0), rate)).collect();
    let total = energy(sound);
    let peak = sound.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if exponents.is_empty() || total <= 0.0 || !total.is_finite() {
        return 0.0;
    }
    let problem = Problem { count: sound.len(), after: 0, ridge: PENALTY * total / (peak * peak) };
    let explained = problem.amplitudes(&exponents, &products(sound, &exponents)).map_or(0.0, |fit| fit.1);
    10.0 * (1.0 - explained / total).clamp(1e-12, 1.0).log10()
}

/// The sound of features from the onset on, each with the decay rate that `decay` returns for it in 1/s.
///
/// # Complexity
/// O(samples features).
#[must_use]
pub fn resynthesis(
    features: &[Feature],
    rate: f64,
    samples: usize,
    decay: impl Fn(&Feature) -> f64,
) -> Vec<f64> {
    let audible = || features.iter().filter(|f| f.freq_hz < 0.5 * rate);
    let exponents: Vec<C> = audible().map(|f| exponent(f.freq_hz, decay(f), rate)).collect();
    let amplitudes: Vec<C> = audible().map(|f| C::from_polar(f.amp, f.phase)).collect();
    let mut out = vec![0.0; samples];
    add(&mut out, &exponents, &amplitudes);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_poles_of_a_sound_explain_it_and_others_do_not() {
        let feature = |freq_hz: f64, decay: f64, phase: f64| Feature {
            freq_hz,
            decay,
            phase,
            amp: 0.3,
            ..Feature::default()
        };
        let features = [feature(440.0, 8.0, 0.3), feature(1234.0, 20.0, -1.0), feature(5000.0, 60.0, 2.0)];
        let sound = resynthesis(&features, 44_100.0, 20_000, |f| f.decay);
        let poles = features.map(|f| [f.freq_hz, f.decay]);
        assert!(unexplained_db(&sound, 44_100.0, &poles) < -50.0);
        let shifted = poles.map(|[f, d]| [1.05 * f, d]);
        assert!(unexplained_db(&sound, 44_100.0, &shifted) > -3.0);
        assert_eq!(unexplained_db(&[0.0; 100], 44_100.0, &poles), 0.0);
        assert_eq!(unexplained_db(&sound, 44_100.0, &[[3e4, 1.0]]), 0.0);
    }
}
