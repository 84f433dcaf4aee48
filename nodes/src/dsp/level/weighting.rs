//! Frequency weighting of levels: how much of a sound is heard.
//!
//! # Source
//! K: ITU-R BS.1770-4, annex 1, with the analogue prototypes of its two stages, so that any sample rate has the same curve.
//! A: IEC 61672-1, annex E.

use super::ramp::db_to_linear;
use crate::dsp::{Biquad, Section};
use crate::{choices, impl_state};
use std::f64::consts::{PI, TAU};

choices! {
    /// Frequency weighting of a level.
    pub enum Weighting {
        /// K-weighting of ITU-R BS.1770: loudness of programmes.
        K,
        /// A-weighting of IEC 61672: soft sounds and noise.
        A,
        /// No weighting: the power of the signal.
        None,
    }
}

/// Offset of the loudness in LUFS from the K-weighted level in dB, so that a full-scale sine of 997 Hz in one channel has -3.01 LUFS.
pub const LUFS_OFFSET: f64 = -0.691;

/// Corner in Hz, gain in dB, gain at the corner as a power of the gain, and quality of the high shelf of K.
const SHELF: (f64, f64, f64, f64) =
    (1_681.974_450_955_533, 3.999_843_853_973_347, 0.499_666_774_154_541_6, 0.707_175_236_955_419_6);
/// Corner in Hz and quality of the high-pass of K.
const HIGH_PASS: (f64, f64) = (38.135_470_876_024_44, 0.500_327_037_323_877_3);
/// Gain of the high-pass far above its corner: its coefficients in the standard, for 48 kHz, are not normalised.
const HIGH_PASS_GAIN: f64 = 1.004_995;
/// Corners of A in Hz: a double high-pass, two high-passes, a double low-pass.
const CORNERS: [f64; 4] = [20.598_997, 107.652_65, 737.862_23, 12_194.217];

impl Weighting {
    /// Gain at a frequency in Hz, by the analogue curve.
    #[must_use]
    pub fn gain_at(self, frequency: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::K => {
                let (corner, db, power, q) = SHELF;
                let high = db_to_linear(db);
                let shelf = second_order([1.0, high.powf(power) / q, high], q, frequency / corner);
                let (corner, q) = HIGH_PASS;
                shelf * second_order([0.0, 0.0, HIGH_PASS_GAIN], q, frequency / corner)
            }
            Self::A => a_curve(frequency) / a_curve(1000.0),
        }
    }

    /// Filter with this curve for interleaved audio of a sample rate in Hz.
    ///
    /// It follows the curve within 0.2 dB up to a tenth of the rate, and within 2 dB up to 0.45 of it.
    #[must_use]
    pub fn filter(self, rate: f64, channels: usize) -> WeightingFilter {
        let sections = match self {
            Self::None => Vec::new(),
            Self::K => k_sections(rate).to_vec(),
            Self::A => a_sections(rate).to_vec(),
        };
        WeightingFilter { sections: sections.into_iter().map(|s| Biquad::new(s, channels)).collect() }
    }
}

/// `|b0 + b1 s + b2 s^2| / |1 + s/q + s^2|` at `s = i w`.
fn second_order([b0, b1, b2]: [f64; 3], q: f64, w: f64) -> f64 {
    (b0 - b2 * w * w).hypot(b1 * w) / (1.0 - w * w).hypot(w / q)
}

fn a_curve(f: f64) -> f64 {
    let high_pass = |corner: f64| f / f.hypot(corner);
    let low_pass = |corner: f64| corner / f.hypot(corner);
    let [a, b, c, d] = CORNERS;
    high_pass(a).powi(2) * high_pass(b) * high_pass(c) * low_pass(d).powi(2)
}

/// Shelf and high-pass by the bilinear transform, each exact at its corner.
fn k_sections(rate: f64) -> [Section; 2] {
    let bilinear = |[b0, b1, b2]: [f64; 3], q: f64, corner: f64| {
        let k = (PI * (corner / rate).min(0.49)).tan();
        let norm = 1.0 / (1.0 + k / q + k * k);
        let (low, high) = (b0 * k * k, b2);
        Section {
            b: [low + b1 * k + high, 2.0 * (low - high), low - b1 * k + high].map(|x| x * norm),
            a: [2.0 * (k * k - 1.0) * norm, (1.0 - k / q + k * k) * norm],
        }
    };
    let (corner, db, power, q) = SHELF;
    let high = db_to_linear(db);
    let shelf = bilinear([1.0, high.powf(power) / q, high], q, corner);
    let (corner, q) = HIGH_PASS;
    [shelf, bilinear([0.0, 0.0, HIGH_PASS_GAIN], q, corner)]
}

/// High-passes by the bilinear transform; the low-passes have the gain of the analogue ones at 0 and at half the rate.
fn a_sections(rate: f64) -> [Section; 3] {
    let [a, b, c, d] = CORNERS;
    let high_pass = |corner: f64| {
        let k = (PI * (corner / rate).min(0.49)).tan();
        ([1.0 / (1.0 + k), -1.0 / (1.0 + k)], (k - 1.0) / (1.0 + k))
    };
    let low_pass = |corner: f64| {
        let pole = (-TAU * corner / rate).exp();
        let nyquist = corner / corner.hypot(0.5 * rate) * (1.0 + pole);
        ([0.5 * (1.0 - pole + nyquist), 0.5 * (1.0 - pole - nyquist)], -pole)
    };
    let both = |([p0, p1], p): ([f64; 2], f64), ([q0, q1], q): ([f64; 2], f64)| Section {
        b: [p0 * q0, p0 * q1 + p1 * q0, p1 * q1],
        a: [p + q, p * q],
    };
    let mut sections =
        [both(high_pass(a), high_pass(a)), both(high_pass(b), high_pass(c)), both(low_pass(d), low_pass(d))];
    let reference = 1000.0_f64.min(0.4 * rate);
    let gain: f64 = sections.iter().map(|s| s.gain_at(reference, rate)).product();
    let factor = Weighting::A.gain_at(reference) / gain;
    sections[0].b = sections[0].b.map(|x| x * factor);
    sections
}

/// The filter of a [`Weighting`], with the state of each channel.
#[derive(Clone, Debug)]
pub struct WeightingFilter {
    sections: Vec<Biquad>,
}
impl_state!(WeightingFilter { each sections });

impl WeightingFilter {
    /// Filters one sample of one channel.
    #[inline]
    pub fn tick(&mut self, channel: usize, x: f32) -> f64 {
        self.sections.iter_mut().fold(f64::from(x), |x, section| section.tick(channel, x))
    }
}

/// Root mean square of a mono signal under a weighting.
///
/// # Complexity
/// O(n).
#[must_use]
pub fn weighted_rms(samples: &[f32], rate: f64, weighting: Weighting) -> f64 {
    let mut filter = weighting.filter(rate, 1);
    let power: f64 = samples.iter().map(|x| filter.tick(0, *x).powi(2)).sum();
    (power / samples.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn db(x: f64) -> f64 {
        20.0 * x.log10()
    }

    #[test]
    fn the_a_curve_has_the_values_of_the_standard() {
        // IEC 61672-1, table 3, at the exact frequencies of the nominal thirds of an octave.
        for (k, value) in
            [(-20, -70.4), (-13, -30.2), (-10, -19.1), (0, 0.0), (4, 1.3), (10, -2.5), (12, -6.6)]
        {
            let f = 1000.0 * 10_f64.powf(f64::from(k) / 10.0);
            let found = db(Weighting::A.gain_at(f));
            assert!((found - value).abs() < 0.06, "{f} Hz: {found} for {value}");
        }
    }

    #[test]
    fn the_k_sections_at_48_khz_are_those_of_the_standard() {
        let [shelf, high_pass] = k_sections(48_000.0);
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        let (b, a) = (
            [1.535_124_859_586_97, -2.691_696_189_406_38, 1.198_392_810_852_85],
            [-1.690_659_293_182_41, 0.732_480_774_215_85],
        );
        assert!(close(&shelf.b, &b) && close(&shelf.a, &a), "{shelf:?}");
        assert!(high_pass.b.iter().zip([1.0, -2.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-5), "{high_pass:?}");
        let a = [-1.990_047_454_833_98, 0.990_072_250_366_21];
        assert!(close(&high_pass.a, &a), "{high_pass:?}");
    }

    #[test]
    fn filters_follow_their_curves_at_every_rate() {
        for rate in [44_100.0, 48_000.0, 96_000.0] {
            for weighting in [Weighting::K, Weighting::A] {
                let sections = if weighting == Weighting::K {
                    k_sections(rate).to_vec()
                } else {
                    a_sections(rate).to_vec()
                };
                for k in 1..90 {
                    let f = 0.005 * f64::from(k) * rate;
                    let found: f64 = sections.iter().map(|s| s.gain_at(f, rate)).product();
                    let miss = db(found / weighting.gain_at(f)).abs();
                    assert!(miss < if f < 0.1 * rate { 0.2 } else { 2.0 }, "{weighting:?} {f} Hz: {miss} dB");
                }
            }
        }
    }

    #[test]
    fn a_sine_of_one_kilohertz_keeps_its_level_under_a_and_has_the_loudness_of_the_standard() {
        let sine: Vec<f32> =
            (0..96_000).map(|n| (TAU * 997.0 * f64::from(n) / 48_000.0).sin() as f32).collect();
        let level = |weighting| db(weighted_rms(&sine, 48_000.0, weighting));
        assert!((level(Weighting::None) + 3.0103).abs() < 1e-3);
        assert!((level(Weighting::A) + 3.01).abs() < 0.05, "{}", level(Weighting::A));
        assert!((level(Weighting::K) + LUFS_OFFSET + 3.01).abs() < 0.01, "{}", level(Weighting::K));
    }
}
