//! Filters without phase.

use super::butterworth::Butterworth;
use super::section::Biquad;

/// Filters a whole signal forwards and backwards: no delay, and the squared magnitude of the filter.
///
/// The signal is continued at both ends by its odd reflection, and the filter begins in the steady state of the first sample.
///
/// # Complexity
/// Linear.
///
/// # Source
/// Gustafsson, "Determining the initial states in forward-backward filtering" (IEEE TSP 44(4), 1996). Equal to `scipy.signal.sosfiltfilt` with
/// its defaults, except that a signal shorter than the extension is extended by less.
#[must_use]
pub fn zero_phase(design: &Butterworth, x: &[f64]) -> Vec<f64> {
    let (Some(first), Some(last)) = (x.first(), x.last()) else { return Vec::new() };
    let sections = design.sections();
    // A section whose last coefficients are 0 is of first order.
    let orders: usize = sections.iter().map(|s| if s.b[2] == 0.0 && s.a[1] == 0.0 { 1 } else { 2 }).sum();
    let pad = (3 * (orders + 1)).min(x.len() - 1);
    let mut y: Vec<f64> = (1..=pad).rev().map(|k| 2.0 * first - x[k]).collect();
    y.extend(x);
    y.extend((1..=pad).map(|k| 2.0 * last - x[x.len() - 1 - k]));
    for _ in 0..2 {
        let mut level = y[0];
        for section in sections {
            let gain = section.b.iter().sum::<f64>() / (1.0 + section.a[0] + section.a[1]);
            let mut filter = Biquad::new(*section, 1);
            filter.settle(level);
            y.iter_mut().for_each(|x| *x = filter.tick(0, *x));
            level *= gain;
        }
        y.reverse();
    }
    y[pad..pad + x.len()].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::Band;

    const EXPECTED: [(usize, f64); 4] = [
        (0, -0.011214433900060081),
        (1, 0.19184565115766428),
        (20, -0.7623722972856876),
        (39, 1.0788003819244327),
    ];

    #[test]
    fn the_result_is_that_of_scipy() {
        // sosfiltfilt(butter(4, 4, fs=60, output="sos"), x)[[0, 1, 20, 39]] for x[n] = sin(0.2 n) + 0.3 sin(2.1 n).
        let x: Vec<f64> =
            (0..40).map(|n| (0.2 * f64::from(n)).sin() + 0.3 * (2.1 * f64::from(n)).sin()).collect();
        let y = zero_phase(&Butterworth::design(Band::LowPass, 4, 4.0, 60.0).unwrap(), &x);
        for (k, expected) in EXPECTED {
            assert!((y[k] - expected).abs() < 1e-9, "{k}: {} {expected}", y[k]);
        }
    }

    #[test]
    fn constants_short_signals_and_nothing_are_filtered() {
        let design = Butterworth::design(Band::LowPass, 4, 4.0, 60.0).unwrap();
        assert!(zero_phase(&design, &[2.5; 50]).iter().all(|y| (y - 2.5).abs() < 1e-9));
        assert!(zero_phase(&design, &[2.5]).iter().all(|y| (y - 2.5).abs() < 1e-9));
        assert_eq!(zero_phase(&design, &[1.0, 2.0]).len(), 2);
        assert!(zero_phase(&design, &[]).is_empty());
    }
}
