//! Paths and figures for tests.

use super::path::PathPiece;
use crate::core::time::ticks;

/// Even motion from a position in m at a velocity in m/s under 1 N.
pub(crate) fn piece(from: [f64; 2], velocity: [f64; 2], duration: f64) -> PathPiece {
    PathPiece {
        contact: 1,
        jump: 0,
        object: 0,
        duration: ticks(duration),
        position: [from, velocity.map(|v| v * duration), [0.0; 2], [0.0; 2]],
        other: None,
        force: [1.0; 2],
        gain: [1.0; 2],
        mass: None,
    }
}

/// Amplitude of a frequency in a signal, under a Blackman-Harris window (side lobes at -92 dB).
pub(crate) fn amplitude(x: &[f32], f: f64, rate: f64) -> f64 {
    use std::f64::consts::TAU;
    let n = x.len() as f64;
    let (mut sum, mut weight) = ([0.0; 2], 0.0);
    for (k, x) in x.iter().enumerate() {
        let p = TAU * k as f64 / n;
        let w = 0.35875 - 0.48829 * p.cos() + 0.14128 * (2.0 * p).cos() - 0.01168 * (3.0 * p).cos();
        let a = TAU * f * k as f64 / rate;
        sum = [sum[0] + w * f64::from(*x) * a.cos(), sum[1] + w * f64::from(*x) * a.sin()];
        weight += w;
    }
    2.0 * sum[0].hypot(sum[1]) / weight
}

/// The frequency near `f` at which the amplitude is highest, by steps of `step` times `f`.
pub(crate) fn peak(x: &[f32], f: f64, rate: f64) -> f64 {
    let around = |middle: f64, reach: f64| {
        let tried = (-20..=20).map(|k| middle * (1.0 + reach * f64::from(k) / 20.0));
        let rated = tried.map(|f| (amplitude(x, f, rate), f));
        rated.fold((0.0, middle), |best, now| if now.0 > best.0 { now } else { best }).1
    };
    around(around(f, 0.02), 0.001)
}

/// Root of the mean square.
pub(crate) fn rms(x: &[f32]) -> f64 {
    (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// Level of a factor, dB.
pub(crate) fn db(x: f64) -> f64 {
    20.0 * x.max(1e-30).log10()
}

/// Power at each Hz of one second, under a Hann window.
fn powers(x: &[f32]) -> Vec<f64> {
    let n = x.len();
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
    let mut windowed: Vec<f64> =
        x.iter().enumerate().map(|(k, x)| f64::from(*x) * (1.0 - turn(k).cos())).collect();
    let fft = foley_fft::RealFftPlanner::new().plan_fft_forward(n);
    let mut out = fft.make_output_vec();
    fft.process(&mut windowed, &mut out).unwrap();
    out.iter().map(|z| z.norm_sqr()).collect()
}

/// Maximum difference of a second at 44.1 kHz and the same at 88.2 kHz, in bands of a third of an octave from 100 Hz to 4 kHz, dB.
pub(crate) fn rates_apart(low: &[f32], high: &[f32]) -> f64 {
    let [a, b] = [powers(&low[..44_100]), powers(&high[..88_200])];
    let miss = (0..16).map(|k| {
        let f = 100.0 * 2.0_f64.powf(f64::from(k) / 3.0);
        let band = |powers: &[f64]| powers[f as usize..(1.26 * f) as usize].iter().sum::<f64>();
        // As many times as there are samples, and as much each: twice the amplitude.
        (0.5 * db(4.0 * band(&a) / band(&b))).abs()
    });
    miss.fold(0.0, f64::max)
}
